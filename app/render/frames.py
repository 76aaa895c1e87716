"""Pictures of a stage that changes, frame after frame, keeping what stays: for animations and other work beside the
window.

Where only the camera moves, photons are traced once: caustic maps do not depend on it. Where light changes,
every frame is traced anew with the same counters, and maps are fitted once to all frames, so that what
stands still in the scene stands still in the pictures, to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..edit.live_inputs import LiveInputs
from ..edit.parameters import Stage
from ..gpu.context import Context
from ..gpu.scene_buffers import GpuSpace, SceneBuffers
from ..model.features import Features
from ..model.optics.glass import Dispersion
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Camera, Scene
from ..model.settings import RenderSettings
from ..passes.camera import CameraPass, CausticMaps
from ..passes.pilot import Pilot
from ..passes.trace import Band
from .light_pass import LightPass, spectral_axis
from .light_plan import LightPlan
from .viewer.dirty_level import DirtyLevel
from .viewer.invalidation import dirty_level
from .viewer.live_camera import solo_scene

DEFAULT_SAMPLES = 16
"""Camera samples a pixel."""
_SURVEYED = 5
"""Frames whose pilots tell where maps are needed."""
_WIDE_DEG = 150.0
_LIGHT_SHARE = 0.8
"""Of a frame's progress, where its light is traced."""


@dataclass(frozen=True)
class _Survey:
    """What one frame needs: where its light landed and into how many sub-lattices it is divided."""

    space: GpuSpace
    pilots: tuple[Pilot, ...]
    glasses: tuple[Dispersion, ...]
    counts: dict[int, tuple[int, int]]
    """Spectral bands and points of each light."""


class _FramedLight(LightPass):
    """Maps and lattices fitted to several frames, so that neither changes from one to the next."""

    surveys: Sequence[_Survey] = ()
    view: Camera | None = None

    def lay_out(self, camera: Camera) -> None:
        """Maps for all landings, as `view` sees them."""
        own = self.pilots
        space = self.buffers.space
        everywhere = [(space, pilot) for pilot in own.values()] + [
            (s.space, pilot) for s in self.surveys for pilot in s.pilots
        ]
        self.pilots = {i: _landings(pilot, at, space) for i, (at, pilot) in enumerate(everywhere)}
        super().lay_out(self.view or camera)
        self.pilots = own

    def begin(self, photons: int, seed: int) -> None:
        """As in `LightPass`, with the finest division that any frame asks for."""
        super().begin(photons, seed)
        self.plans = [self._divided(plan) for plan in self.plans]
        for plan in self.plans:
            name = self.scene.lights[plan.index].name
            self.stats.bands[name], self.stats.light_points[name] = len(plan.bands), plan.light_points
        limits = {plan.index: [(b.x_lo, b.x_hi) for b in plan.bands] for plan in self.plans}
        spans = [limits.get(i, [(0.0, 1.0)]) for i in range(len(self.scene.lights))]
        if spans != self._spans:
            self.tables.release()
            self._spans, self._tables = spans, self._tables_of(spans)

    def _divided(self, plan: LightPlan) -> LightPlan:
        needs = [s.counts[plan.index] for s in self.surveys if plan.index in s.counts]
        count = max([len(plan.bands), *(bands for bands, _ in needs)])
        points = max([plan.light_points, *(points for _, points in needs)])
        bands = plan.bands
        if count > len(bands) and self.features.spectral_groups:
            power = self.buffers.light_power[plan.index]
            edges = np.linspace(bands[0].x_lo, bands[-1].x_hi, count + 1).tolist()
            bands = tuple(Band(lo, hi, 0.5 * (lo + hi), float(power.band(lo, hi)[3])) for lo, hi in pairwise(edges))
        return replace(plan, bands=bands, light_points=points)


