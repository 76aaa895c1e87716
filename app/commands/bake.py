"""The commands that bake a receiver's caustic map: `bake`, to a texture with its placement, and `export`, for the
programs in which scenes are modelled and played."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.interrupts import interrupt_flag
from .opened import note_assumptions, open_scene, settings_for
from .printing import note
from .table import Bake, Export

if TYPE_CHECKING:
    from ..model.scene import Scene
    from ..model.settings import RenderSettings


def _checked(options: Bake | Export, outputs: Iterable[Path]) -> tuple[Scene, RenderSettings]:
    """The scene and how its map is rendered. Raises `UserError` for all that can be refused beforehand: numbers,
    memory, files that cannot be written, the scene, its receiver."""
    from ..base.atomic import check_writable
    from ..render import bake

    for path in outputs:
        check_writable(path)
    scene = open_scene(options)
    bake.check_receiver(scene, options.receiver)
    note_assumptions(scene)
    width, height = bake.DEFAULT_SIZE
    return scene, settings_for(options, scene, width=width, height=height)


def bake_texture(options: Bake) -> int:
    """Bake to a file; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage
    from ..render import bake
    from ..render.notices import FrameNotices

    bake.check_output(options.output)
    scene, settings = _checked(options, (options.output, bake.placement_path(options.output)))

    from ..gpu.context import create_context

    started, notices = time.perf_counter(), FrameNotices()
    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        stage = Stage(scene, scene.camera)
        for share in bake.bake(context, stage, settings, options.receiver, options.output, notices):
            progress(share, "baking")
            if interrupted() and share < 1.0:
                print("spectrasplat: nothing was written: a map is whole or not at all", file=sys.stderr)
                return interrupted.exit_code
    for notice in notices.lines():
        note(notice)
    place = options.output.resolve()
    print(
        f"{place}: caustic map of '{options.receiver}' in {time.perf_counter() - started:.1f} s; its placement is in "
        f"{bake.placement_path(place).name}"
    )
    return 0


def export(options: Export) -> int:
    """Bake and write; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage
    from ..render import bake
    from ..render.export_caustic import check_export, write_export
    from ..render.notices import FrameNotices

    outputs = check_export(options.output, options.plane, options.source)
    scene, settings = _checked(options, outputs)

    from ..gpu.context import create_context

    started, notices = time.perf_counter(), FrameNotices()
    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        steps = bake.bake_map(context, Stage(scene, scene.camera), settings, options.receiver)
        while True:
            try:
                progress(next(steps), "baking")
            except StopIteration as finished:
                baked: bake.BakedMap = finished.value
                break
            if interrupted():
                print("spectrasplat: nothing was written: a map is whole or not at all", file=sys.stderr)
                return interrupted.exit_code
    notices.take(baked.notices)
    for notice in notices.lines():
        note(notice)
    rgb, where = baked.picture.rgb, baked.placement
    write_export(scene, options.receiver, rgb, where, options.output, options.plane, options.source)
    names = ", ".join(path.name for path in outputs[1:])
    print(
        f"{options.output.resolve()}: the caustic on '{options.receiver}' in {time.perf_counter() - started:.1f} s; "
        f"next to it {names}"
    )
    return 0
