"""`spectrasplat farm …`: commands with the options of those that they spread over workers, and some of their own."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Annotated, Any

import typer

from . import options
from .animate import AnimateRequest
from .arguments import SchedulerOption, WorkersOption
from .bench import BenchRequest
from .farm import FarmRequest, farm_animate_command, farm_bench_command, farm_render_command
from .render import RenderRequest

_OPENING = ("up", "glass", "environment", "smooth")
"""Options that together say how a scene is opened."""


def farm_options(workers: WorkersOption = None, scheduler: SchedulerOption = None) -> None:
    """What every farm command takes."""


def part_options(
    parts: Annotated[
        str | None,
        typer.Option(metavar="N", help="Into how many parts light is divided; default: four a worker."),
    ] = None,
    keep_parts: Annotated[
        bool, typer.Option("--keep-parts", help="Leave the parts beside the picture, in OUT.parts.")
    ] = False,
) -> None:
    """What `farm render` takes besides."""


def add_farm(
    app: typer.Typer,
    render: Callable[..., None],
    animate: Callable[..., None],
    bench: Callable[..., None],
    show: Callable[[object], None],
) -> None:
    """Add `farm` and its commands to the program; the functions are the commands that they spread."""
    farm = typer.Typer(help="Render on many workers, here or on a Dask cluster; needs the extra 'farm'.")
    app.add_typer(farm, name="farm")
    _add(farm, "render", render, RenderRequest, farm_render_command, ("passes", "seconds"), part_options)
    _add(farm, "animate", animate, AnimateRequest, farm_animate_command, ("skip_existing",))
    run_bench = partial(farm_bench_command, show=show)
    _add(farm, "bench", bench, BenchRequest, run_bench, ("features",))


def _add(
    farm: typer.Typer,
    name: str,
    command: Callable[..., None],
    request: type,
    run: Callable[[Any, FarmRequest], int],
    left_out: tuple[str, ...],
    *more: Callable[..., None],
) -> None:
    """One command: `command`'s options without those `left_out`, and those of a farm."""
    own = [p for each in (farm_options, *more) for p in inspect.signature(each, eval_str=True).parameters.values()]
    shared = inspect.signature(command, eval_str=True).parameters.values()
    taken = [*own, *(p for p in shared if p.name not in left_out)]
    wanted = {item.name for item in fields(request)}

    def on_farm(**given: Any) -> None:
        asked = {key: tuple(value) if isinstance(value, list) else value for key, value in given.items()}
        if "opening" in wanted:
            asked["opening"] = options.parse_opening(*(given.get(key) for key in _OPENING))
        of_farm = FarmRequest(**{p.name: given[p.name] for p in own})
        values = {key: value for key, value in asked.items() if key in wanted and value is not None}
        raise typer.Exit(run(request(**values), of_farm))

    on_farm.__doc__ = f"{(command.__doc__ or '').strip().removesuffix('.')}, on a farm."
    # Typer asks the signature which options there are.
    needed = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in taken]
    on_farm.__signature__ = inspect.Signature(needed)  # type: ignore[attr-defined]
    on_farm.__annotations__ = {p.name: p.annotation for p in needed}
    farm.command(name)(on_farm)
