"""The animation looked at by scrubbing: the state as it is drawn at a time, which is never what is edited or saved."""

from __future__ import annotations

from dataclasses import replace

from ..base.errors import UserError
from ..model.scene import Camera
from .animation import tracks_of
from .parameters import Stage, apply_all
from .state import State


class Preview:
    """Remembers the last scene that it made: a picture that stands still must not be begun anew in every frame."""

    def __init__(self) -> None:
        self._key: tuple[object, ...] = ()
        self._stage: Stage | None = None

    def drawn(self, state: State) -> State:
        """`state` with the scene at its preview's time; as it is without one, or where its keys fit the scene no
        more."""
        if state.preview_s is None or not state.animation:
            return state
        key = (state.scene, state.animation, state.preview_s)
        if len(self._key) != len(key) or any(a is not b for a, b in zip(self._key, key, strict=True)):
            self._key, self._stage = key, stage_at(state, state.preview_s)
        if self._stage is None:
            return state
        return replace(state, scene=self._stage.scene, solo_nm=self._stage.solo_nm)


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
