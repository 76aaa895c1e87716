"""Files that a person or a scene names, read with care: regular files only, no longer than what they are for, and,
where a scene names them, only where scenes may read.

A scene may come from anybody. What it names is read in or below its own folder and among the program's assets;
elsewhere only where the user allows it: with `--allow-outside` for one run, or for good with folders in the environment
variable SPECTRASPLAT_ALLOW. `docs/threat-model.md` says what that is for.
"""

from __future__ import annotations

import csv
import errno
import io
import os
import stat
import tokenize
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

import numpy as np

from .errors import UserError
from .paths import assets_dir

ENVIRONMENT = "SPECTRASPLAT_ALLOW"
OUTSIDE = (
    "lies outside the scene's folder; copy it there, or allow it with --allow-outside (or its folder in "
    f"{ENVIRONMENT}) if you trust the scene"
)
"""The end of the sentence about a file that a scene may not read."""
SETTINGS_BYTES = 16 << 20
"""Settings, presets, keys, notes: what people and this program write by hand."""
SCENE_BYTES = 64 << 20
TABLE_BYTES = 256 << 20
DATA_BYTES = 2 << 30
"""Meshes, pictures, glTF buffers."""

_everything = ContextVar("everything", default=False)
_were_read: set[tuple[int, int]] = set()
"""Devices and numbers of the files that were opened since `forget_read`."""


class _Permission:
    """What the user allows for this process."""

    everything = False


def allow_outside(allowed: bool) -> None:
    """Let scenes read anywhere from now on, or no longer: what the user says on the command line."""
    _Permission.everything = allowed


@contextmanager
def own_files() -> Iterator[None]:
    """Within the block, what is read was written by this program for this user and may name files anywhere."""
    before = _everything.set(True)
    try:
        yield
    finally:
        _everything.reset(before)


def may_read(path: str | os.PathLike[str], folder: Path) -> bool:
    """Whether a scene in `folder` may read `path`; symbolic links count as what they point to."""
    if _Permission.everything or _everything.get():
        return True
    allowed = [Path(part) for part in os.environ.get(ENVIRONMENT, "").split(os.pathsep) if part]
    try:
        target = Path(os.path.realpath(path))
        return any(target.is_relative_to(os.path.realpath(root)) for root in (folder, assets_dir(), *allowed))
    except ValueError:  # a name that no file can have
        return True


def is_file(path: str | os.PathLike[str]) -> bool:
    """As `Path.is_file`, and no also for names that no file can have (too long, with a null byte)."""
    return os.path.isfile(path)


def read_bytes(path: str | os.PathLike[str], limit: int) -> bytes:
    """Content of the regular file `path`; raises OSError, whose `strerror` is plain, for anything else and for more
    than `limit` bytes."""
    with _opened(path, limit) as file:
        # Not file.read(limit + 1), which takes memory for all that it might be.
        data = file.read(os.fstat(file.fileno()).st_size + 1)
        while len(data) <= limit and (more := file.read(1 << 20)):  # it grows, or does not say its length
            data += more
    if len(data) > limit:
        raise _too_long(path, limit)
    return data


def read_text(path: str | os.PathLike[str], limit: int, encoding: str = "utf-8-sig") -> str:
    """As `read_bytes`, decoded, with every end of line a newline. Raises UnicodeDecodeError too."""
    return io.TextIOWrapper(io.BytesIO(read_bytes(path, limit)), encoding=encoding).read()


def read_any_text(path: str | os.PathLike[str], limit: int) -> str:
    """As `read_text` for what other people's programs export: UTF-8 or UTF-16, with or without a mark, or Latin-1."""
    data = read_bytes(path, limit)
    zeros = [data[start:512:2].count(0) * 3 > len(data[:512]) for start in (0, 1)]
    encoding = "utf-8-sig"
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    elif any(zeros):
        encoding = "utf-16-be" if zeros[0] else "utf-16-le"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        return data.decode("latin-1")


def with_part(name: str | os.PathLike[str]) -> tuple[Path, str]:
    """A file and what is meant within it: "lamp.csv:Sample 2" where lamp.csv is a file; "" for all of it."""
    text = os.fspath(name)
    for at in [i for i, character in enumerate(text) if character == ":"]:
        if not is_file(text) and is_file(text[:at]):
            return Path(text[:at]), text[at + 1 :].strip()
    return Path(text), ""


def was_read(path: str | os.PathLike[str]) -> bool:
    """Whether that file was read since `forget_read`, by whatever name."""
    try:
        state = os.stat(path)
    except (OSError, ValueError):
        return False
    return (state.st_dev, state.st_ino) in _were_read


def forget_read() -> None:
    """A new piece of work begins: what was read before has no part in it."""
    _were_read.clear()


def check_regular(path: str | os.PathLike[str], limit: int) -> None:
    """Raise as `read_bytes` would: for libraries that open a file by its name."""
    _opened(path, limit).close()


def read_npy(path: str | os.PathLike[str], limit: int = DATA_BYTES) -> np.ndarray:
    """The array of numbers in a .npy file; its header is held against the file's length before memory is taken.

    Raises OSError, and ValueError with a reason that quotes nothing of the file.
    """
    data = read_bytes(path, limit)
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a file of Python 2
            shape, is_fortran, dtype = read_header[version](stream)
    except (ValueError, KeyError, TypeError, AttributeError, SyntaxError, tokenize.TokenError, RecursionError) as error:
        raise ValueError("its header is not that of a .npy file") from error
    if dtype.kind not in "biuf" or dtype.itemsize > 8 or not all(type(side) is int and side >= 0 for side in shape):
        raise ValueError("it holds something else than numbers")
    count = 1
    for side in shape:
        count *= side
    if count * dtype.itemsize > len(data) - stream.tell():
        raise ValueError("it is shorter than its header promises")
    values = np.frombuffer(data, dtype, count, stream.tell())
    return values.reshape(shape[::-1]).T if is_fortran else values.reshape(shape)


@contextmanager
def reading(path: str | os.PathLike[str], remedy: str) -> Iterator[None]:
    """Within the block, a file that cannot be read is a `UserError` that ends with `remedy`."""
    try:
        yield
    except (OSError, csv.Error) as error:
        raise UserError(f"cannot read {path}: {reason_of(error)}; {remedy}") from error


def reason_of(error: Exception) -> str:
    """Why a file could not be read, without the names that an OSError repeats."""
    return (error.strerror or type(error).__name__) if isinstance(error, OSError) else str(error)


def _opened(path: str | os.PathLike[str], limit: int) -> io.BufferedReader:
    # Not waiting: a pipe that nobody writes to would hold the program for ever.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)
    name = os.fspath(path)
    try:
        descriptor = os.open(path, flags | getattr(os, "O_CLOEXEC", 0))
    except ValueError as error:
        raise OSError(errno.EINVAL, "no file can have this name", name) from error
    state = os.fstat(descriptor)
    if stat.S_ISREG(state.st_mode) and state.st_size <= limit:
        _were_read.add((state.st_dev, state.st_ino))
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISREG(state.st_mode):
        raise _too_long(path, limit)
    if stat.S_ISDIR(state.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), name)
    raise OSError(errno.EINVAL, "it is a device or a pipe, not an ordinary file", name)


def _too_long(path: str | os.PathLike[str], limit: int) -> OSError:
    return OSError(errno.EINVAL, f"it is longer than {limit >> 20} MiB", os.fspath(path))
