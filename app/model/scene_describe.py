"""Finds the short description behind a spectrum or a material: the words a scene file would use.

Descriptions are recognised from the values themselves, so nothing has to remember where a
value came from: a spectrum proportional to D65 is "D65" however it was made.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.errors import UserError
from .io.scene_pictures import picture_name
from .optics.colorimetry import VISIBLE_NM, rgb_partition
from .optics.glass import Dispersion
from .optics.spectrum import Spectrum, blackbody, illuminant, illuminant_names
from .scene import (
    Absorption,
    Black,
    Dielectric,
    Diffuse,
    Material,
    Mirror,
)

_SAME = 1e-9
"""Relative difference below which two curves are one."""


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
        if _equal(density / density.sum(), shape):
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
    return {"blackbody": kelvin} if _equal(density / density.sum(), shape) else None


def _equal(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.abs(a - b).max() <= _SAME * np.abs(b).max())


def describe_material(material: Material) -> dict[str, Any]:
    """The keys of a material table that give this material.

    A texture is told by its absolute path, or by a name of its content where it has no file: who writes a scene
    file makes one (`scene_save`).
    """
    if isinstance(material, Mirror):
        return {"kind": "mirror", "reflectance": list(material.reflectance_rgb)}
    if isinstance(material, Black):
        return {"kind": "black"}
    if isinstance(material, Diffuse):
        if material.texture is not None:
            texture = {
                "file": material.texture.source or picture_name(material.texture.rgb),
                "wrap": material.texture.wrap,
            }
            return {"kind": "diffuse", "colour": list(material.reflectance_rgb), "texture": texture}
        if material.reflectance is None:
            return {"kind": "diffuse", "colour": list(material.reflectance_rgb)}
        return {"kind": "diffuse", "reflectance": {"nm": VISIBLE_NM.tolist(), "values": material.reflectance.tolist()}}
    return _describe_glass(material)


def _describe_glass(material: Dielectric) -> dict[str, Any]:
    values = _describe_dispersion(material.dispersion)
    if material.absorption is not None:
        values["absorption"] = _describe_absorption(material.absorption)
    if material.priority:
        values["priority"] = material.priority
    return values


def _describe_dispersion(dispersion: Dispersion) -> dict[str, Any]:
    if dispersion.gain != 1.0:
        return _describe_dispersion(replace(dispersion, gain=1.0)) | {"dispersion_gain": dispersion.gain}
    from .optics import catalogue

    try:
        if catalogue.find(dispersion.name) == dispersion:
            return {"glass": dispersion.name}
    except UserError:
        pass  # not of the catalogue: its data are written out
    values: dict[str, Any] = {"name": dispersion.name} if dispersion.name else {}
    kind, data = dispersion.kind, dispersion.coefficients
    if kind == "constant":
        return values | {"n_d": data[0]}
    if kind == "abbe":
        return values | {"n_d": data[0], "V_d": data[1]}
    if kind == "table":
        # Micrometres came from nanometres: rounding brings those back exactly.
        pairs = zip(data[0::2], data[1::2], strict=True)
        return values | {"table": [[round(um * 1e3, 9), n] for um, n in pairs]}
    values["formula"] = {"number": int(kind.removeprefix("formula ")), "coefficients": list(data)}
    if dispersion.range_nm != (0.0, math.inf):
        values["range_nm"] = list(dispersion.range_nm)
    return values


def _describe_absorption(absorption: Absorption) -> dict[str, Any]:
    alpha = absorption.coefficient
    strength, *_ = np.linalg.lstsq(rgb_partition(), alpha, rcond=None)
    strongest = float(strength.max())
    if strongest > 0.0 and strength.min() > -_SAME * strongest and _equal(rgb_partition() @ strength, alpha):
        # The distance at which the strongest channel has fallen to one half.
        distance = math.log(2.0) / strongest
        return {"colour": np.exp(-np.maximum(strength, 0.0) * distance).tolist(), "distance": distance}
    return {"nm": VISIBLE_NM.tolist(), "coefficient": alpha.tolist()}
