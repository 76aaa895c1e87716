"""Figures of cut stones, of lenses and of caustic plates."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..base.errors import UserError
from ..commands.gem import stone_at
from ..commands.lens import check, lens_at
from ..commands.scenes import find_scene
from ..model.gems.figures import ASET_HEAD_DEG, Cancelled, GemFigures, Report
from ..model.gems.in_scene import stone_in
from ..model.gems.report import GemReport, TableFire, gem_report
from ..model.lens_scene import lens_in
from ..model.optics import lens_design
from ..model.optics.index_file import find_glass
from ..model.optics.lens_design import LensTable
from ..model.plate_check import PlateReport
from .device import Cancel, Progress, run
from .scene import Scene

__all__ = ["GemFigures", "GemReport", "gem", "lens_check", "lens_table"]


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


def lens_table(
    source: Scene | str | os.PathLike[str],
    object: str | None = None,
    *,
    beam: float | None = None,
    wavelengths_nm: Sequence[float] | None = None,
) -> LensTable:
    """Focal lengths, chromatic shift and spots of the lens in a prescription (.csv, .zmx), or of the objects of shape
    lens in a scene: those on the axis of `object`, by default of the first.

    `beam`: diameter of the parallel light that enters, by default the file's, or all that passes. Raises `UserError`.
    """
    lens = (
        lens_in(source._model, object) if isinstance(source, Scene) else lens_at(find_scene(os.fspath(source)), object)
    )
    return lens_design.lens_table(lens, wavelengths_nm, None if beam is None else 0.5 * beam)


def lens_check(
    plate: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    glass: str = "PMMA",
    distance: float | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> PlateReport:
    """Whether the caustic plate in a mesh file draws the picture `target` on a screen at `distance` (None: where it is
    most like), in parallel light: focus, error, efficiency, colour blur, tolerances, all in the mesh's unit.

    Raises `UserError` where the mesh is no plate or the picture blank.
    """
    return check(Path(plate), Path(target), glass, distance, [], progress, cancel)
