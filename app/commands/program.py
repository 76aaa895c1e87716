"""The command line: what the commands are called and which function each of them runs.

Their options are in `table`, `solving_table` and `measuring_table`. A command's module is imported when it runs, so
that `--help` and small commands start at once.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import Any

import click

from ..base.errors import UserError
from ..base.files import allow_outside
from ..base.version import __version__
from . import completion, options

COMMANDS = {
    "render": ("table:Render", "render:render_picture"),
    "merge": ("table:Merge", "merge:merge"),
    "animate": ("table:Animate", "animate:animate"),
    "sweep": ("table:Sweep", "sweep:sweep"),
    "view": ("table:View", "view:view"),
    "lesson": ("table:Lesson", "view:lesson"),
    "bake": ("table:Bake", "bake:bake_texture"),
    "export": ("table:Export", "bake:export"),
    "gradient": ("solving_table:Gradient", "solving:gradient"),
    "match": ("solving_table:Match", "solving:match"),
    "fit": ("solving_table:Fit", "solving:fit"),
    "gallery": ("table:Gallery", "gallery:gallery"),
    "inspect": ("table:Inspect", "inspect_report:inspect"),
    "glass": ("table:Glass", "glass:glass"),
    "gem": ("solving_table:Gem", "gem:gem"),
    "lens table": ("solving_table:LensTable", "lens:lens_table"),
    "lens check": ("solving_table:LensCheck", "lens:lens_check"),
    "doctor": ("table:Doctor", "doctor:doctor"),
    "bench": ("measuring_table:Bench", "bench:bench"),
    "stress": ("measuring_table:Stress", "stress:stress"),
    "bench-agreement": ("measuring_table:BenchAgreement", "bench_agreement:bench_agreement"),
    "bench-view": ("measuring_table:BenchView", "bench:bench_view"),
    "prove-gpu": ("measuring_table:ProveGpu", "prove_gpu:prove_gpu"),
    "farm render": ("table:FarmRender", "farm:render"),
    "farm animate": ("table:FarmAnimate", "farm:animate"),
}
"""By name: the class of a command's values, and the function that gets them and returns the exit code, both with their
modules."""
_GROUPS = {
    "farm": "Render on many workers, here or on a Dask cluster; needs the extra 'farm'.",
    "lens": "Figures of lenses, and of plates that draw pictures with light.",
}
"""Commands of two words, by their first: its help."""
_HELP = {"help_option_names": ["-h", "--help"], "max_content_width": 120}


class _Interrupted(Exception):
    """Ctrl-C, carried past click, which would print an empty line."""


class _Commands(click.Group):
    def invoke(self, ctx: click.Context) -> object:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            raise _Interrupted from interrupt

    def list_commands(self, ctx: click.Context) -> list[str]:
        """In the order of the table."""
        return list(self.commands)


def run(arguments: Sequence[str]) -> int:
    """Run one command line; returns the exit code. Raises `UserError` for wrong usage."""
    names = [name for name in COMMANDS if [name] == list(arguments[:1])] or COMMANDS
    try:
        code = program(names).main(list(arguments) or ["--help"], prog_name="spectrasplat", standalone_mode=False)
    except (_Interrupted, click.Abort) as interrupted:
        raise (interrupted.__cause__ or KeyboardInterrupt()) from None
    except click.exceptions.NoArgsIsHelpError as error:
        print(error.format_message(), file=sys.stderr)
        return error.exit_code
    except click.ClickException as error:
        raise UserError(_usage_sentence(error.format_message())) from error
    return code if isinstance(code, int) else 0


def _usage_sentence(message: str) -> str:
    sentence = message.strip().rstrip(".?").replace(". (Did you", " (did you").replace(". Did you", ", did you")
    return f"{sentence[:1].lower()}{sentence[1:]}; 'spectrasplat --help' shows the usage"


def named(place: str) -> Any:
    """What "module:name" is in this package."""
    module, name = place.split(":")
    return getattr(import_module(f"{__package__}.{module}"), name)


def _command(name: str, values: type, runs: str) -> click.Command:
    def command(**given: Any) -> int:
        typed: Any = options.read(values, given)
        allow_outside(getattr(typed, "allow_outside", False))
        return named(runs)(typed)

    parameters = [row.parameter() for row in options.rows(values)]
    # click cuts a short help of its own making to 45 letters.
    return click.Command(name, callback=command, params=parameters, help=values.__doc__, short_help=values.__doc__)


def _ends(flag: str, help: str, does: Callable[[], None]) -> click.Option:
    """An option of the program itself, which ends it."""

    def callback(context: click.Context, _: click.Parameter, wanted: bool) -> None:
        if wanted:
            does()
            context.exit()

    return click.Option([flag], is_flag=True, is_eager=True, expose_value=False, help=help, callback=callback)


def program(names: Iterable[str] = COMMANDS) -> click.Group:
    """The program with these of its commands."""
    app = _Commands(
        help="Dispersive caustics: light through glass, split into its colours.",
        context_settings=_HELP,
        params=[
            _ends("--version", "Print the version.", lambda: print(f"spectrasplat {__version__}")),
            _ends("--install-completion", "Complete words in this shell from now on.", completion.install),
            _ends("--show-completion", "Print the script that does so.", lambda: print(completion.script())),
        ],
    )
    for name in names:
        group, _, own = name.rpartition(" ")
        if group and group not in app.commands:
            app.add_command(_Commands(group, help=_GROUPS[group], short_help=_GROUPS[group]))
        values, runs = COMMANDS[name]
        (app.commands[group] if group else app).add_command(_command(own, named(values), runs))  # type: ignore[attr-defined]
    return app
