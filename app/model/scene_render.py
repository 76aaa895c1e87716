"""What a scene file says about the picture: its size and effort, and what lies behind everything."""

from __future__ import annotations

from .io.scene_table import SceneTable
from .scene import RenderDefaults, Vec3

MAX_PICTURE_SIDE = 16384
MAX_DEPTH = 4096


def read_background(table: SceneTable) -> Vec3:
    """Linear Rec.709 radiance, black without one."""
    background = table.vector("background", (0.0, 0.0, 0.0))
    if min(background) < 0.0:
        table.fail("background", "must be three radiances of 0 or more")
    return background


def read_render(table: SceneTable | None) -> RenderDefaults:
    """The [render] table; the defaults without one."""
    defaults = RenderDefaults()
    if table is None:
        return defaults
    width, height = table.numbers("size", (defaults.width, defaults.height), count=2)
    for side in (width, height):
        if side != int(side) or not 1 <= side <= MAX_PICTURE_SIDE:
            table.fail("size", f"is {width:g} × {height:g} but each side must be 1 to {MAX_PICTURE_SIDE} whole pixels")
    render = RenderDefaults(
        width=int(width),
        height=int(height),
        photons=table.integer("photons", defaults.photons, at_least=1, at_most=10**12),
        exposure_ev=table.number("exposure_ev", defaults.exposure_ev, at_least=-64.0, at_most=64.0),
        max_depth=table.integer("max_depth", defaults.max_depth, at_least=1, at_most=MAX_DEPTH),
    )
    table.finish("[render]")
    return render
