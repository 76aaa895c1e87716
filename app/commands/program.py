"""The command line: what the commands are called and which function each of them runs.

Their options are in `table` and `measuring_table`. A command's module is imported when it runs, so that `--help` and
small commands start at once.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ..base.errors import UserError
from ..base.files import allow_outside
from ..base.version import __version__
from . import measuring_table, options, table

COMMANDS = {
    "render": (table.Render, "render:render_picture"),
    "merge": (table.Merge, "merge:merge"),
    "animate": (table.Animate, "animate:animate"),
    "sweep": (table.Sweep, "sweep:sweep"),
    "view": (table.View, "view:view"),
    "lesson": (table.Lesson, "view:lesson"),
    "bake": (table.Bake, "bake:bake_texture"),
    "export": (table.Export, "bake:export"),
    "inspect": (table.Inspect, "inspect_report:inspect"),
    "glass": (table.Glass, "glass:glass"),
    "doctor": (table.Doctor, "doctor:doctor"),
    "bench": (measuring_table.Bench, "bench:bench"),
    "stress": (measuring_table.Stress, "stress:stress"),
    "bench-speed": (measuring_table.BenchSpeed, "bench_parts:bench_speed"),
    "bench-beams": (measuring_table.BenchBeams, "bench_parts:bench_beams"),
    "bench-agreement": (measuring_table.BenchAgreement, "bench_agreement:bench_agreement"),
    "bench-view": (measuring_table.BenchView, "bench_parts:bench_view"),
    "fingerprint": (measuring_table.Fingerprint, "fingerprint:fingerprint"),
    "prove-gpu": (measuring_table.ProveGpu, "prove_gpu:prove_gpu"),
    "farm render": (table.FarmRender, "farm:render"),
    "farm animate": (table.FarmAnimate, "farm:animate"),
    "farm bench": (measuring_table.FarmBench, "farm:bench"),
}
"""By name: the class of a command's values, and the function that gets them and returns the exit code, with its
module."""


class _Interrupted(Exception):
    """Ctrl-C, carried past typer, some of whose versions turn it silently into an exit code."""


class _Program(TyperGroup):
    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            raise _Interrupted from interrupt


def run(arguments: Sequence[str]) -> int:
    """Run one command line; returns the exit code. Raises `UserError` for wrong usage."""
    names = [name for name in COMMANDS if [name] == list(arguments[:1])] or COMMANDS
    try:
        code = program(names)(args=list(arguments) or ["--help"], prog_name="spectrasplat", standalone_mode=False)
    except _Interrupted as interrupted:
        raise (interrupted.__cause__ or KeyboardInterrupt()) from None
    except Exception as error:
        # click's usage errors; typer has moved click inside itself, so there is no one class to name.
        if not hasattr(error, "format_message"):
            raise
        raise UserError(_usage_sentence(error.format_message())) from error
    return code if isinstance(code, int) else 0


def _usage_sentence(message: str) -> str:
    sentence = message.strip().rstrip(".").replace(". Did you", ", did you")
    return f"{sentence[:1].lower()}{sentence[1:]}; 'spectrasplat --help' shows the usage"


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"spectrasplat {__version__}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Dispersive caustics: light through glass, split into its colours."""


def _command(values: type, runs: str) -> Callable[..., None]:
    """The function whose signature tells typer which options there are."""
    module, function = runs.split(":")

    def command(**given: Any) -> None:
        typed: Any = options.read(values, given)
        if isinstance(typed, table.ReadsScenes):
            allow_outside(typed.allow_outside)
        raise typer.Exit(getattr(import_module(f"{__package__}.{module}"), function)(typed))

    parameters = [row.parameter() for row in options.rows(values)]
    command.__doc__ = values.__doc__
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


def program(names: Iterable[str] = COMMANDS) -> typer.Typer:
    """The program with these of its commands: typer takes a tenth of a second to learn them all."""
    app = typer.Typer(
        name="spectrasplat",
        cls=_Program,
        pretty_exceptions_enable=False,
        no_args_is_help=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_options)
    farm = typer.Typer(help="Render on many workers, here or on a Dask cluster; needs the extra 'farm'.")
    app.add_typer(farm, name="farm")
    for name in names:
        group = farm if name.startswith("farm ") else app
        group.command(name.removeprefix("farm "))(_command(*COMMANDS[name]))
    return app
