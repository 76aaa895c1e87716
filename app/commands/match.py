"""The match command: which glass casts the light that is wanted."""

from __future__ import annotations

import sys
import time

from ..base.errors import UserError
from ..base.interrupts import interrupt_flag
from .opened import note_assumptions, open_scene, settings_for
from .printing import show
from .solving_table import Match


def match(options: Match) -> int:
    """Rank and list glasses; returns the exit code. Raises `UserError`."""
    from ..base.progress import ProgressReporter
    from ..edit.parameters import Stage
    from ..gpu.context import create_context
    from ..gpu.shader import keep_programs
    from ..render import light_target, solving
    from ..render.bake import check_receiver

    scene = open_scene(options)
    check_receiver(scene, options.receiver)
    index = light_target.glass_called(scene, options.through)
    ends = [options.begin, options.end, options.last]
    between = [place for place in ends if place is not None]
    if between and (options.begin is None or options.end is None):
        raise UserError("--begin and --end go together: give both, where the target's first row begins and ends")
    values = None if options.target is None else light_target.read_target(options.target)
    note_assumptions(scene)
    settings = settings_for(options, scene)
    started = time.perf_counter()

    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        keep_programs(context.ctx)
        stage, count = Stage(scene, scene.camera), options.count or 10
        work = solving.solution(
            context, stage, settings, options.receiver, values, between or None, lambda its: its.match(index, count)
        )
        while True:
            try:
                progress(next(work), "comparing glasses")
            except StopIteration as finished:
                found = finished.value
                break
            if interrupted():
                print("spectrasplat: stopped before there was an answer", file=sys.stderr)
                return interrupted.exit_code
    show(f"{'glass':<28} {'n_d':>9} {'V_d':>7}  differs by")
    for each in found.glasses:
        show(f"{each.name:<28} {each.n_d:9.5f} {each.V_d:7.2f}  {100.0 * each.error:.3g} %")
    (n_d, v_d), (n_d_sd, v_d_sd) = found.fit.values.values(), found.fit.deviations.values()
    show(f"without a name: n_d {n_d:.6f} ± {n_d_sd:.1g}, V_d {v_d:.3f} ± {v_d_sd:.1g}")
    show(f"in {time.perf_counter() - started:.1f} s")
    return 0
