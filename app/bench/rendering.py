"""One method in one scene, ready to render again and again: what the bench times, and nothing else. This is the light
pass's; the camera pass's is `camera_rendering`.

Programs, buffers, pilot and maps are made once. Then each rendering starts from nothing with one lattice of the wanted
photons. Times are wall clock between points where the device has finished, on software and GPU alike; on a GPU the wait
after every slice costs a little, which the figures then contain.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..base.errors import UserError
from ..gpu import splat_tables
from ..gpu.context import Context
from ..model.optics.colorimetry import rgb709_to_xyz
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.camera import CameraPass
from ..render.device_scene import scene_buffers
from ..render.light_pass import LightPass
from ..render.pass_sizes import pass_sizes
from ..render.sampling import CAUSTIC_SAMPLES
from .results import OWN_METHODS

KERNELS = tuple(float(width) for width in np.geomspace(0.45, 32.0, 13))
"""Widths of a kernel that are tried: standard deviations in lattice spacings."""
WARM_UP_PHOTONS = 2048
SMALLEST_BUDGET = 128
FIRST_SECONDS = 0.02
"""Photon time of the smallest budget, as far as the costs that do not depend on it allow."""
_TRIAL_SHARE = 0.25
"""A trial this long, as a share of the time given, gives the rate of the longest rendering."""
_TRIAL_GROWTH = 4


class NothingToMeasure(UserError):
    """The scene's caustic layer is black, or the camera sees nothing that methods differ in."""


@dataclass(frozen=True)
class Rendering:
    """A picture and what it took."""

    xyz: np.ndarray
    """float64 (H, W, 3), linear XYZ of the layer that is measured, row 0 on top."""
    seconds: dict[str, float]
    """The light pass's: "plan", "trace", "splat", "resolve", "camera"; the camera pass's: "bands", "lookups"."""
    emitted: int
    """Photons, or samples a pixel, that there really were."""
    splats: int
    """0 for the camera pass."""


class Rig(Protocol):
    """What the runner needs of one method in one scene."""

    setup_seconds: dict[str, float]
    buffers_mib: float
    goes_on: bool
    """Followed beyond the time given, to the horizon, until its error is what is sought."""
    kernels: tuple[float, ...]
    """Widths of its kernel to be tried, lattice spacings; empty where it has none or none is to be chosen."""

    def render(self, budget: int, seed: int, kernel: float | None = None) -> Rendering:
        """One rendering from nothing of about `budget` photons, or camera samples a pixel; `kernel` None: as the method
        has it."""

    def budgets(self, seconds: float, count: int) -> list[int]:
        """Ascending, `count` at most: evenly spaced in the logarithm, the largest takes about `seconds`."""

    def fitting(self, budget: int) -> int:
        """The largest budget up to this one that can be rendered exactly."""

    def release(self) -> None:
        """Free everything on the device."""


@contextmanager
def light_rigs(
    context: Context, scene: Scene, methods: Sequence[str], width: int, height: int, progress: Callable[[str], None]
) -> Iterator[dict[str, Rig]]:
    """The light pass's rigs by method, freed at the end. Raises `NothingToMeasure`."""
    rigs: dict[str, Rig] = {}
    with ExitStack() as stack:
        # What the first of a process pays for all, late imports and drivers that start up, falls on none.
        progress(f"preparing {methods[0]}")
        MethodRig(context, scene, methods[0], width, height).release()
        for method in methods:
            progress(f"preparing {method}")
            rigs[method] = rig = MethodRig(context, scene, method, width, height)
            stack.callback(rig.release)
        yield rigs


