"""Spectra in the words of a scene file, read and written.

The short description is recognised from the values themselves, so nothing has to remember where a spectrum came
from: one proportional to D65 is "D65" however it was made.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np

from ..base.errors import UserError
from .io.scene_table import SceneTable
from .optics import spectrum as spectra
from .optics.colorimetry import VISIBLE_NM
from .optics.spectrum import Spectrum, blackbody, illuminant, illuminant_names

SAME = 1e-9
"""Relative difference below which two curves are one."""
_SPECTRUM_KEYS = ("illuminant", "blackbody", "laser", "csv", "nm", "constant")


def read_spectrum(table: SceneTable) -> Spectrum:
    """`spectrum`: a name, a table, or a list of tables that are added by weight."""
    value = table.raw("spectrum", "D65")
    if isinstance(value, str):
        return _named(table, "spectrum", value)
    if isinstance(value, list):
        parts = table.tables("spectrum")
        if not parts:
            table.fail("spectrum", "is an empty list; name at least one spectrum")
        weighted = ((part.number("weight", 1.0, above=0.0), _read_table(part)) for part in parts)
        return reduce(Spectrum.__add__, (term.scaled_to_power(weight) for weight, term in weighted))
    inner = table.table("spectrum")
    if inner is None:
        table.fail("spectrum", 'must be a name such as "D65" or a table such as {blackbody = 3200}')
    return _read_table(inner)


def _read_table(table: SceneTable) -> Spectrum:
    key = table.one_of(_SPECTRUM_KEYS, "the spectrum")
    spectrum = _spectrum_of(table, key)
    if table.has("lines"):
        for wavelength_nm, power in table.rows("lines", 2, at_least=1):
            spectrum = _laser(table, "lines", wavelength_nm, power) + spectrum
    table.finish("a spectrum")
    return spectrum


def _spectrum_of(table: SceneTable, key: str | None) -> Spectrum:
    if key == "illuminant":
        return _named(table, key, table.string(key))
    if key == "blackbody":
        return spectra.blackbody(table.number(key, at_least=500.0, at_most=1e6))
    if key == "laser":
        return _laser(table, key, table.number(key), 1.0)
    if key == "csv":
        return spectra.from_csv(table.existing_file(key, or_part=True), table.notes)
    if key == "constant":
        return spectra.constant(table.number(key, above=0.0))
    if key == "nm":
        wavelengths = table.numbers("nm", at_least=2)
        values = table.numbers("values", count=len(wavelengths))
        return spectra.from_table(np.array(wavelengths), np.array(values), table.where("values"))
    if table.has("lines"):
        return spectra.constant(0.0)
    return table.fail("", f"names no spectrum: give one of {', '.join(_SPECTRUM_KEYS)} or lines")


def _named(table: SceneTable, key: str, name: str) -> Spectrum:
    try:
        return spectra.illuminant(name)
    except UserError as error:
        table.fail(key, f"is not known: {error}")


def _laser(table: SceneTable, key: str, wavelength_nm: float, power: float) -> Spectrum:
    low, high = VISIBLE_NM[0], VISIBLE_NM[-1]
    if not low <= wavelength_nm <= high:
        table.fail(key, f"is at {wavelength_nm:g} nm, outside the visible {low:g} to {high:g} nm that is computed")
    return spectra.laser(wavelength_nm, power)


# -- writing it ---------------------------------------------------------------------------


def describe_spectrum(spectrum: Spectrum) -> str | dict[str, Any]:
    """What `spectrum = …` must say to give this spectrum up to its power."""
    lines = [[w, p] for w, p in spectrum.lines if p > 0.0]
    if not spectrum.density.any():
        if len(lines) == 1:
            return {"laser": lines[0][0]}
        return {"lines": lines} if lines else "E"
    if not lines:
        shape = spectrum.density / spectrum.density.sum()
        known = _illuminant_of(shape) or _temperature_of(shape)
        if known:
            return known
    table: dict[str, Any] = {"nm": VISIBLE_NM.tolist(), "values": spectrum.density.tolist()}
    return table | ({"lines": lines} if lines else {})


def _illuminant_of(shape: np.ndarray) -> str | None:
    for name in illuminant_names():
        density = illuminant(name).density
        if same_curve(density / density.sum(), shape):
            return name
    return None


def _temperature_of(shape: np.ndarray) -> dict[str, Any] | None:
    """Black body of this shape: blue over red rises with temperature, so bisection finds it."""
    if shape.min() <= 0.0:
        return None
    wanted = math.log(shape[70] / shape[320])
    low, high = 500.0, 1e6
    for _ in range(80):
        middle = math.sqrt(low * high)
        density = blackbody(middle).density
        if density[70] <= 0.0 or math.log(density[70] / density[320]) < wanted:
            low = middle
        else:
            high = middle
    kelvin = round(math.sqrt(low * high), 6)
    density = blackbody(kelvin).density
    return {"blackbody": kelvin} if same_curve(density / density.sum(), shape) else None


def same_curve(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.abs(a - b).max() <= SAME * np.abs(b).max())
