"""Stripped shader texts, kept on the disk: a scene's two or three dozen programs take a second to strip, which is a
good part of a warm start, and milliseconds to read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from ..base.kept_files import KeptFiles
from . import dead_code, glsl_conditionals, glsl_folding
from .glsl_conditionals import Line

KEPT = KeptFiles("shaders", 1 << 22, most_files=4096)
"""8 KB each; all tests together build so many."""


def stripped(lines: Sequence[Line], switches: frozenset[str]) -> list[Line]:
    """`dead_code.stripped`, from the disk where it was made before."""
    key = _key_of(lines, switches)
    kept = _load(key)
    if kept is None:
        kept = dead_code.stripped(lines, switches)
        numbers = {name: at for at, name in enumerate(dict.fromkeys(line.file for line in kept))}
        rows = [(numbers[line.file], line.number, line.text) for line in kept]
        KEPT.save(key, json.dumps([list(numbers), rows]).encode())
    return kept


@cache
def _version() -> bytes:
    """Changes with the code that strips."""
    digest = hashlib.blake2b(digest_size=16)
    for module in (dead_code, glsl_conditionals, glsl_folding):
        digest.update(Path(module.__file__ or "").read_bytes())
    return digest.digest()


def _key_of(lines: Sequence[Line], switches: frozenset[str]) -> str:
    """Key of these lines, as they came from their files."""
    digest = hashlib.blake2b(_version(), digest_size=16)
    digest.update(" ".join(sorted(switches)).encode())
    texts, names, numbers = zip(*lines, strict=True)
    digest.update("\n".join((*texts, *dict.fromkeys(names), str(numbers))).encode())
    return digest.hexdigest()


def _load(key: str) -> list[Line] | None:
    content = KEPT.load(key)
    if content is None:
        return None
    names, rows = json.loads(content)
    return [Line(text, names[name], number) for name, number, text in rows]
