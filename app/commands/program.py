"""The command line: what the commands are called and which options they take.

Options arrive as text and are checked in `options`; the work is in the modules that each
command imports when it runs, so that `--help` and small commands start at once. Commands that
make pictures are in `picture_program`, those about a scene in `scene_program`, those that measure
in `measure_program`, those that spread over machines in `farm_program`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer
from typer.core import TyperGroup

from ..base.errors import UserError
from ..base.version import __version__
from . import measure_program, picture_program, scene_program
from .farm_program import add_farm
from .printing import show
from .prove_gpu import prove_gpu


class _Interrupted(Exception):
    """Ctrl-C, carried past typer, some of whose versions turn it silently into an exit code."""


class _Program(TyperGroup):
    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            raise _Interrupted from interrupt


app = typer.Typer(
    name="spectrasplat",
    cls=_Program,
    pretty_exceptions_enable=False,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def run(arguments: Sequence[str]) -> int:
    """Run one command line; returns the exit code. Raises `UserError` for wrong usage."""
    try:
        code = app(args=list(arguments) or ["--help"], prog_name="spectrasplat", standalone_mode=False)
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


def _print_version(asked: bool) -> None:
    if asked:
        print(f"spectrasplat {__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Dispersive caustics: light through glass, split into its colours."""


for _command in (
    picture_program.render,
    picture_program.merge,
    picture_program.animate,
    picture_program.sweep,
    scene_program.view,
    scene_program.lesson,
    scene_program.bake,
    scene_program.export,
    scene_program.inspect,
    scene_program.glass,
    scene_program.doctor,
    measure_program.bench,
    measure_program.stress,
    measure_program.bench_speed,
    measure_program.bench_beams,
    measure_program.bench_agreement,
    measure_program.bench_view,
    prove_gpu,
):
    app.command(_command.__name__.replace("_", "-"))(_command)
add_farm(app, picture_program.render, picture_program.animate, measure_program.bench, show)
