"""What is under the cursor: its surface, found at once, and the light there, which the engine looks up."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..base.not_yet import NotYet
from ..edit.picking import PickHit, pick_in
from ..edit.state import State
from .live_picture import LivePicture
from .screenshot import pixel_of
from .view_model import CursorInfo, LightHere

if TYPE_CHECKING:
    from ..model.lights import Light
    from ..model.scene import Scene
    from ..reference.direct_light import DirectLight
    from ..render.viewer.photon_queries import CausticSpectrum

SPECTRUM_S = 0.1
"""Shortest time between two spectra: each reads stored photons."""


class DirectLightQuery:
    """One question at a time; the last answer stays until the next one's."""

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None
        self._future: Future[np.ndarray | None] | None = None
        self._asked: tuple[object, ...] = ()
        self._scene: Scene | None = None
        self._made: DirectLight | None = None

    def gains(self, scene: Scene, place: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
        """Irradiance per unit of each light's quantity, (L,); None while it is not known, or cannot be."""
        key = (id(scene), *map(float, place), *map(float, normal))
        if key != self._asked and (self._future is None or self._future.done()):
            self._pool = self._pool or ThreadPoolExecutor(1, thread_name_prefix="direct light")
            self._asked, self._future = key, self._pool.submit(self._find, scene, np.array(place), np.array(normal))
        if key != self._asked or self._future is None or not self._future.done():
            return None
        return self._future.result()

    @property
    def is_hopeless(self) -> bool:
        """The last question has no answer."""
        return self._future is not None and self._future.done() and self._future.result() is None

    def _find(self, scene: Scene, place: np.ndarray, normal: np.ndarray) -> np.ndarray | None:
        from ..reference.direct_light import DirectLight

        try:
            if scene is not self._scene or self._made is None:
                self._made, self._scene = DirectLight.of(scene), scene
        except UserError:
            return None
        return self._made.gains(place, normal)

    def release(self) -> None:
        """End the thread."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._future = None


class Cursor:
    """What was found at the last cursor position."""

    def __init__(self) -> None:
        self.view_model: CursorInfo | None = None
        self._spectrum_s = -1e9
        self._spectrum_key: tuple[object, ...] = ()
        self._direct = DirectLightQuery()

    def update(self, state: State, picture: LivePicture, now_s: float) -> None:
        """Find what is under `state.hover`: surfaces at once, light as soon as the engine has an answer."""
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
            self.view_model = replace(self.view_model, light=before.light)
        key = (id(picture.shown_scene), hit, picture.stats.photons, state.physical, state.smoothing)
        if key == self._spectrum_key or now_s - self._spectrum_s < SPECTRUM_S:
            return
        place, normal = (np.asarray(v, float) for v in (hit.position, hit.normal))
        found = picture.caustic_spectrum(state.scene, hit.object_index, place)
        scene = picture.shown_scene or state.scene
        gains = self._direct.gains(scene, place, normal)
        self._spectrum_s = now_s
        is_awaited = isinstance(found, NotYet) or (gains is None and not self._direct.is_hopeless)
        # While an answer is awaited the question is repeated.
        self._spectrum_key = () if is_awaited else key
        if not isinstance(found, NotYet) and (not is_awaited or self.view_model.light is None):
            self.view_model = replace(self.view_model, light=_light_here(found, scene.lights, gains))

    def release(self) -> None:
        """End what works beside the interface."""
        self._direct.release()


def _light_here(caustic: CausticSpectrum, lights: Sequence[Light], gains: np.ndarray | None) -> LightHere:
    """A caustic with the direct light of `lights`, each `gains` times its quantity; None where they are not known."""
    width = caustic.resolution_nm
    total, luminous = np.zeros(len(caustic.wavelength_nm)), None
    if gains is not None:
        edges = np.append(caustic.wavelength_nm - 0.5 * width, caustic.wavelength_nm[-1] + 0.5 * width)
        shining = [(gain, light.spectral_power) for gain, light in zip(gains, lights, strict=True)]
        total = sum((gain * power.binned(edges) for gain, power in shining), total)
        luminous = float(sum(gain * power.luminous() for gain, power in shining))
    if caustic.irradiance is not None:
        total = total + caustic.irradiance
    return LightHere(caustic.wavelength_nm, total, caustic.error, caustic.irradiance is None, luminous)
