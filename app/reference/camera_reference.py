"""The converged picture of everything a camera sees, that the camera pass is measured against.

It shares no code with the shaders, the maps or the camera pass: float64 paths of one random wavelength each through
glass and over mirrors, exact Fresnel by chance, textures and environments looked up at random points. With a
`SpectralCaustic` the caustic is on what is seen, each wavelength of it where that wavelength sees it.

Diffuse surfaces send back direct light, the caustic, the environment's light, and what the scene's `bounces` bring of
other diffuse surfaces. Known bound: caustics need flat receivers.

PARTS independent scramblings of one quasi-random sequence run side by side, a thread each, every pixel with a shift
of its own: the picture converges faster than random and still knows its own error. Pictures are kept by the content of
their scene, as those of `photon_reference`, and grow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..model.optics.colorimetry import xyz_to_rgb709
from ..model.scene import Scene
from ..model.scene_key import picture_key
from .code_key import code_key
from .photon_reference import TALLY_SIZE, relative_variance
from .rounds import PARTS, Cancelled, Limits, PartsRun, Progress, continue_kept, continue_run, kept_path
from .scene_surfaces import description

if TYPE_CHECKING:
    from .spectral_caustic import CausticPlan, SpectralCaustic

MAX_DEPTH = 256
_LAST_SAMPLE = 2**31
_BLACK_SAMPLES = 256
_NOISE_SAMPLES = 128
"""Samples of each pixel by which the noise is measured."""


@dataclass(frozen=True)
class CameraPicture:
    """What the camera sees and what is known of its error; row 0 on top."""

    xyz: np.ndarray
    """float64 (H, W, 3): CIE XYZ, the mean over each pixel; Y in lm/(sr unit²)."""
    variance: np.ndarray
    """float64 (H, W, 3): of `xyz` as an estimate, from PARTS independent pictures, or two where the caustic has
    halves."""
    samples: int
    """Samples of each pixel."""
    seconds: float
    """Time spent tracing."""
    lost: dict[str, float]
    """Share of paths given up: "depth" (too many events) and "numeric" (nothing met inside a solid)."""
    caustic_photons: int = 0
    """Photons of the caustic that was looked up."""
    caustic_relmse: float = 0.0
    """What its noise adds to the picture's own error, about, where `cached_camera_reference` measured it: a part of
    `variance`."""

    @property
    def amount(self) -> int:
        """Samples a pixel."""
        return self.samples

    def rgb(self) -> np.ndarray:
        """Linear Rec.709, float64 (H, W, 3)."""
        return xyz_to_rgb709(self.xyz)

    @cached_property
    def relmse(self) -> float:
        """The picture's own error, mean[var/(R² + ε)] as `ReferencePicture.relmse` has it; 0 for a black picture."""
        return relative_variance(self.xyz, self.variance)

    def is_within(self, target_relmse: float) -> bool:
        """Whether the error is known to be no larger; blackness is believed after many samples only."""
        return self.relmse <= target_relmse and (bool(self.xyz.any()) or self.samples >= _BLACK_SAMPLES)


