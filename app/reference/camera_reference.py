"""The converged picture of everything a camera sees, that the camera pass is measured against.

It shares no code with the shaders, the maps or the camera pass: float64 paths of one random wavelength each through
glass and over mirrors, exact Fresnel by chance, textures and environments looked up at random points. With a
`SpectralCaustic` the caustic lies on what is seen, each wavelength of it where that wavelength sees it.

Diffuse surfaces send back direct light, the caustic, the environment's light, and what the scene's `bounces` bring of
other diffuse surfaces. Known bound: caustics need flat receivers.

Pictures are kept by the content of their scene beside those of `photon_reference`, in the same kind of file, and grow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..model.scene import Scene
from ..model.scene_key import picture_key
from .camera_run import MAX_DEPTH, CameraPicture, CameraRun, summed_camera
from .code_key import code_key
from .exact_shapes import description
from .kept import continue_kept, kept_path
from .photon_run import TALLY_SIZE
from .rounds import PARTS, Cancelled, Limits, Progress, continue_run

if TYPE_CHECKING:
    from .spectral_caustic import CausticPlan, SpectralCaustic

_SEED = 1
_CAUSTIC_SHARE = 0.5
"""Of the progress bar, where there is a caustic to be made."""


def camera_reference_key(scene: Scene, width: int, height: int, max_depth: int, caustic: CausticPlan | None) -> str:
    """SHA-256 over everything the picture depends on, the code that makes it included."""
    plan = None if caustic is None else astuple(caustic)
    return picture_key(scene, code_key("camera_run"), description(scene), width, height, max_depth, plan)


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
    return CachedCaustic(scene, width, height, max_depth, plan, key, folder).grown(
        lambda done, text: progress(_CAUSTIC_SHARE * done, text)
    )
