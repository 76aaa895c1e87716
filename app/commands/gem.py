"""The gem command: what a cut stone looks like from above, as a table, a report, a picture or numbers."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UserError
from .printing import note, show, table
from .scenes import find_scene

if TYPE_CHECKING:
    from ..model.gems.figures import Cancelled, Report, Stone
    from ..model.gems.report import GemReport, TableFire
    from .solving_table import Gem

SUFFIXES = (".html", ".png", ".json")


def gem(options: Gem) -> int:
    """Find a stone's figures, show them and write what was asked for; returns the exit code. Raises `UserError`."""
    from ..base.atomic import check_writable
    from ..base.interrupts import interrupt_flag
    from ..base.progress import ProgressReporter
    from ..model.gems.report import PICTURES, gem_report

    output = options.output
    if output is not None:
        if output.suffix.lower() not in SUFFIXES:
            raise UserError(f"cannot write {output}: give a name that ends with one of {', '.join(SUFFIXES)}")
        check_writable(output)
    if options.picture not in PICTURES:
        raise UserError(f"--picture '{options.picture}' is unknown; known are {', '.join(PICTURES)}")
    stone = stone_at(find_scene(options.stone), options.object, options.glass, options.up)
    for sentence in stone.notes:
        note(f"{sentence}.")

    def thrown(report: Report, cancelled: Cancelled) -> TableFire | None:
        from ..gpu.context import create_context
        from ..render.gem_fire import table_fire

        try:
            with create_context() as context:
                return table_fire(context, stone, report, cancelled)
        except UserError as error:
            note(f"no fire on the table: {error}.")
            return None

    wants_table = output is not None and output.suffix.lower() != ".png"
    with interrupt_flag() as interrupted, ProgressReporter(stone.name) as progress:
        found = gem_report(stone, options.head, progress, interrupted, thrown if wants_table else None)
    if found is None:
        note("stopped before there was a figure; nothing was written.")
        return interrupted.exit_code
    if interrupted():
        note("stopped: what is missing is left out.")
    title = f"{stone.name}, {stone.glass.name or f'n = {stone.glass.n_d:g}'}"
    show(table(title, ("figure", ">value", "what it is"), found.rows()))
    if output is not None:
        write(found, output, options.picture)
        show(f"{output.resolve()}")
    return interrupted.exit_code


def stone_at(path: Path, name: str | None, glass: str | None, up: str) -> Stone:
    """The stone in a file: of a scene its object `name`, or its first solid of glass. Raises `UserError`."""
    from ..model.gems.in_scene import stone_in
    from ..model.io.scene_file import load_scene
    from ..model.optics.index_file import find_glass
    from ..model.staging import AS_FOUND, Staging

    notes: list[str] = []
    made_of = None if glass is None else find_glass(glass, path.parent, "glass", notes)
    if path.suffix.lower() == ".asc":
        scene = load_scene(path, AS_FOUND if glass is None else Staging(glass=((None, glass),)))
        # Of the stone, not of the lamp and the table that a scene got.
        notes += (sentence for sentence in scene.notes if sentence.startswith(path.name))
    else:
        scene = load_scene(path)
    stone = stone_in(scene, name, made_of, up)
    return replace(stone, notes=(*stone.notes, *(sentence.rstrip(".") for sentence in notes)))


def write(found: GemReport, path: Path, picture: str = "aset") -> None:
    """Write a report (.html), numbers (.json) or one of the pictures (.png). Raises `UserError`."""
    from ..base.atomic import atomic_output
    from ..base.image_io import png_bytes
    from ..model.io.scene_pictures import nearest_levels
    from .gem_page import page

    suffix = path.suffix.lower()
    if suffix == ".json":
        data = (json.dumps(found.values(), indent=1, ensure_ascii=False) + "\n").encode()
    elif suffix == ".html":
        data = page(found).encode()
    elif found.pictures:
        data = png_bytes(nearest_levels(found.pictures[picture]))
    else:
        raise UserError("it was stopped before there was a picture; nothing was written")
    with atomic_output(path) as temporary:
        temporary.write_bytes(data)
