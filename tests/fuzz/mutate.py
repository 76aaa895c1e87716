"""Damage to files, seeded: bytes, lines, numbers and JSON values changed, cut, doubled, moved, or made extreme."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

NUMBERS = (
    *b"0 -1 1 2 255 65536 2147483647 2147483648 4294967295 99999999 9223372036854775807 9223372036854775808".split(),
    *b"-9223372036854775809 1e30 1e31 -1e308 1e400 1e-320 0.0 -0.0 nan inf -inf 1e 0x10 1_0 true".split(),
    b"9" * 40,
    b"9" * 5000,
)
WORDS = (
    *b"../ /etc/passwd [/] \" ' [ ] { } # , = \\ \\u0000 \\ud800 %00".split(),
    *(b"\0", b"\xff\xfe", b"\xed\xa0\x80", b"\x1b[31m", b"\r", b"\n\n", b" ", b"\t", b"a" * 300, b"(" * 300),
)
_NUMBER = re.compile(rb"[-+]?\d[\d.eE+-]*")
_VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 1, 3, 1 << 31, 1 << 63, 10**30, 99_999_999, 0.5, 1e300, float("nan"), float("inf")),
    *("", "a" * 300, "../x", "\x1b[31m", "\0", "\ud800", [], {}, [[]], [0] * 3, [None], {"a": 1}),
)

Random = np.random.Generator


def mutant(seeds: Sequence[bytes], seed: int, index: int) -> bytes:
    """Mutant `index` of the run `seed`: one of `seeds` after one to six changes; the same for the same numbers."""
    rng = np.random.default_rng((seed, index))
    data = seeds[int(rng.integers(len(seeds)))]
    for _ in range(int(rng.integers(1, 4) * rng.integers(1, 3))):
        change = _CHANGES[int(rng.integers(len(_CHANGES)))]
        data = change(data, rng, seeds)
    return data


def _at(data: bytes, rng: Random) -> int:
    return int(rng.integers(len(data) + 1))


def _span(data: bytes, rng: Random) -> tuple[int, int]:
    start = _at(data, rng)
    return start, min(len(data), start + int(2 ** rng.uniform(0, 8)))


def _flip(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    changed = bytearray(data)
    for at in rng.integers(0, max(len(data), 1), 3 if data else 0):
        changed[at] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _bytes(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + rng.bytes(end - start) + data[end:]


def _cut(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def _end(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    return data[: _at(data, rng)]


def _double(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    start, end = _span(data, rng)
    return data[:end] + data[start:end] * int(rng.integers(1, 4)) + data[end:]


def _splice(data: bytes, rng: Random, seeds: Sequence[bytes]) -> bytes:
    other = seeds[int(rng.integers(len(seeds)))]
    return data[: _at(data, rng)] + other[_at(other, rng) :]


def _word(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    at = _at(data, rng)
    return data[:at] + WORDS[int(rng.integers(len(WORDS)))] + data[at:]


def _extreme(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    """A binary number of 1, 2, 4 or 8 bytes at its ends."""
    at, size = _at(data, rng), int(2 ** rng.integers(4))
    value = (b"\0" * size, b"\xff" * size, b"\xff" * (size - 1) + b"\x7f", b"\0" * (size - 1) + b"\x80")
    return data[:at] + value[int(rng.integers(4))] + data[at + size :]


def _number(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    found = list(_NUMBER.finditer(data[: 1 << 16]))
    if not found:
        return data
    place = found[int(rng.integers(len(found)))]
    return data[: place.start()] + NUMBERS[int(rng.integers(len(NUMBERS)))] + data[place.end() :]


def _lines(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    """A line doubled, left out, or moved."""
    lines = data.split(b"\n")
    start = int(rng.integers(len(lines)))
    line = lines[start]
    match int(rng.integers(3)):
        case 0:
            lines.insert(int(rng.integers(len(lines))), line)
        case 1:
            del lines[start]
        case _:
            del lines[start]
            lines.insert(int(rng.integers(len(lines) + 1)), line)
    return b"\n".join(lines)


def _json(data: bytes, rng: Random, _: Sequence[bytes]) -> bytes:
    """A value somewhere in a JSON file (or a GLB's first chunk, whose lengths are put right) replaced or left out."""
    is_glb = data[:4] == b"glTF" and len(data) >= 20
    size = int.from_bytes(data[12:16], "little") if is_glb else 0
    text = data[20 : 20 + size] if is_glb else data
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return data
    places: list[tuple[Any, Any]] = []
    waiting = [document]
    while waiting:
        value = waiting.pop()
        if not isinstance(value, dict | list):
            continue
        inside = list(value.items()) if isinstance(value, dict) else list(enumerate(value))
        places += [(value, key) for key, _ in inside]
        waiting += [each for _, each in inside if isinstance(each, dict | list)]
    if not places:
        return data
    holder, key = places[int(rng.integers(len(places)))]
    other, from_key = places[int(rng.integers(len(places)))]
    match int(rng.integers(4)):
        case 0:
            del holder[key]
        case 1:
            holder[key] = json.loads(json.dumps(other[from_key]))
        case _:
            holder[key] = _VALUES[int(rng.integers(len(_VALUES)))]
    changed = json.dumps(document).encode()
    if not is_glb:
        return changed
    changed += b" " * (-len(changed) % 4)
    rest = data[20 + size :]
    whole = len(changed) + len(rest) + 20
    return data[:8] + whole.to_bytes(4, "little") + len(changed).to_bytes(4, "little") + data[16:20] + changed + rest


Change = Callable[[bytes, Random, Sequence[bytes]], bytes]
_CHANGES: tuple[Change, ...] = (
    _flip,
    _bytes,
    _cut,
    _end,
    _double,
    _splice,
    _word,
    _extreme,
    _number,
    _number,
    _lines,
    _json,
    _json,
)
