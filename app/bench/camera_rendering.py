"""One method of the camera pass in one scene, ready to run again and again: what `bench --camera` times, and nothing
else.

All methods look up the same caustic maps, which are made once and cost nothing here: they differ in how camera rays
sample the spectrum. A rendering starts from nothing; what `srd` needs to choose the bands of its spectrum counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

import numpy as np

from ..features.features import Features
from ..gpu.context import Context
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..model.optics.colorimetry import rgb709_to_xyz
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.camera import CameraPass
from ..passes.caustic_maps import CausticMaps
from ..passes.spectrum_choice import Spectrum
from ..render.device_scene import scene_buffers, spectral_axis
from ..render.light_pass import LightPass
from ..render.sampling import CameraSampling
from .rendering import NothingToMeasure, Rendering, Rig

LIGHT_PHOTONS = 1 << 22
"""Photons of the caustic maps, traced by `srd`. In `ball_caustic` twice 2^20 photons change the picture by a relMSE of
2.6e-4, twice 2^18 by ten times that: with so many more, the maps' own error is far below what the camera's methods
reach in the time."""
LIGHT_SEED = 1
_TRIAL_SHARE = 0.25
"""A trial this long, as a share of the time given, gives the rate of the longest rendering."""


class SharedLight:
    """The caustic maps that all camera passes of a scene look up; none where the scene has no light or
    nothing that light could fall on."""

    def __init__(
        self,
        context: Context,
        scene: Scene,
        width: int,
        height: int,
        progress: Callable[[str], None],
        photons: int | None = None,
    ) -> None:
        photons = photons or LIGHT_PHOTONS
        self.maps: CausticMaps | None = None
        self.channels = MapChannels()
        self.reflectances: Sequence[np.ndarray | None] = (None,)
        self.seconds = 0.0
        self._light: LightPass | None = None
        if not scene.lights or not any(o.material.receives for o in scene.objects):
            return
        started = time.perf_counter()
        settings = _settings(scene, "srd", width, height)
        self._buffers = scene_buffers(context, scene, settings)
        self._light = light = LightPass(context, scene, settings, self._buffers.features, self._buffers)
        light.prepare()
        light.begin(photons, LIGHT_SEED)

        def report(done: float) -> bool:
            progress(f"light pass, {100.0 * done:.0f} %")
            return True

        light.run_pass(0, photons, report)
        light.finish()
        self.channels, self.reflectances = light.shown.channels, light.shown.reflectances
        self.maps = light.caustic_maps()
        context.finish()
        context.check("the light pass of the bench")
        self.seconds = time.perf_counter() - started

    def release(self) -> None:
        """Free everything on the device."""
        if self._light is not None:
            self._light.release()
            self._buffers.release()


class CameraRig:
    """Owns the camera's buffers and programs for one scene, method and picture size; the maps are `light`'s."""

    goes_on = False
    kernels: tuple[float, ...] = ()

    def __init__(
        self, context: Context, scene: Scene, method: str, width: int, height: int, light: SharedLight
    ) -> None:
        """Raises `NothingToMeasure` where the camera cannot see through dispersive glass: all methods are the same
        then."""
        self._context, self._scene, self._size, self._light = context, scene, (width, height), light
        features = Features.of(scene, _settings(scene, method, width, height))
        if not features.camera_disperses:
            raise NothingToMeasure(
                f"scene '{scene.name}': the camera sees nothing through glass that disperses, so the camera's "
                "methods do not differ and there is nothing to measure"
            )
        started = time.perf_counter()
        self._buffers = SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
        buffered = self._finished()
        self._camera_pass = CameraPass(context, self._buffers, "beauty", light.reflectances, light.channels)
        # Drivers put off part of the compiling until a program runs.
        self._camera_pass.run(scene.camera, width, height, 1, 0, light.maps)
        if self._camera_pass.chooses:
            self._camera_pass.spectrum = Spectrum(single=True)
            self._camera_pass.run(scene.camera, width, height, 1, 0, light.maps)
        compiled = self._finished()
        self.setup_seconds = {
            "light pass": light.seconds,
            "buffers": buffered - started,
            "compile": compiled - buffered,
        }
        self.buffers_mib = self._buffers.bytes / 2**20

    def render(self, budget: int, seed: int, kernel: float | None = None) -> Rendering:
        """One picture from nothing: the way to sample the spectrum chosen for `budget` samples a pixel, then those, or
        what they buy in that way."""
        started = self._finished()
        samples = self._choose(budget).samples(budget)
        chosen = self._finished()
        self._camera_pass.run(self._scene.camera, *self._size, samples, 0, self._light.maps, seed)
        sampled = self._finished()
        xyz = rgb709_to_xyz(self._camera_pass.read_rgb().astype(np.float64))
        return Rendering(xyz, {"bands": chosen - started, "lookups": sampled - chosen}, samples, 0)

    def fitting(self, budget: int) -> int:
        """The largest multiple of the bands that `budget` samples are given; the smallest where that is none."""
        bands = self._choose(budget).bands
        return max(budget // bands, 1) * bands

    def budgets(self, seconds: float, count: int) -> list[int]:
        """Sample counts, about `count`: evenly spaced in the logarithm as far as whole multiples of the bands allow,
        the largest takes about `seconds`."""
        samples = 1
        while (took := self._seconds(samples))[1] < _TRIAL_SHARE * seconds:
            samples *= 2
        # Few samples fit into the time, so a moment's disturbance of the trial would cost the curve its end: the better
        # of two counts.
        bands_s, all_s, taken = min(took, self._seconds(samples), key=lambda one: one[1])
        largest = max(taken * max(seconds - bands_s, 0.0) / (all_s - bands_s), 1.0)
        found: set[int] = set()
        for steps in (count, 2 * count):
            if len(found) < count:
                found |= {self.fitting(round(n)) for n in np.geomspace(1.0, largest, steps)}
        return _thinned(sorted(found), count)

    def release(self) -> None:
        """Free everything on the device."""
        self._camera_pass.release()
        self._buffers.release()

    def _seconds(self, budget: int) -> tuple[float, float, int]:
        """Seconds of choosing the bands and of all, and the samples taken."""
        rendering = self.render(budget, 0)
        taken = budget if self._choose(budget).single else rendering.emitted
        return rendering.seconds["bands"], sum(rendering.seconds.values()), taken

    def _choose(self, samples: int) -> Spectrum:
        for _ in CameraSampling(samples).choosing(self._camera_pass, self._scene.camera, *self._size, self._light.maps):
            pass
        return self._camera_pass.spectrum

    def _finished(self) -> float:
        self._context.finish()
        return time.perf_counter()


@contextmanager
def camera_rigs(
    context: Context, scene: Scene, methods: Sequence[str], width: int, height: int, progress: Callable[[str], None]
) -> Iterator[dict[str, Rig]]:
    """The camera pass's rigs by method, freed at the end. Raises `NothingToMeasure`."""
    rigs: dict[str, Rig] = {}
    with ExitStack() as stack:
        progress("preparing the light pass")
        light = SharedLight(context, scene, width, height, progress)
        stack.callback(light.release)
        for method in methods:
            progress(f"preparing {method}")
            rigs[method] = rig = CameraRig(context, scene, method, width, height, light)
            stack.callback(rig.release)
        yield rigs


def _settings(scene: Scene, method: str, width: int, height: int) -> RenderSettings:
    return RenderSettings(width=width, height=height, method=method, max_depth=scene.render.max_depth)


def _thinned(counts: list[int], most: int) -> list[int]:
    """At most `most` of ascending counts, evenly spread over the list, both ends kept."""
    if len(counts) <= most:
        return counts
    return [counts[round(i)] for i in np.linspace(0, len(counts) - 1, most)]
