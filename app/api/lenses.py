"""Lenses, caustic plates and their figures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from ..commands.lens import check, lens_at
from ..commands.scenes import find_scene
from ..model.lens_scene import lens_in
from ..model.optics import lens_design
from ..model.optics.lens_design import LensTable
from ..model.plate_check import PlateReport
from .device import Cancel, Progress
from .scene import Scene


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