class MethodRig:
    """Owns everything on the device for one scene, method and picture size."""

    goes_on = True

    def __init__(self, context: Context, scene: Scene, method: str, width: int, height: int) -> None:
        self._context = context
        self._scene = scene
        self._settings = RenderSettings(
            width=width, height=height, method=method, layer="caustic", max_depth=scene.render.max_depth
        )
        started = time.perf_counter()
        self._buffers = scene_buffers(context, scene, self._settings)
        buffered = self._finished()
        self._light = LightPass(context, scene, self._settings, self._buffers.features, self._buffers)
        self._camera_pass = CameraPass(context, self._buffers, "caustic", self._light.shown.reflectances)
        compiled = self._finished()
        self._light.prepare()
        piloted = self._finished()
        tuned = method not in OWN_METHODS and self._light.features.footprints
        self.kernels: tuple[float, ...] = KERNELS if tuned else ()
        # Drivers put off part of the compiling until a program runs.
        seen = bool(scene.lights) and self.render(WARM_UP_PHOTONS, 1).xyz.any()
        warm = self._finished()
        if not seen:
            self.release()
            raise NothingToMeasure(
                f"scene '{scene.name}': no light from glass or mirrors falls on what the camera sees directly, "
                "so there is nothing to measure"
            )
        self.render(WARM_UP_PHOTONS, 1)
        self.setup_seconds = {
            "buffers": buffered - started,
            "compile": compiled - buffered,
            "pilot": piloted - compiled,
            "first run": max((warm - piloted) - (self._finished() - warm), 0.0),
        }
        self.buffers_mib = (self._buffers.bytes + self._light.trace.bytes) / 2**20

    def render(self, photons: int, seed: int, kernel: float | None = None) -> Rendering:
        """One rendering from nothing of about `photons`, seen by the camera."""
        self._light.smoothing = self._settings.smoothing if kernel is None else kernel
        seconds = self._light_seconds(photons, seed)
        started = time.perf_counter()
        light, settings = self._light, self._settings
        maps = light.caustic_maps(self._textures)
        self._camera_pass.run(self._scene.camera, settings.width, settings.height, CAUSTIC_SAMPLES, 0, maps, seed)
        xyz = rgb709_to_xyz(self._camera_pass.read_rgb().astype(np.float64))
        seconds["camera"] = time.perf_counter() - started
        return Rendering(xyz, seconds, light.stats.photons, light.stats.splats)

    def budgets(self, seconds: float, count: int) -> list[int]:
        """At most `count` photon counts, evenly spaced in the logarithm, the largest of which takes about `seconds`.

        The first trials are small; each is four times the last, until one gives the rate."""
        photons = WARM_UP_PHOTONS
        while (took := self._photon_seconds(photons)) < _TRIAL_SHARE * seconds:
            photons *= _TRIAL_GROWTH
        largest = max(photons * seconds / took, SMALLEST_BUDGET)
        # Few photons have broad splats: the time of a rendering grows more slowly than its photons, so the other end is
        # tried out too.
        smallest = float(WARM_UP_PHOTONS)
        first_seconds = min(FIRST_SECONDS, 0.5 * seconds)
        took = self._photon_seconds(WARM_UP_PHOTONS)
        if took < first_seconds:
            smallest *= first_seconds / took
        while took > first_seconds and smallest > SMALLEST_BUDGET:
            smallest = max(smallest / _TRIAL_GROWTH, SMALLEST_BUDGET)
            took = self._photon_seconds(int(smallest))
        smallest = min(smallest, largest)
        return sorted({round(n) for n in np.geomspace(smallest, largest, count)})

    def fitting(self, budget: int) -> int:
        """Any number of photons has its lattice."""
        return budget

    def release(self) -> None:
        """Free everything on the device."""
        self._camera_pass.release()
        self._light.release()
        self._buffers.release()

    def _photon_seconds(self, photons: int) -> float:
        return sum(seconds for stage, seconds in self._light_seconds(photons, 0).items() if stage != "plan")

    def _light_seconds(self, photons: int, seed: int) -> dict[str, float]:
        """Fill the maps; seconds by stage. All that a pass does besides tracing counts as splatting."""
        light = self._light
        # As a process that renders once has none yet.
        light.batches.records.release()
        splat_tables.forget_blurred()
        sizes, planning, filling = pass_sizes(light.features.method, photons), 0.0, 0.0
        started = self._finished()
        light.begin(sizes[0], seed)
        for number, size in enumerate(sizes):
            light.plan(size, number)
            _ = light.batches.tables  # made when they are first used
            planned = self._finished()
            light.run_pass(number, size, self._wait)
            filled = self._finished()
            planning, filling, started = planning + planned - started, filling + filled - planned, filled
        self._textures = light.maps.resolved_textures()
        resolved = self._finished()
        self._context.check("a rendering of the bench")
        trace = light.stats.trace_seconds
        return {
            "plan": planning,
            "trace": trace,
            "splat": filling - trace,
            "resolve": resolved - filled,
        }

    def _wait(self, _: float) -> bool:
        """Finish a slice before the next is traced, so that its time counts for the right stage."""
        self._context.finish()
        return True

    def _finished(self) -> float:
        self._context.finish()
        return time.perf_counter()
