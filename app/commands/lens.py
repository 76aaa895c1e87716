"""The commands about lenses and caustic plates: their figures as tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .opened import check_unread
from .printing import note, show, table
from .scenes import find_scene

if TYPE_CHECKING:
    from ..model.optics.lens_design import Lens
    from ..model.plate_check import Cancelled, PlateReport, Report
    from .solving_table import LensCheck, LensTable


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


def lens_check(options: LensCheck) -> int:
    """Check a caustic plate and show what was found. Raises `UserError`."""
    from ..base.image_io import check_suffix, write_image
    from ..base.interrupts import INTERRUPTED, interrupt_flag
    from ..base.progress import ProgressReporter

    if options.output is not None:
        check_suffix(options.output)
    notes: list[str] = []
    with interrupt_flag() as interrupted, ProgressReporter(options.plate.name) as progress:
        report = check(options.plate, options.target, options.glass, options.distance, notes, progress, interrupted)
    for sentence in dict.fromkeys(notes):
        note(sentence)
    show(table(options.plate.name, ("what", f"lengths in its unit, glass {report.plate.glass.name}"), report.rows()))
    check_unread(options.output)
    if options.output is not None:
        write_image(options.output, report.pictures())
    return INTERRUPTED if interrupted() else 0


def check(
    plate: Path,
    target: Path,
    glass: str,
    distance: float | None,
    notes: list[str],
    progress: Report | None = None,
    cancelled: Cancelled | None = None,
) -> PlateReport:
    """See `model.plate_check.check_plate`, of files; what was assumed goes to `notes`."""
    from ..model.io.picture_files import read_picture
    from ..model.optics.index_file import find_glass
    from ..model.plate_check import check_plate
    from ..model.scene_objects import load_checked_mesh

    rgb, more = read_picture(target)
    made_of = find_glass(glass, plate.parent, "glass", notes)
    mesh = load_checked_mesh(plate, None, notes)
    notes += more
    return check_plate(mesh, made_of, rgb, distance, progress, cancelled)
