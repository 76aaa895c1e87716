"""What a scene file says about the picture: its size and effort, and what lies behind everything."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .fields import Flag, Integer, Number, Part, check_numbers, read_fields, write_fields
from .io.scene_table import SceneTable
from .scene import RenderDefaults, Vec3

MAX_PICTURE_SIDE = 16384
MAX_DEPTH = 4096
MAX_GLARE = 0.5
"""A lens that scatters more is no lens."""
MAX_BOUNCES = 3
"""From one diffuse surface to another."""
MAX_HAZE = 1e9
"""1/scene unit."""
MAX_ANISOTROPY = 0.99
"""Either way; at 1 light would only go straight on."""


def read_background(table: SceneTable) -> Vec3:
    """Linear Rec.709 radiance, black without one."""
    background = table.vector("background", (0.0, 0.0, 0.0))
    if min(background) < 0.0:
        table.fail("background", "must be three radiances of 0 or more")
    return background


class _Size(Part):
    """`size`, whole pixels."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """Width and height."""
        width, height = table.numbers("size", (_USUAL.width, _USUAL.height), count=2)
        for side in (width, height):
            if side != int(side) or not 1 <= side <= MAX_PICTURE_SIDE:
                limit = f"each side must be 1 to {MAX_PICTURE_SIDE} whole pixels"
                table.fail("size", f"is {width:g} × {height:g} but {limit}")
        return {"width": int(width), "height": int(height)}

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """Both."""
        return {"size": [value.width, value.height]}


_USUAL = RenderDefaults()
EXPOSURE_EV = Number("exposure_ev", _USUAL.exposure_ev, at_least=-64.0, at_most=64.0)
GLARE = Number("glare", _USUAL.glare, at_least=0.0, at_most=MAX_GLARE)
HAZE = Number("haze", _USUAL.haze, optional=True, at_least=0.0, at_most=MAX_HAZE)
HAZE_ANISOTROPY = Number(
    "haze_anisotropy", _USUAL.haze_anisotropy, optional=True, at_least=-MAX_ANISOTROPY, at_most=MAX_ANISOTROPY
)
_FIELDS = (
    _Size(),
    Integer("photons", _USUAL.photons, at_least=1, at_most=10**12),
    EXPOSURE_EV,
    Integer("max_depth", _USUAL.max_depth, at_least=1, at_most=MAX_DEPTH),
    GLARE,
    Flag("antialias_highlights", _USUAL.antialias_highlights, optional=True),
    Flag("polarisation", _USUAL.polarisation, optional=True),
    Integer("bounces", _USUAL.bounces, optional=True, at_least=0, at_most=MAX_BOUNCES),
    HAZE,
    HAZE_ANISOTROPY,
)


def check_render(render: RenderDefaults) -> None:
    """Raise UserError for a number that no scene file could hold."""
    sides = (Integer(side, at_least=1, at_most=MAX_PICTURE_SIDE) for side in ("width", "height"))
    check_numbers((*sides, *_FIELDS), render, "")


def read_render(table: SceneTable | None) -> RenderDefaults:
    """The [render] table; the defaults without one."""
    if table is None:
        return RenderDefaults()
    render = RenderDefaults(**read_fields(_FIELDS, table))
    table.finish("[render]")
    return render


def render_values(render: RenderDefaults) -> dict[str, Any]:
    """The [render] table of a scene file."""
    return write_fields(_FIELDS, render)
