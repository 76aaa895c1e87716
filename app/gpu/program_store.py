"""Programs as a driver compiled them, kept on the disk: compiling takes it seconds, taking one back milliseconds.

A binary is for one driver and one device, whose names are part of its key. A file that is damaged, or that the driver
does not take back, only means compiling again.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from os import utime
from pathlib import Path

from ..base import files, paths
from ..base.atomic import atomic_output
from ..base.errors import UserError

MOST_BYTES = 256 << 20
"""Of all that is kept."""
_LARGEST = 64 << 20
"""Bytes of one program."""
_SUFFIX = ".program"
_FORM = "1"
"""Changes with the form of the files."""


@dataclass(frozen=True)
class Binary:
    """What glGetProgramBinary gives."""

    form: int
    code: bytes


def key_of(device: Iterable[str], texts: Iterable[str]) -> str:
    """Of a program of these texts, by the driver and for the device that these strings name."""
    return hashlib.sha256("\0".join((_FORM, *device, *texts)).encode()).hexdigest()


def load(key: str) -> Binary | None:
    """What `save` kept, whole; else None."""
    try:
        path = _folder() / (key + _SUFFIX)
        unpacker = zlib.decompressobj()
        content = unpacker.decompress(files.read_bytes(path, _LARGEST), _LARGEST)
    except (OSError, UserError, zlib.error):
        return None
    digest, form, code = content[:32], content[32:36], content[36:]
    if not unpacker.eof or hashlib.sha256(form + code).digest() != digest:
        return None
    with suppress(OSError):
        utime(path)  # what was not used for longest is forgotten first
    return Binary(int.from_bytes(form, "little"), code)


def save(key: str, binary: Binary) -> None:
    """Keep it, where the disk allows."""
    content = binary.form.to_bytes(4, "little") + binary.code
    if len(content) > _LARGEST - 32:
        return
    with suppress(OSError, UserError):
        path = _folder() / (key + _SUFFIX)
        with atomic_output(path, lasting=False) as temporary:
            temporary.write_bytes(zlib.compress(hashlib.sha256(content).digest() + content, 1))
        paths.forget_oldest(path.parent, _SUFFIX, size=MOST_BYTES)


def _folder() -> Path:
    folder = paths.cache_dir() / "programs"
    folder.mkdir(exist_ok=True)
    return folder
