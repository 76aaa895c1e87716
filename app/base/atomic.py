"""Output files appear whole or not at all, an existing one survives a failure, and what is done survives a power cut.

Every writer of the project (pictures, scenes, meshes, plots, baked tables) writes to a temporary neighbour of the
target and renames it when it is complete. A process that is killed leaves its neighbour behind: the next one that
writes into the folder removes it. A lock tells it from one that is being written.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from .errors import UserError
from .locks import lock

_PART = re.compile(r"\..*\.[0-9a-f]{8}\.part(\.[^.]*)?", re.DOTALL)
_open_parts: set[Path] = set()
_swept: set[str] = set()
"""Folders that this process has looked through for what others left behind."""


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise `UserError` when `path` could not be written; leaves nothing behind.

    Meant to be called before a long job, so that minutes of work do not end in a refusal.
    """
    target = Path(path)
    with _reserved(target, _part_of(target)):
        pass


def make_output_folder(folder: Path, *names: str) -> None:
    """Make a folder, and refuse now that any of the files `names` in it could not be written in minutes.

    Raises `UserError` naming what cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"cannot make the folder {folder}: {error.strerror or error}; give another one with -o"
        ) from error
    for name in names:
        check_writable(folder / name)


@contextmanager
def atomic_output(path: str | os.PathLike[str], lasting: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` when the block succeeds.

    The temporary name keeps the suffix, because libraries choose a format by it. It exists
    as an empty file when the block starts. If the block fails or is interrupted, it is
    removed and whatever was at `path` stays as it was. A symbolic link is followed, not replaced.
    `lasting`: on the disk before this returns; caches, which can be made again, need not be.

    Raises `UserError` naming the path where the folder is missing or not writable, the
    path is a folder, or the disk is full; other errors of the block pass unchanged.
    """
    with atomic_outputs(path, lasting=lasting) as (temporary,):
        yield temporary


@contextmanager
def atomic_outputs(*paths: str | os.PathLike[str], lasting: bool = True) -> Iterator[tuple[Path, ...]]:
    """As `atomic_output` for files that belong together: all of them appear, or all stay as they were."""
    targets = [Path(path) for path in paths]
    parts = [_part_of(target) for target in targets]
    with ExitStack() as stack:
        descriptors = [stack.enter_context(_reserved(*pair)) for pair in zip(targets, parts, strict=True)]
        try:
            yield tuple(parts)
            for descriptor in descriptors if lasting else ():
                os.fsync(descriptor)
            _put_in_place(parts, [_real(target) for target in targets])
        except OSError as error:
            for part, target in zip(parts, targets, strict=True):
                if error.filename is not None and os.fspath(error.filename) in (os.fspath(part), os.fspath(target)):
                    raise _refusal(target, error) from error
            if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                raise _refusal(targets[0], error) from error
            raise
    if lasting:
        for folder in {_real(target).parent for target in targets}:
            _settle(folder)


def remove_parts() -> None:
    """Remove what is being written, for a process that ends on the spot."""
    for part in tuple(_open_parts):
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _put_in_place(parts: list[Path], targets: list[Path]) -> None:
    """Rename all `parts`, or none; of several targets the old ones are set aside until then."""
    if len(parts) == 1:
        os.replace(parts[0], targets[0])
        return
    aside: list[tuple[Path, Path]] = []
    placed: list[Path] = []
    try:
        for target in targets:
            if os.path.lexists(target):
                # Not a name that is swept: until the end it is the only copy.
                old = _part_of(target).with_suffix(f".old{target.suffix}")
                os.replace(target, old)
                aside.append((old, target))
        for part, target in zip(parts, targets, strict=True):
            os.replace(part, target)
            placed.append(target)
    except BaseException:
        for target in placed:
            target.unlink(missing_ok=True)
        for old, target in aside:
            os.replace(old, target)
        raise
    for old, _ in aside:
        old.unlink(missing_ok=True)


def _part_of(target: Path) -> Path:
    """A name beside `target` for the file while it is being written."""
    # Bounded, so that a target name near the file system's 255 bytes still has a neighbour.
    stem = target.stem.encode(errors="surrogateescape")[:100].decode(errors="ignore")
    try:
        return _real(target).with_name(f".{stem}.{secrets.token_hex(4)}.part{target.suffix}")
    except ValueError as error:  # a null byte, or no name at all
        raise UserError(f"cannot write {target}: no file can have this name; choose another") from error


@contextmanager
def _reserved(target: Path, part: Path) -> Iterator[int]:
    """Within the block `part` exists, empty at first, with the permissions umask gives, and locked; its descriptor."""
    if os.path.isdir(target):  # unlike Path.is_dir, silent about a name that is too long
        raise _refusal(target, IsADirectoryError(errno.EISDIR, "Is a directory"))
    if os.path.exists(target) and not os.path.isfile(target):
        # A rename would put a file where a device or a pipe was.
        raise UserError(f"cannot write {target}: it is a device or a pipe; give the name of an ordinary file")
    descriptor = -1
    _open_parts.add(part)
    try:
        try:
            with suppress(FileNotFoundError):
                os.stat(target)  # a name that is too long is reported now, not after the work
            _sweep(part.parent)
            while descriptor < 0:
                descriptor = os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_CLOEXEC", 0), 0o666)
                if not lock(descriptor, wait=True) or os.path.exists(part):
                    break
                os.close(descriptor)  # swept before it was locked
                descriptor = -1
        except OSError as error:
            raise _refusal(target, error) from error
        if os.path.exists(target) and not os.access(target, os.W_OK):
            # A rename would replace a write-protected file; the user protected it on purpose.
            raise _refusal(target, PermissionError(errno.EACCES, "Permission denied"))
        yield descriptor
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        _open_parts.discard(part)
        if descriptor >= 0:
            os.close(descriptor)


def _sweep(folder: Path) -> None:
    """Remove what killed processes left in `folder`; once a process."""
    name = os.fspath(folder)
    if name in _swept or sys.platform == "win32":
        return
    _swept.add(name)
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _PART.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                with suppress(OSError):
                    descriptor = os.open(entry.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
                    try:
                        if os.fstat(descriptor).st_uid == os.geteuid() and lock(descriptor):
                            os.unlink(entry.path)
                    finally:
                        os.close(descriptor)


def _settle(folder: Path) -> None:
    """Have the names in `folder` on the disk, where the system can."""
    if sys.platform == "win32":
        return
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _real(target: Path) -> Path:
    """Where the file itself lies, symbolic links followed."""
    return Path(os.path.realpath(target))


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