class CameraRun(PartsRun[CameraPicture]):
    """Samples of one picture, added round by round; `picture()` at any time."""

    def __init__(
        self,
        scene: Scene,
        width: int,
        height: int,
        max_depth: int = MAX_DEPTH,
        seed: int = 1,
        caustic: SpectralCaustic | None = None,
        caustic_relmse: float = 0.0,
    ) -> None:
        """`caustic_relmse`: what the caustic's noise adds to the picture's error, to be noted with it.

        Even and odd parts look up one half each of the caustic's photons, so that the picture's variance holds the
        caustic's too. Raises UserError where numba is missing or solids nest beyond reach.
        """
        try:
            from . import (
                camera_kernel,
                camera_lights,
                camera_scene,
                photon_scene,
                sampling,
                spectral_caustic,
                viewpoint,
            )
        except ImportError as error:
            raise UserError(
                f"the camera's reference renderer needs numba ({error}); install it with: pip install numba"
            ) from error
        self._kernel, self._scratch = camera_kernel, sampling.scratch
        photons, centre = photon_scene.photon_scene(scene)
        self._scene = camera_scene.with_upsampled_mirrors(photons, scene)
        self._camera = viewpoint.viewpoint(scene.camera, width, height, centre)
        self._start = camera_scene.camera_start(scene, photons)
        self._lights = camera_lights.camera_lights(scene.lights, centre)
        self._pictures = camera_scene.pictures(scene, photons)
        self._tables = (
            [caustic.half(number).tables for number in range(2)] if caustic else [spectral_caustic.no_caustic(scene)]
        )
        self._spectra = camera_scene.spectra(scene, caustic.plan.bins if caustic else 1)
        self._sequences = [sampling.scrambled(seed, part) for part in range(PARTS)]
        self._max_depth, self._bounces = max_depth, scene.render.bounces
        self._caustic_noted = caustic.photons if caustic else 0, caustic_relmse
        super().__init__((height, width, 3), TALLY_SIZE)

    @property
    def samples(self) -> int:
        """Samples of every pixel so far."""
        return self.amount

    @property
    def amount_words(self) -> str:
        """Samples for people."""
        return f"{self.samples} samples a pixel"

    @property
    def exhausted(self) -> bool:
        """Whether the sequence has no fresh points left."""
        return int(self.units.max()) >= _LAST_SAMPLE

    def picture(self) -> CameraPicture:
        """What has been gathered; black without variance before the first round."""
        halves = len(self._tables) > 1
        return summed_camera(self.sums, self.units, self.tallies, self.seconds, halves, self._caustic_noted)

    def kept(self) -> dict[str, object]:
        """With what is noted of the caustic."""
        photons, relmse = self._caustic_noted
        return super().kept() | {"caustic_photons": photons, "caustic_relmse": relmse}

    def restore(self, stored: Mapping[str, np.ndarray]) -> None:
        """With what was noted of the caustic then: it may have grown since."""
        super().restore(stored)
        self._caustic_noted = int(stored["caustic_photons"]), float(stored["caustic_relmse"])

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
            self._bounces,
            self.sums[part],
            self.tallies[part],
            self._scratch(),
        )
        self.units[part] += count


def summed_camera(
    sums: np.ndarray,
    units: np.ndarray,
    tallies: np.ndarray,
    seconds: float,
    halves: bool = False,
    caustic_noted: tuple[int, float] = (0, 0.0),
) -> CameraPicture:
    """The picture from the sums (PARTS, H, W, 3) and tallies (PARTS, TALLY_SIZE) of parts with `units` (PARTS,) samples
    a pixel.

    `halves`: even parts have one thing in common, the caustic they looked up, and so have odd ones: two independent
    pictures."""
    total = max(int(units.sum()), 1)
    mean = sums.sum(axis=0) / total
    variance = np.zeros_like(mean)
    if halves:
        sums, units = (np.stack([values[half::2].sum(axis=0) for half in range(2)]) for values in (sums, units))
    used = np.flatnonzero(units)
    if len(used) > 1:
        for part in used:
            variance += units[part] / total * (sums[part] / units[part] - mean) ** 2
        variance /= len(used) - 1
    lost = tallies.sum(axis=0)[:2] / (total * mean.shape[0] * mean.shape[1])
    fates = {"depth": float(lost[0]), "numeric": float(lost[1])}
    return CameraPicture(mean, variance, total if used.size else 0, seconds, fates, *caustic_noted)


_SEED = 1
_CAUSTIC_SHARE = 0.5
"""Share of the progress bar for the caustic, where one must be made."""


def camera_reference_key(scene: Scene, width: int, height: int, max_depth: int, caustic: CausticPlan | None) -> str:
    """SHA-256 over everything the picture depends on, the code that makes it included."""
    plan = None if caustic is None else astuple(caustic)
    return picture_key(scene, code_key("camera_reference"), description(scene), width, height, max_depth, plan)


