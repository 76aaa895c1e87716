"""The eye half of a live rendering: camera samples within a time budget, and the last picture worth showing.

A picture is published when every pixel has a whole sample. While something moves the picture is as small as one
sample in the time that is left asks for; once still it starts over in full size and is refined.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from app.gpu import shader
from app.passes.eye import CausticMaps, EyePass

if TYPE_CHECKING:
    import moderngl

    from app.gpu.context import Context
    from app.gpu.scene_buffers import SceneBuffers
    from app.model.scene import Camera, Scene

SCALES = (1.0, 0.5, 1 / 3, 0.25, 1 / 6, 0.125)
"""Sides of a picture in motion over the side asked for."""
DISPATCH_SECONDS = 0.008
SETTLED = 8
"""Samples at most that a better map waits for before its picture replaces the one shown."""
_FIRST_RATE = 0.5e6
"""Pixels per second before anything was measured: slow, so that the first picture comes at once."""


class LiveEye:
    """Owns the eye pass of the shown scene and the published picture."""

    def __init__(self, context: Context, target_samples: int = 32) -> None:
        self._context = context
        self.target_samples = target_samples
        self._pass: EyePass | None = None
        self._average = shader.compute(context.ctx, "average.comp")
        self._steps: Iterator[float] | None = None
        self._maps: CausticMaps | None = None
        self._camera: Camera | None = None
        self._size = (0, 0)
        self._taken = 0
        self._publish_from = 1
        self._rate = _FIRST_RATE
        self.picture: moderngl.Texture | None = None
        """RGBA32F, linear Rec.709, top row first; None before the first sample."""
        self.shown_samples = 0
        self.version = 0
        """Counts what was published."""
        self.scale = 1.0
        self._wanted_scale = 1.0

    def look_at(self, buffers: SceneBuffers, scene: Scene, reflectances: list[np.ndarray | None]) -> None:
        """Take the scene as it is shown: `buffers` hold its geometry, `scene` its colours and lights."""
        shown = copy.copy(buffers)
        shown.scene = scene
        before, self._pass = self._pass, EyePass(self._context, shown, "beauty", reflectances)
        self._pass.dispatch_seconds = DISPATCH_SECONDS
        self._steps = None
        if before is not None:
            before.release()

    def restart(self, camera: Camera, width: int, height: int, maps: CausticMaps, *, seconds: float | None = None, same_view: bool = False) -> None:
        """Start over. `seconds`: be done with one sample in about that time, however small the picture.

        `same_view`: only the maps are better: what is shown stays until the new picture is as smooth.
        """
        scale = 1.0
        if seconds is not None:
            scale = next((s for s in SCALES if s * s * width * height <= self._rate * seconds), SCALES[-1])
        self._camera, self._maps = camera, maps
        self._size = max(8, round(width * scale)), max(8, round(height * scale))
        keeps = same_view and self.scale == scale == 1.0
        self._publish_from = max(1, min(self.shown_samples, SETTLED)) if keeps else 1
        self._wanted_scale = scale
        self._taken = 0
        self._steps = None

    def pause(self) -> None:
        """Leave the maps alone, which are about to go; what is shown stays until `restart`."""
        self._maps = self._steps = None

    @property
    def is_coarse(self) -> bool:
        """The picture asked for last is smaller than what is wanted."""
        return self._wanted_scale < 1.0

    @property
    def owes_picture(self) -> bool:
        """Nothing of what was asked for last is shown yet."""
        return self._maps is not None and self._taken < self._publish_from

    @property
    def is_done(self) -> bool:
        """Every sample is taken, in full size."""
        return self._maps is None or (self._taken >= self.target_samples and self.scale == 1.0)

    def advance(self, deadline: float, *, one_sample: bool = False) -> float:
        """Take samples until `deadline` (`time.perf_counter`), `one_sample` not beyond the next published one; returns the seconds it took."""
        started = now = time.perf_counter()
        published = False
        while now < deadline and self._taken < self.target_samples and not (published and one_sample):
            published = self._step()
            now = time.perf_counter()
        return now - started

    def _step(self) -> bool:
        """One dispatch; whether it completed a picture that was published."""
        assert self._pass is not None and self._camera is not None and self._maps is not None
        width, height = self._size
        if self._steps is None:
            self._steps = self._pass.samples(self._camera, width, height, 1, self._taken, self._maps)
            self._share = 0.0
        started = time.perf_counter()
        share = next(self._steps, None)
        if share is not None:
            seconds = time.perf_counter() - started
            pixels = (share - self._share) * width * height
            self._share = share
            if seconds > 1e-4:
                self._rate += 0.2 * (pixels / seconds - self._rate)
            return False
        self._steps = None
        self._taken += 1
        if self._taken < self._publish_from:
            return False
        self._publish()
        return True

    def _publish(self) -> None:
        assert self._pass is not None
        (sums,) = self._pass.sums
        if self.picture is None or self.picture.size != sums.size:
            if self.picture is not None:
                self.picture.release()
            self.picture = self._context.ctx.texture(sums.size, 4, dtype="f4")
        sums.bind_to_image(0, read=True, write=False)
        self.picture.bind_to_image(1, read=False, write=True)
        self._average["scale"].value = 1.0 / self._taken
        self._average.run(-(-sums.width // 8), -(-sums.height // 8))
        self._context.ctx.memory_barrier()
        self.shown_samples, self.scale = self._taken, self._wanted_scale
        self.version += 1

    def release(self) -> None:
        """Free everything."""
        shader.release(self._average)
        for owned in (self._pass, self.picture):
            if owned is not None:
                owned.release()
        self._pass = self.picture = None


def solo_scene(scene: Scene, wavelength_nm: float | None) -> Scene:
    """`scene` as seen in the light of one wavelength: lights narrowed, background dark; itself for None."""
    if wavelength_nm is None:
        return scene
    from app.live.light import solo

    lights = tuple(replace(light, spectral_power=solo(light.spectral_power, wavelength_nm)) for light in scene.lights)
    return replace(scene, lights=lights, background_rgb=(0.0, 0.0, 0.0))
