"""The bench-view command: checks what was typed, makes a context, prints lines as they are measured."""

from __future__ import annotations

from dataclasses import dataclass

from . import options

DEFAULT_SCENE = "default"
DEFAULT_SIZE = {True: (960, 540), False: (1920, 1080)}
"""Pixels of the viewport, by whether the processor draws: the sizes that the viewer promises its frame times for."""
DEFAULT_SECONDS = 6.0


@dataclass(frozen=True)
class BenchViewRequest:
    """The options as typed."""

    scene: str | None = None
    size: str | None = None
    seconds: str | None = None


def bench_view_command(request: BenchViewRequest) -> int:
    """Measure and print; returns the exit code. Raises `UserError`."""
    size = None if request.size is None else options.parse_size(request.size)
    seconds = DEFAULT_SECONDS if request.seconds is None else options.parse_seconds(request.seconds)
    scene = options.find_scene(request.scene or DEFAULT_SCENE)

    from ..bench import viewer_speed
    from ..gpu.context import create_context

    with create_context() as context:
        for line in viewer_speed.run(context, scene, size or DEFAULT_SIZE[context.is_software], seconds):
            print(line, flush=True)
    return 0
