"""An engine that draws one colour: enough to see what the session asks of it, without tracing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np
from spectrasplat.base.not_yet import NOT_YET, NotYet
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.stored_photons import StoredPhotons
from spectrasplat.gpu.context import Context
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.photon_queries import CausticSpectrum
from spectrasplat.render.viewer.stats import LiveStats


def dispersed(place: Sequence[float], source: int, receiver: int, count: int = 2000) -> StoredPhotons:
    """Light of 380 to 780 nm about a place, which came through glass `source` and is spread along x: red at 1.5."""
    ones, at = np.ones(count), np.random.default_rng(2).normal(0.0, 0.3, (count, 3)) * [1.0, 1.0, 0.0]
    return StoredPhotons(
        np.asarray(place, float) + at,
        np.tile([[[30.0, 0.0, 0.0]]], (count, 1, 1)),
        1.52 * ones[:, None],
        ones,
        np.full(count, source),
        np.full(count, receiver),
        np.tile([380.0, 780.0], (count, 1)),
        np.zeros(count, int),
        (lambda nm: 1.504 + 4200.0 / np.asarray(nm) ** 2,),
        {source: 0},
    )


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
    photons: StoredPhotons | None = None
    advanced: int = 0
    rebuilt: int = 0
    retraced: int = 0
    released: bool = False
    playing: bool = True
    target_photons: int = 0
    refine_when_still: bool = True
    is_busy: bool = False
    """Of one that always is, `FakeEngine.busy`, nothing is ever heard."""

    @staticmethod
    def busy(context: Context) -> FakeEngine:
        return FakeEngine(context, is_busy=True)

    def set(self, inputs: LiveInputs) -> DirtyLevel:
        if self.is_busy:
            return DirtyLevel.NOTHING
        self.inputs = inputs
        return DirtyLevel.CAMERA

    def advance(self, budget_s: float, interacting: bool = False) -> None:
        if self.is_busy:
            return
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

    def stored_photons(self, limit: int = 0) -> StoredPhotons | NotYet:
        return NOT_YET if self.is_busy else self.photons or dispersed((0.0, 0.0, 0.0), 0, 0, 0)

    def caustic_spectrum(self, receiver: int, position: np.ndarray) -> CausticSpectrum | NotYet:
        return NOT_YET if self.is_busy else CausticSpectrum(np.linspace(385, 775, 40), np.ones(40), 0.05)

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
