"""The export command: a receiver's caustic for the programs in which scenes are modelled and played."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass

from ..base.errors import UserError, plain
from ..base.interrupts import interrupt_flag
from .bake import BakeRequest, map_asked_for


@dataclass(frozen=True)
class ExportRequest(BakeRequest):
    """The export command's options as typed; None where the user said nothing."""

    plane: bool = False
    source: str | None = None


def export_command(request: ExportRequest) -> int:
    """Bake and write; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage
    from ..render import bake
    from ..render.export_caustic import check_export, write_export
    from ..render.notices import FrameNotices

    source = None if request.source is None else parse_place(request.source)
    outputs = check_export(request.output, request.plane, source)
    scene, settings = map_asked_for(request, outputs)

    from ..gpu.context import create_context

    started, notices = time.perf_counter(), FrameNotices()
    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        steps = bake.bake_map(context, Stage(scene, scene.camera), settings, request.receiver)
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
        print(f"note: {plain(notice)}", file=sys.stderr)
    rgb, where = baked.picture.rgb, baked.placement
    write_export(scene, request.receiver, rgb, where, request.output, request.plane, source)
    names = ", ".join(path.name for path in outputs[1:])
    print(
        f"{request.output.resolve()}: the caustic on '{request.receiver}' in {time.perf_counter() - started:.1f} s; "
        f"beside it {names}"
    )
    return 0


def parse_place(text: str) -> tuple[float, float, float]:
    """ "1,2,3" as a place. Raises `UserError`."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"--source '{text}' is no place: give three numbers, for example --source 0,-2,5") from None
    if not all(map(math.isfinite, (x, y, z))):
        raise UserError(f"--source '{text}' is no place: its numbers must be finite")
    return x, y, z
