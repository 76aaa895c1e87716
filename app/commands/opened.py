"""A command's scene: opened as the options say, with settings, and worked on until there is something to write."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from click.exceptions import Exit

from ..base import files, generators
from ..base.errors import UserError
from ..base.interrupts import Interruption, interrupt_flag
from ..base.memory import check_picture_memory
from ..model.settings import RenderSettings
from .options import given_for
from .printing import note
from .scenes import check_layer, find_scene
from .table import OpensScene

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..model.scene import Scene

T = TypeVar("T")


def open_scene(values: OpensScene) -> Scene:
    """The scene of a command, with what its options say of the scene's own defaults and camera. Raises `UserError`."""
    files.forget_read()
    path, opening = find_scene(values.scene), values.opening
    if opening is None:
        from ..model.io.scene_file import load_scene

        scene = load_scene(path)
    else:
        from ..edit.opening import open_scene as opened

        scene = opened(path, opening)
    check_unread(getattr(values, "output", None))
    camera, defaults = given_for("camera", values), given_for("render", values)
    if camera:
        scene = replace(scene, camera=replace(scene.camera, **camera))
    if "focus_distance" in camera and scene.camera.lens_radius == 0.0:
        raise UserError("--focus-distance changes nothing where the lens has no radius: give --lens-radius as well")
    return replace(scene, render=replace(scene.render, **defaults)) if defaults else scene


def check_unread(output: Path | None) -> None:
    """Raise `UserError` where an output would replace what was read to make it."""
    if output is not None and files.was_read(output):
        raise UserError(
            f"cannot write {output}: it is the scene itself, or a file that this is made of; choose another name"
        )


def note_assumptions(scene: Scene) -> None:
    """Report what was assumed when the scene was read."""
    for sentence in scene.notes:
        note(sentence)


def settings_for(values: object, scene: Scene, **defaults: object) -> RenderSettings:
    """Settings as a command's options say, else as `defaults`, else as the scene. Raises `UserError`."""
    wishes = scene.render
    own = {"width": wishes.width, "height": wishes.height, "max_depth": wishes.max_depth}
    settings = RenderSettings(**(own | defaults | given_for("settings", values)))  # type: ignore[arg-type]
    if settings.photons is not None and settings.seconds is not None:
        raise UserError("--photons and --seconds exclude each other: give a count or a time, not both")
    check_layer(settings.layer, scene)
    check_picture_memory(settings.width, settings.height, settings.bins)
    return settings


def worked_out(
    scene: Scene,
    what: str,
    begin: Callable[[Context], Generator[float, None, T]],
    stopped: str = "nothing was written: it is whole or not at all",
) -> T:
    """What the steps of `begin` return on a context of their own; see `finished`."""
    from ..base.progress import ProgressReporter
    from ..gpu.context import create_context

    with create_context() as context, interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        return finished(begin(context), progress, what, interrupted, stopped)


def finished(
    steps: Generator[float, None, T],
    progress: Callable[[float, str], None],
    what: str,
    interrupted: Interruption,
    stopped: str,
) -> T:
    """What `steps` return. Where the work is interrupted, the user is told `stopped` and the command ends."""

    def at_pause(share: float) -> None:
        progress(share, what)
        if interrupted():
            print(f"spectrasplat: {stopped}", file=sys.stderr)
            raise Exit(interrupted.exit_code)

    with closing(steps):
        return generators.finished(steps, at_pause)
