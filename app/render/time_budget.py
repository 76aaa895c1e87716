"""Seconds that a still picture may take as a whole: how they are shared out between photons and camera samples.

What a camera sample costs is measured on a small picture before photons are traced, so that these get what is left.
What the estimate missed, samples make up for: they are taken until the time is over.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from ..model.scene import Camera
from ..passes.camera import CameraPass
from ..passes.caustic_maps import CausticMaps
from .sampling import DEFAULT_SAMPLES

_PROBES = 4, 2
"""Sides of the picture over those of small ones, whose estimate is the better the larger they are."""
_PROBE_SHARE = 0.02
"""Share of the time for a larger probe than the first."""
_MOST_FOR_CAMERA = 0.5
"""Share of the time that is left after preparing, where no number of samples is given."""
_LEAST_FOR_LIGHT = 0.02
_SURE = 0.9
"""Share of the time left that is planned for the first samples: a lattice of samples is best taken whole."""
_NOTHING = 0.02
"""Share of the time too short for another sample."""
_ALMOST = 0.99
MAX_SAMPLES = 4096


@dataclass
class TimeBudget:
    """One picture's."""

    seconds: float
    begun: float
    """`time.perf_counter()` then."""
    sample_s: float = 0.0
    """A camera sample of every pixel."""
    compile_s: float = 0.0
    """What the camera's first sample took beyond the second."""

    @property
    def left(self) -> float:
        """Seconds; negative where it took too long."""
        return self.begun + self.seconds - time.perf_counter()

    @property
    def spent(self) -> float:
        """Share, 0 to almost 1: what takes longer than it may is not done when its time is over."""
        return min(max(1.0 - self.left / self.seconds, 0.0), _ALMOST)

    def measuring(
        self,
        camera_pass: CameraPass,
        camera: Camera,
        width: int,
        height: int,
        maps: CausticMaps | None = None,
        first: bool = False,
    ) -> Iterator[float]:
        """Find out what a sample costs in the way `camera_pass` takes them now, pausing; `first`: it has to be compiled
        before, which is no part of that."""
        for probe in _PROBES:
            if probe != _PROBES[0] and self.sample_s / probe**2 > _PROBE_SHARE * self.seconds:
                return
            size = max(width // probe, 1), max(height // probe, 1)
            took = []
            for _ in range(1 + first):
                started = time.perf_counter()
                for _ in camera_pass.samples(camera, *size, 1, 0, maps):
                    yield self.spent
                took.append(time.perf_counter() - started)
            self.sample_s = took[-1] * width * height / (size[0] * size[1])
            if first:
                self.compile_s, first = took[0] - took[1], False

    def for_light(self, samples: int | None) -> float:
        """Seconds for photons, after `measuring`; `samples`: those a pixel that were requested."""
        left = self.left
        camera = (samples or DEFAULT_SAMPLES) * self.sample_s
        if samples is None:
            camera = min(camera, _MOST_FOR_CAMERA * left)
        # Choosing how the spectrum is sampled may compile another program.
        return max(left - camera - self.compile_s, _LEAST_FOR_LIGHT * self.seconds)

    def samples(self, taken: int = 0) -> int:
        """Camera samples a pixel that there is time for, beyond those `taken`."""
        share = 1.0 if taken else _SURE
        return max(min(int(share * self.left / max(self.sample_s, 1e-9)), MAX_SAMPLES - taken), 0)

    def has_time_for_part(self, taken: int) -> bool:
        """Whether a sample should be begun that will be broken off."""
        return self.left > _NOTHING * self.seconds and taken < MAX_SAMPLES
