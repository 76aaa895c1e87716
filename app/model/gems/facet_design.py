"""Faceting designs: tiers of facets by angle, distance and index on a gear; GemCad's text files (.asc) of them.

A facet's angle is counted from the plane of the girdle: 0 is the table, 90 the girdle, below zero the pavilion, and -0
a culet. Its distance is that of its plane from the origin, in a unit of the file's own. The index `location` is at the
front, -y; seen from the table, which faces +z, indices run counter-clockwise, on a gear of negative teeth clockwise.
Sources: R. W. Strickland, GemCad User's Manual (1992), Index gear; GemCad for Windows User's Guide, ASC files.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, NoReturn, TypeVar

import numpy as np

from ...base import files
from ...base.atomic import atomic_output
from ...base.errors import UserError
from ..geometry.half_spaces import convex_solid, faces_of
from ..geometry.mesh import Mesh

SUFFIX = ".asc"
MOST_FACETS = 1000
_MAX_BYTES = 1 << 20
_MOST_TEETH = 1000
_FURTHEST = 1e6
_LEAST_INDEX, _MOST_INDEX = 1.0, 5.0
_RECORD = re.compile(r"([agyihfp])(?=[\s\d.+-]|$)\s*", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)


T = TypeVar("T")


@dataclass(frozen=True)
class Tier:
    """Facets of one angle and distance."""

    angle_deg: float
    distance: float
    """Distance of the planes from the origin."""
    indices: tuple[float, ...]
    """Positions on the gear, whole ones as a rule; of a table or culet one that means nothing."""
    name: str = ""
    """Those of its facets; "" where they have none."""

    @property
    def is_below(self) -> bool:
        """Whether it belongs to the pavilion; -0 does."""
        return math.copysign(1.0, self.angle_deg) < 0.0


@dataclass(frozen=True)
class FacetDesign:
    """A stone as it is cut."""

    title: str
    tiers: tuple[Tier, ...]
    gear: int = 96
    """Teeth of the index gear; below zero: its indices run clockwise."""
    location: float = 0.0
    """The index at the front, -y."""
    n_d: float | None = None
    """The refractive index that it was made for."""
    symmetry: int = 1
    """Turns that leave it as it is, for programs of facetting; facets are listed one by one all the same."""
    is_mirrored: bool = False

    @cached_property
    def facets(self) -> tuple[tuple[Tier, float], ...]:
        """Tier and index of every facet, in the order of `planes`."""
        return tuple((tier, index) for tier in self.tiers for index in tier.indices)

    @cached_property
    def planes(self) -> np.ndarray:
        """Half-spaces n·x <= d, float64 (P, 4) as rows (n, d), one a facet."""
        signs = np.array([-1.0 if tier.is_below else 1.0 for tier, _ in self.facets])
        angles = np.radians([abs(tier.angle_deg) for tier, _ in self.facets])
        turns = np.array([(index - self.location) / self.gear for _, index in self.facets]) - 0.25
        across = np.where(angles == 0.0, 0.0, np.sin(angles))
        azimuths = 2.0 * np.pi * turns
        normals = [across * np.cos(azimuths), across * np.sin(azimuths), signs * np.cos(angles)]
        return np.column_stack([*normals, [tier.distance for tier, _ in self.facets]])

    @cached_property
    def cut_away(self) -> tuple[str, ...]:
        """Facets of which others leave nothing, in words. Raises `UserError` as `mesh`."""
        _, faces = self._shaped(self.title, faces_of)
        return tuple(
            f"{tier.name or f'{tier.angle_deg:g}°'} at index {index:g}"
            for (tier, index), face in zip(self.facets, faces, strict=True)
            if not len(face)
        )

    def mesh(self, name: str | None = None, source: str | None = None) -> Mesh:
        """The stone, its table facing +z, in the design's own unit. Raises `UserError` where its facets enclose
        none."""
        return self._shaped(source or self.title, lambda planes: convex_solid(name or self.title, planes, source))

    def _shaped(self, where: str, make: Callable[[np.ndarray], T]) -> T:
        try:
            return make(self.planes)
        except ValueError as error:
            raise UserError(
                f"{where}: its {len(self.facets)} facets make no stone: {error}; check their angles and distances"
            ) from None


# ---- GemCad's text files ----------------------------------------------------------------------


def read_asc(path: str | os.PathLike[str]) -> FacetDesign:
    """The design in a text file of GemCad's, .asc. Raises `UserError` with line and remedy for what is not understood.

    Keywords in either case, glued to their first number or not, a gear's line without its `g`, lists of indices over
    several lines, names of several words and any end of line are read; a preform is refused.
    """
    path = Path(path)
    with files.reading(path, "give a GemCad .asc file"):
        text = files.read_any_text(path, _MAX_BYTES)
    read: dict[str, list[_Record]] = {key: [] for key in "agyihf"}
    for record in _records(path, text.replace("\0", "").replace("\x1a", "")):
        if record.key not in read:
            record.fail("a preform (p) is not read; turn it into facets in GemCad")
        if record.key in "gi" and read[record.key]:
            record.fail(f"'{record.key}' was given before; leave one of them")
        read[record.key].append(record)
    if not read["g"]:
        raise UserError(f"{path.name}: there is no gear (g); write 'g 96 0.0' in its second line")
    gear, location = read["g"][0].gear()
    tiers = tuple(record.tier(abs(gear)) for record in read["a"])
    if not 4 <= (count := sum(len(tier.indices) for tier in tiers)) <= MOST_FACETS:
        raise UserError(f"{path.name}: it has {count} facets; a stone has 4 to {MOST_FACETS}")
    title = next((record.words for record in read["h"] if record.words), path.stem)
    return FacetDesign(title, tiers, gear, location, read["i"][0].refractive_index() if read["i"] else None)


def _records(path: Path, text: str) -> list[_Record]:
    """The records of a file; a tier's has all of its lines."""
    lines = [line.strip() for line in text.splitlines()]
    begin = next((i for i, line in enumerate(lines) if line), None)
    if begin is None:
        raise UserError(f"{path.name}: the file is empty; save a design from GemCad as .asc")
    if not lines[begin].casefold().startswith("gemcad"):
        _Record(path, begin + 1).fail(
            "it does not begin with 'GemCad': it is no faceting design; save one from GemCad as .asc"
        )
    records = [_Record(path, begin + 1)]
    for number, words in enumerate(lines[begin + 1 :], start=begin + 2):
        last = records[-1]
        found = _RECORD.match(words)
        key, rest = (found[1].casefold(), words[found.end() :]) if found else ("", words)
        if last.key == "a" and key not in "af" and last.words.split()[-1:] in (["n"], ["N"]):
            key = ""  # a name that its line had no room for
        if not words or words.startswith(";"):
            words = key = ""
        if key and not (key == "g" and last.key == "a" and not _is_number(rest)):
            records.append(_Record(path, number, key, rest))
        elif last.key == "a" or not words:
            records[-1] = last._replace(words=f"{last.words}\n{words}")
        elif _is_number(words) and all(record.key != "g" for record in records):
            records.append(_Record(path, number, "g", words))
        else:
            _Record(path, number).fail(f"'{words[:40]}' is not understood; lines begin with g, y, I, H, a or F")
    return records[1:]


