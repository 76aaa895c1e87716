"""The camera reference's samples, round by round, and the picture they have made so far.

PARTS independent scramblings of one quasi-random sequence run side by side, a thread each, every pixel with a shift
of its own: the picture converges faster than random and still knows its own error. `camera_reference` is the way in.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..model.optics.colorimetry import xyz_to_rgb709
from ..model.scene import Scene
from .photon_run import RELMSE_EPSILON, TALLY_SIZE
from .rounds import PARTS, Pace, trace_parts

if TYPE_CHECKING:
    from .spectral_caustic import SpectralCaustic

MAX_DEPTH = 256
_LAST_SAMPLE = 2**31
_BLACK_SAMPLES = 256


@dataclass(frozen=True)
class CameraPicture:
    """What the camera sees and what is known of its error; row 0 on top."""

    xyz: np.ndarray
    """float64 (H, W, 3): CIE XYZ, the mean over each pixel; Y in lm/(sr unit²)."""
    variance: np.ndarray
    """float64 (H, W, 3): of `xyz` as an estimate, from PARTS independent pictures, or two where the caustic's halves
    are told apart."""
    samples: int
    """Of each pixel."""
    seconds: float
    """Time spent tracing."""
    lost: dict[str, float]
    """Share of paths given up: "depth" (too many events) and "numeric" (nothing met inside a solid)."""
    caustic_photons: int = 0
    """Of the caustic that was looked up, where `cached_camera_reference` made it."""
    caustic_relmse: float = 0.0
    """What its noise adds to the picture's own error, about: a part of `variance`."""

    def rgb(self) -> np.ndarray:
        """Linear Rec.709, float64 (H, W, 3)."""
        return xyz_to_rgb709(self.xyz)

    @cached_property
    def relmse(self) -> float:
        """The picture's own error, mean[var/(R² + ε)] as `ReferencePicture.relmse` has it; 0 for a black picture."""
        epsilon = RELMSE_EPSILON * self.xyz.mean() ** 2
        return float(np.mean(self.variance / (self.xyz**2 + epsilon))) if epsilon > 0.0 else 0.0

    def is_within(self, target_relmse: float) -> bool:
        """Whether the error is known to be no larger; blackness is believed after many samples only."""
        return self.relmse <= target_relmse and (bool(self.xyz.any()) or self.samples >= _BLACK_SAMPLES)


class CameraRun:
    """Samples of one picture, added round by round; `picture()` at any time."""

    def __init__(
        self,
        scene: Scene,
        width: int,
        height: int,
        max_depth: int = MAX_DEPTH,
        seed: int = 1,
        caustic: SpectralCaustic | None = None,
    ) -> None:
        """Even and odd parts look up one half each of the caustic's photons, so that the picture's variance holds the
        caustic's too.

        Raises UserError where numba is missing or solids nest beyond reach."""
        try:
            from . import (
                camera_kernel,
                camera_lights,
                camera_optics,
                camera_scene,
                camera_start,
                photon_kernel,
                photon_scene,
                spectral_caustic,
            )
        except ImportError as error:
            raise UserError(
                f"the camera's reference renderer needs numba ({error}); install it with: pip install numba"
            ) from error
        self._kernel, self._scratch = camera_kernel, camera_optics.scratch
        photons, centre = photon_scene.photon_scene(scene)
        self._scene = camera_scene.with_upsampled_mirrors(photons, scene)
        self._camera = photon_scene.viewpoint(scene.camera, width, height, centre)
        self._start = camera_start.camera_start(scene, photons)
        self._lights = camera_lights.camera_lights(scene.lights, centre)
        self._pictures = camera_scene.pictures(scene, photons, centre)
        self._tables = (
            [caustic.half(number).tables for number in range(2)] if caustic else [spectral_caustic.no_caustic(scene)]
        )
        self._spectra = camera_scene.spectra(scene, caustic.plan.bins if caustic else 1)
        self._sequences = [photon_kernel.scrambled(seed, part) for part in range(PARTS)]
        self._max_depth = max_depth
        self.sums = np.zeros((PARTS, height, width, 3))
        self.units = np.zeros(PARTS, np.int64)
        """Samples of a pixel by each part."""
        self.tallies = np.zeros((PARTS, TALLY_SIZE))
        self.seconds = 0.0
        self._pace = Pace()

    @property
    def samples(self) -> int:
        """Samples of every pixel so far."""
        return int(self.units.sum())

    amount = samples

    @property
    def amount_words(self) -> str:
        """Samples for people."""
        return f"{self.samples} samples a pixel"

    @property
    def exhausted(self) -> bool:
        """Whether the sequence has no fresh points left."""
        return int(self.units.max()) >= _LAST_SAMPLE

    def advance(self, samples_left: int | None = None, seconds_left: float | None = None) -> None:
        """One round of all parts, about half a second or what is left. An interrupt keeps the parts that were
        finished."""
        count = self._pace.units
        if samples_left is not None:
            count = min(count, max(1, -(-samples_left // PARTS)))
        took = trace_parts(self._trace_part, count)
        self.seconds += took
        self._pace.learn(count, took, seconds_left)

    def picture(self) -> CameraPicture:
        """What has been gathered; black without variance before the first round."""
        return summed_camera(self.sums, self.units, self.tallies, self.seconds, len(self._tables) > 1)

    def _trace_part(self, part: int, count: int) -> None:
        self._kernel.trace_camera(
            self._scene,
            self._camera,
            self._lights,
            self._spectra,
            self._pictures,
            self._tables[part % len(self._tables)],
            self._start,
            self._sequences[part],
            int(self.units[part]),
            count,
            self._max_depth,
            self.sums[part],
            self.tallies[part],
            self._scratch(),
        )
        self.units[part] += count


def summed_camera(
    sums: np.ndarray, units: np.ndarray, tallies: np.ndarray, seconds: float, measured_passes: bool = False
) -> CameraPicture:
    """The picture from the sums (PARTS, H, W, 3) and tallies (PARTS, TALLY_SIZE) of parts with `units` (PARTS,) samples
    a pixel.

    `halves`: even parts have one thing in common, the caustic they looked up, and so have odd ones: two independent
    pictures."""
    total = max(int(units.sum()), 1)
    mean = sums.sum(axis=0) / total
    variance = np.zeros_like(mean)
    if measured_passes:
        sums, units = (np.stack([values[half::2].sum(axis=0) for half in range(2)]) for values in (sums, units))
    used = np.flatnonzero(units)
    if len(used) > 1:
        for part in used:
            variance += units[part] / total * (sums[part] / units[part] - mean) ** 2
        variance /= len(used) - 1
    lost = tallies.sum(axis=0)[:2] / (total * mean.shape[0] * mean.shape[1])
    return CameraPicture(
        mean, variance, total if used.size else 0, seconds, {"depth": float(lost[0]), "numeric": float(lost[1])}
    )
