"""Lights of a scene file: shape, spectrum and one physical quantity with its unit in the key's name.

All areas are in scene units: `illuminance_lx` is lumen per square scene unit, and so on, so
that a scene in centimetres needs no conversion of its brightness. Photometric quantities use
K_m = 683.002 lm/W.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import UserError
from ..fields import read_fields, write_fields
from ..io.scene_table import SceneTable
from ..placement import Surroundings, default_direction
from ..spectrum_file import describe_spectrum, read_spectrum
from . import LIGHT_KINDS
from .light import Light, PowerKey, made


def read_light(table: SceneTable, index: int, around: Surroundings) -> Light:
    """One entry of [[lights]], its power already in the quantity of `Light.spectral_power`."""
    kind = table.choice("kind", tuple(LIGHT_KINDS), "point")
    cls = LIGHT_KINDS[kind]
    attributes = {"name": table.string("name", f"{kind} {index + 1}")} | read_fields(cls.parts, table)
    placement, distance = _read_placement(table, cls, around)
    light = made(cls, attributes | placement | {"spectral_power": read_spectrum(table)})
    light = _read_power(table, light, distance)
    table.finish(f"a light of kind '{kind}'")
    return light


def light_values(light: Light, path: Path | None = None, power: PowerKey | None = None) -> dict[str, Any]:
    """One of the [[lights]] of a scene file; files are named as the scene file `path` would, absolutely without one.
    `power`: what its power is given in, the watts of its own quantity if None."""
    values: dict[str, Any] = {"name": light.name, "kind": light.kind}
    if light.has_place:
        values["position"] = list(light.position)
    if light.has_direction:
        values["direction"] = list(light.direction)
    values |= write_fields(light.parts, light, path)
    values["spectrum"] = describe_spectrum(light.spectral_power)
    power = power or light.own_keys[1]
    return values | {power.key: light.power(power)}


def _read_placement(table: SceneTable, cls: type[Light], around: Surroundings) -> tuple[dict[str, Any], float]:
    """Position and direction, and the distance to what is lit (scene units)."""
    aim = table.one_of(("target", "direction"), "the aim") if cls.has_direction else None
    direction = table.unit_vector("direction") if aim == "direction" else None
    target = np.array(table.vector("target")) if aim == "target" else around.centre
    reach = 6.0 * around.radius
    if not cls.has_place:
        if aim == "target":
            # Only the direction of a sun matters; "from" is where the target sees it.
            position = np.array(table.vector("position"))
            direction = _unit(table, target - position)
        return {"direction": direction or default_direction()}, 1.0
    if table.has("position"):
        position = np.array(table.vector("position"))
    else:
        position = target - reach * np.array(direction or default_direction())
    if cls.has_direction and direction is None:
        direction = _unit(table, target - position)
    distance = max(float(np.linalg.norm(target - position)), 1e-3 * around.radius)
    return {"position": tuple(float(v) for v in position), "direction": direction}, distance


def _unit(table: SceneTable, vector: np.ndarray) -> tuple[float, float, float]:
    length = float(np.linalg.norm(vector))
    if length < 1e-150:
        table.fail("target", "lies at the light's own position and so gives no direction")
    x, y, z = (float(v) / length for v in vector)
    return x, y, z


def _read_power(table: SceneTable, light: Light, distance: float) -> Light:
    keys: dict[str, PowerKey] = {key.key: key for key in light.power_keys}
    name = table.one_of(tuple(keys), "the power")
    if name is None:
        key, value = light.own_keys[0], light.default_power(distance)
    else:
        key, value = keys[name], table.number(name, at_least=0.0)
    try:
        return light.with_power(key, value)
    except UserError as error:
        table.fail(name or "spectrum", f"cannot be applied: {error}")
