"""What is drawn of a state: the animation at the time it is scrubbed to, without what is hidden. Never what is edited
or saved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from ..base.errors import UserError
from ..model.scene import Camera, Scene
from .animation import tracks_of
from .parameters import Stage, apply_all
from .state import Selection, State

_T = TypeVar("_T")


class Drawn:
    """Remembers the last scenes that it made: a still picture must not be begun anew in every frame."""

    def __init__(self) -> None:
        self._staged = _Last()
        self._visible = _Last()

    def of(self, state: State) -> State:
        """`state` as the picture shows it; its selection means the same thing."""
        return self.visible(self.staged(state))

    def staged(self, state: State) -> State:
        """With the scene at its preview's time; as it is without one, or where its keys fit the scene no more."""
        time_s = state.preview_s
        if time_s is None or not state.animation:
            return state
        stage = self._staged.get((state.scene, state.animation, time_s), lambda: stage_at(state, time_s))
        return state if stage is None else replace(state, scene=stage.scene, solo_nm=stage.solo_nm)

    def visible(self, state: State) -> State:
        """Without hidden objects and lights; with all objects where none would be left."""
        if not state.hidden:
            return state
        scene = self._visible.get((state.scene, state.hidden), lambda: visible_scene(state))
        if scene is state.scene:
            return state
        return replace(state, scene=scene, selection=_selected_in(scene, state))


class _Last:
    """The value made last, as long as what it was made of is the same."""

    def __init__(self) -> None:
        self._key: tuple[object, ...] = ()
        self._value: object = None

    def get(self, key: tuple[object, ...], make: Callable[[], _T]) -> _T:
        if len(self._key) != len(key) or any(a is not b for a, b in zip(self._key, key, strict=True)):
            self._key, self._value = key, make()
        return self._value  # type: ignore[return-value]


def visible_scene(state: State) -> Scene:
    """The scene without what is hidden."""
    scene = state.scene
    objects = tuple(item for item in scene.objects if ("object", item.name) not in state.hidden)
    lights = tuple(light for light in scene.lights if ("light", light.name) not in state.hidden)
    if not objects or (len(objects), len(lights)) == (len(scene.objects), len(scene.lights)):
        return scene
    return replace(scene, objects=objects, lights=lights)


def _selected_in(scene: Scene, state: State) -> Selection:
    """The selection's place among what is visible; nothing for one that is hidden."""
    chosen = state.selection
    before, now = (
        (state.scene.objects, scene.objects) if chosen.kind == "object" else (state.scene.lights, scene.lights)
    )
    if chosen.kind not in ("object", "light") or chosen.index >= len(before):
        return chosen
    thing = before[chosen.index]
    index = next((i for i, other in enumerate(now) if other is thing), None)
    return Selection() if index is None else replace(chosen, index=index)


def stage_at(state: State, time_s: float) -> Stage | None:
    """What the keys make of the scene at a time; None where a key belongs to nothing any more."""
    stage = Stage(state.scene, state.camera, state.display.exposure_ev, state.solo_nm)
    try:
        return apply_all(stage, {track.path: track.at(time_s) for track in tracks_of(state.animation)})
    except UserError:
        return None


def scrubbed(state: State, time_s: float) -> State:
    """With the preview at a time; the camera follows its own keys."""
    stage = stage_at(state, time_s)
    camera: Camera = state.camera
    if stage is not None and any(key.path.startswith("camera.") for key in state.animation):
        camera = stage.camera
    return replace(state, preview_s=time_s, camera=camera)
