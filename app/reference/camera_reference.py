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

from dataclasses import astuple, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..model.scene import Scene
from ..model.scene_key import picture_key
from .code_key import code_key
from .rounds import (
    PARTS,
    Kind,
    Limits,
    PartsRun,
    Picture,
    Progress,
    continue_kept,
    continue_run,
    kept_path,
    relative_variance,
)
from .scene_surfaces import description

if TYPE_CHECKING:
    from .spectral_caustic import CausticPlan, SpectralCaustic

MAX_DEPTH = 256
_LAST_SAMPLE = 2**31
_NOISE_SAMPLES = 128
"""Samples of each pixel by which the noise is measured."""


KIND = Kind(("depth", "numeric"), per_pixel=True, is_rgb=False, black_amount=256)
"""Fates are shares of paths given up: too many events, nothing met inside a solid."""


class CameraRun(PartsRun):
    """Samples of one picture, added round by round; `picture()` at any time."""

    unit_words = 1.0, "samples a pixel"

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
        caustic's too. Raises UserError where solids nest beyond reach.
        """
        from . import camera_kernel, camera_lights, camera_scene, photon_scene, sampling, spectral_caustic, viewpoint

        self._kernel, self._scratch = camera_kernel, sampling.scratch
        photons, centre = photon_scene.photon_scene(scene)
        photons = photons._replace(backwards=True)
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
        self.kind = replace(KIND, has_halves=caustic is not None)
        super().__init__(width, height)
        self.caustic_noted = caustic.photons if caustic else 0, caustic_relmse

    @property
    def exhausted(self) -> bool:
        """Whether the sequence has no fresh points left."""
        return int(self.units.max()) >= _LAST_SAMPLE

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
    samples: int,
    seed: int = 1,
    max_depth: int = MAX_DEPTH,
    caustic: SpectralCaustic | None = None,
) -> Picture:
    """What the camera of `scene` sees, of `samples` a pixel.

    `caustic` (`spectral_caustic.build_caustic`, made of the same scene) adds the light that came by glass and mirrors;
    without it such light is missing. Raises UserError where too many solids nest.
    """
    return continue_run(CameraRun(scene, width, height, max_depth, seed, caustic), Limits(samples))


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
    folder: Path | None = None,
) -> Picture:
    """The stored picture where it is good enough, otherwise what is stored and more samples, stored again.

    Limits as in `cached_reference`; `samples` counts those that are stored, `seconds` only the time spent now,
    the caustic's not counted. That is given as a plan and loaded, or made, only when samples are needed. A damaged file
    is ignored; a folder that cannot be written costs only the saving; an interrupt stores what is done.
    """

    def begin() -> CameraRun:
        progress(0.0, "preparing")
        tables, noise = None, 0.0
        if caustic is not None:
            tables, noise = _caustic(scene, width, height, max_depth, caustic, folder, progress)
        return CameraRun(scene, width, height, max_depth, caustic=tables, caustic_relmse=noise)

    path = kept_path(camera_reference_key(scene, width, height, max_depth, caustic), folder)
    first = 0.0 if caustic is None else _CAUSTIC_SHARE
    return continue_kept(
        path,
        replace(KIND, has_halves=caustic is not None),
        (width, height),
        begin,
        Limits(samples, seconds, target_relmse),
        lambda done, text: progress(first + (1.0 - first) * done, text),
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
        while run.amount < _NOISE_SAMPLES:
            run.advance(_NOISE_SAMPLES - run.amount)
    even, odd = (run.sums / run.units[:, None, None, None] for run in runs)
    apart = even - odd
    variance = 0.25 * (apart.sum(axis=0) ** 2 - (apart**2).sum(axis=0)) / (PARTS * (PARTS - 1))
    mean = 0.5 * (even + odd).mean(axis=0)
    return max(relative_variance(mean, variance), 0.0)
