"""The scenes of a command line: found by path or name, and what in them a command may name."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import files
from ..base.errors import UserError, nearest_names, suggestion
from ..base.paths import SCENE_SUFFIXES, shipped_scenes

if TYPE_CHECKING:
    from ..model.scene import Scene


def find_scene(text: str) -> Path:
    """The file of a scene given by path, or by the bare name of a shipped one. Raises `UserError`."""
    path = Path(text)
    if files.is_file(path):
        return path
    if os.path.isdir(path):
        raise UserError(f"scene {text} is a folder: give a scene file in it")
    shipped = shipped_scenes()
    if text in shipped:
        return shipped[text]
    if os.path.exists(path):
        raise UserError(f"scene {text} is a device or a pipe: give an ordinary file")
    if os.sep in text or path.suffix:
        near = nearest_names(path.name, _files_next_to(path))
        hint = f", did you mean '{path.with_name(near[0])}'?" if near else ""
        if not hint and path.stem in shipped:
            hint = f", did you mean the shipped scene '{path.stem}'?"
        raise UserError(f"scene file {text} does not exist{hint or ': check the path'}")
    hint = suggestion(text, shipped)
    names = ", ".join(shipped) or "none"
    raise UserError(f"scene '{text}' is neither a file nor shipped{hint or ','} shipped are {names}")


def _files_next_to(path: Path) -> list[str]:
    try:
        return [entry.name for entry in path.parent.iterdir() if entry.suffix.lower() in SCENE_SUFFIXES]
    except OSError:
        return []


def check_layer(text: str, scene: Scene) -> None:
    """Raise `UserError` unless this is "beauty", "caustic" or "map:RECEIVER" with a diffuse object of `scene`."""
    kind, _, name = text.partition(":")
    if text in ("beauty", "caustic"):
        return
    if kind != "map":
        hint = suggestion(text, ("beauty", "caustic", "map"))
        raise UserError(f"--layer '{text}' is unknown{hint or ','} known are beauty, caustic and map:RECEIVER")
    receivers = scene.receiver_names
    if name not in receivers:
        listed = ", ".join(f"'map:{receiver}'" for receiver in receivers) or "none, for nothing in it is diffuse"
        raise UserError(f"--layer '{text}' names no receiver of scene '{scene.name}'; it has {listed}")


def load_scenes(names: Sequence[str]) -> dict[str, Scene]:
    """Scenes by the stems of their files; without names, every shipped one that holds glass. Raises `UserError`."""
    from ..model.io.scene_file import load_scene

    if not names:
        shipped = {name: load_scene(path) for name, path in shipped_scenes().items()}
        return {name: scene for name, scene in shipped.items() if any(o.material.transmits for o in scene.objects)}
    found = [find_scene(name) for name in names]
    scenes: dict[str, Scene] = {}
    for name, file in zip(names, found, strict=True):
        if file.stem in scenes:
            raise UserError(
                f"scene {name}: another scene of this run is called '{file.stem}' too; rename the file or run them "
                "apart"
            )
        scenes[file.stem] = load_scene(file)
    return scenes
