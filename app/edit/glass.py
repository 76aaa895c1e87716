"""Edits of a glass: which, how dispersive, how absorbing. Pure functions from a scene to a new one, as in `objects`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.errors import UserError
from ..model.materials.absorption import MAX_ATTENUATION
from ..model.materials.dielectric import MAX_PRIORITY
from ..model.optics import glass
from ..model.optics.glass import Dispersion
from ..model.optics.tints import Tint
from ..model.scene import Absorption, Dielectric, Scene, Vec3
from ..model.scene_checks import check_lines
from ..model.vectors import frozen
from .objects import changed

_CURVE_NM = np.arange(380.0, 781.0, 4.0)


def set_dispersion(scene: Scene, index: int, dispersion: Dispersion) -> Scene:
    """Make object `index` of another glass; absorption and priority stay.

    Raises UserError where the object is not glass, or a light has a line outside the glass's data.
    """
    after = _with_glass(scene, index, dispersion=dispersion, extraordinary=None)
    if dispersion.range_nm != _glass(scene, index).dispersion.range_nm:
        for light in scene.lights:
            check_lines(light, [after.objects[index]], scene.name)
    return after


def set_dispersion_gain(scene: Scene, index: int, gain: float) -> Scene:
    """Factor on n(λ) − n_d of object `index`: 0 none, 1 as in nature."""
    return changed(scene, index, material=_glass(scene, index).with_gain(gain, scene.objects[index].name))


def bent(dispersion: Dispersion, field: str, change: float) -> Dispersion:
    """The glass with its "n_d", its "V_d" or its whole "index" changed, by the differences of glasses that have no more
    than n_d and V_d; the rest of its curve stays."""
    n_d, v_d = dispersion.n_d, dispersion.natural.V_d
    n = dispersion.index(_CURVE_NM)
    if field == "index" or not math.isfinite(v_d):
        n = n + change
    else:
        other = (n_d + change, v_d) if field == "n_d" else (n_d, v_d + change)
        shift = glass.from_abbe(*other).index(_CURVE_NM) - glass.from_abbe(n_d, v_d).index(_CURVE_NM)
        n = n + dispersion.gain * shift + (1.0 - dispersion.gain) * (other[0] - n_d)
    return glass.table(_CURVE_NM, n, dispersion.name)


def abbe_numbers(dispersion: Dispersion) -> tuple[float, float]:
    """n_d and V_d (inf without dispersion) to show and to edit: giving them to `glass.from_abbe` again changes nothing.

    For a glass made by it they are the numbers it was made of, not those the formula gives back, which differ in the
    sixth digit and would creep while a slider is dragged.
    """
    if dispersion.kind == "abbe":
        n_d, v_d = dispersion.coefficients
        return n_d, math.inf if dispersion.gain == 0.0 else v_d / dispersion.gain
    if dispersion.kind == "constant":
        return dispersion.coefficients[0], math.inf
    return dispersion.n_d, dispersion.V_d


def set_absorption(scene: Scene, index: int, colour: Vec3 | None, distance: float = 1.0) -> Scene:
    """White light takes this colour (linear Rec.709, 0 to 1) after `distance` scene units of object `index`; None is
    clear."""
    if colour is None:
        return _with_glass(scene, index, absorption=None)
    if not (math.isfinite(distance) and distance > 0.0):
        raise UserError(
            f"{scene.objects[index].name}: the distance of the absorption is {distance:g}; give a length above 0"
        )
    absorption = Absorption.of_colour(colour, distance, scene.objects[index].name)
    if absorption.coefficient.max() > MAX_ATTENUATION:
        raise UserError(
            f"{scene.objects[index].name}: the glass would be opaque within {1.0 / MAX_ATTENUATION:g} units; choose a "
            "longer distance"
        )
    return _with_glass(scene, index, absorption=absorption)


def set_tint(scene: Scene, index: int, tint: Tint, distance: float) -> Scene:
    """Colour object `index` so that daylight is half as bright after `distance` scene units."""
    if not (math.isfinite(distance) and distance > 0.0):
        raise UserError(f"{scene.objects[index].name}: the distance of the tint is {distance:g}; give a length above 0")
    return _with_glass(scene, index, absorption=Absorption(frozen(tint.coefficient / distance)))


def set_priority(scene: Scene, index: int, priority: int) -> Scene:
    """Which of overlapping solids decides the medium: the higher priority."""
    if abs(priority) > MAX_PRIORITY:
        raise UserError(
            f"{scene.objects[index].name}: the priority is {priority}; give a whole number within ±{MAX_PRIORITY}"
        )
    return _with_glass(scene, index, priority=int(priority))


def _glass(scene: Scene, index: int) -> Dielectric:
    material = scene.objects[index].material
    if not isinstance(material, Dielectric):
        raise UserError(f"'{scene.objects[index].name}' is not made of glass; give it a glass first")
    return material


def _with_glass(scene: Scene, index: int, **changes: Any) -> Scene:
    return changed(scene, index, material=replace(_glass(scene, index), **changes))
