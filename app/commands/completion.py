"""What the shell may complete: shipped scenes, receivers of the scene already typed, glasses, methods.

Called by the shell at every press of Tab, so each imports only what it needs. Typer keeps what begins as typed; where
nothing does, the shell completes names of files. Where a scene cannot be read, nothing is offered, silently.
"""

from __future__ import annotations

import typer

from ..base.errors import UserError
from ..base.paths import shipped_scenes
from ..model.settings import CAMERA_METHODS, METHODS
from .scenes import find_scene, receivers_of


def lessons() -> list[str]:
    """Lessons of the window."""
    from ..edit.lessons import lessons

    return [each.name for each in lessons()]


def scenes() -> list[str]:
    """Shipped scenes."""
    return list(shipped_scenes())


def receivers(ctx: typer.Context) -> list[str]:
    """Diffuse objects of the scene on the command line."""
    from ..model.io.scene_file import load_scene

    # Where the option to complete lacks its value, click keeps the arguments apart.
    scene = ctx.params.get("scene") or next(iter(ctx.args), "")
    try:
        return receivers_of(load_scene(find_scene(scene)))
    except (UserError, OSError):
        return []


def layers(ctx: typer.Context) -> list[str]:
    """ "beauty", "caustic", and the map of each receiver."""
    return ["beauty", "caustic", *(f"map:{name}" for name in receivers(ctx))]


def glasses(incomplete: str) -> list[str]:
    """Names of the catalogue's materials."""
    from ..model.optics import catalogue

    return sorted({entry.name for entry in catalogue.search(incomplete)})


def methods() -> list[str]:
    """Sampling methods of the light pass."""
    return list(METHODS)


def camera_methods() -> list[str]:
    """Sampling methods of the camera pass."""
    return list(CAMERA_METHODS)


def method_lists(incomplete: str) -> list[str]:
    """The last of several methods, with a comma between."""
    before, comma, _ = incomplete.rpartition(",")
    return [before + comma + name for name in METHODS]
