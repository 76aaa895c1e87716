"""An engine that draws one colour: enough to see what the session asks of it, without tracing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.stored_photons import StoredPhotons
from spectrasplat.gpu.context import Context
from spectrasplat.passes.pick import PickHit
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.photon_queries import CausticSpectrum
from spectrasplat.render.viewer.stats import LiveStats


@dataclass
class FakeEngine:
    """Grey, brighter with the camera's height; `fails` makes the next call raise."""

    context: Context
    fails: Exception | None = None
    problem: str | None = None
    inputs: LiveInputs | None = None
    picture: moderngl.Texture | None = None
    picture_version: int = 0
    stats: LiveStats = LiveStats()
    hit: PickHit | None = None
    photons: StoredPhotons | None = None
    advanced: int = 0
    rebuilt: int = 0
    retraced: int = 0
    released: bool = False
    playing: bool = True
    target_photons: int = 0
    refine_when_still: bool = True
    is_busy: bool = False

    def set(self, inputs: LiveInputs) -> DirtyLevel:
        self.inputs = inputs
        return DirtyLevel.CAMERA

    def advance(self, budget_s: float, interacting: bool = False) -> None:
        assert self.inputs is not None
        if self.fails is not None:
            raise self.fails
        self.advanced += 1
        size = (self.inputs.width, self.inputs.height)
        if self.picture is None or self.picture.size != size:
            self._forget()
            self.picture = self.context.ctx.texture(size, 4, dtype="f4")
        grey = np.full((size[1], size[0], 4), 0.1 * abs(self.inputs.camera.position[2]), "f4")
        self.picture.write(grey.tobytes())
        self.picture_version += 1
        self.stats = replace(self.stats, photons=self.stats.photons + 1000, converged=self.advanced > 5)

    def pick(self, x: float, y: float) -> PickHit | None:
        return self.hit

    def stored_photons(self, limit: int = 0) -> StoredPhotons:
        return self.photons or StoredPhotons.none()

    def caustic_spectrum(self, receiver: int, position: np.ndarray) -> CausticSpectrum | None:
        return CausticSpectrum(np.linspace(385, 775, 40), np.ones(40), 0.05)

    def retrace(self) -> None:
        self.retraced += 1

    def rebuild(self) -> None:
        self.rebuilt += 1

    def release(self) -> None:
        self._forget()
        self.released = True

    def _forget(self) -> None:
        if self.picture is not None:
            self.picture.release()
            self.picture = None
