"""The gem command: what a cut stone looks like from above, as a table, a report, a picture or numbers."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UserError
from .printing import note, show, table
from .scenes import find_scene

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..model.gems.figures import Cancelled, Report, Stone
    from ..model.gems.report import GemReport, TableFire
    from ..model.optics.glass import Dispersion
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
    wants_table = output is not None and output.suffix.lower() != ".png"
    share = 0.6 if wants_table else 1.0
    with interrupt_flag() as interrupted, ProgressReporter(stone.name) as progress:
        found = gem_report(stone, options.head, lambda done, text: progress(share * done, text), interrupted)
        if found is not None and wants_table and not interrupted():
            from ..gpu.context import create_context

            try:
                with create_context() as context:
                    thrown = on_table(context, stone, lambda done, text: progress(0.6 + 0.4 * done, text), interrupted)
                found = replace(found, table=thrown)
            except UserError as error:
                note(f"no fire on the table: {error}.")
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
    from ..model.staging import AS_FOUND, Staging

    notes: list[str] = []
    made_of = None if glass is None else glass_called(glass, path.parent, notes)
    is_design = path.suffix.lower() == ".asc"
    scene = load_scene(path, Staging(glass=((None, "N-BK7"),)) if is_design and made_of is not None else AS_FOUND)
    if is_design:  # of the stone, not of the lamp and the table that a scene got
        notes += (sentence for sentence in scene.notes if sentence.startswith(path.name))
    stone = stone_in(scene, name, made_of, up)
    return replace(stone, notes=(*stone.notes, *(sentence.rstrip(".") for sentence in notes)))


def glass_called(text: str, folder: Path, notes: list[str]) -> Dispersion:
    """A glass by its name, or of an index without dispersion."""
    from ..model.optics import glass
    from ..model.optics.index_file import find_glass

    try:
        index = float(text)
    except ValueError:
        return find_glass(text, folder, "glass", notes)
    notes.append(f"An index of {text} alone has no dispersion, so there is no fire")
    return glass.constant(index, where="glass")


def on_table(context: Context, stone: Stone, report: Report, cancelled: Cancelled) -> TableFire:
    """The fire that it throws on a table. Raises `UserError`."""
    from ..base.generators import finished
    from ..render.gem_fire import table_fire

    return finished(table_fire(context, stone, cancelled), lambda share: report(share, "light on the table"))


def write(found: GemReport, path: Path, picture: str = "aset") -> None:
    """Write a report (.html), numbers (.json) or one of the pictures (.png). Raises `UserError`."""
    from ..base.atomic import atomic_output

    suffix = path.suffix.lower()
    if suffix == ".png":
        if not found.pictures:
            raise UserError("it was stopped before there was a picture; nothing was written")
        _save_png(found, path, picture)
        return
    from .gem_page import page

    as_text: Callable[[], str] = (
        (lambda: json.dumps(found.values(), indent=1, ensure_ascii=False)) if suffix == ".json" else lambda: page(found)
    )
    with atomic_output(path) as temporary:
        temporary.write_text(as_text() + "\n", encoding="utf-8")


def _save_png(found: GemReport, path: Path, picture: str) -> None:
    from ..base.atomic import atomic_output
    from .gem_page import png

    with atomic_output(path) as temporary:
        temporary.write_bytes(png(found.pictures[picture]))
