"""The bake command: a receiver's caustic map as a texture with its placement."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import plain
from ..base.interrupts import interrupt_flag
from ..base.memory import check_picture_memory
from ..model.settings import RenderSettings
from . import options

if TYPE_CHECKING:
    from ..edit.opening import Opening
    from ..model.scene import Scene


@dataclass(frozen=True)
class BakeRequest:
    """The bake command's options as typed; None where the user said nothing."""

    scene: str
    receiver: str
    output: Path
    size: str | None = None
    photons: str | None = None
    seed: str | None = None
    opening: Opening | None = None


def map_asked_for(request: BakeRequest, outputs: Iterable[Path]) -> tuple[Scene, RenderSettings]:
    """The scene whose map is asked for, and how it is rendered. Raises `UserError` for all that can be refused
    beforehand: numbers, memory, files that cannot be written, the scene, its receiver."""
    from ..base.atomic import check_writable
    from ..render import bake

    width, height = bake.DEFAULT_SIZE if request.size is None else options.parse_size(request.size)
    photons = None if request.photons is None else options.parse_photons(request.photons)
    seed = 1 if request.seed is None else options.parse_integer("--seed", request.seed, 0, options.MAX_SEED)
    check_picture_memory(width, height, None)
    for path in outputs:
        check_writable(path)
    scene = options.open_scene(request.scene, request.opening)
    bake.check_receiver(scene, request.receiver)
    for note in scene.notes:
        print(f"note: {plain(note)}", file=sys.stderr)
    settings = RenderSettings(width=width, height=height, photons=photons, seed=seed, max_depth=scene.render.max_depth)
    return scene, settings


def bake_command(request: BakeRequest) -> int:
    """Bake to a file; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage
    from ..render import bake
    from ..render.notices import FrameNotices

    bake.check_output(request.output)
    scene, settings = map_asked_for(request, (request.output, bake.placement_path(request.output)))

    from ..gpu.context import create_context

    started, notices = time.perf_counter(), FrameNotices()
    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        stage = Stage(scene, scene.camera)
        for share in bake.bake(context, stage, settings, request.receiver, request.output, notices):
            progress(share, "baking")
            if interrupted() and share < 1.0:
                print("spectrasplat: nothing was written: a map is whole or not at all", file=sys.stderr)
                return interrupted.exit_code
    for notice in notices.lines():
        print(f"note: {plain(notice)}", file=sys.stderr)
    place = request.output.resolve()
    print(
        f"{place}: caustic map of '{request.receiver}' in {time.perf_counter() - started:.1f} s; where it lies is in "
        f"{bake.placement_path(place).name}"
    )
    return 0