class _Record(NamedTuple):
    """A line of a file behind its keyword, and the lines on which it goes on."""

    path: Path
    line: int
    key: str = ""
    words: str = ""

    def fail(self, words: str, lines: int = 0) -> NoReturn:
        raise UserError(f"{self.path.name}, line {self.line + lines}: {words}")

    def numbers(self, words: str, least: int, usual: tuple[float, ...]) -> list[float]:
        """`words` as numbers, `least` at least, filled up from `usual`."""
        found = words.split()
        if not least <= len(found) <= len(usual) or not all(map(_is_number, found)):
            key = "I" if self.key == "i" else self.key
            example = " ".join(f"{value:g}" for value in usual)
            self.fail(f"'{words[:40]}' behind {key} is not understood; give numbers as in '{key} {example}'")
        return [*map(float, found), *usual[len(found) :]]

    def gear(self) -> tuple[int, float]:
        """Teeth, and the index at the front."""
        teeth, location = self.numbers(self.words, 1, (96.0, 0.0))
        if teeth != int(teeth) or not 3 <= abs(teeth) <= _MOST_TEETH:
            self.fail(f"a gear has 3 to {_MOST_TEETH} teeth, not {teeth:g}; g 96 0.0 is the usual one")
        return int(teeth), location

    def refractive_index(self) -> float:
        """The index of the stone."""
        (index,) = self.numbers(self.words, 1, (1.54,))
        if not _LEAST_INDEX < index <= _MOST_INDEX:
            self.fail(f"a refractive index of {index:g} is none of a stone; I 1.54 is that of quartz")
        return index

    def tier(self, teeth: int) -> Tier:
        """Angle and distance, then indices, names behind `n` and, behind `G`, how to cut it; a table's one facet needs
        no index."""
        words = re.findall(r"\n|\S+", self.words)
        if len(words) < 2 or not all(map(_is_number, words[:2])):
            self.fail("a tier begins with its angle and distance; write it as in 'a 41.5 0.62 96 12 24'")
        angle, distance = map(float, words[:2])
        if not abs(angle) <= 90.0:
            self.fail(f"an angle of {angle:g}° is none of a facet; angles run from -90 to 90")
        if angle == 0.0 and distance < 0.0:  # how a culet is written
            angle, distance = -0.0, -distance
        if not 0.0 <= distance <= _FURTHEST:
            self.fail(f"a distance of {distance:g} is none of a facet; give one from 0 to {_FURTHEST:g}")
        indices: list[float] = []
        names: list[str] = []
        lines, instructions = 0, ""
        awaits_name = is_in_name = False
        for at, word in enumerate(words[2:], start=3):
            if word == "\n":
                lines += 1
            elif awaits_name:
                names, awaits_name, is_in_name = [*names, word], False, True
            elif word in "nN":
                awaits_name = True
            elif word in "gG":
                instructions = " ".join(words[at:])
                break
            elif _is_number(word):
                indices.append(float(word))
                is_in_name = False
                if not abs(indices[-1]) <= teeth:
                    self.fail(f"index {word} is beyond the gear's {teeth} teeth; separate indices by blanks", lines)
            elif is_in_name:
                names[-1] += f" {word}"
            else:
                self.fail(
                    f"'{word[:40]}' is no index; write a facet's name behind an n, instructions behind a G", lines
                )
        for more, line in enumerate(instructions.split("\n")[1:], start=lines + 1):
            if line.strip() and all(map(_is_number, line.split())):
                self.fail("numbers follow a cutting instruction (G); put a tier's indices before it", more)
        if not indices and angle != 0.0:
            self.fail("a tier without indices has no facets; list them behind its distance")
        return Tier(angle, distance, tuple(indices or [0.0]), "/".join(dict.fromkeys(names)))


