"""The picture of the viewport: the engine's radiance, its exposure, and the 8-bit texture that is shown.

The only part of the host that touches the device. When the engine fails it is given up, what went wrong is
raised as `EngineError`, and `restart` makes a new one; the last picture stays.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..base.not_yet import NOT_YET, NotYet
from ..edit.state import State
from ..edit.stored_photons import StoredPhotons, index_in, photons_in
from ..gpu.shader import ShaderError
from ..passes.display import Display
from ..passes.glare import Glare
from ..passes.sample_picture import SamplePicture
from ..render.viewer.dirty_level import DirtyLevel
from ..render.viewer.stats import LiveStats
from .auto_exposure import AutoExposure
from .screenshot import pixel_of, read_pixel

if TYPE_CHECKING:
    import moderngl

    from ..gpu.context import Context
    from ..model.scene import Scene, Vec3
    from ..render.viewer.photon_queries import CausticSpectrum
    from ..render.viewer.threaded_engine import Engine
    from .compare import Comparison


class EngineError(RuntimeError):
    """The engine stopped: a bug, or the device is lost. `__cause__` is what happened."""


Stops = Callable[[], bool]
_SHADER_FILE = re.compile(r"\.(comp|vert|frag|glsl)\b")


class LivePicture:
    """Owns the engine and what shows its picture."""

    def __init__(self, context: Context, make_engine: Callable[[Context], Engine] | None = None) -> None:
        self._context = context
        self._make_engine = make_engine or _live_engine
        self.engine: Engine | None = self._make_engine(context)
        self._display = Display(context)
        self._glare = Glare(context)
        self._sampler = SamplePicture(context)
        self._exposure = AutoExposure()
        self._size = (0, 0)
        self._reload_error: str | None = None
        self.stats = LiveStats(renderer=context.renderer, is_software=context.is_software, device_advice=context.advice)
        """The engine's, as of the last frame."""
        self._developed: tuple[object, ...] | None = None
        """What `shown` was made of."""
        self.shown: moderngl.Texture | None = None
        """RGBA8, sRGB codes, row 0 on top."""
        self.magnified: moderngl.Texture | None = None
        self.seen: Scene | None = None
        """The scene that the picture really shows."""
        self.awaits_scene = False
        """Another document was opened and nothing of it has been drawn: its objects' outlines, rays and marks would be
        drawn on the picture of what was there before."""
        self.exposure_ev = 0.0
        self.display_s = 0.0

    @property
    def radiance(self) -> moderngl.Texture | None:
        """The linear picture."""
        return self.engine.picture if self.engine is not None else None

    @property
    def is_busy(self) -> bool:
        """The driver compiles, and there is no news until it is done."""
        return self.engine is not None and self.engine.is_busy

    @property
    def is_presentable(self) -> bool:
        """It shows what is wanted, whole, if with few photons."""
        stats = self.stats
        lacks = self.shown is None or self.radiance is None or stats.differs or stats.preparing
        return not lacks and stats.resolution_scale == 1.0

    @property
    def problem(self) -> str | None:
        """Why the engine could not follow the last change; it shows what was before."""
        return self.engine.problem if self.engine is not None else None

    @property
    def shader_error(self) -> str | None:
        """A shader on disk that does not compile, with file and line; the last good programs go on."""
        problem = self._reload_error or self.problem
        return problem if problem is not None and _SHADER_FILE.search(problem) else None

    def resize(self, state: State, other: Comparison | None = None) -> None:
        """Give the shown texture the size of `state`'s viewport, for the frame that begins.

        Only between frames: a texture that imgui is about to draw must not be made anew. While the engine is busy the
        one that is shown keeps its size.
        """
        if state.viewport_size == self._size or (self.radiance is None and self.shown is not None):
            return
        self._size = state.viewport_size
        if self.radiance is not None:
            self._develop(state, self.radiance, other)

    def give_up(self) -> None:
        """Do without an engine until `restart`; the last picture stays."""
        failed, self.engine = self.engine, None
        if failed is not None:
            with suppress(Exception):  # it has failed, and perhaps the device with it
                failed.release()

    def restart(self) -> None:
        """A new engine."""
        self.give_up()
        self.engine = self._make_engine(self._context)

    def reload_shaders(self) -> None:
        """Compile from disk again, while the last good programs go on (`shader_error` says what fails). Raises
        `EngineError`."""
        if self.engine is None:
            self.restart()
            return
        self._reload_error = None
        try:
            with self._guarded():
                self.engine.rebuild()
            self._display.reload()
            self._developed = None
        except ShaderError as error:
            self._reload_error = str(error)

    def new_scene(self) -> None:
        """Another scene: its exposure is found at once."""
        self._exposure.restart()
        self.awaits_scene = True

    def advance(self, state: State, budget_s: float, slice_s: float = math.inf, stops: Stops = lambda: False) -> None:
        """Let the engine follow `state`. Raises `EngineError`.

        It works in slices of `slice_s`, the last of which is one that made another picture, had little to do, or after
        which `stops()` is true. Without a budget it works only on what has changed."""
        if self.engine is None:
            return
        with self._guarded():
            self.engine.playing = state.playing
            self.engine.target_photons = state.preferences.target_photons
            self.engine.refine_when_still = state.preferences.refine_when_still
            if self.engine.set(state.live_inputs) != DirtyLevel.NOTHING:
                budget_s = min(budget_s or slice_s, slice_s)  # what is under way has to learn of it
            elif budget_s <= 0.0:
                return
            self.stats = self._advance(self.engine, state.interacting, budget_s, slice_s, stops)
            if not self.is_busy:
                self.awaits_scene &= self.stats.shows_other and self.problem is None
                self.seen = self.seen if self.stats.shows_other else self.shown_scene

    @staticmethod
    def _advance(engine: Engine, interacting: bool, budget_s: float, slice_s: float, stops: Stops) -> LiveStats:
        """The engine's stats, with what all slices together took."""
        version, started = engine.picture_version, time.perf_counter()
        trace_s = splat_s = resolve_s = camera_s = 0.0
        while True:
            begun = time.perf_counter()
            given = min(slice_s, max(budget_s - (begun - started), 0.5 * min(slice_s, budget_s)))
            engine.advance(given, interacting)
            stats = engine.stats
            trace_s, splat_s = trace_s + stats.trace_s, splat_s + stats.splat_s
            resolve_s, camera_s = resolve_s + stats.resolve_s, camera_s + stats.camera_s
            now = time.perf_counter()
            ends = now - started > budget_s - 0.5 * min(slice_s, budget_s) or now - begun < 0.5 * given
            ends |= engine.is_busy or engine.picture_version != version or stats.converged
            if ends or stops():
                return replace(stats, trace_s=trace_s, splat_s=splat_s, resolve_s=resolve_s, camera_s=camera_s)

    def show(self, state: State, now_s: float, delta_s: float, other: Comparison | None = None) -> None:
        """Develop the engine's picture for the screen."""
        radiance = self.radiance
        if radiance is None or min(self._size) < 1:
            return
        started = time.perf_counter()
        self._expose(state, radiance, now_s, delta_s)
        self._develop(state, radiance, other)
        self.magnified = None
        if state.display.magnifier and state.hover is not None:
            pixel = pixel_of(state.hover, radiance.size)
            self.magnified = self._display.magnify(
                radiance, pixel, state.display, self.exposure_ev, antialias=_antialiases(state, other)
            )
        self.display_s = time.perf_counter() - started

    def _develop(self, state: State, radiance: moderngl.Texture, other: Comparison | None) -> None:
        texture = other.picture if other is not None else None
        version = self.engine.picture_version if self.engine is not None else -1
        # What is compared or measured is data.
        is_data = texture is not None or state.display.false_colour
        glare = 0.0 if is_data else state.scene.render.glare
        antialias = _antialiases(state, other)
        halo = glare, glare > 0.0 and state.interacting
        key = (id(radiance), version, state.display, halo, antialias, self.exposure_ev, self._size, state.compare)
        if texture is None and self.shown is not None and key == self._developed:
            return
        self._developed = None if texture is not None else key
        joins = glare > 0.0 and state.interacting and not antialias and radiance.size == self._size
        scattered = self._glare.halo(radiance, glare, in_motion=True) if joins else None
        radiance = radiance if joins else self._glare.run(radiance, glare, in_motion=state.interacting)
        look = state.display, self.exposure_ev, self._size
        self.shown = self._display.run(radiance, *look, texture, state.compare, antialias, halo=scattered)

    def _expose(self, state: State, radiance: moderngl.Texture, now_s: float, delta_s: float) -> None:
        if not state.display.auto_exposure:
            self.exposure_ev = state.display.exposure_ev
            return
        if self.awaits_scene:  # the picture is still another scene's
            return
        measured = self._exposure.follow(lambda: self._sampler.run(radiance), now_s, delta_s)
        self.exposure_ev = measured + state.scene.render.exposure_ev

    @property
    def shown_scene(self) -> Scene | None:
        """What the picture shows, or is about to."""
        inputs = self.engine.inputs if self.engine is not None else None
        return None if inputs is None else inputs.scene

    def stored_photons(self, scene: Scene, limit: int) -> StoredPhotons | NotYet:
        """The engine's, which met objects of `scene`."""
        shown = self.shown_scene
        photons = NOT_YET if self.engine is None else self.engine.stored_photons(limit)
        return photons if isinstance(photons, NotYet) or shown is None else photons_in(scene, shown, photons)

    def caustic_spectrum(self, scene: Scene, receiver: int, position: np.ndarray) -> CausticSpectrum | NotYet:
        """The engine's, at a world position on object `receiver` of `scene`."""
        shown = self.shown_scene
        index = None if shown is None else index_in(shown, scene, receiver)
        return NOT_YET if self.engine is None or index is None else self.engine.caustic_spectrum(index, position)

    @property
    def is_settling(self) -> bool:
        """The exposure is still on its way."""
        return self._exposure.is_moving

    def pixel(self, place: tuple[float, float]) -> Vec3 | None:
        """Radiance at a place of the picture, 0..1 from the top left."""
        radiance = self.radiance
        return None if radiance is None else read_pixel(self._context, radiance, place)

    def release(self) -> None:
        """Free everything."""
        self.give_up()
        self._display.release()
        self._glare.release()
        self._sampler.release()

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """Turns what an engine should never raise into `EngineError`, and gives the engine up."""
        try:
            yield
        except ShaderError:
            raise
        except Exception as error:
            self.give_up()
            raise EngineError(str(error) or type(error).__name__) from error


def _antialiases(state: State, other: Comparison | None) -> bool:
    """What is compared or measured is data; while something is dragged a picture is better soon than fine."""
    is_data = state.display.false_colour or (other is not None and other.picture is not None)
    return state.scene.render.antialias_highlights and not is_data and not state.interacting


def _live_engine(context: Context) -> Engine:
    from ..render.viewer.engine import LiveEngine

    return LiveEngine(context)
