"""Choosing files that become part of the scene (pictures of the environment and of surfaces, lamps): the questions, and
what is dropped on the window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ...edit import edits, environments
from ...edit.lights import LIGHT_SUFFIXES, set_light_file
from ...edit.requests import Notice
from ...edit.state import State
from ...model.scene import Light, SceneObject
from ..view_model import ViewModel
from . import file_browser

_PANORAMAS = (".hdr", ".exr", ".pic")
"""Dropped files of these kinds are environments: no surface reflects more than 1."""


def ask_environment(state: State, view_model: ViewModel) -> None:
    """Ask for a panorama."""
    source = None if state.scene.environment is None else state.scene.environment.source
    _ask("Choose environment", environments.ENVIRONMENT_SUFFIXES, view_model, source, _as_environment)


def ask_texture(state: State, view_model: ViewModel, index: int) -> None:
    """Ask for a picture for the surface of object `index`."""
    item = state.scene.objects[index]
    source = None if item.material.texture is None else item.material.texture.source

    def chosen(state: State, path: Path) -> State:
        index = _index(state.scene.objects, item.name)
        return state if index is None else _as_texture(state, path, index)

    _ask(f"Picture for {item.name}", environments.TEXTURE_SUFFIXES, view_model, source, chosen)


def ask_lamp(state: State, view_model: ViewModel, index: int) -> None:
    """Ask for a photometric file for light `index`."""
    light = state.scene.lights[index]
    source = None if light.profile is None else light.profile.source

    def chosen(state: State, path: Path) -> State:
        index = _index(state.scene.lights, light.name)
        return state if index is None else _as_lamp(state, path, index)

    _ask(f"Lamp for {light.name}", LIGHT_SUFFIXES, view_model, source, chosen)


def _ask(
    title: str,
    suffixes: tuple[str, ...],
    view_model: ViewModel,
    source: str | None,
    chosen: Callable[[State, Path], State],
) -> None:
    """Begin in the folder of the present file `source`, else in the scene's."""
    start = view_model.recent[0].parent if view_model.recent else Path.home()
    start = view_model.path.parent if view_model.path is not None else start
    if source is not None and Path(source).parent.is_dir():
        start = Path(source).parent
    then = lambda state, _view_model, path: chosen(state, path)  # noqa: E731
    file_browser.ask(file_browser.Question(title, suffixes, start, then))


def is_part(path: Path) -> bool:
    """Whether a dropped file is one for `dropped`."""
    return path.suffix.lower() in {*LIGHT_SUFFIXES, *environments.ENVIRONMENT_SUFFIXES, *environments.TEXTURE_SUFFIXES}


def dropped(state: State, path: Path) -> State:
    """A panorama becomes the environment, a photometric file the selected light or a new one; another picture is put on
    the selected object."""
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
        Notice(f"Select a diffuse object to put {path.name} on it, or drop an .hdr or .exr for the environment.")
    )


def _as_environment(state: State, path: Path) -> State:
    return edits.attempt(state, f"Environment {path.name}", environments.set_environment_map, path)


def _as_lamp(state: State, path: Path, index: int | None) -> State:
    return edits.attempt(state, f"Lamp {path.name}", set_light_file, index, path)


def _as_texture(state: State, path: Path, index: int) -> State:
    return edits.attempt(state, f"Picture of {state.scene.objects[index].name}", environments.set_texture, index, path)


def _index(things: Sequence[SceneObject | Light], name: str) -> int | None:
    return next((i for i, thing in enumerate(things) if thing.name == name), None)
