"""What glass absorbs, with its words in a scene file, and curves over wavelength in general."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import suggestion
from ..fields import Part
from ..io import curve_file
from ..io.scene_table import SceneTable
from ..optics import tints
from ..optics.colorimetry import VISIBLE_NM, attenuation_from_colour
from ..vectors import Vec3, frozen

MAX_ATTENUATION = 1e15
"""Per scene unit; float32 holds it in any unit the renderer may choose."""
_SPECTRUM_SOURCES = ("csv", "nm")


@dataclass(frozen=True)
class Absorption:
    """Absorption coefficient alpha(wavelength), per scene unit, on the visible grid of `spectrum`."""

    coefficient: np.ndarray
    """float64 (401,), 1/unit, at 380, 381, … 780 nm."""
    colour: tuple[Vec3, float] | None = None
    """Linear Rec.709 colour that it was given by, and the distance at which white light has it; None: by a curve."""

    @classmethod
    def of_colour(cls, rgb: Vec3, distance: float, where: str = "") -> Absorption:
        """White light has the linear colour `rgb` after `distance` scene units. Raises `UserError` that begins with
        `where`."""
        return cls(frozen(attenuation_from_colour(rgb, distance, where)), (rgb, distance))


class AbsorptionPart(Part):
    """`absorption`: a colour or a spectrum of transmittance, reached at a distance; a tint that halves light there; or
    the coefficient itself."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The absorption, None without one."""
        return {"absorption": _read_absorption(table)}

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """A tint or a colour at a distance where one explains it, else the coefficient."""
        return {} if value.absorption is None else {"absorption": _describe_absorption(value.absorption)}


def _read_absorption(table: SceneTable) -> Absorption | None:
    if not table.has("absorption"):
        return None
    inner = table.given_table("absorption", "{ colour = [0.4, 0.9, 0.7], distance = 2.0 }")
    colour = None
    if inner.has("coefficient"):
        wavelengths = inner.numbers("nm", at_least=2)
        values = np.array(inner.numbers("coefficient", count=len(wavelengths)))
        alpha = _on_visible_grid(inner, "coefficient", np.array(wavelengths), values)
    else:
        distance = inner.number("distance", above=0.0)
        key = inner.one_of(("colour", "tint", *_SPECTRUM_SOURCES), "the colour")
        if key == "tint":
            alpha = _tint(inner) / distance
        elif key == "colour":
            absorption = Absorption.of_colour(inner.colour("colour"), distance, inner.where("colour"))
            alpha, colour = absorption.coefficient, absorption.colour
        else:
            source, transmittance = read_curve(inner, "transmittance", "transmittance")
            if transmittance.min() <= 0.0 or transmittance.max() > 1.0:
                inner.fail(source, "must hold transmittances above 0 and at most 1")
            alpha = -np.log(transmittance) / distance
    if alpha.min() < 0.0:
        inner.fail("coefficient", "is negative somewhere; glass cannot amplify light")
    if alpha.max() > MAX_ATTENUATION:
        inner.fail(
            "distance",
            f'makes the glass opaque within {1.0 / MAX_ATTENUATION:g} units; use material = "black" for that',
        )
    inner.finish("absorption")
    return Absorption(alpha, colour)


def _tint(table: SceneTable) -> np.ndarray:
    name = table.string("tint")
    found = tints.tint(name)
    if found is None:
        names = [each.name for each in tints.tints()]
        table.fail("tint", f"'{name}' is unknown{suggestion(name, names) or ','} there are {', '.join(names)}")
    return found.coefficient


def read_curve(table: SceneTable, value_key: str, what: str) -> tuple[str, np.ndarray]:
    """A share of light over wavelength from `csv`, or from `nm` with `value_key`: (key to blame, (401,))."""
    source = table.one_of(_SPECTRUM_SOURCES, "the curve")
    if source is None:
        table.fail("", f"holds no curve: give 'csv', or 'nm' with '{value_key}'")
    if source == "csv":
        path = table.existing_file("csv", or_part=True)
        curve = curve_file.read_curve(path, table.notes)
        shares = curve_file.share(path, curve, what, table.notes)
        return source, _on_visible_grid(table, source, curve.nm, shares)
    wavelengths = table.numbers("nm", at_least=2)
    values = table.numbers(value_key, count=len(wavelengths))
    return value_key, _on_visible_grid(table, "nm", np.array(wavelengths), np.array(values))


def _on_visible_grid(table: SceneTable, key: str, wavelength_nm: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear between the rows, held at the ends, float64 (401,)."""
    if wavelength_nm.max() < 100.0:
        table.fail(key, "must be in nm, and these wavelengths look like µm: give 1000 times as much")
    if np.any(np.diff(wavelength_nm) <= 0.0):
        table.fail(key, "must list its wavelengths in ascending order")
    return frozen(np.interp(VISIBLE_NM, wavelength_nm, values))


def _describe_absorption(absorption: Absorption) -> dict[str, Any]:
    if absorption.colour is not None:
        return {"colour": list(absorption.colour[0]), "distance": absorption.colour[1]}
    alpha = absorption.coefficient
    tinted = tints.tint_of(alpha)
    if tinted is not None:
        return {"tint": tinted[0].name, "distance": tinted[1]}
    return {"nm": VISIBLE_NM.tolist(), "coefficient": alpha.tolist()}
