"""A live engine on a thread of its own, with an OpenGL context of its own that shares its objects with the window's.

Work and drawing take turns as they would on one thread: `advance` waits for the work that it starts. Only where
that takes much longer than its budget, because the driver compiles, does it return early. Until that work is done the
engine `is_busy`: it follows nothing, answers `NOT_YET`, and reports how long that has taken.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import moderngl
import numpy as np

from ...base.not_yet import NOT_YET, NotYet
from ...edit.live_inputs import LiveInputs
from ...edit.stored_photons import StoredPhotons
from ...gpu import shader
from ...gpu.context import Context
from ...gpu.context_thread import ContextThread, SteppedWork
from .building import COMPILING, PATIENCE_S
from .dirty_level import DirtyLevel
from .engine import LiveEngine
from .photon_queries import QUERIED_PHOTONS, CausticSpectrum
from .stats import LiveStats

T = TypeVar("T")

OVERRUN_S, OVERRUN_GPU_S = 0.15, 0.02
"""What work may take beyond its budget before the window is drawn without it, where the processor draws and where a
GPU does."""


class ThreadedEngine:
    """What a `LiveEngine` offers, for the thread of the window. `context` is the window's."""

    def __init__(
        self,
        context: Context,
        thread: ContextThread,
        make: Callable[[Context], LiveEngine] = LiveEngine,
    ) -> None:
        """`thread`, which is closed with the engine, has a context that shares `context`'s objects."""
        self.context, self._thread = context, thread
        self._engine = thread.run(lambda: make(thread.context))
        self._stepped: SteppedWork[None] = SteppedWork(thread)
        self._overrun_s = OVERRUN_S if context.is_software else OVERRUN_GPU_S
        self._work_began = 0.0
        self._is_released = False
        self._stats, self._inputs = self._engine.stats, self._engine.inputs
        self._version = self._engine.picture_version
        self._original: moderngl.Texture | None = None
        self._picture: moderngl.Texture | None = None
        """`_original` as the window's context knows it."""

    # ---- work --------------------------------------------------------------------------------

    @property
    def is_busy(self) -> bool:
        """It is still at earlier work; this frame, too, will be without news."""
        return self._stepped.is_under_way

    def advance(self, budget_s: float, interacting: bool = False) -> None:
        """As of a `LiveEngine`; returns without news where the driver compiles."""
        if not self.is_busy:
            self._work_began = time.perf_counter()
        self._stepped.step(lambda: self._advance(budget_s, interacting), budget_s + self._overrun_s)
        if self.is_busy:
            return
        self._stats, self._inputs = self._engine.stats, self._engine.inputs
        self._version = self._engine.picture_version

    def _advance(self, budget_s: float, interacting: bool) -> None:
        self._engine.advance(budget_s, interacting)
        self._engine.context.finish()  # what the window's context shows must be there

    def set(self, inputs: LiveInputs) -> DirtyLevel:
        """As of a `LiveEngine`; a caller that finds it busy calls again in the next frame."""
        return DirtyLevel.NOTHING if self.is_busy else self._thread.run(lambda: self._engine.set(inputs))

    def retrace(self) -> None:
        """As of a `LiveEngine`; while it is busy, after what it is at."""
        self._thread.submit(self._engine.retrace)

    def rebuild(self) -> None:
        """As of a `LiveEngine`; waits until all is compiled."""
        self._stepped.finish()
        self._thread.run(self._engine.rebuild)

    def release(self) -> None:
        """End the work and free everything (once); waits for the driver."""
        if self._is_released:
            return
        self._is_released = True
        try:
            self._stepped.finish()
        finally:
            self._forget_picture()
            try:
                self._thread.run(self._engine.release)
            finally:
                self._thread.close()

    def _answer(self, question: Callable[[], T]) -> T | NotYet:
        """What the engine answers on its thread."""
        return NOT_YET if self.is_busy else self._thread.run(question)

    # ---- settings ------------------------------------------------------------------------------

    @property
    def playing(self) -> bool:
        """As of a `LiveEngine`."""
        return self._engine.playing

    @playing.setter
    def playing(self, playing: bool) -> None:
        if not self.is_busy:
            self._engine.playing = playing

    @property
    def refine_when_still(self) -> bool:
        """As of a `LiveEngine`."""
        return self._engine.refine_when_still

    @refine_when_still.setter
    def refine_when_still(self, refines: bool) -> None:
        if not self.is_busy:
            self._engine.refine_when_still = refines

    @property
    def target_photons(self) -> int:
        """As of a `LiveEngine`."""
        return self._engine.target_photons

    @target_photons.setter
    def target_photons(self, photons: int) -> None:
        if not self.is_busy and photons != self._engine.target_photons:
            self._engine.target_photons = photons

    # ---- what there is -----------------------------------------------------------------------

    @property
    def picture(self) -> moderngl.Texture | None:
        """As of a `LiveEngine`, in the window's context; None also while it is busy and may be drawing it."""
        if self.is_busy:
            return None
        original = self._engine.picture
        if original is not self._original:
            self._forget_picture()
            self._original = original
            if original is not None:
                self._picture = self.context.ctx.external_texture(
                    original.glo, original.size, original.components, 0, original.dtype
                )
        return self._picture

    def _forget_picture(self) -> None:
        shader.release(self._picture)
        self._picture = self._original = None

    @property
    def is_idle(self) -> bool:
        """As of a `LiveEngine` after its last work."""
        return self._stats.converged and not self.is_busy

    @property
    def picture_version(self) -> int:
        """As of a `LiveEngine`."""
        return self._version

    @property
    def problem(self) -> str | None:
        """As of a `LiveEngine`."""
        return self._engine.problem

    @property
    def inputs(self) -> LiveInputs | None:
        """As of a `LiveEngine`."""
        return self._inputs

    @property
    def stats(self) -> LiveStats:
        """As of a `LiveEngine`; while it is busy those of before, with what is compiled now."""
        if not self.is_busy:
            return self._stats
        waited_s = time.perf_counter() - self._work_began
        stats = replace(self._stats, differs=self._engine.differs, converged=False)
        if waited_s < PATIENCE_S and not stats.preparing:
            return stats
        preparing = self._engine.building_at or stats.preparing or COMPILING
        before_s = stats.preparing_s if stats.preparing else 0.0
        return replace(stats, preparing=preparing, preparing_s=before_s + waited_s)

    def stored_photons(self, limit: int = QUERIED_PHOTONS) -> StoredPhotons | NotYet:
        """As of a `LiveEngine`."""
        return self._answer(lambda: self._engine.stored_photons(limit))

    def caustic_spectrum(self, receiver: int, position: np.ndarray) -> CausticSpectrum | NotYet:
        """As of a `LiveEngine`."""
        return self._answer(lambda: self._engine.caustic_spectrum(receiver, position))


Engine = LiveEngine | ThreadedEngine
"""What a viewer may draw with."""
