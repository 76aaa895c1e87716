"""Choosing picture files for the environment and for surfaces: the questions, their answers, and pictures dropped on
the window."""

from __future__ import annotations

from pathlib import Path

from ...edit import edits, environments
from ...edit.requests import Notice
from ...edit.state import State
from ...model.scene import Scene
from ..view_model import ViewModel
from . import file_browser

_ENVIRONMENT = "environment"
_TEXTURE = "texture"
_PANORAMAS = (".hdr", ".exr", ".pic")
"""Dropped files of these kinds are environments: no surface reflects more than 1."""

_memory = {"worn by": ""}
"""Name of the object that is to wear the picture asked for."""


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


def answers(state: State) -> State:
    """Files chosen since the last frame."""
    path = file_browser.take(_ENVIRONMENT)
    if path is not None:
        state = _as_environment(state, path)
    path = file_browser.take(_TEXTURE)
    index = _index(state.scene, _memory["worn by"])
    if path is not None and index is not None:
        state = _as_texture(state, path, index)
    return state


def is_picture(path: Path) -> bool:
    """Whether a dropped file is one for `dropped`."""
    return path.suffix.lower() in {*environments.ENVIRONMENT_SUFFIXES, *environments.TEXTURE_SUFFIXES}


def dropped(state: State, path: Path) -> State:
    """A panorama becomes the environment; another picture is worn by the selected object."""
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
