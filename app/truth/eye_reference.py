"""The converged picture of everything a camera sees, that the eye half is measured against.

It shares no code with the shaders, the maps or the eye pass: float64 paths of one random wavelength each through
glass and over mirrors, exact Fresnel by chance, textures and environments looked up at random points. With a
`SpectralCaustic` the caustic lies on what is seen, each wavelength of it where that wavelength sees it.

Known bounds: a diffuse surface sends back direct light and the caustic, nothing that came from other diffuse
surfaces or from the environment, as in the renderer; caustics need flat receivers.

Pictures are kept by the content of their scene beside those of `photon_reference`, in the same kind of file, and grow.
"""

from __future__ import annotations

import hashlib
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.model.scene import Diffuse, Scene
from app.truth.eye_run import (
    MAX_DEPTH,
    EyePicture,
    EyeRun,
    continue_eye_run,
    summed_eye,
)
from app.truth.photon_reference import _load, _path, _save, scene_key
from app.truth.photon_run import Cancelled, Progress

if TYPE_CHECKING:
    from app.truth.spectral_caustic import CausticPlan, SpectralCaustic

EYE_REFERENCE_VERSION = 1
"""Grows whenever the same scene would give another picture."""
_SEED = 1


def eye_scene_key(scene: Scene, width: int, height: int, max_depth: int, caustic: CausticPlan | None) -> str:
    """SHA-256 over everything the picture depends on, textures and what lies beyond included; names and notes do not count."""
    digest = hashlib.sha256(scene_key(scene, width, height, max_depth).encode())

    def add(label: str, *values: object) -> None:
        digest.update(f"\n{label}:".encode())
        for value in values:
            if isinstance(value, np.ndarray):
                digest.update(f"{value.dtype.str}{value.shape}".encode())
                digest.update(np.ascontiguousarray(value))
            else:
                digest.update(f"{value!r};".encode())

    add("eye", EYE_REFERENCE_VERSION, None if caustic is None else astuple(caustic))
    if scene.environment is None:
        add("background", *(float(v) for v in scene.background_rgb))
    else:
        add("environment", scene.environment.rgb, np.asarray(scene.environment.world_to_local, float))
    for index, item in enumerate(scene.objects):
        if isinstance(item.material, Diffuse) and item.material.texture is not None:
            add("texture", index, item.material.texture.rgb, item.material.texture.wrap, item.mesh.uv)
    return digest.hexdigest()


def render_eye_reference(
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
) -> EyePicture:
    """What the camera of `scene` sees, until `samples` a pixel, `seconds` or `target_relmse` is reached, whichever comes first.

    `caustic` (`spectral_caustic.build_caustic`, made of the same scene) adds the light that came by glass and mirrors; without it
    such light is missing. What was done when `cancelled()` turned true is kept. Raises ValueError without any limit, UserError
    without numba or where too many solids nest.
    """
    progress(0.0, "preparing")
    return continue_eye_run(EyeRun(scene, width, height, max_depth, seed, caustic), samples, seconds, target_relmse, progress, cancelled)


def cached_eye_reference(
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
) -> EyePicture:
    """The stored picture where it is good enough, otherwise what is stored and more samples, stored again.

    Limits as in `render_eye_reference`; `samples` counts those that are stored, `seconds` only the time spent now. The
    caustic is given as a plan and made only when samples are needed (the same plan gives the same caustic). A damaged
    file is ignored; a folder that cannot be written costs only the saving; an interrupt stores what is done.
    """
    path = _path(eye_scene_key(scene, width, height, max_depth, caustic), folder)
    stored = _load(path, (height, width))
    if stored is not None:
        picture = summed_eye(stored["sums"], stored["units"], stored["tallies"], float(stored["seconds"]))
        if (samples is not None and picture.samples >= samples) or (target_relmse is not None and picture.is_within(target_relmse)):
            return picture
    progress(0.0, "preparing")
    run = EyeRun(scene, width, height, max_depth, _SEED, _built(scene, width, height, caustic, progress))
    if stored is not None:
        run.sums[:], run.units[:], run.tallies[:] = stored["sums"], stored["units"], stored["tallies"]
        run.seconds = float(stored["seconds"])
    before = run.samples
    try:
        return continue_eye_run(run, samples, seconds, target_relmse, progress, cancelled)
    finally:
        if path is not None and run.samples > before:
            _save(path, run)


def _built(scene: Scene, width: int, height: int, plan: CausticPlan | None, progress: Progress) -> SpectralCaustic | None:
    if plan is None:
        return None
    from app.truth.spectral_caustic import build_caustic

    return build_caustic(scene, width, height, plan, progress)
