"""What a whole frame costs where every photon is traced anew: the figure that real-time programs are compared by."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..features.features import Features
from ..model.settings import RenderSettings
from ..passes.camera import CameraPass
from ..render.device_scene import scene_buffers
from ..render.light_pass import LightPass
from ..render.splatting import Pace

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..model.scene import Scene

_FRAMES = 4
"""The first one compiles."""


@dataclass(frozen=True)
class FrameCost:
    """Of one frame, s by the wall clock with the device finished after every stage."""

    photons: int
    splats: int
    trace: float
    splat: float
    camera: float
    device: dict[str, float] = field(default_factory=dict)
    """Of the same, by the device's own timers; empty where these do not work."""

    @property
    def all(self) -> float:
        """The whole frame."""
        return self.trace + self.splat + self.camera

    @property
    def line(self) -> str:
        """For people."""
        by_device = ", ".join(f"{name} {1e3 * spent:.2f}" for name, spent in self.device.items())
        return (
            f"{1e3 * self.all:.1f} ms: trace {1e3 * self.trace:.1f}, splat {1e3 * self.splat:.1f}, camera "
            f"{1e3 * self.camera:.1f}; {self.photons / max(self.trace, 1e-9) / 1e6:.2f} M photons/s traced, "
            f"{self.splats / max(self.splat, 1e-9) / 1e6:.2f} M splats/s"
            + (f"; by the device's timers, ms: {by_device}" if by_device else "")
        )


def measure(context: Context, scene: Scene, size: tuple[int, int], photons: int) -> FrameCost:
    """The best of a few frames of `photons` by photons alone, maps fitted to a picture of `size`, and one camera sample
    a pixel. What is done once for a scene (pilots, tables) is left out."""
    settings = RenderSettings(
        width=size[0], height=size[1], photons=photons, method="srd-photons", max_depth=scene.render.max_depth
    )
    buffers = scene_buffers(context, scene, settings)
    light = LightPass(context, scene, settings, Features.of(scene, settings), buffers, pace=Pace(True))
    camera: CameraPass | None = None
    try:
        light.prepare()
        camera = CameraPass(context, buffers, "beauty", light.reflectances, light.map_channels)
        frames = [_frame(context, light, camera, size, photons, seed) for seed in range(_FRAMES)]
    finally:
        for owned in (camera, light, buffers):
            if owned is not None:
                owned.release()
    return min(frames[1:], key=lambda cost: cost.all)


def _frame(
    context: Context, light: LightPass, camera: CameraPass, size: tuple[int, int], photons: int, seed: int
) -> FrameCost:
    light.begin(photons, seed)
    before = light.stats.photons, light.stats.splats, light.stats.trace_seconds
    on_device = dict(context.timers.seconds)
    context.finish()
    started = time.perf_counter()
    for _ in light.steps_until(0, photons, lambda: False):
        pass
    light.atlas.flush()
    context.finish()
    lit = time.perf_counter()
    for _ in camera.samples(light.scene.camera, *size, 1, 0, light.caustic_maps(), seed):
        pass
    context.finish()
    seen = time.perf_counter()
    trace = light.stats.trace_seconds - before[2]
    return FrameCost(
        light.stats.photons - before[0],
        light.stats.splats - before[1],
        trace,
        lit - started - trace,
        seen - lit,
        context.timers.since(on_device),
    )
