"""Tinted glasses and gems by name: what a colouring ion absorbs, over wavelength.

`assets/glass/tints.toml` holds them: approximations by a few Gaussian bands at the wavelengths that textbooks give for
the ion, their strengths chosen by eye, not measured samples. How deep a colour is depends on the amount of the
colourant, so a curve says only the hue; a distance says how deep.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import msgspec
import numpy as np

from ...base import files
from ...base.paths import assets_dir
from ..vectors import frozen
from . import catalogue
from .catalogue import search_key
from .colorimetry import VISIBLE_NM, cmf_xyz, daylight_per_lumen
from .glass import Dispersion


@dataclass(frozen=True)
class Tint:
    """What colours a glass."""

    name: str
    colourant: str
    bands: tuple[tuple[float, float, float], ...]
    """(centre in nm, full width at half maximum in nm, relative strength)."""
    level: float = 0.0
    """Relative absorption at every wavelength."""
    glass: str = ""
    """What is coloured so: a catalogue name."""
    also: tuple[str, ...] = ()
    """Other names."""

    @cached_property
    def coefficient(self) -> np.ndarray:
        """α(λ) on the visible grid, float64 (401,), where daylight is half as bright after 1 unit."""
        curve = np.full(len(VISIBLE_NM), self.level)
        for centre_nm, width_nm, strength in self.bands:
            curve += strength * np.exp(-4.0 * math.log(2.0) * ((VISIBLE_NM - centre_nm) / width_nm) ** 2)
        return frozen(curve * half_distance(curve))

    @property
    def dispersion(self) -> Dispersion:
        """n(λ) of the glass that is usually coloured so."""
        return catalogue.find(self.glass)


@dataclass(frozen=True)
class _Tints:
    tints: tuple[Tint, ...]


@cache
def tints() -> tuple[Tint, ...]:
    """All of them, in the file's order."""
    path = assets_dir() / "glass" / "tints.toml"
    return msgspec.toml.decode(files.read_bytes(path, files.SETTINGS_BYTES), type=_Tints).tints


def tint(name: str) -> Tint | None:
    """By name, without regard to case, blanks and punctuation; None for one that does not exist."""
    key = search_key(name)
    return next((each for each in tints() if key in map(search_key, (each.name, *each.also))), None)


def half_distance(coefficient: np.ndarray) -> float:
    """The distance at which daylight that crosses `coefficient` (401,), 1/unit, is half as bright; infinite where it
    never is."""
    weights = daylight_per_lumen() * cmf_xyz()[:, 1]
    weights = weights / weights.sum()
    least, most = float(coefficient[weights > 0.0].min()), float(coefficient.max())
    if most <= 0.0:
        return math.inf
    low, high = math.log(2.0) / most, math.log(2.0) / max(least, 1e-12 * most)
    for _ in range(80):
        middle = math.sqrt(low * high)
        is_brighter = float(weights @ np.exp(-np.minimum(coefficient * middle, 700.0))) > 0.5
        low, high = (middle, high) if is_brighter else (low, middle)
    return math.sqrt(low * high)


def tint_of(coefficient: np.ndarray) -> tuple[Tint, float] | None:
    """The tint of which `coefficient` is a multiple, and the distance at which daylight is half as bright; None where
    there is none."""
    strongest = int(coefficient.argmax())
    if coefficient[strongest] <= 0.0:
        return None
    for each in tints():
        scale = coefficient[strongest] / each.coefficient[strongest]
        if np.abs(scale * each.coefficient - coefficient).max() <= 1e-9 * coefficient[strongest]:
            return each, float(1.0 / scale)
    return None
