"""What the shell may complete: shipped scenes, receivers of the scene already typed, glasses, methods; and the script
that a shell needs for it.

Called by the shell at every press of Tab, so each imports only what it needs. What begins as typed is kept; where
nothing does, the shell completes names of files. Where a scene cannot be read, nothing is offered, silently.
"""

from __future__ import annotations

import os
from pathlib import Path

import click
from click.shell_completion import get_completion_class

from ..base.errors import UserError
from ..base.paths import shipped_scenes
from ..model.settings import METHODS
from .scenes import find_scene

_STARTS = {
    "bash": ".bashrc",
    "zsh": ".zshrc",
    "fish": ".config/fish/completions/spectrasplat.fish",
}
"""By shell: the file in the home folder that it reads."""


def lessons(_: click.Context, incomplete: str) -> list[str]:
    """Lessons of the window."""
    from ..edit.lessons import lessons

    return [each.name for each in lessons()]


def scenes(_: click.Context, incomplete: str) -> list[str]:
    """Shipped scenes."""
    return list(shipped_scenes())


def receivers(context: click.Context, incomplete: str) -> list[str]:
    """Diffuse objects of the scene on the command line."""
    from ..model.io.scene_file import load_scene

    # Where the option to complete lacks its value, click keeps the arguments apart.
    scene = context.params.get("scene") or next(iter(context.args), "")
    try:
        return load_scene(find_scene(scene)).receiver_names
    except (UserError, OSError):
        return []


def layers(context: click.Context, incomplete: str) -> list[str]:
    """ "beauty", "caustic", and the map of each receiver."""
    return ["beauty", "caustic", *(f"map:{name}" for name in receivers(context, incomplete))]


def glasses(_: click.Context, incomplete: str) -> list[str]:
    """Names of the catalogue's materials."""
    from ..model.optics import catalogue

    return sorted({entry.name for entry in catalogue.search(incomplete)})


def method_lists(_: click.Context, incomplete: str) -> list[str]:
    """The last of several methods, with a comma between."""
    before, comma, _last = incomplete.rpartition(",")
    return [before + comma + name for name in METHODS]


# ---- the script of a shell --------------------------------------------------------------------


def script() -> str:
    """What the user's shell has to read. Raises `UserError` for a shell that is not known."""
    found = get_completion_class(_shell())
    assert found is not None
    return found(click.Command("spectrasplat"), {}, "spectrasplat", "_SPECTRASPLAT_COMPLETE").source()


def install() -> None:
    """Let the user's shell read the script when it starts. Raises `UserError`."""
    shell = _shell()
    file, text = Path.home() / _STARTS[shell], f"\n# spectrasplat\n{script()}"
    try:
        before = file.read_text(encoding="utf-8") if file.exists() else ""
        if text not in before:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(before + text, encoding="utf-8")
    except (OSError, ValueError) as error:
        raise UserError(f"cannot change {file}: {error}; 'spectrasplat --show-completion' prints the script") from error
    print(f"{file}: completion for {shell}, from the next {shell} on")


def _shell() -> str:
    shell = Path(os.environ.get("SHELL", "")).stem
    if shell not in _STARTS:
        raise UserError(f"$SHELL is '{shell}', which cannot be completed; known are {', '.join(_STARTS)}")
    return shell
