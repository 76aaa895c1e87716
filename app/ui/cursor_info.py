"""What lies under the cursor: asked of the engine when the cursor or the picture moved, and not more often."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..edit.state import State
from .live_picture import LivePicture, pixel_of
from .view_model import CursorInfo

if TYPE_CHECKING:
    from ..passes.pick import PickHit

SPECTRUM_S = 0.1
"""Shortest time between two spectra: each reads stored photons."""


class Cursor:
    """What was found at the last cursor position."""

    def __init__(self) -> None:
        self.view_model: CursorInfo | None = None
        self._key: tuple[object, ...] = ()
        self._hit: PickHit | None = None
        self._spectrum_s = -1e9
        self._spectrum_key: tuple[object, ...] = ()

    def update(self, state: State, picture: LivePicture, now_s: float) -> None:
        """Query again under `state.hover`."""
        if state.hover is None or picture.engine is None or picture.radiance is None:
            self.view_model = None
            self._key = ()
            return
        inputs = picture.engine.inputs
        key = (state.hover, state.camera, id(inputs and inputs.scene), state.viewport_size)
        if key != self._key:
            self._hit = picture.pick(state.hover)
            self._key = key
        before = self.view_model
        self.view_model = self._query(state, picture)
        if state.preferences.panels.spectrum and self._hit is not None and self._hit.is_receiver:
            self._take_spectrum(state, picture, before, now_s)

    def _query(self, state: State, picture: LivePicture) -> CursorInfo:
        assert state.hover is not None
        radiance, hit = picture.radiance, self._hit
        assert radiance is not None
        view_model = CursorInfo(
            pixel_of(state.hover, state.viewport_size),
            picture.pixel(state.hover) or (0.0, 0.0, 0.0),
            magnified=None if picture.magnified is None else picture.magnified.glo,
        )
        index = None if hit is None else picture.object_in(state.scene, hit.object_index)
        if hit is None or index is None:
            return view_model
        return replace(
            view_model, object_index=index, position=hit.position, normal=hit.normal, is_receiver=hit.is_receiver
        )

    def _take_spectrum(self, state: State, picture: LivePicture, before: CursorInfo | None, now_s: float) -> None:
        assert self.view_model is not None and self._hit is not None and picture.engine is not None
        key = (*self._key, picture.stats.photons, state.physical, state.smoothing)
        if key == self._spectrum_key or now_s - self._spectrum_s < SPECTRUM_S:
            if before is not None and before.object_index == self.view_model.object_index:
                self.view_model = replace(self.view_model, spectrum_nm=before.spectrum_nm, spectrum=before.spectrum)
            return
        found = picture.engine.caustic_spectrum(self._hit.object_index, np.asarray(self._hit.position, float))
        self._spectrum_key, self._spectrum_s = key, now_s
        if found is not None:
            self.view_model = replace(self.view_model, spectrum_nm=found[0], spectrum=found[1])
