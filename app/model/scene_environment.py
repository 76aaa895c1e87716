"""The [environment] table of a scene file: what is beyond everything, read and written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..base import files
from ..base.errors import UserError
from ..base.paths import assets_dir
from .environment import (
    DEFAULT_SKY_TYPE,
    Z_UP,
    constant,
    from_map,
    gradient,
    sky,
    up_and_rotation,
)
from .io.scene_pictures import picture_file
from .io.scene_table import SceneTable
from .scene_render import read_background
from .texture import Environment
from .vectors import Vec3

ENVIRONMENT = "environment"
KINDS = ("map", "studio", "gradient", "sky", "constant")
STUDIO_MAP = assets_dir() / "environments" / "studio.hdr"
"""The shipped panorama, which has a word of its own so that saved scenes name no file of this installation."""
_BLACK = (0.0, 0.0, 0.0)


def read_environment(table: SceneTable) -> tuple[Vec3, Environment | None]:
    """Background (linear Rec.709 radiance) and environment of a scene's table; black and None where neither is given.

    What was assumed goes to the table's notes. Raises UserError for both at once and for what is not understood.
    """
    if table.one_of(("background", ENVIRONMENT), "what lies behind everything") != ENVIRONMENT:
        return read_background(table), None
    inner = table.table(ENVIRONMENT)
    assert inner is not None
    kind = inner.choice("kind", KINDS)
    lights = inner.boolean("lights", True)
    background, environment = _BLACK, None
    if kind == "constant":
        background = _read_constant(inner)
        environment = constant(background, lights)
    elif kind == "map":
        environment = _read_map(inner, lights)
    elif kind == "studio":
        rotation_deg = inner.number("rotation_deg", 0.0)
        environment = from_map(STUDIO_MAP, _intensity(inner), rotation_deg, _up(inner), lights=lights)
    elif kind == "gradient":
        environment = _read_gradient(inner, lights)
    else:
        environment = _read_sky(inner, lights)
    inner.finish(f"an environment of kind '{kind}'")
    return background, environment


def _read_constant(table: SceneTable) -> Vec3:
    """`colour` (0 to 1) or `radiance`, times `intensity`."""
    key = table.one_of(("colour", "radiance"), "the radiance")
    if key is None:
        table.raw("colour")  # blames a misspelt key, or says that this one is missing
    r, g, b = table.colour("colour") if key == "colour" else _radiance(table, "radiance")
    intensity = _intensity(table)
    return intensity * r, intensity * g, intensity * b


def _read_map(table: SceneTable, lights: bool) -> Environment:
    path = table.existing_file("file", or_part=True)
    rotation_deg = table.number("rotation_deg", 0.0)
    try:
        return from_map(path, _intensity(table), rotation_deg, _up(table), table.notes, lights)
    except UserError as error:
        table.fail("file", f"cannot be used: {error}")


def _read_gradient(table: SceneTable, lights: bool) -> Environment:
    zenith, horizon = _radiance(table, "zenith"), _radiance(table, "horizon")
    nadir = _radiance(table, "nadir") if table.has("nadir") else horizon
    return gradient(zenith, horizon, nadir, _up(table), _intensity(table), lights)


def _read_sky(table: SceneTable, lights: bool) -> Environment:
    return sky(
        sun_elevation_deg=table.number("sun_elevation_deg", 45.0, at_least=0.0, at_most=90.0),
        sun_azimuth_deg=table.number("sun_azimuth_deg", 0.0),
        luminance=table.number("luminance", 1.0, at_least=0.0),
        sky_type=table.integer("type", DEFAULT_SKY_TYPE, at_least=1, at_most=15),
        ground=table.colour("ground", (0.2, 0.2, 0.2)),
        up=_up(table),
        lights=lights,
    )


def _intensity(table: SceneTable) -> float:
    return table.number("intensity", 1.0, at_least=0.0)


def _up(table: SceneTable) -> Vec3:
    return table.unit_vector("up", Z_UP)


def _radiance(table: SceneTable, key: str) -> Vec3:
    """Linear Rec.709 in lm/(sr unit²), 0 or more: three numbers, one for a grey, or an sRGB "#rrggbb"."""
    value = table.raw(key)
    if isinstance(value, str):
        return table.colour(key)
    if not isinstance(value, list):
        return (table.number(key, at_least=0.0),) * 3
    r, g, b = table.vector(key)
    if min(r, g, b) < 0.0:
        table.fail(key, "must be three radiances of 0 or more")
    return r, g, b


def environment_values(environment: Environment, scene_path: Path) -> dict[str, Any]:
    """The [environment] table that gives `environment` when read from `scene_path`.

    A picture without a file, or without a description, is written beside the scene (`scene_pictures`).
    """
    parameters = dict(environment.parameters)
    if environment.kind == "map" and parameters and environment.source == str(STUDIO_MAP.resolve()):
        return {"kind": "studio"} | parameters
    if (
        environment.kind == "map"
        and parameters
        and environment.source
        and files.with_part(environment.source)[0].is_file()
    ):
        return {"kind": "map", "file": picture_file(environment.rgb, environment.source, scene_path)} | parameters
    if environment.kind != "map" and parameters:
        return {"kind": environment.kind} | parameters
    # The values stand as they are: an intensity was multiplied in already.
    up, rotation_deg = up_and_rotation(environment)
    name = picture_file(np.asarray(environment.rgb), None, scene_path)
    lights = {} if environment.lights else {"lights": False}
    return {"kind": "map", "file": name, "rotation_deg": rotation_deg, "up": list(up)} | lights
