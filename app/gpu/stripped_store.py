"""Stripped shader texts, kept on the disk: a scene's two or three dozen programs take a second to strip, which is a
good part of a warm start, and milliseconds to read.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from ..base import files, paths
from ..base.atomic import atomic_output
from ..base.errors import UserError
from . import dead_code, glsl_conditionals, glsl_folding
from .glsl_conditionals import Line

MOST_FILES = 4096
"""8 KB each; all tests together build so many."""
_MOST_BYTES = 1 << 22
"""Largest file, packed and unpacked."""
_SUFFIX = ".glsl.z"


def stripped(lines: Sequence[Line], switches: frozenset[str]) -> list[Line]:
    """`dead_code.stripped`, from the disk where it was made before. A folder that cannot be read or written, and a
    damaged file, only cost time."""
    path = _path_of(lines, switches)
    kept = None if path is None else _load(path)
    if kept is None:
        kept = dead_code.stripped(lines, switches)
        if path is not None:
            _save(path, kept)
    return kept


@cache
def _version() -> bytes:
    """Changes with the code that strips."""
    digest = hashlib.blake2b(digest_size=16)
    for module in (dead_code, glsl_conditionals, glsl_folding):
        digest.update(Path(module.__file__ or "").read_bytes())
    return digest.digest()


def _path_of(lines: Sequence[Line], switches: frozenset[str]) -> Path | None:
    """Where these lines, as they came from their files, are kept; None without a folder."""
    try:
        folder = paths.cache_dir() / "shaders"
        folder.mkdir(exist_ok=True)
        digest = hashlib.blake2b(_version(), digest_size=16)
    except OSError:
        return None
    digest.update(" ".join(sorted(switches)).encode())
    texts, names, numbers = zip(*lines, strict=True)
    digest.update("\n".join((*texts, *dict.fromkeys(names), str(numbers))).encode())
    return folder / (digest.hexdigest() + _SUFFIX)


def _load(path: Path) -> list[Line] | None:
    try:
        unpacker = zlib.decompressobj()
        text = unpacker.decompress(files.read_bytes(path, _MOST_BYTES), _MOST_BYTES)
        if not unpacker.eof:
            return None
        names, rows = json.loads(text)
        kept = [Line(str(text), str(names[name]), int(number)) for name, number, text in rows]
    except (OSError, UserError, zlib.error, ValueError, TypeError, IndexError):
        return None
    with suppress(OSError):
        os.utime(path)  # what was not used for longest is forgotten first
    return kept


def _save(path: Path, kept: list[Line]) -> None:
    numbers = {name: at for at, name in enumerate(dict.fromkeys(line.file for line in kept))}
    rows = [(numbers[line.file], line.number, line.text) for line in kept]
    packed = zlib.compress(json.dumps([list(numbers), rows]).encode(), 1)
    with suppress(OSError, UserError):
        with atomic_output(path, lasting=False) as temporary:
            temporary.write_bytes(packed)
        paths.forget_oldest(path.parent, _SUFFIX, files=MOST_FILES)
