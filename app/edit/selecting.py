"""Several things selected, hidden and locked: functions of the state."""

from __future__ import annotations

from dataclasses import replace

from ..model.scene import Scene
from .state import Selection, State


def chosen(state: State, selection: Selection, add: bool = False) -> State:
    """With `selection` alone; or with `add` to the others, or taken away from them."""
    if not add or state.selection.kind not in ("object", "light"):
        return replace(state, selection=selection, also=())
    everything = [state.selection, *state.also]
    if selection in everything:
        left = [each for each in everything if each != selection]
        return (
            replace(state, selection=left[0], also=tuple(left[1:])) if left else replace(state, selection=Selection())
        )
    return replace(state, selection=selection, also=tuple(everything))


def is_selected(state: State, selection: Selection) -> bool:
    """Whether it is the selection or one of the others."""
    return state.selection == selection or selection in state.also


def everything(state: State) -> tuple[Selection, ...]:
    """The selection and the others, without those that the scene has not."""
    return tuple(each for each in (state.selection, *state.also) if key_of(state.scene, each) is not None)


def key_of(scene: Scene, selection: Selection) -> tuple[str, str] | None:
    """As `State.hidden` and `State.locked` hold it; None for what is no object and no light of the scene."""
    if selection.kind == "object" and selection.index < len(scene.objects):
        return "object", scene.objects[selection.index].name
    if selection.kind == "light" and selection.index < len(scene.lights):
        return "light", scene.lights[selection.index].name
    return None


def is_locked(state: State, selection: Selection) -> bool:
    """Whether the hand in the picture may not take it."""
    return key_of(state.scene, selection) in state.locked


def toggled(keys: frozenset[tuple[str, str]], key: tuple[str, str]) -> frozenset[tuple[str, str]]:
    """`keys` with `key` in it, or without."""
    return keys ^ {key}
