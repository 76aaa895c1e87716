"""What lies under the cursor: asked of the engine when the cursor or the picture moved, and not more often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..edit.state import State
from .direct_light import DirectLightQuery
from .live_picture import LivePicture, pixel_of
from .view_model import CursorInfo

if TYPE_CHECKING:
    from ..model.lights import Light
    from ..passes.pick import PickHit
    from ..render.viewer.photon_queries import CausticSpectrum

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
        self._direct = DirectLightQuery()

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
                self.view_model = replace(self.view_model, **{name: getattr(before, name) for name in _SPECTRUM_FIELDS})
            return
        place, normal = (np.asarray(v, float) for v in (self._hit.position, self._hit.normal))
        found = picture.engine.caustic_spectrum(self._hit.object_index, place)
        scene = state.scene if picture.engine.inputs is None else picture.engine.inputs.scene
        gains = self._direct.gains(scene, place, normal)
        self._spectrum_s = now_s
        # An answer that is still awaited is asked for again.
        self._spectrum_key = key if gains is not None or self._direct.is_hopeless else ()
        is_awaited = gains is None and not self._direct.is_hopeless
        if is_awaited and before is not None and before.spectrum is not None:
            # The answer before stays until the next is whole: no flicker while the cursor moves.
            self.view_model = replace(self.view_model, **{name: getattr(before, name) for name in _SPECTRUM_FIELDS})
        elif found is not None:
            self.view_model = replace(self.view_model, **_told(found, scene.lights, gains))

    def release(self) -> None:
        """End what works beside the interface."""
        self._direct.release()


_SPECTRUM_FIELDS = ("spectrum_nm", "spectrum", "spectrum_error", "too_few_photons", "direct_illuminance")


def _told(caustic: CausticSpectrum, lights: Sequence[Light], gains: np.ndarray | None) -> dict[str, Any]:
    """Fields of `CursorInfo`: a caustic with the direct light of `lights`, each `gains` times its quantity."""
    width = caustic.resolution_nm
    direct = np.zeros(len(caustic.wavelength_nm))
    if gains is not None:
        edges = np.append(caustic.wavelength_nm - 0.5 * width, caustic.wavelength_nm[-1] + 0.5 * width)
        for light, gain in zip(lights, gains, strict=True):
            direct += gain * light.spectral_power.binned(edges)
    total = direct if caustic.irradiance is None else direct + caustic.irradiance
    luminous = None
    if gains is not None:
        luminous = float(sum(g * light.spectral_power.luminous() for g, light in zip(gains, lights, strict=True)))
    values = (caustic.wavelength_nm, total, caustic.error, caustic.irradiance is None, luminous)
    return dict(zip(_SPECTRUM_FIELDS, values, strict=True))
