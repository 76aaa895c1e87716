"""The commands that measure parts of the program: `bench-beams`, `bench-view`."""

from __future__ import annotations

from ..base.atomic import atomic_output, make_output_folder
from .measuring_table import BenchBeams, BenchView
from .scenes import find_scene

DEFAULT_SIZE = {True: (960, 540), False: (1920, 1080)}
"""Pixels of the viewport, by whether the processor draws: the sizes that the viewer promises its frame times for."""


def bench_view(options: BenchView) -> int:
    """Measure the viewer and print; returns the exit code. Raises `UserError`."""
    scene = find_scene(options.scene)

    from ..bench import viewer_speed
    from ..gpu.context import create_context

    with create_context() as context:
        size = options.size or DEFAULT_SIZE[context.is_software]
        for line in viewer_speed.run(context, scene, size, options.seconds):
            print(line, flush=True)
    return 0


def bench_beams(options: BenchBeams) -> int:
    """Measure the searches for beams, print them, write table and plot; returns the exit code. Raises `UserError`."""
    import msgspec

    from ..bench import beam_costs
    from ..gpu.context import create_context

    make_output_folder(options.output, "beam_costs.json")
    costs = []
    print(beam_costs.HEAD, flush=True)
    with create_context() as context:
        for cost in beam_costs.measure(context):
            costs.append(cost)
            print(beam_costs.line(cost), flush=True)
            # Whoever stops it keeps what is measured.
            with atomic_output(options.output / "beam_costs.json") as temporary:
                temporary.write_bytes(msgspec.json.format(msgspec.json.encode(costs)))
    beam_costs.plot(costs, options.output / "beam_costs")
    print(f"wrote {options.output / 'beam_costs.json'} and beam_costs.png, .svg next to it")
    return 0
