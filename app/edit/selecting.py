"""Several things selected, hidden and locked, and what is done to all of them: functions of the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..model.scene import Scene
from . import edits
from .lights import delete_light, duplicate_light, rename_light
from .objects import delete, duplicate, rename, set_material
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
    """Whether it may not be selected and moved in the picture."""
    return key_of(state.scene, selection) in state.locked


def name_of(scene: Scene, selection: Selection) -> str:
    """What an object or a light is called."""
    return (scene.lights if selection.kind == "light" else scene.objects)[selection.index].name


def added(state: State, kind: str, label: str, edit: Callable[..., Scene], *args: object) -> State:
    """With what `edit` adds at the end of the objects or lights, selected."""
    new = (
        Selection("light", len(state.scene.lights))
        if kind == "light"
        else Selection("object", len(state.scene.objects))
    )
    after = edits.attempt(state, label, edit, *args)
    return after if after.scene is state.scene else replace(after, selection=new)


def duplicated(state: State, things: tuple[Selection, ...] | None = None) -> State:
    """With copies of `things`, or of everything that is selected, in one step; the copies are selected."""
    copies: list[Selection] = []
    for each in everything(state) if things is None else things:
        edit, label = duplicate_light if each.kind == "light" else duplicate, name_of(state.scene, each)
        state = added(state, each.kind or "", f"Duplicate {label}", edit, each.index)
        copies.append(state.selection)
    label = state.edit_label if len(copies) == 1 else f"Duplicate {len(copies)} things"
    return replace(state, selection=copies[0], also=tuple(copies[1:]), edit_label=label) if copies else state


def deleted(state: State, things: tuple[Selection, ...] | None = None) -> State:
    """Without `things`, or everything that is selected, in one step; the last of its kind is refused with a notice."""
    chosen = sorted(everything(state) if things is None else things, key=lambda each: -each.index)
    for each in chosen:
        edit = delete_light if each.kind == "light" else delete
        after = edits.attempt(state, f"Delete {name_of(state.scene, each)}", edit, each.index)
        state = after if after.scene is state.scene else replace(after, selection=Selection())
    return state if len(chosen) < 2 else replace(state, also=(), edit_label=f"Delete {len(chosen)} things")


def renamed(state: State, thing: Selection, name: str) -> State:
    """With another name for an object or a light."""
    edit = rename_light if thing.kind == "light" else rename
    return edits.attempt(state, f"Rename {name_of(state.scene, thing)}", edit, thing.index, name)


def with_pasted_material(state: State) -> State:
    """With the material of the clipboard on the selected object."""
    label = f"Paste material on {name_of(state.scene, state.selection)}"
    return edits.attempt(state, label, set_material, state.selection.index, state.clipboard)
