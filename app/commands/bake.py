"""The commands that bake a receiver's caustic map: `bake`, to a texture with its placement, and `export`, for the
programs in which scenes are modelled and played."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UserError
from .opened import note_assumptions, open_scene, settings_for, worked_out
from .printing import note
from .scenes import find_scene
from .table import Bake, Export

if TYPE_CHECKING:
    from ..model.scene import Scene
    from ..render.bake import Drawn


def bake_texture(options: Bake) -> int:
    """Bake to a file; returns the exit code. Raises `UserError`."""
    from ..base.image_io import check_suffix
    from ..render.bake import write_map, written_with

    check_suffix(options.output)
    outputs = written_with(options.output)
    return _baked(
        options,
        outputs,
        lambda scene, baked: write_map(baked, scene, options.receiver, options.output),
        f"caustic map of '{options.receiver}'",
        f"its placement is in {outputs[1].name}",
    )


def export(options: Export) -> int:
    """Bake and write; returns the exit code. Raises `UserError`."""
    from ..model.gems.facet_design import SUFFIX as DESIGN_SUFFIX
    from ..render.export_caustic import PAGE_SUFFIXES, check_export, write_export

    if options.output.suffix.lower() == DESIGN_SUFFIX:
        return _design(options)
    if options.output.suffix.lower() in PAGE_SUFFIXES:
        check_export(options.output, options.plane, options.source)
        return _page(options)
    outputs = check_export(options.output, options.plane, options.source)

    def write(scene: Scene, baked: Drawn) -> None:
        rgb, where = baked.pictures[0].rgb, baked.placement
        write_export(scene, options.receiver, rgb, where, options.output, options.plane, options.source)

    others = ", ".join(path.name for path in outputs[1:])
    return _baked(options, outputs, write, f"the caustic on '{options.receiver}'", f"next to it {others}")


def _design(options: Export) -> int:
    """Write a stone's faceting design; returns the exit code. Raises `UserError`."""
    from ..model.gems.facet_design import write_asc
    from ..model.gems.from_mesh import design_in

    given = {"--plane": options.plane, "--source": options.source, "--size": options.size, "--photons": options.photons}
    for option, value in given.items():
        if value:
            raise UserError(f"{option} does not go with {options.output.name}: a design is a stone's facets, not light")
    design, words = design_in(open_scene(options), options.receiver)
    write_asc(design, options.output)
    print(f"{options.output.resolve()}: {words}")
    return 0


def _page(options: Export) -> int:
    """Make a page; returns the exit code. Raises `UserError` as `_baked`."""
    from ..edit.parameters import Stage
    from ..render.page.page import check_page, check_page_path, page_size, page_steps, words_of

    check_page_path(options.output)
    scene = open_scene(options)
    check_page(scene, options.receiver)
    note_assumptions(scene)
    width, height = page_size(scene)
    settings = settings_for(options, scene, width=width, height=height, exposure_ev=scene.render.exposure_ev)
    started = time.perf_counter()
    stage, words = Stage(scene, scene.camera), words_of(scene, find_scene(options.scene))
    page = worked_out(
        scene, "making the page", lambda context: page_steps(context, stage, settings, options.receiver, words)
    )
    page.to_html(options.output)
    megabytes = options.output.stat().st_size / 1e6
    took = time.perf_counter() - started
    print(f"{options.output.resolve()}: a page of {megabytes:.1f} MB in {took:.1f} s; any browser opens it")
    return 0


def _baked(
    options: Bake | Export, outputs: Sequence[Path], write: Callable[[Scene, Drawn], None], what: str, where: str
) -> int:
    """Bake, write and say so; returns the exit code. Raises `UserError` for all that can be refused beforehand:
    numbers, memory, files that cannot be written, the scene, its receiver."""
    from ..base.atomic import check_writable
    from ..edit.parameters import Stage
    from ..render import bake

    for path in outputs:
        check_writable(path)
    scene = open_scene(options)
    bake.check_receiver(scene, options.receiver)
    note_assumptions(scene)
    width, height = bake.DEFAULT_SIZE
    settings = settings_for(options, scene, width=width, height=height)
    started = time.perf_counter()
    stage = Stage(scene, scene.camera)
    baked = worked_out(scene, "baking", lambda context: bake.bake_map(context, stage, settings, options.receiver))
    for notice in baked.notices:
        note(notice)
    write(scene, baked)
    print(f"{options.output.resolve()}: {what} in {time.perf_counter() - started:.1f} s; {where}")
    return 0
