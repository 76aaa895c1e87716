"""The command `bench-view`, which measures the viewer."""

from __future__ import annotations

from .measuring_table import BenchView
from .scenes import find_scene

DEFAULT_SIZE = {True: (960, 540), False: (1920, 1080)}
"""Pixels of the viewport, by whether the processor draws: the sizes that the viewer promises its frame times for."""


def bench_view(options: BenchView) -> int:
    """Measure the viewer and print; returns the exit code. Raises `UserError`."""
    scene = find_scene(options.scene)

    from ..bench import viewer_speed
    from ..bench.machine import words
    from ..gpu.context import create_context

    with create_context() as context:
        size = options.size or DEFAULT_SIZE[context.is_software]
        print(f"{scene.stem}, viewport {size[0]}×{size[1]}, {context.renderer}, {context.version}")
        for name, figures in viewer_speed.run(context, scene, size, options.seconds):
            print(f"{name:<22}{words(figures)}", flush=True)
    return 0
