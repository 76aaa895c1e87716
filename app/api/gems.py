"""Cut stones and their figures."""

from __future__ import annotations

import os
from pathlib import Path

from ..base.errors import UserError
from ..commands.gem import stone_at
from ..commands.scenes import find_scene
from ..model.gems.figures import ASET_HEAD_DEG, Cancelled, GemFigures, Report
from ..model.gems.in_scene import stone_in
from ..model.gems.report import GemReport, TableFire, gem_report
from ..model.optics.index_file import find_glass
from .device import Cancel, Progress, run
from .scene import Scene

__all__ = ["GemFigures", "GemReport", "gem"]


def gem(
    source: Scene | str | os.PathLike[str],
    object: str | None = None,
    *,
    glass: str | float | None = None,
    up: str = "z",
    head_deg: float = ASET_HEAD_DEG,
    table: bool = False,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> GemReport:
    """What a cut stone looks like from above: light return, fire, scintillation, tilt curves, ASET and ideal-scope.

    The stone is `object` of a scene, or its first solid of glass; `source` is the scene or a file. `glass`: another
    than its own, or an index without dispersion. `up`: where its table faces, an axis of its own coordinates.
    `head_deg`: half the angle at which the viewer's head hides light. `table`: the light that it throws on a table as
    well, which needs OpenGL. `cancel`: what is missing then is NaN or left out. Raises `UserError`, also where it was
    cancelled before there was a figure.
    """
    if not 0.0 <= head_deg <= 60.0:
        raise UserError(f"head_deg is {head_deg:g}; give an angle from 0 to 60 degrees")
    if isinstance(source, Scene):
        made_of = None if glass is None else find_glass(str(glass), Path(), "glass", [])
        stone = stone_in(source._model, object, made_of, up)
    else:
        stone = stone_at(find_scene(os.fspath(source)), object, None if glass is None else str(glass), up)

    def thrown(report: Report, cancelled: Cancelled) -> TableFire:
        from ..render.gem_fire import table_fire

        return run(lambda context, told, stop: table_fire(context, stone, told, stop), report, cancel)

    found = gem_report(stone, head_deg, progress, cancel, thrown if table else None)
    if found is None:
        raise UserError("it was cancelled before there was a figure")
    return found
