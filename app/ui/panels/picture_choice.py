"""Choosing files that become part of the scene (pictures of the environment and of surfaces, lamps): the questions,
their answers, and what is dropped on the window."""

from __future__ import annotations

from pathlib import Path

from ...edit import edits, environments
from ...edit.lights import LIGHT_SUFFIXES
from ...edit.requests import Notice
from ...edit.state import State
from ...model.scene import Scene
from ..view_model import ViewModel
from . import file_browser

_ENVIRONMENT = "environment"
_TEXTURE = "texture"
_LAMP = "lamp"
_PANORAMAS = (".hdr", ".exr", ".pic")
"""Dropped files of these kinds are environments: no surface reflects more than 1."""

_memory = {"worn by": "", "shines": ""}
"""Name of the object that is to wear the picture asked for, and of the light that is to shine as the file has it."""


def ask_environment(state: State, view_model: ViewModel) -> None:
    """Ask for a panorama."""
    now = state.scene.environment
    start = _folder(view_model, None if now is None else now.source)
    file_browser.ask(
        file_browser.Question(_ENVIRONMENT, "Choose environment", environments.ENVIRONMENT_SUFFIXES, start)
    )


def ask_texture(state: State, view_model: ViewModel, index: int) -> None:
    """Ask for a picture that object `index` is to wear."""
    item = state.scene.objects[index]
    worn = item.material.texture
    _memory["worn by"] = item.name
    start = _folder(view_model, None if worn is None else worn.source)
    file_browser.ask(file_browser.Question(_TEXTURE, f"Picture for {item.name}", environments.TEXTURE_SUFFIXES, start))


def ask_lamp(state: State, view_model: ViewModel, index: int) -> None:
    """Ask for a photometric file for light `index`."""
    light = state.scene.lights[index]
    _memory["shines"] = light.name
    start = _folder(view_model, light.profile.source if light.profile is not None else None)
    file_browser.ask(file_browser.Question(_LAMP, f"Lamp for {light.name}", LIGHT_SUFFIXES, start))


def answers(state: State) -> State:
    """Files chosen since the last frame."""
    path = file_browser.take(_ENVIRONMENT)
    if path is not None:
        state = _as_environment(state, path)
    path = file_browser.take(_TEXTURE)
    index = _index(state.scene, _memory["worn by"])
    if path is not None and index is not None:
        state = _as_texture(state, path, index)
    path = file_browser.take(_LAMP)
    lamp = next((i for i, light in enumerate(state.scene.lights) if light.name == _memory["shines"]), None)
    if path is not None and lamp is not None:
        state = _as_lamp(state, path, lamp)
    return state


def is_part(path: Path) -> bool:
    """Whether a dropped file is one for `dropped`."""
    return path.suffix.lower() in {*LIGHT_SUFFIXES, *environments.ENVIRONMENT_SUFFIXES, *environments.TEXTURE_SUFFIXES}


def dropped(state: State, path: Path) -> State:
    """A panorama becomes the environment, a photometric file the selected light or a new one; another picture is worn
    by the selected object."""
    if path.suffix.lower() in LIGHT_SUFFIXES:
        chosen = state.selection.index if state.selection.kind == "light" else None
        return _as_lamp(state, path, chosen)
    if path.suffix.lower() in _PANORAMAS:
        return _as_environment(state, path)
    selection = state.selection
    if (
        selection.kind == "object"
        and selection.index < len(state.scene.objects)
        and state.scene.objects[selection.index].material.receives
    ):
        return _as_texture(state, path, selection.index)
    return state.asking(
        Notice(f"Select a diffuse object to lay {path.name} on it, or drop an .hdr or .exr for the environment.")
    )


def _as_environment(state: State, path: Path) -> State:
    return edits.attempt(state, f"Environment {path.name}", environments.set_environment_map, path)


def _as_lamp(state: State, path: Path, index: int | None) -> State:
    return edits.attempt(state, f"Lamp {path.name}", edits.set_light_file, index, path)


def _as_texture(state: State, path: Path, index: int) -> State:
    return edits.attempt(state, f"Picture of {state.scene.objects[index].name}", environments.set_texture, index, path)


def _index(scene: Scene, name: str) -> int | None:
    return next((i for i, item in enumerate(scene.objects) if item.name == name), None)


def _folder(view_model: ViewModel, source: str | None) -> Path:
    """Where to look first: beside the present picture, else beside the scene."""
    if source is not None and Path(source).parent.is_dir():
        return Path(source).parent
    if view_model.path is not None:
        return view_model.path.parent
    return view_model.recent[0].parent if view_model.recent else Path.home()