def render_camera_reference(
    scene: Scene,
    width: int,
    height: int,
    *,
    samples: int | None = None,
    seconds: float | None = None,
    target_relmse: float | None = None,
    seed: int = 1,
    max_depth: int = MAX_DEPTH,
    caustic: SpectralCaustic | None = None,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
) -> CameraPicture:
    """What the camera of `scene` sees, until `samples` a pixel, `seconds` or `target_relmse` is reached, whichever
    comes first.

    `caustic` (`spectral_caustic.build_caustic`, made of the same scene) adds the light that came by glass and mirrors;
    without it such light is missing. What was done when `cancelled()` turned true is kept. Raises ValueError without
    any limit, UserError without numba or where too many solids nest.
    """
    progress(0.0, "preparing")
    limits = Limits(samples, seconds, target_relmse)
    return continue_run(CameraRun(scene, width, height, max_depth, seed, caustic), limits, progress, cancelled)


def cached_camera_reference(
    scene: Scene,
    width: int,
    height: int,
    *,
    samples: int | None = None,
    seconds: float | None = None,
    target_relmse: float | None = None,
    max_depth: int = MAX_DEPTH,
    caustic: CausticPlan | None = None,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
    folder: Path | None = None,
) -> CameraPicture:
    """The stored picture where it is good enough, otherwise what is stored and more samples, stored again.

    Limits as in `render_camera_reference`; `samples` counts those that are stored, `seconds` only the time spent now,
    the caustic's not counted. That is given as a plan and loaded, or made, only when samples are needed. A damaged file
    is ignored; a folder that cannot be written costs only the saving; an interrupt stores what is done.
    """

    def picture_of(stored: Mapping[str, np.ndarray]) -> CameraPicture:
        values = stored["sums"], stored["units"], stored["tallies"], float(stored["seconds"])
        noted = int(stored["caustic_photons"]), float(stored["caustic_relmse"])
        return summed_camera(*values, caustic is not None, noted)

    def begin(stored: Mapping[str, np.ndarray] | None) -> CameraRun:
        progress(0.0, "preparing")
        tables, noise = None, 0.0
        if caustic is not None:
            tables, noise = _caustic(scene, width, height, max_depth, caustic, folder, progress)
        run = CameraRun(scene, width, height, max_depth, _SEED, tables, noise)
        if stored is not None:
            run.restore(stored)
        return run

    path = kept_path(camera_reference_key(scene, width, height, max_depth, caustic), folder)
    shapes = {"sums": (PARTS, height, width, 3), "units": (PARTS,), "tallies": (PARTS, TALLY_SIZE)}
    shapes |= {"seconds": (), "caustic_photons": (), "caustic_relmse": ()}
    first = 0.0 if caustic is None else _CAUSTIC_SHARE
    return continue_kept(
        path,
        shapes,
        picture_of,
        begin,
        Limits(samples, seconds, target_relmse),
        lambda done, text: progress(first + (1.0 - first) * done, text),
        cancelled,
    )


def _caustic(
    scene: Scene, width: int, height: int, max_depth: int, plan: CausticPlan, folder: Path | None, progress: Progress
) -> tuple[SpectralCaustic, float]:
    """The caustic as far as `plan` asks for, and the noise it leaves in the picture."""
    from .caustic_cache import CachedCaustic

    any_number = replace(plan, photons=0, target_relmse=0.0)
    key = camera_reference_key(scene, width, height, max_depth, any_number)

    def noise_of(caustic: SpectralCaustic) -> float:
        return picture_noise(scene, width, height, max_depth, caustic)

    return CachedCaustic(scene, width, height, plan, key, folder, noise_of).grown(
        lambda done, text: progress(_CAUSTIC_SHARE * done, text)
    )


def picture_noise(scene: Scene, width: int, height: int, max_depth: int, caustic: SpectralCaustic) -> float:
    """relMSE that the caustic's noise adds to a picture, mean[var/(R² + ε)].

    Both halves are looked up by the same paths, and what the parts' differences have in common is no noise of the
    paths.
    """
    runs = [CameraRun(scene, width, height, max_depth, caustic=caustic.half(number)) for number in range(2)]
    for run in runs:
        while run.samples < _NOISE_SAMPLES:
            run.advance(_NOISE_SAMPLES - run.samples)
    even, odd = (run.sums / run.units[:, None, None, None] for run in runs)
    apart = even - odd
    variance = 0.25 * (apart.sum(axis=0) ** 2 - (apart**2).sum(axis=0)) / (PARTS * (PARTS - 1))
    mean = 0.5 * (even + odd).mean(axis=0)
    return max(relative_variance(mean, variance), 0.0)
