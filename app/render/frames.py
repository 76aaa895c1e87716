"""A frame, top to bottom: Scene → Features → buffers → light pass → camera pass → picture. Stills, animations, bakes
and exports drive it; the scene comes from its file, or is what a window shows.

What one frame has in common with the next is kept. Where only the camera moves, photons are traced once: caustic maps
do not depend on it. Where light changes, every frame is traced anew with the same counters, and maps are fitted once to
all frames (`FrameFit`), so that what does not move in the scene does not move in the pictures, to the bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..edit.live_inputs import LiveInputs
from ..edit.parameters import Stage
from ..features.features import Features
from ..gpu import shader
from ..gpu.context import Context
from ..gpu.scene_buffers import SceneBuffers
from ..model.flat_faces import with_flat_faces
from ..model.optics.spectral_tables import SpectralAxis
from ..model.panorama_lights import with_panorama_lights
from ..model.scene import Camera, Scene
from ..model.settings import RenderSettings
from ..passes.bounce_light import LEAST_DIRECTIONS as LEAST_OF_BOUNCES
from ..passes.bounce_light import BounceLightPass
from ..passes.camera import CameraPass
from ..passes.caustic_maps import CausticMaps
from ..passes.environment_light import LEAST_DIRECTIONS, EnvironmentLightPass
from ..passes.map_layout import MapLayout
from .device_scene import scene_buffers, spectral_axis
from .frame_fit import FrameFit, Survey, inputs_of, share_light, stages_to_survey
from .frame_progress import FrameProgress
from .light_pass import LightPass
from .map_picture import map_picture
from .memory_estimate import MemoryEstimate, check_room, estimate
from .sampling import CameraSampling, LightSampling, camera_settings, has_own_method
from .solo import scene_seen
from .time_budget import TimeBudget
from .traced_light import traced_light

_ENVIRONMENT_SHARE = 0.25
"""Share of a timed rendering, at most, for the light of the environment."""
_BOUNCES_SHARE = 0.15
"""Share of a timed rendering, at most, for what receivers give to each other."""
_PREPARING, _TRACING, _SEEING = "preparing", "tracing photons", "taking camera samples"
_GATHERING = "gathering the environment's light"
_BOUNCING = "gathering what surfaces give to each other"

Stop = Callable[[], bool]
Fill = Callable[[LightPass, LightSampling, Stop], Iterator[float]]
"""Fills the maps of a prepared light pass, pausing with the share done."""


@dataclass(frozen=True)
class Picture:
    """A finished frame."""

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709, lm/(sr unit²) for white; top row first."""
    spectral: np.ndarray | None = None
    """float32 (H, W, bins), W/(sr unit²) per bin, or None."""
    bin_edges_nm: np.ndarray | None = None


@dataclass
class Traced:
    """What frames share as long as their light does. Owns it."""

    inputs: LiveInputs
    buffers: SceneBuffers
    light: LightPass
    environment: EnvironmentLightPass | None = None
    """None where the scene's features lack it."""
    bounces: BounceLightPass | None = None
    """None where the scene's features lack them."""
    camera_buffers: SceneBuffers | None = None
    """The camera's own, where it has a method of its own."""
    camera_pass: CameraPass | None = None

    @property
    def maps(self) -> CausticMaps:
        """All light that surfaces get by way of maps."""
        known = self.bounces or self.environment
        return replace(self.light.caustic_maps(), environment=None if known is None else known.texture)

    def release(self) -> None:
        shader.release(self.camera_pass, self.bounces, self.environment, self.camera_buffers, self.light, self.buffers)


@dataclass
class FrameSeconds:
    """Where a frame's time went; the light pass counts its own."""

    prepare: float = 0.0
    camera: float = 0.0
    started: float = field(default_factory=time.perf_counter)


