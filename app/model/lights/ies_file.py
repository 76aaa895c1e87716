"""Photometric files of lamps: candela over directions. ANSI/IES LM-63 (1986 to 2019) and EULUMDAT (.ldt).

Angles of type C: the vertical one is 0 straight along the lamp's axis and 180° behind it, the horizontal one turns
about that axis from the C0 plane. Between the listed directions the candela are bilinear in both angles.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from ...base import files
from ...base.errors import UserError
from ...base.paths import assets_dir
from ..io.scene_table import MAX_MAGNITUDE
from ..vectors import frozen

MAX_BYTES = 1 << 20
MAX_ANGLES = 4096
"""Most vertical or horizontal angles: one every 0.09°."""
_WHERE = "export the file again from the lamp's maker or a photometric editor"
_Images = tuple[tuple[int, float], ...]
_ONCE: _Images = ((1, 0.0),)
_SYMMETRIES = (
    _ONCE,
    _ONCE,
    ((1, 0.0), (-1, 0.0)),
    ((1, 0.0), (-1, 180.0)),
    ((1, 0.0), (-1, 0.0), (1, 180.0), (-1, 180.0)),
)
"""By EULUMDAT's number: none, about the axis, to C0–C180, to C90–C270, to both; signs and turns of the angles."""
_IMAGES = {(0.0, 90.0): _SYMMETRIES[4], (0.0, 180.0): _SYMMETRIES[2], (90.0, 270.0): _SYMMETRIES[3]}
"""LM-63's, by the first and the last horizontal angle."""
_UNLIT_DEG = 1e-3
"""A lamp whose angles begin at 90° goes dark within this of it."""


@dataclass(frozen=True, eq=False)
class Profile:
    """A lamp's intensity over directions; equal by content."""

    vertical_deg: np.ndarray
    """float64 (V,), ascending from 0; beyond the last one there is no light."""
    horizontal_deg: np.ndarray
    """float64 (H,), ascending from 0 to 360."""
    intensity: np.ndarray
    """float64 (H, V), as a share of the peak; first and last row are the same."""
    peak_cd: float
    """The file's own candela where `intensity` is 1."""
    source: str
    """Path of the file."""

    @cached_property
    def _content(self) -> tuple[object, ...]:
        arrays = (self.vertical_deg, self.horizontal_deg, self.intensity)
        return (self.source, self.peak_cd, *(array.tobytes() for array in arrays))

    def __eq__(self, other: object) -> bool:
        return self._content == other._content if isinstance(other, Profile) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._content)

    def __repr__(self) -> str:
        return f"Profile({self.source!r}, {hash(self)})"

    @cached_property
    def integral_sr(self) -> float:
        """∫ intensity dω: the flux of a peak of 1.

        Exact for the bilinear table: a stretch of the vertical angle holds ∫ (a + bθ) sin θ dθ in closed form."""
        theta, phi = np.radians(self.vertical_deg), np.radians(self.horizontal_deg)
        slope = np.diff(self.intensity, axis=1) / np.diff(theta)
        # ∫ (g₀ + s (θ − θ₀)) sin θ = −g₁ cos θ₁ + g₀ cos θ₀ + s (sin θ₁ − sin θ₀)
        ends = self.intensity * np.cos(theta)
        rings = (ends[:, :-1] - ends[:, 1:] + slope * np.diff(np.sin(theta))).sum(axis=1)
        return float(np.trapezoid(rings, phi))

    @cached_property
    def cone_rad(self) -> float:
        """Half angle beyond which there is no light, rad; beyond π for none."""
        lit = np.flatnonzero(self.intensity.max(axis=0) > 0.0)
        last = min(int(lit[-1]) + 1, len(self.vertical_deg) - 1)
        return 4.0 if self.vertical_deg[last] >= 180.0 else math.radians(self.vertical_deg[last])

    def at(self, theta_rad: np.ndarray, phi_rad: np.ndarray) -> np.ndarray:
        """Intensity as a share of the peak towards these angles from the axis and about it (any φ)."""
        theta, phi = np.degrees(theta_rad), np.mod(np.degrees(phi_rad), 360.0)
        (i, s), (j, t) = _cell(self.horizontal_deg, phi), _cell(self.vertical_deg, theta)
        g = self.intensity
        low, high = g[i, j] * (1.0 - t) + g[i, j + 1] * t, g[i + 1, j] * (1.0 - t) + g[i + 1, j + 1] * t
        return np.where(theta_rad <= self.cone_rad, low * (1.0 - s) + high * s, 0.0)

    def packed(self) -> np.ndarray:
        """float64: V, H, the vertical angles, the horizontal ones (rad), then row by row the intensities."""
        angles = np.radians(self.vertical_deg), np.radians(self.horizontal_deg)
        return np.concatenate([self.intensity.shape[::-1], *angles, self.intensity.ravel()])


