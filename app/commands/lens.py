"""The commands about lenses: their figures as tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .printing import note, show, table
from .scenes import find_scene

if TYPE_CHECKING:
    from ..model.optics.lens_design import Lens
    from .table import LensTable


def lens_table(options: LensTable) -> int:
    """Show a lens's figures. Raises `UserError`."""
    from ..model.optics import lens_design

    lens = lens_at(find_scene(options.file), options.object)
    found = lens_design.lens_table(lens, options.wavelengths, None if options.beam is None else 0.5 * options.beam)
    for sentence in lens.notes:
        note(sentence)
    show(table(lens.name, [f">{heading}" for heading in lens_design.HEADINGS], (row.texts() for row in found.rows)))
    show(found.summary() + ".")
    return 0


def lens_at(path: Path, name: str | None = None) -> Lens:
    """The lens in a prescription, or that of the object `name` in a scene. Raises `UserError`."""
    from ..model.io.prescription_file import SUFFIXES, read_prescription
    from ..model.io.scene_file import load_scene
    from ..model.lens_scene import lens_in

    if path.suffix.lower() in SUFFIXES and name is None:
        return read_prescription(path)
    return lens_in(load_scene(path), name)
