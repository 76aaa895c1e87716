"""What lies under the cursor: its surface, found at once, and the light there, which the engine is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.not_yet import NotYet
from ..edit.picking import PickHit, pick_in
from ..edit.state import State
from .direct_light import DirectLightQuery
from .live_picture import LivePicture, pixel_of
from .view_model import CursorInfo

if TYPE_CHECKING:
    from ..model.lights import Light
    from ..render.viewer.photon_queries import CausticSpectrum

SPECTRUM_S = 0.1
"""Shortest time between two spectra: each reads stored photons."""


class Cursor:
    """What was found at the last cursor position."""

    def __init__(self) -> None:
        self.view_model: CursorInfo | None = None
        self._spectrum_s = -1e9
        self._spectrum_key: tuple[object, ...] = ()
        self._direct = DirectLightQuery()

    def update(self, state: State, picture: LivePicture, now_s: float) -> None:
        """Find what is under `state.hover`: surfaces at once, light as soon as the engine tells."""
        if state.hover is None:
            self.view_model = None
            return
        before, hit = self.view_model, pick_in(state, *state.hover)
        self.view_model = CursorInfo(
            pixel_of(state.hover, state.viewport_size),
            picture.pixel(state.hover),
            hit,
            magnified=None if picture.magnified is None else picture.magnified.glo,
        )
        if state.preferences.panels.spectrum and hit is not None and hit.is_receiver:
            same = before is not None and before.hit is not None and before.hit.object_index == hit.object_index
            self._take_spectrum(state, picture, hit, before if same else None, now_s)

    def _take_spectrum(
        self, state: State, picture: LivePicture, hit: PickHit, before: CursorInfo | None, now_s: float
    ) -> None:
        """A spectrum of the same object stays until the next is whole: no flicker while the cursor moves."""
        assert self.view_model is not None
        if before is not None:
            self.view_model = replace(self.view_model, **{name: getattr(before, name) for name in _SPECTRUM_FIELDS})
        key = (id(picture.shown_scene), hit, picture.stats.photons, state.physical, state.smoothing)
        if key == self._spectrum_key or now_s - self._spectrum_s < SPECTRUM_S:
            return
        place, normal = (np.asarray(v, float) for v in (hit.position, hit.normal))
        found = picture.caustic_spectrum(state.scene, hit.object_index, place)
        scene = picture.shown_scene or state.scene
        gains = self._direct.gains(scene, place, normal)
        self._spectrum_s = now_s
        is_awaited = isinstance(found, NotYet) or (gains is None and not self._direct.is_hopeless)
        # An answer that is still awaited is asked for again.
        self._spectrum_key = () if is_awaited else key
        if not isinstance(found, NotYet) and (not is_awaited or self.view_model.spectrum is None):
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