class FrameRenderer:
    """Owns what frames share. Run `steps(stage)` to its end, then read."""

    def __init__(self, context: Context, settings: RenderSettings, stages: Sequence[Stage]) -> None:
        """`stages`: what will be asked for; maps and lattices are fitted to some of them.

        Where light changes, `shader.keep_programs` on the context spares compiling every frame's programs."""
        self._context = context
        self._shown: LiveInputs | None = None
        self._buffers: SceneBuffers | None = None
        self.light: LightPass | None = None
        self._camera_pass: CameraPass | None = None
        moves = any(s.camera != stages[0].camera for s in stages)
        # Light is traced once for all views, so no single one may decide what the programs leave out.
        self._settings = settings = replace(settings, any_view=settings.any_view or moves)
        self._view, self._map_settings = _map_view([s.camera for s in stages], settings)
        self._unsurveyed = self._distinct(stages)
        self._surveys: list[_Survey] = []
        self.traces = 0
        """How often photons were traced."""

    def steps(self, stage: Stage) -> Iterator[float]:
        """Render a frame, pausing with the share done."""
        yield from self._survey()
        inputs = self._inputs(stage)
        # A change of what is merely looked at may still concern the maps' records, so only a moved camera keeps the
        # light.
        if (
            self._shown is None
            or dirty_level(self._shown, self._shown, replace(inputs, camera=self._shown.camera)) != DirtyLevel.NOTHING
        ):
            yield from self._trace(stage)
        self._shown = inputs
        if self._settings.layer.startswith("map:"):
            return
        assert self.light is not None and self._camera_pass is not None
        light, settings, camera_pass = self.light, self._settings, self._camera_pass
        maps = CausticMaps(light.resolved_textures(), light.receivers, light.atlas.placements, light.map_scale)
        samples = _whole_cycles(camera_pass, settings.spp or DEFAULT_SAMPLES)
        # For every frame anew: a frame is a function of its own stage, whatever was drawn before it.
        if camera_pass.chooses:
            for _ in camera_pass.choosing_spectrum(stage.camera, settings.width, settings.height, samples, maps):
                yield _LIGHT_SHARE
        for share in camera_pass.samples(
            stage.camera, settings.width, settings.height, samples, 0, maps, settings.seed
        ):
            yield _LIGHT_SHARE + (1.0 - _LIGHT_SHARE) * share

    def run(self, stage: Stage) -> np.ndarray:
        """The whole frame at once: `rgb` of it."""
        for _ in self.steps(stage):
            pass
        return self.rgb()

    def rgb(self) -> np.ndarray:
        """Linear Rec.709, float32 (H, W, 3), row 0 on top, of the last frame."""
        assert self._camera_pass is not None
        return self._camera_pass.read_rgb()

    def spectral(self) -> tuple[np.ndarray, np.ndarray]:
        """Radiance per bin (H, W, bins) and the bins' edges (nm), with `RenderSettings.bins`."""
        assert self._camera_pass is not None and self.light is not None and self.light.bin_edges_nm is not None
        return self._camera_pass.read_spectral(), self.light.bin_edges_nm

    def release(self) -> None:
        """Free everything but the context's programs."""
        for owned in (self._camera_pass, self.light, self._buffers):
            if owned is not None:
                owned.release()
        self._camera_pass = self.light = self._buffers = self._shown = None

    def _inputs(self, stage: Stage) -> LiveInputs:
        s = self._settings
        return LiveInputs(
            stage.scene, stage.camera, s.width, s.height, s.method, s.smoothing, stage.solo_nm, s.local_gain, s.seed
        )

    def _distinct(self, stages: Sequence[Stage]) -> list[Stage]:
        """Stages, evenly spread, whose light differs; none where all share it, for then a frame's own pilot says
        everything."""
        found: list[Stage] = []
        for index in np.unique(np.linspace(0, len(stages) - 1, _SURVEYED).astype(int)):
            new = self._inputs(stages[index])
            old = [replace(self._inputs(s), camera=new.camera) for s in found]
            if all(dirty_level(o, o, new) != DirtyLevel.NOTHING for o in old):
                found.append(stages[index])
        return found if len(found) > 1 else []

    def _survey(self) -> Iterator[float]:
        while self._unsurveyed:
            light, buffers = self._made(self._unsurveyed[0])
            try:
                for _ in light.preparing():
                    yield 0.0
                light.begin(self._photons(light.scene), self._settings.seed)
                counts = {plan.index: (len(plan.bands), plan.light_points) for plan in light.plans}
                self._surveys.append(_Survey(buffers.space, tuple(light.pilots.values()), buffers.axis.glasses, counts))
            finally:
                light.release()
                buffers.release()
            self._unsurveyed.pop(0)

    def _trace(self, stage: Stage) -> Iterator[float]:
        self.release()
        self.light, self._buffers = light, buffers = self._made(stage)
        light.surveys = self._surveys
        for _ in light.preparing():
            yield 0.0
        photons = self._photons(stage.scene)
        light.begin(photons, self._settings.seed)
        for step in light.pass_steps(0, photons):
            yield _LIGHT_SHARE * step.fraction
        light.finish()
        self.traces += 1
        self._camera_pass = CameraPass(
            self._context, buffers, self._settings.layer, light.reflectances, light.map_channels
        )

    def _photons(self, scene: Scene) -> int:
        return self._settings.photons or scene.render.photons

    def _axis(self, scene: Scene, features: Features) -> SpectralAxis:
        """One axis for all frames: bands of equal places on it are then the same wavelengths in all."""
        own = spectral_axis(scene, features)
        glasses = [glass for survey in self._surveys for glass in survey.glasses]
        return SpectralAxis.build(glasses) if own.glasses and glasses else own

    def _made(self, stage: Stage) -> tuple[_FramedLight, SceneBuffers]:
        scene = lit(stage)
        features = Features.of(scene, self._map_settings)
        buffers = SceneBuffers(self._context.ctx, scene, features, self._axis(scene, features))
        light = _FramedLight(self._context, scene, self._map_settings, features, buffers)
        light.view = self._view
        return light, buffers


