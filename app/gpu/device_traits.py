"""What differs between devices in how the programs are built and how much work they are given at a time.

The only place where renderers are distinguished by name: all other code reads a `DeviceTraits`. The
numbers of llvmpipe were measured with Mesa 22.3 on two cores.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from ..base.errors import UserError, suggestion
from .dispatch_budget import DISPATCH_S

ENVIRONMENT_VARIABLE = "SPECTRASPLAT_DEVICE"
"""`gpu`: programs, sizes and schedules are a GPU's, whatever draws; so a software renderer shows what a GPU does."""
_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "swiftshader")


@dataclass(frozen=True)
class Budget:
    """Sizes of a live rendering: a software renderer answers in small steps, a GPU takes millions at a time."""

    batch: int = 1 << 18
    """Rays in flight at once."""
    first_photons: int = 1 << 20
    """Photons of the first picture."""
    largest_photons: int = 1 << 25
    """Photons of the best picture."""
    store_bytes: int = 1 << 30
    """Photons kept so that edits need no new tracing."""
    finest_photons: int = 0
    """Photons of the finest pass at least, however few are wanted in all."""
    portion: int = 1 << 30
    """Photons traced between two pauses, at most."""


@dataclass(frozen=True)
class DeviceTraits:
    """One device's peculiarities. The defaults are a GPU's."""

    is_software: bool = False
    """The processor draws: say so to people, and expect a thousandth of the speed."""
    texels_as_images: bool = False
    """Scene and pictures are read by `imageLoad`: `texelFetch` works out a mip level for every ray there."""
    loops_may_end: bool = False
    """All loops of an invocation end, silently, once they have run about 65,535 rounds together."""
    ray_events: tuple[int, ...] = (4, 4, 8, 8, 64, 64, 64, 4096)
    """For how many events each dispatch of a batch follows a ray; the last one follows all that becomes of it. Empty: a
    dispatch is one event, after which rays are listed in order."""
    packs_records: bool = True
    """Rays, photons and splats lie in memory rounded, where one waits longer for memory than packing takes."""
    photon_batch: int = 1 << 20
    """Lattice points whose photons are traced at once, where memory allows."""
    photon_queue_bytes: int = 1 << 30
    """What their queue may take."""
    work_is_queued: bool = True
    """A command only queues work: to keep a deadline is to wait for the device."""
    dispatch_s: float = DISPATCH_S
    """What a dispatch should take where no frames are waited for."""
    camera_s: float = 0.25
    """What a dispatch of the camera may take at most: an eighth of what drivers end. It is not waited for, so a picture
    is cut up only after one has taken longer."""
    camera_paths: int = 1 << 15
    """Camera paths that are followed side by side, each of which needs some kilobytes: as many as fill a GPU."""
    paths_group: int = 64
    """Camera paths of a work group. A software renderer gives groups to its threads one by one and runs eight paths
    of one side by side: with more in a group, few paths are shared out unevenly."""
    viewer: Budget = Budget()
    """Sizes while a picture is shown that gets better."""
    compiles_ahead: bool = True
    """The driver's threads compile programs side by side, where it has some, and binaries are kept on the disk. Of a
    software renderer programs are compiled at their first dispatch, which no binary spares."""
    tables_by_compute: bool = True
    """Spectral tables of pictures in motion are written by compute shaders, in their float32."""
    moves_by_photons: bool = True
    """Where beams carry light, photons stand for it while something is dragged: a search for beams takes the processor
    longer than a GPU takes to splat a million photons."""
    splats_by_compute: bool = False
    """Compute shaders add splats, the rasteriser does not draw them. Of a GPU that is measured (`splat_way`)."""

    @property
    def clock(self) -> Callable[[], float]:
        """Seconds of work for measurements: the processor's own time where it draws, since other work on the machine
        disturbs that less; timer queries are meaningless there."""
        return time.process_time if self.is_software else time.perf_counter

    @staticmethod
    def of(renderer: str) -> DeviceTraits:
        """From OpenGL's GL_RENDERER. Raises `UserError` where the environment names a device that there is not."""
        if _assumed:
            return _assumed[-1]
        if _is_gpu_wanted():
            is_software = is_software_renderer(renderer)
            return DeviceTraits(splats_by_compute=is_software, loops_may_end=is_software)
        if not is_software_renderer(renderer):
            return DeviceTraits()
        llvmpipe = "llvmpipe" in renderer.casefold()
        return DeviceTraits(
            is_software=True,
            texels_as_images=llvmpipe,
            loops_may_end=True,
            ray_events=(),
            packs_records=False,
            photon_batch=1 << 16,
            photon_queue_bytes=64 << 20,
            work_is_queued=False,
            compiles_ahead=False,
            dispatch_s=0.15,
            camera_s=0.15,
            camera_paths=1 << 13,
            paths_group=8,
            tables_by_compute=False,
            moves_by_photons=False,
            viewer=Budget(1 << 14, 1 << 14, 1 << 22, 256 << 20),
        )


def is_software_renderer(renderer: str) -> bool:
    """From OpenGL's GL_RENDERER, whatever is assumed."""
    return any(known in renderer.casefold() for known in _SOFTWARE_RENDERERS)


def _is_gpu_wanted() -> bool:
    name = os.environ.get(ENVIRONMENT_VARIABLE, "").strip().casefold()
    if name not in ("", "gpu"):
        hint = suggestion(name, ("gpu",)) or ", use 'gpu' or nothing"
        raise UserError(f"{ENVIRONMENT_VARIABLE} is '{name}', which is no kind of device{hint}")
    return name == "gpu"


_assumed: list[DeviceTraits] = []


@contextmanager
def assumed(traits: DeviceTraits) -> Iterator[None]:
    """Within the block every device is taken for one of these traits, by contexts that are made inside it.

    So a software renderer builds, and shows to strict compilers, what a GPU would get."""
    _assumed.append(traits)
    try:
        yield
    finally:
        _assumed.pop()