def _cell(listed: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    index = np.clip(np.searchsorted(listed, angle, "right") - 1, 0, len(listed) - 2)
    return index, np.clip((angle - listed[index]) / (listed[index + 1] - listed[index]), 0.0, 1.0)


@cache
def default_profile() -> Profile:
    """A lamp to begin with."""
    return read_ies(assets_dir() / "lights" / "downlight.ies")


def read_ies(path: str | os.PathLike[str]) -> Profile:
    """The profile in `path`. Raises UserError, one sentence with the file and a remedy, for what cannot be used."""
    path = Path(path)
    if not files.is_file(path):
        raise UserError(f"{path} is not a file; choose a .ies or .ldt file")
    with files.reading(path, "choose another file"):
        if path.stat().st_size > MAX_BYTES:
            raise UserError(
                f"{path} is longer than {MAX_BYTES >> 20} MiB, as no lamp's file is; choose a .ies or .ldt file"
            )
        text = files.read_any_text(path, MAX_BYTES).replace("\x1a", "")  # the end of a file, to DOS
    # By content: EULUMDAT's second and third line are whole numbers, and LM-63 has a line TILT=.
    is_eulumdat = re.match(r"[^\n]*\n\s*[0-3]\s*\n\s*[0-4]\s*\n", "\n".join(text.splitlines()[:4])) is not None
    return _Eulumdat(path, text).profile() if is_eulumdat else _Lm63(path, text).profile()


class _Numbers:
    """Numbers of a file, taken one after the other."""

    _words: list[str]

    def __init__(self, path: Path) -> None:
        self._path = path
        self._next = 0

    def _profile(self, vertical: np.ndarray, horizontal: np.ndarray, candela: np.ndarray, images: _Images) -> Profile:
        """With the symmetries written out: all the way round, and dark before the first vertical angle.

        `images`: signs and turns (deg) that make all horizontal angles of those that are listed."""
        if self._next < len(self._words):
            raise self._error(f"goes on after its {candela.size} candela, so its counts of angles are wrong")
        if not (candela.min() >= 0.0 and candela.max() <= MAX_MAGNITUDE):
            raise self._error("has candela, or a factor on them, that are negative or too large")
        if candela.max() <= 0.0:
            raise self._error("gives no light in any direction", "choose another file")
        if vertical[0] not in (0.0, 90.0) or vertical[-1] not in (90.0, 180.0):
            raise self._error("has vertical angles that do not run from 0 or 90 to 90 or 180")
        angles = np.concatenate([sign * horizontal + turn for sign, turn in images]) % 360.0
        rows = np.concatenate([candela] * len(images))
        angles[angles == 360.0] = 0.0  # what was a hair below 0
        horizontal = np.unique(angles)
        candela = np.stack([rows[angles == angle].mean(axis=0) for angle in horizontal])
        # Where C0 is not listed, it is between its neighbours.
        share = horizontal[0] / (horizontal[0] + 360.0 - horizontal[-1]) if len(horizontal) > 1 else 0.0
        seam = candela[:1] * (1.0 - share) + candela[-1:] * share
        inner = slice(int(horizontal[0] == 0.0 or len(horizontal) == 1), None)
        horizontal = np.concatenate([[0.0], horizontal[inner], [360.0]])
        candela = np.concatenate([seam, candela[inner], seam])
        if vertical[0] == 90.0:
            dark = np.zeros((len(candela), 2))
            vertical = np.concatenate([[0.0, 90.0 - _UNLIT_DEG], vertical])
            candela = np.hstack([dark, candela])
        peak = float(candela.max())
        return Profile(frozen(vertical), frozen(horizontal), frozen(candela / peak), peak, str(self._path.resolve()))

    def _angles(self, count: int, which: str) -> np.ndarray:
        angles = np.array(self._take(count, f"{which} angles"))
        if np.any(np.diff(angles) <= 0.0):
            raise self._error(f"has {which} angles that do not ascend")
        if which == "vertical" and count < 2:
            raise self._error("has a single vertical angle, which says nothing about the others")
        return angles

    def _count(self, what: str) -> int:
        number = self._take(1, f"the number of {what}")[0]
        if number != int(number) or not 1 <= number <= MAX_ANGLES:
            raise self._error(f"says it has {number:g} {what}")
        return int(number)

    def _take(self, count: int, what: str) -> list[float]:
        words = self._words[self._next : self._next + count]
        if len(words) < count:
            raise self._error(f"ends within {what}, after {len(self._words)} numbers")
        self._next += count
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            raise self._error(f"has something among {what} that is no number") from None
        if not all(map(math.isfinite, numbers)):
            raise self._error(f"has a number that is not finite among {what}")
        return numbers

    def _error(self, problem: str, remedy: str = _WHERE) -> UserError:
        return UserError(f"{self._path} {problem}; {remedy}")


class _Lm63(_Numbers):
    """What is behind the TILT line of an LM-63 file."""

    def __init__(self, path: Path, text: str) -> None:
        super().__init__(path)
        lines = text.splitlines()
        at = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT=")), None)
        if at is None:
            problem = "has no line TILT=, so it is no LM-63 file or is cut off" if text.strip() else "is empty"
            raise self._error(problem)
        self._tilt = lines[at].partition("=")[2].strip().upper()
        words = " ".join(lines[at + 1 :]).split()
        # Commas part numbers, but where each stands within one of its own and no point does: then they are decimal.
        is_decimal = all(re.fullmatch(r"[-+\d]+(,\d+)?", word) for word in words)
        self._words = " ".join(words).replace(",", "." if is_decimal else " ").split()

    def profile(self) -> Profile:
        """All of the file."""
        if self._tilt == "INCLUDE":
            # What a lamp loses when it is tilted; here it is never tilted.
            self._take(1, "the lamp's place in the luminaire")
            self._take(2 * self._count("tilt angles"), "the factors for a tilted lamp")
        elif self._tilt != "NONE":
            raise self._error("keeps its tilt factors in another file, which is not read", "write TILT=NONE into it")
        _, _, multiplier = self._take(3, "lamps, lumens and multiplier")
        verticals, horizontals = self._count("vertical angles"), self._count("horizontal angles")
        kind = int(self._take(1, "the photometric type")[0])
        if kind != 1:
            name = {2: "B", 3: "A"}.get(kind, str(kind))
            raise self._error(f"is of photometric type {name} and only type C is read", "export it as type C")
        self._take(4, "the luminaire's size")
        ballast, ballast_lamp, _ = self._take(3, "ballast factors and watts")
        vertical = self._angles(verticals, "vertical")
        horizontal = self._angles(horizontals, "horizontal")
        candela = np.array(self._take(verticals * horizontals, "candela")).reshape(horizontals, verticals)
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            candela = candela * multiplier * ballast * ballast_lamp
        first, last = horizontal[0], horizontal[-1]
        wide = 1.5 * np.diff(horizontal).max(initial=0.0)
        ends_early = first == 0.0 and 270.0 <= last and 360.0 - last <= wide  # 315 or 345: 360 is 0
        if horizontals == 1 or ends_early:
            images = _ONCE
        elif (first, last) in _IMAGES:
            images = _IMAGES[first, last]
        else:
            raise self._error("has horizontal angles that run neither to 0, 90, 180 or 360 from 0, nor from 90 to 270")
        return self._profile(vertical, horizontal, candela, images)


class _Eulumdat(_Numbers):
    """EULUMDAT (A. Stockmar, 1990): one value a line, then candela for 1000 lm of the lamps in as many C planes as the
    symmetry leaves open."""

    def __init__(self, path: Path, text: str) -> None:
        super().__init__(path)
        lines = text.replace(",", ".").splitlines() + [""] * 30
        sets = lines[25].strip()
        if not re.fullmatch(r"0?[1-9]|1\d", sets):
            raise self._error("does not say which lamps it has, as line 26 of a EULUMDAT file should")
        # Symmetry, C planes, angles, factor on intensities, lumens of the first set of lamps; what follows the sets.
        self._words = [lines[i].strip() for i in (2, 3, 5, 23, 28)]
        self._words += " ".join(lines[26 + 6 * int(sets) :]).split()

    def profile(self) -> Profile:
        """All of the file."""
        symmetry = int(self._take(1, "the symmetry")[0])
        planes, verticals = self._count("C planes"), self._count("angles in each plane")
        parts = {0: 1, 1: planes, 2: 2, 3: 2, 4: 4}[symmetry]
        if planes % parts:
            raise self._error(f"has {planes} C planes, which its symmetry {symmetry} does not allow")
        factor, lumens = self._take(2, "the factor on intensities and the lumens of the lamps")
        self._take(10, "the direct ratios")
        horizontal = self._angles(planes, "horizontal")
        vertical = self._angles(verticals, "vertical")
        if symmetry == 3:  # from C270 over C0 to C90
            horizontal = np.roll(horizontal, planes // 4)
        count = planes // parts + (1 < parts < planes)
        candela = np.array(self._take(count * verticals, "intensities")).reshape(count, verticals)
        with np.errstate(over="ignore", invalid="ignore", under="ignore"):
            candela = candela * factor * (lumens / 1000.0)
        return self._profile(vertical, horizontal[:count], candela, _SYMMETRIES[symmetry])
