"""What a whole frame costs where every photon is traced anew: the figure that real-time programs are compared by."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..features.features import Features
from ..gpu import shader
from ..model.settings import RenderSettings
from ..passes.camera import CameraPass
from ..render.device_scene import scene_buffers
from ..render.light_pass import LightPass
from ..render.photon_batches import traced_besides

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..model.scene import Scene

T = TypeVar("T")
_RUNS, _PATIENCE_S = 21, 1.0
"""Of each measurement at most; none is begun after so many seconds, but for the first three."""
SCHEDULES = {f"{each}, then all": (each,) * (32 // each) + (4096,) for each in (1, 4, 8)} | {"1, in order": ()}
"""By name: `DeviceTraits.ray_events`."""


@dataclass(frozen=True)
class FrameCost:
    """Of one frame, s by the wall clock; nothing within a stage is waited for."""

    photons: int
    splats: int
    trace: float
    """Of the same photons alone."""
    light: float
    """Photons traced and in the maps."""
    camera: float
    """One sample a pixel."""
    slow: float = 0.0
    """A whole frame that a twentieth takes longer than."""
    runs: int = 1

    @property
    def all(self) -> float:
        """The whole frame."""
        return self.light + self.camera

    @property
    def figures(self) -> dict[str, float]:
        """With units in their names."""
        spent = {"frame_ms": self.all, "light_ms": self.light, "trace_ms": self.trace, "camera_ms": self.camera}
        times = {name: _ms(s) for name, s in (spent | {"frame_p95_ms": self.slow}).items()}
        return {"photons": self.photons, "splats": self.splats, **times, "runs": self.runs}


def _ms(seconds: float) -> float:
    return round(1e3 * seconds, 3)


def _spread(spent: Sequence[float]) -> dict[str, float]:
    """Of seconds."""
    return {"ms": _ms(float(np.median(spent))), "p95_ms": _ms(float(np.percentile(spent, 95))), "runs": len(spent)}


def repeated(run: Callable[[int], T]) -> list[T]:
    """What `run` of 1, 2, … gives; that of 0 only warms up."""
    run(0)
    found, started = [run(1)], time.perf_counter()
    while len(found) < 3 or (len(found) < _RUNS and time.perf_counter() - started < _PATIENCE_S):
        found.append(run(len(found) + 1))
    return found


def photons_within(costs: Sequence[FrameCost], seconds: float, with_camera: bool) -> int:
    """Photons whose light, or whole frame, takes so many `seconds`, by the straight line through the two `costs` of
    different photons that are nearest to it; 0 where none do."""
    photons = np.array([cost.photons for cost in costs], float)
    spent = np.array([cost.all if with_camera else cost.light for cost in costs])
    order = np.argsort(photons)
    photons, spent = photons[order], spent[order]
    at = int(np.clip(np.searchsorted(spent, seconds), 1, len(spent) - 1))
    slope = max(spent[at] - spent[at - 1], 1e-9) / (photons[at] - photons[at - 1])
    return max(0, int(photons[at - 1] + (seconds - spent[at - 1]) / slope))


@contextmanager
def _light(context: Context, scene: Scene, settings: RenderSettings) -> Iterator[LightPass]:
    """A light pass of `scene`, with what is done once for a scene (pilots, tables) done."""
    settings = replace(settings, method="srd-photons", max_depth=scene.render.max_depth)
    buffers = scene_buffers(context, scene, settings)
    light = LightPass(context, scene, settings, Features.of(scene, settings), buffers)
    try:
        light.prepare()
        yield light
    finally:
        shader.release(light, buffers)


def measure(context: Context, scene: Scene, size: tuple[int, int], photons: Sequence[int]) -> Iterator[FrameCost]:
    """For each number of `photons`, by photons alone: the median of frames with maps fitted to a picture of `size`
    and one camera sample a pixel. What is done once for a scene is left out."""
    with _light(context, scene, RenderSettings(width=size[0], height=size[1])) as light:
        camera = CameraPass(context, light.buffers, "beauty", light.shown.reflectances, light.shown.channels)
        try:
            for count in photons:
                frames = repeated(partial(_frame, context, light, camera, size, count))
                frames.sort(key=lambda cost: cost.all)
                slow = float(np.percentile([cost.all for cost in frames], 95))
                yield replace(frames[len(frames) // 2], slow=slow, runs=len(frames))
        finally:
            camera.release()


def trace_rates(
    context: Context, scene: Scene, photons: int, batches: Sequence[int]
) -> Iterator[tuple[str, dict[str, float]]]:
    """Tracing `photons` alone, so many at once and by each of `SCHEDULES`."""
    traits = context.traits
    try:
        for name, ray_events in {"the device's own": traits.ray_events, **SCHEDULES}.items():
            context.traits = replace(traits, ray_events=ray_events)
            for batch in batches:
                with _light(context, scene, RenderSettings(width=480, height=270, batch=batch)) as light:
                    light.begin(photons, 1)
                    spent = repeated(partial(_trace, context, light, photons))
                figures = {"batch": batch, "photons": photons, "landed": spent[0][1]}
                yield f"events a dispatch: {name}", figures | _spread([seconds for seconds, _ in spent])
    finally:
        context.traits = traits


def _trace(context: Context, light: LightPass, photons: int, _run: int = 0) -> tuple[float, int]:
    landed = 0

    def keep(_buffer: object, count: int, *_: object) -> None:
        nonlocal landed
        landed += count

    context.finish()
    started = time.perf_counter()
    for _ in traced_besides(light.trace, 1, light.plans, photons, keep):
        pass
    context.finish()
    return time.perf_counter() - started, landed


def camera_costs(
    context: Context, scene: Scene, size: tuple[int, int], caps_s: Sequence[float]
) -> Iterator[dict[str, float]]:
    """A camera sample a pixel where no dispatch shall take longer than each of `caps_s`."""
    with _light(context, scene, RenderSettings(width=size[0], height=size[1])) as light:
        light.begin(1 << 14, 1)
        light.run_pass(0, 1 << 14, lambda _: True)
        light.maps.atlas.flush()
        camera = CameraPass(context, light.buffers, "beauty", light.shown.reflectances, light.shown.channels)
        try:
            maps = light.caustic_maps()

            def sample(seed: int) -> tuple[float, int]:
                context.finish()
                started = time.perf_counter()
                pauses = sum(1 for _ in camera.samples(scene.camera, *size, 1, seed, maps, 1))
                context.finish()
                return time.perf_counter() - started, pauses

            for cap in caps_s:
                camera.dispatch_seconds = cap
                spent = repeated(sample)
                yield {"cap_ms": _ms(cap), **_spread([seconds for seconds, _ in spent]), "pauses": spent[-1][1]}
        finally:
            camera.release()


def _frame(
    context: Context, light: LightPass, camera: CameraPass, size: tuple[int, int], photons: int, seed: int
) -> FrameCost:
    light.begin(photons, seed)
    trace, _ = _trace(context, light, photons)
    before = light.stats.photons, light.stats.splats
    started = time.perf_counter()
    for _ in light.pass_steps(0, photons):
        pass
    light.maps.atlas.flush()
    context.finish()
    lit = time.perf_counter()
    for _ in camera.samples(light.scene.camera, *size, 1, 0, light.caustic_maps(), seed):
        pass
    context.finish()
    emitted, splats = light.stats.photons - before[0], light.stats.splats - before[1]
    return FrameCost(emitted, splats, trace, lit - started, time.perf_counter() - lit)
