"""Output files appear whole or not at all, and an existing one survives a failure.

Every writer of the project (pictures, scenes, meshes, plots, baked tables) writes to a
temporary neighbour of the target and renames it when it is complete.
"""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import UserError


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise `UserError` when `path` could not be written; leaves nothing behind.

    Meant to be called before a long job, so that minutes of work do not end in a refusal.
    """
    target = Path(path)
    probe = _reserve(target)
    probe.unlink(missing_ok=True)


@contextmanager
def atomic_output(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` when the block succeeds.

    The temporary name keeps the suffix, because libraries choose a format by it. It exists
    as an empty file when the block starts. If the block fails or is interrupted, it is
    removed and whatever was at `path` stays as it was. A symbolic link is followed, not replaced.

    Raises `UserError` naming the path where the folder is missing or not writable, the
    path is a folder, or the disk is full; other errors of the block pass unchanged.
    """
    target = Path(path)
    temporary = _reserve(target)
    try:
        yield temporary
        os.replace(temporary, _real(target))
    except OSError as error:
        if _concerns_output(error, temporary, target):
            raise _refusal(target, error) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def _reserve(target: Path) -> Path:
    """Create an empty temporary file beside `target`, with the permissions umask gives."""
    if os.path.isdir(target):  # unlike Path.is_dir, silent about a name that is too long
        raise _refusal(target, IsADirectoryError(errno.EISDIR, "Is a directory"))
    if os.path.exists(target) and not os.path.isfile(target):
        # A rename would put a file where a device or a pipe was.
        raise UserError(f"cannot write {target}: it is a device or a pipe; give the name of an ordinary file")
    # Bounded, so that a target name near the file system's 255 bytes still has a neighbour.
    stem = target.stem.encode()[:100].decode(errors="ignore")
    temporary = _real(target).with_name(f".{stem}.{secrets.token_hex(4)}.part{target.suffix}")
    try:
        with suppress(FileNotFoundError):
            os.stat(target)  # a name that is too long is told now, not after the work
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise _refusal(target, error) from error
    if os.path.exists(target) and not os.access(target, os.W_OK):
        # A rename would replace a write-protected file; the user protected it on purpose.
        temporary.unlink(missing_ok=True)
        raise _refusal(target, PermissionError(errno.EACCES, "Permission denied"))
    return temporary


def _real(target: Path) -> Path:
    """Where the file itself lies, symbolic links followed."""
    return Path(os.path.realpath(target))


def _concerns_output(error: OSError, temporary: Path, target: Path) -> bool:
    """Whether an error of the block is about the output and not, say, about an input file."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return True
    return error.filename is not None and os.fspath(error.filename) in (
        os.fspath(temporary),
        os.fspath(target),
    )


def _refusal(target: Path, error: OSError) -> UserError:
    """One sentence for `error`, naming the path and the way out."""
    folder = target.parent
    match error.errno:
        case errno.EISDIR:
            return UserError(f"cannot write {target}: it is a folder; give a file name inside it")
        case errno.ENOENT if not os.path.isdir(folder):
            return UserError(f"cannot write {target}: the folder {folder} does not exist; create it or choose another")
        case errno.ENOTDIR:
            return UserError(f"cannot write {target}: {folder} is not a folder; choose another")
        case errno.EACCES | errno.EPERM | errno.EROFS | errno.ENOENT:  # ENOENT: /proc and the like
            return UserError(f"cannot write {target}: no permission; choose another place or make it writable")
        case errno.ENOSPC | errno.EDQUOT:
            return UserError(f"cannot write {target}: the disk is full; free some space or choose another disk")
        case errno.ENAMETOOLONG:
            return UserError(f"cannot write {target}: the name is too long; choose a shorter one")
        case _:
            reason = error.strerror or str(error)
            return UserError(f"cannot write {target}: {reason}; choose another place")