def _whole_cycles(camera_pass: CameraPass, samples: int) -> int:
    """`samples` or a few more, in which every band of the spectrum has its turn equally often, however many bands a
    frame chooses:
    all frames then have as many samples, and what stands still in them stays."""
    cycle = camera_pass.fixed_bands or (1 << (samples.bit_length() - 1) if camera_pass.chooses else 1)
    return -(-samples // cycle) * cycle


def lit(stage: Stage) -> Scene:
    """The scene as the camera of `stage` sees it, with the light of one wavelength only where it says so."""
    return replace(solo_scene(stage.scene, stage.solo_nm), camera=stage.camera)


def _map_view(cameras: Sequence[Camera], settings: RenderSettings) -> tuple[Camera | None, RenderSettings]:
    """The view that maps are fitted to, and the settings whose size belongs to it: a camera that moves
    gets one that sees everything, with pixels as small as those of the nearest."""
    first = cameras[0]
    if settings.layer.startswith("map:") or all(camera == first for camera in cameras):
        return None, settings
    nearest = min(
        cameras,
        key=lambda c: (
            np.linalg.norm(np.subtract(c.position, c.target))
            * (c.vertical_extent if c.kind == "orthographic" else math.tan(math.radians(0.5 * c.vertical_fov_deg)))
        ),
    )
    if nearest.kind == "orthographic":
        factor, view = 8.0, replace(nearest, vertical_extent=8.0 * nearest.vertical_extent)
    else:
        factor = math.tan(math.radians(0.5 * _WIDE_DEG)) / math.tan(math.radians(0.5 * nearest.vertical_fov_deg))
        view = replace(nearest, vertical_fov_deg=max(_WIDE_DEG, nearest.vertical_fov_deg))
        factor = max(factor, 1.0)
    return view, replace(settings, width=round(factor * settings.width), height=round(factor * settings.height))


_LANDING = np.dtype([("position", "f4", 3), ("flux_w", "f4"), ("receiver", "u4")])
"""What maps are fitted to; the records of two frames may differ in their columns."""


def _landings(pilot: Pilot, old: GpuSpace, new: GpuSpace) -> Pilot:
    """Only the landings of `pilot`, in another frame's GPU space."""

    def moved(records: np.ndarray) -> np.ndarray:
        found = np.zeros(len(records), _LANDING)
        found["position"] = (
            records["position"] if old is new else new.to_gpu(old.to_world(records["position"].astype(float)))
        )
        found["flux_w"], found["receiver"] = records["flux_w"], records["receiver"]
        return found

    return replace(
        pilot, whole=moved(pilot.whole), spectral=[moved(r) for r in pilot.spectral], rim=[moved(r) for r in pilot.rim]
    )