class FrameRenderer:
    """Owns what frames share. Run `steps(stage)` to its end, then read."""

    def __init__(
        self,
        context: Context,
        settings: RenderSettings,
        stages: Sequence[Stage],
        begun: float | None = None,
        fill: Fill | None = None,
        window: np.ndarray | None = None,
    ) -> None:
        """`stages`: what will be rendered; maps and lattices are fitted to some of them. `begun`: the
        `time.perf_counter()` from which `settings.seconds` count, which are those of one picture. `fill`: where light
        comes from, instead of `traced_light`. `window`: `MapFit.window` of a map's frames; None: the first one's own.

        Where light changes, `shader.keep_programs` on the context spares compiling every frame's programs."""
        self._context = context
        stages = [_as_rendered(s, settings) for s in stages]
        moves = any(s.camera != stages[0].camera for s in stages)
        # Light is traced once for all views, so no single one may decide what the programs leave out.
        self._settings = settings = replace(settings, any_view=settings.any_view or moves)
        self._fit = FrameFit.of(stages, settings)
        self._unsurveyed = list(stages_to_survey(stages, settings))
        self.window = window
        """Window of the map (`MapFit.window`), once one was rendered."""
        self.traced: Traced | None = None
        """Light and passes of the last frame."""
        self._budget: TimeBudget | None = None
        if settings.seconds is not None:
            self._budget = TimeBudget(settings.seconds, time.perf_counter() if begun is None else begun)
        self._fill = fill or traced_light
        self.phase = _PREPARING
        """What `steps` is at."""
        self.seconds = FrameSeconds()
        self._progress = FrameProgress()
        self.memory: MemoryEstimate | None = None
        """Expected of the last frame that was traced."""
        self.traces = 0
        """How often photons were traced."""

    # ---- the frame ---------------------------------------------------------------------------

    def steps(self, stage: Stage, stop: Stop = lambda: False) -> Iterator[float]:
        """Render a frame, pausing with the share done. What was done when `stop()` turned true is a picture too."""
        self.seconds, self.phase, self._progress = FrameSeconds(), _PREPARING, self._progress_of_camera()
        yield from self._survey()
        stage = _as_rendered(stage, self._settings)
        if self.traced is None or not share_light(self.traced.inputs, inputs_of(stage, self._settings)):
            yield from self._trace(stage, stop)
        if not self._shows_map:
            yield from self._see(stage, stop)

    def preparing(self, stage: Stage) -> Iterator[float]:
        """Make the light pass of `stage` ready to be traced by the caller: `light`, whose maps are empty."""
        yield from self._survey()
        self.release()
        stage = _as_rendered(stage, self._settings)
        self.traced = self._made(stage, inputs_of(stage, self._settings))
        for _ in self.traced.light.preparing():
            yield 0.0
        self.window = self.traced.light.map_window
        self.seconds.prepare = time.perf_counter() - self.seconds.started

    def _trace(self, stage: Stage, stop: Stop) -> Iterator[float]:
        """The light pass of `stage`, and the camera pass that sees it."""
        try:
            yield from self.preparing(stage)
            assert self.traced is not None
            traced, light = self.traced, self.traced.light
            sampling, budget = LightSampling.of(stage.scene, self._settings), self._budget
            if light.survey.domains:
                self._progress.expect_photons(sampling.photons)
            if traced.buffers.features.environment_lights:
                traced.environment = EnvironmentLightPass(self._context, traced.buffers, self._settings.seed)
                yield from self._gather(traced.environment, _GATHERING, _ENVIRONMENT_SHARE, LEAST_DIRECTIONS, stop)
            if not self._shows_map and (budget is not None or self._context.traits.compiles_ahead):
                # The driver can compile its programs while light is traced.
                self._add_camera_pass(traced)
            if budget is not None:
                if not self._shows_map:
                    assert traced.camera_pass is not None
                    traced.camera_pass.draw_haze(*self._view(stage))
                    yield from budget.measuring(traced.camera_pass, *self._view(stage), first=True)
                sampling = replace(sampling, seconds=budget.for_light(self._settings.spp))
            self.phase = _TRACING
            for share in self._fill(light, sampling, stop):
                yield self._share(self._progress.light(share))
            light.finish()
            light.settle()
            if traced.buffers.features.bounces:
                traced.bounces = bounces = BounceLightPass(
                    self._context, traced.buffers, traced.environment, self._settings.seed
                )
                bounces.take(light.scene, light.caustic_maps(), light.shown.channels)
                yield from self._gather(bounces, _BOUNCING, _BOUNCES_SHARE, LEAST_OF_BOUNCES, stop)
            if traced.camera_pass is None and not self._shows_map:
                self._add_camera_pass(traced)
        except BaseException:
            self.release()
            raise
        self.traces += 1

    def _gather(
        self, light: EnvironmentLightPass | BounceLightPass, phase: str, most: float, least: int, stop: Stop
    ) -> Iterator[float]:
        """Light of what is beyond everything, or of other receivers; a timed rendering (for `most` of its time) and
        one that is stopped take fewer directions, `least` at least."""
        self.phase = phase
        longest = float("inf") if self._settings.seconds is None else most * self._settings.seconds
        for share in light.steps():
            done = self._progress.light(1.0) if phase == _BOUNCING else self._progress.environment(share, light.seconds)
            yield self._share(done)
            if light.asked >= least and (light.seconds >= longest or stop()):
                break
        light.show()

    def _add_camera_pass(self, traced: Traced) -> None:
        """The camera pass of `traced`."""
        started = time.perf_counter()
        if has_own_method(self._settings):
            traced.camera_buffers = scene_buffers(self._context, traced.light.scene, camera_settings(self._settings))
        traced.camera_pass = self._pass_of(traced, self._settings.layer)
        self.seconds.camera = time.perf_counter() - started

    def _pass_of(self, traced: Traced, layer: str) -> CameraPass:
        buffers, shown = traced.camera_buffers or traced.buffers, traced.light.shown
        return CameraPass(self._context, buffers, layer, shown.reflectances, shown.channels)

    def _view(self, stage: Stage) -> tuple[Camera, int, int]:
        return stage.camera, self._settings.width, self._settings.height

    def _see(self, stage: Stage, stop: Stop) -> Iterator[float]:
        """The camera pass of `stage`."""
        assert self.traced is not None and self.traced.camera_pass is not None
        started, self.phase = time.perf_counter(), _SEEING
        settings, camera_pass = self._settings, self.traced.camera_pass
        maps = self.traced.maps
        view = self._view(stage)
        # Even after a stop while tracing there is to be a picture: only the first sample is taken then.
        stops_at_once, samples = stop(), 1
        budget = None if stops_at_once or settings.spp is not None else self._budget
        if not stops_at_once:
            sampling = CameraSampling.of(settings)
            if budget is not None:
                sampling = replace(sampling, budget=max(budget.samples(), 1))
            for _ in sampling.choosing(camera_pass, *view, maps):
                yield self._share(self._progress.camera(0.0))
            samples = sampling.samples(camera_pass)
        if budget is not None:
            yield from self._see_until(budget, stage, maps, stop)
            self.seconds.camera += time.perf_counter() - started
            return
        for share in camera_pass.samples(*view, samples, 0, maps, settings.seed):
            yield self._share(self._progress.camera(share))
            # A survey comes before the first sample: without it all is black, and without a turn of bands
            # colours are missing.
            turn = min(camera_pass.spectrum.bands, samples)
            if not stops_at_once and stop() and camera_pass.is_even and camera_pass.samples_taken >= turn:
                break
        self.seconds.camera += time.perf_counter() - started

    def _see_until(self, budget: TimeBudget, stage: Stage, maps: CausticMaps, stop: Stop) -> Iterator[float]:
        """Whole turns of samples until the time is over, one at least."""
        assert self.traced is not None and self.traced.camera_pass is not None
        camera_pass, view = self.traced.camera_pass, self._view(stage)
        if budget.samples():  # else there is nothing to decide
            yield from budget.measuring(camera_pass, *view, maps)
        turn, taken, started = camera_pass.spectrum.bands, 0, time.perf_counter()
        while (count := budget.samples(taken) // turn * turn) or not taken or budget.has_time_for_part(taken):
            if taken and not count and turn > 1:
                return  # part of a turn would lack colours
            count = max(count, turn)
            for _ in camera_pass.samples(*view, count, taken, maps, self._settings.seed):
                yield budget.spent
                if camera_pass.is_even and camera_pass.samples_taken >= turn and (budget.left <= 0.0 or stop()):
                    return
            taken += count
            budget.sample_s = (time.perf_counter() - started) / taken

    def _progress_of_camera(self) -> FrameProgress:
        """Progress of a frame whose light is there."""
        settings, progress = self._settings, FrameProgress()
        if not self._shows_map:
            progress.expect_samples(settings.width * settings.height * CameraSampling.of(settings).budget)
        return progress

    @property
    def phase_ends(self) -> float:
        """Progress at which the phase is done."""
        return self._progress.ends if self._budget is None else 1.0

    def _share(self, of_work: float) -> float:
        """Progress: of the time where that is given, else of the work."""
        return of_work if self._budget is None else self._budget.spent

    def steps_of_layer(self, layer: str, stage: Stage, stop: Stop = lambda: False) -> Iterator[float]:
        """Another layer ("beauty", "caustic") of the frame that `steps` rendered, from the same photons; `picture` is
        it then. To be called last: later frames would show this layer too."""
        traced = self.traced
        assert traced is not None and traced.camera_pass is not None, "steps() comes first, and not of a map"
        traced.camera_pass.release()
        traced.camera_pass = self._pass_of(traced, layer)
        yield from self._see(_as_rendered(stage, self._settings), stop)

    def run(self, stage: Stage) -> np.ndarray:
        """The whole frame at once: `rgb` of it."""
        for _ in self.steps(stage):
            pass
        return self.picture.rgb

    # ---- what there is -----------------------------------------------------------------------

    @property
    def light(self) -> LightPass:
        """Light pass of the last frame."""
        assert self.traced is not None, "steps() comes first"
        return self.traced.light

    @property
    def camera_pass(self) -> CameraPass | None:
        """Camera pass of the last frame; None for a map."""
        return self.traced.camera_pass if self.traced is not None else None

    @property
    def picture(self) -> Picture:
        """The last frame."""
        edges = self.light.bin_edges_nm
        camera_pass = self.camera_pass
        if camera_pass is None:
            return Picture(*map_picture(self.light), edges)
        return Picture(camera_pass.read_rgb(), None if edges is None else camera_pass.read_spectral(), edges)

    @property
    def _shows_map(self) -> bool:
        return self._settings.layer.startswith("map:")

    def release(self) -> None:
        """Free everything but the context's programs."""
        shader.release(self.traced)
        self.traced = None

    # ---- what frames share -------------------------------------------------------------------

    def _survey(self) -> Iterator[float]:
        while self._unsurveyed:
            stage = self._unsurveyed[0]
            traced = self._made(stage, inputs_of(stage, self._settings))
            try:
                for _ in traced.light.preparing():
                    yield 0.0
                sampling = LightSampling.of(stage.scene, self._settings)
                traced.light.begin(sampling.photons, sampling.seed)
                self._fit = replace(self._fit, surveys=(*self._fit.surveys, Survey.of(traced.light)))
            finally:
                traced.release()
            self._unsurveyed.pop(0)

    def _made(self, stage: Stage, inputs: LiveInputs) -> Traced:
        settings = self._fit.settings
        scene = scene_seen(stage.scene, stage.camera, stage.solo_nm)
        features = Features.of(scene, settings)
        buffers = SceneBuffers(self._context.ctx, scene, features, self._axis(scene, features))
        fit, division = replace(self._fit.maps(scene.camera), window=self.window), self._fit.division
        light = LightPass(self._context, scene, settings, features, buffers, fit=fit, division=division)

        def look_at_memory(layout: MapLayout) -> None:
            self.memory = estimate(light, layout, settings)
            check_room(self.memory, settings)

        light.before_maps = look_at_memory
        return Traced(inputs, buffers, light)

    def _axis(self, scene: Scene, features: Features) -> SpectralAxis:
        """One axis for all frames: bands of equal places on it are then the same wavelengths in all."""
        own = spectral_axis(scene, features)
        glasses = self._fit.glasses
        return SpectralAxis.build(glasses) if own.glasses and glasses else own


def _as_rendered(stage: Stage, settings: RenderSettings) -> Stage:
    """With the lights of its panorama, and flat faces apart unless a whole object's map is asked for."""
    scene = with_panorama_lights(stage.scene)
    scene = scene if settings.layer.startswith("map:") else with_flat_faces(scene)
    return stage if scene is stage.scene else replace(stage, scene=scene)
