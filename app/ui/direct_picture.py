"""What is seen directly without any caustic, in the light of lamps and of the environment: on which the reference's
caustics are put."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..edit.live_inputs import LiveInputs
from ..gpu.context import Context
from ..gpu.context_thread import ContextThread, SteppedWork
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.camera import CameraPass
from ..passes.caustic_maps import CausticMaps
from ..passes.environment_light import EnvironmentLightPass
from ..passes.gathered_light import FIRST_DIRECTIONS
from ..passes.spectrum_choice import Spectrum
from ..render.device_scene import scene_buffers
from ..render.shown_spectra import reflectance_classes

SAMPLES = (1, 4, 16, 32)
"""At which it is shown anew: something at once, and it becomes finer."""
DISPATCH_SECONDS = 0.012


class DirectPicture:
    """Owns what it is made with, on the thread that it is given."""

    def __init__(self, context: Context, thread: ContextThread | None, scene: Scene, inputs: LiveInputs) -> None:
        """`thread` None: it is made where `advance` is called, with `context`."""
        self._stepped: SteppedWork[None] = SteppedWork(thread)
        self._buffers: SceneBuffers | None = None
        self._camera_pass: CameraPass | None = None
        self._around: EnvironmentLightPass | None = None
        self._maps: CausticMaps | None = None
        self._steps = self._sampled(context if thread is None else thread.context, scene, inputs)
        self._rgb: np.ndarray | None = None
        self.version = 0
        """0 while there is nothing; another number for another `rgb`."""

    @property
    def is_done(self) -> bool:
        """It becomes no better."""
        return self.version == len(SAMPLES)

    @property
    def samples(self) -> int:
        """Samples in each pixel of `rgb`; 0 while there is none."""
        return SAMPLES[self.version - 1] if self.version else 0

    @property
    def rgb(self) -> np.ndarray:
        """float32 (H, W, 3), from the first version on."""
        assert self._rgb is not None
        return self._rgb

    def advance(self, budget_s: float) -> None:
        """Work for about `budget_s`, one dispatch at least; what takes longer continues on the thread."""
        self._stepped.step(lambda: self._advance(budget_s), budget_s)

    def _advance(self, budget_s: float) -> None:
        started = time.perf_counter()
        while next(self._steps, None) is not None and time.perf_counter() - started < budget_s:
            pass

    def _sampled(self, context: Context, scene: Scene, inputs: LiveInputs) -> Iterator[float]:
        """Without caustics."""
        settings = RenderSettings(width=inputs.width, height=inputs.height, method=inputs.method)
        self._buffers = buffers = scene_buffers(context, scene, settings)
        reflectances, _ = reflectance_classes(scene, buffers)
        self._camera_pass = camera_pass = CameraPass(context, buffers, "beauty", reflectances)
        camera_pass.dispatch_seconds = DISPATCH_SECONDS
        camera_pass.spectrum = Spectrum()  # what is seen directly alone needs no bands
        camera_pass.primary_samples = 1
        camera_pass.only_directly = True
        self._maps = maps = CausticMaps.without_light(context.ctx, len(buffers.receivers), MapChannels().targets)
        around = None
        if buffers.features.environment_lights:
            self._around = around = EnvironmentLightPass(context, buffers, inputs.seed)
            maps = replace(maps, environment=around.texture)
            yield from self._asked(around, FIRST_DIRECTIONS)
        view, taken = (scene.camera, inputs.width, inputs.height), 0
        for samples in SAMPLES:
            yield from camera_pass.samples(*view, samples - taken, taken, maps, inputs.seed)
            taken = samples
            self._rgb = camera_pass.read_rgb()
            self.version += 1
            if around is not None and not around.is_done:  # samples from here on begin anew in all of its light
                yield from self._asked(around, around.total)
                taken = 0

    @staticmethod
    def _asked(around: EnvironmentLightPass, directions: int) -> Iterator[float]:
        """Light of the environment, of so many directions at least."""
        for share in around.steps(DISPATCH_SECONDS):
            yield share
            if around.asked >= directions:
                break
        around.show()

    def release(self) -> None:
        """Free everything once the step that is under way is done."""
        self._stepped.end(self._free)

    def _free(self) -> None:
        for owned in (self._around, self._maps, self._camera_pass, self._buffers):
            if owned is not None:
                owned.release()
        self._around = self._maps = self._camera_pass = self._buffers = None