def _is_number(word: str) -> bool:
    """Whether the first of its words is one."""
    return bool(words := word.split()) and _NUMBER.fullmatch(words[0]) is not None


def write_asc(design: FacetDesign, path: str | os.PathLike[str]) -> None:
    """Write `design` to a text file of GemCad's, whole or not at all. Raises `UserError`."""
    with atomic_output(path) as temporary:
        temporary.write_bytes(asc_text(design).encode())


def asc_text(design: FacetDesign) -> str:
    """The text of its file, each tier one line; blanks in names are underscores."""
    lines = ["GemCad 5.0", f"g {design.gear} {_decimal(design.location)}"]
    lines.append(f"y {design.symmetry} {'y' if design.is_mirrored else 'n'}")
    lines += [f"I {_decimal(design.n_d)}"] if design.n_d is not None else []
    lines += [f"H {line}" for line in design.title.splitlines()]
    for tier in design.tiers:
        distance = -tier.distance if tier.angle_deg == 0.0 and tier.is_below else tier.distance
        first, *others = (_decimal(index).removesuffix(".0") for index in tier.indices)
        name = ["n", "_".join(tier.name.split())] if tier.name.strip() else []
        lines.append(" ".join(["a", _decimal(tier.angle_deg), _decimal(distance), first, *name, *others]))
    return "\r\n".join(lines) + "\r\n"


def _decimal(value: float) -> str:
    """Without exponent, and as exact as a float64 is."""
    return np.format_float_positional(value, unique=True, trim="0")
