"""The [environment] table of a scene file: what is beyond everything, read and written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..base import files
from ..base.errors import UserError
from ..base.paths import assets_dir
from .environment import DEFAULT_SKY_TYPE, Z_UP, constant, from_map, gradient, sky, up_and_rotation
from .fields import Colour, Direction, Field, Integer, Number, Part, read_fields
from .io.scene_pictures import picture_file
from .io.scene_table import SceneTable
from .scene_render import read_background
from .texture import Environment
from .vectors import Vec3

ENVIRONMENT = "environment"
STUDIO_MAP = assets_dir() / "environments" / "studio.hdr"
"""The shipped panorama, which has a word of its own so that saved scenes name no file of this installation."""
_BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _Radiance(Field):
    """Linear Rec.709 in lm/(sr unit²), 0 or more: three numbers, one for a grey, or an sRGB "#rrggbb"."""

    def value(self, table: SceneTable, key: str) -> Any:
        """The three channels."""
        value = table.raw(key, self.default)
        if isinstance(value, str):
            return table.colour(key)
        if not isinstance(value, list):
            return self.default if value is self.default else (table.number(key, at_least=0.0),) * 3
        r, g, b = table.vector(key)
        if min(r, g, b) < 0.0:
            table.fail(key, "must be three radiances of 0 or more")
        return r, g, b


class _Constant(Part):
    """`colour` (0 to 1) or `radiance`, times `intensity`."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The radiance."""
        key = table.one_of(("colour", "radiance"), "the radiance")
        if key is None:
            table.raw("colour")  # blames a misspelt key, or says that this one is missing
        r, g, b = table.colour("colour") if key == "colour" else _Radiance("radiance").value(table, "radiance")
        intensity = _INTENSITY.value(table, "intensity")
        return {"radiance": (intensity * r, intensity * g, intensity * b)}


class _MapFile(Part):
    """The panorama's file."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """Its path, and where notes on it go."""
        return {"path": table.existing_file("file", or_part=True), "notes": table.notes}


_INTENSITY = Number("intensity", 1.0, at_least=0.0)
_ROTATION, _UP = Number("rotation_deg", 0.0), Direction("up", Z_UP)
_KINDS: dict[str, tuple[Callable[..., Environment], tuple[Part, ...]]] = {
    "map": (from_map, (_MapFile(), _INTENSITY, _ROTATION, _UP)),
    "studio": (partial(from_map, STUDIO_MAP), (_INTENSITY, _ROTATION, _UP)),
    "gradient": (gradient, (_Radiance("zenith"), _Radiance("horizon"), _Radiance("nadir", None), _UP, _INTENSITY)),
    "sky": (
        sky,
        (
            Number("sun_elevation_deg", 45.0, at_least=0.0, at_most=90.0),
            Number("sun_azimuth_deg", 0.0),
            Number("luminance", 1.0, at_least=0.0),
            Integer("sky_type", DEFAULT_SKY_TYPE, "type", at_least=1, at_most=15),
            Colour("ground", (0.2, 0.2, 0.2)),
            _UP,
        ),
    ),
    "constant": (constant, (_Constant(),)),
}
"""What makes each kind, and its keys."""


def read_environment(table: SceneTable) -> tuple[Vec3, Environment | None]:
    """Background (linear Rec.709 radiance) and environment of a scene's table; black and None where neither is given.

    What was assumed goes to the table's notes. Raises UserError for both at once and for what is not understood.
    """
    if table.one_of(("background", ENVIRONMENT), "what lies behind everything") != ENVIRONMENT:
        return read_background(table), None
    inner = table.given_table(ENVIRONMENT, '{ file = "room.exr" }')
    kind = inner.choice("kind", tuple(_KINDS))
    make, parts = _KINDS[kind]
    values = {"lights": inner.boolean("lights", True)} | read_fields(parts, inner)
    try:
        environment = make(**values)
    except UserError as error:
        inner.fail("file" if kind == "map" else "kind", f"cannot be used: {error}")
    inner.finish(f"an environment of kind '{kind}'")
    return values.get("radiance", _BLACK), environment


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
