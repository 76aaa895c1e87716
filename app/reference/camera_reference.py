"""The converged picture of everything a camera sees, that the camera pass is measured against.

It shares no code with the shaders, the maps or the camera pass: float64 paths of one random wavelength each through
glass and over mirrors, exact Fresnel by chance, textures and environments looked up at random points. With a
`SpectralCaustic` the caustic lies on what is seen, each wavelength of it where that wavelength sees it.

Known bounds: a diffuse surface sends back direct light and the caustic, nothing that came from other diffuse
surfaces or from the environment, as in the renderer; caustics need flat receivers.

Pictures are kept by the content of their scene beside those of `photon_reference`, in the same kind of file, and grow.
"""

from __future__ import annotations

from dataclasses import astuple, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..model.content_key import ContentKey
from ..model.scene import Scene
from .camera_run import MAX_DEPTH, CameraPicture, CameraRun, summed_camera
from .kept import kept_path, load_kept, save_kept
from .photon_reference import scene_key
from .photon_run import TALLY_SIZE
from .rounds import PARTS, Cancelled, Progress, continue_run

if TYPE_CHECKING:
    from .spectral_caustic import CausticPlan, SpectralCaustic

CAMERA_REFERENCE_VERSION = 1
"""Grows whenever the same scene would give another picture."""
CAUSTIC_VERSION = 3
"""Grows whenever the same plan would give another caustic."""
_SEED = 1
_CAUSTIC_SHARE = 0.5
"""Of the progress bar, where there is a caustic to be made."""


def camera_scene_key(scene: Scene, width: int, height: int, max_depth: int, caustic: CausticPlan | None) -> str:
    """SHA-256 over everything the picture depends on, textures and what lies beyond included; names and notes do not
    count."""
    key = ContentKey(scene_key(scene, width, height, max_depth))
    key.add("camera", CAMERA_REFERENCE_VERSION, None if caustic is None else (CAUSTIC_VERSION, *astuple(caustic)))
    if scene.environment is None:
        key.add("background", *(float(v) for v in scene.background_rgb))
    else:
        key.add("environment", scene.environment.rgb, np.asarray(scene.environment.world_to_local, float))
    for index, item in enumerate(scene.objects):
        if item.material.texture is not None:
            key.add("texture", index, item.material.texture.rgb, item.material.texture.wrap, item.mesh.uv)
    return key.hexdigest()


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
    return continue_run(
        CameraRun(scene, width, height, max_depth, seed, caustic), samples, seconds, target_relmse, progress, cancelled
    )


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
    path = kept_path(camera_scene_key(scene, width, height, max_depth, caustic), folder)
    shapes = {"sums": (PARTS, height, width, 3), "units": (PARTS,), "tallies": (PARTS, TALLY_SIZE), "seconds": ()}
    stored = load_kept(path, shapes if caustic is None else shapes | {"caustic_photons": (), "caustic_relmse": ()})
    looked_up = (
        None if stored is None or caustic is None else (int(stored["caustic_photons"]), float(stored["caustic_relmse"]))
    )
    if stored is not None:
        picture = summed_camera(
            stored["sums"], stored["units"], stored["tallies"], float(stored["seconds"]), caustic is not None
        )
        if (samples is not None and picture.samples >= samples) or (
            target_relmse is not None and picture.is_within(target_relmse)
        ):
            return _with_caustic(picture, looked_up)
    progress(0.0, "preparing")
    tables = None
    if caustic is not None:
        tables, noise = _caustic(scene, width, height, max_depth, caustic, folder, progress)
        looked_up = looked_up or (tables.photons, noise)
    run = CameraRun(scene, width, height, max_depth, _SEED, tables)
    if stored is not None:
        run.sums[:], run.units[:], run.tallies[:] = stored["sums"], stored["units"], stored["tallies"]
        run.seconds = float(stored["seconds"])
    before = run.samples
    begin = 0.0 if caustic is None else _CAUSTIC_SHARE
    try:
        picture = continue_run(
            run,
            samples,
            seconds,
            target_relmse,
            lambda done, text: progress(begin + (1.0 - begin) * done, text),
            cancelled,
        )
    finally:
        if run.samples > before:
            more = {} if looked_up is None else {"caustic_photons": looked_up[0], "caustic_relmse": looked_up[1]}
            save_kept(path, sums=run.sums, units=run.units, tallies=run.tallies, seconds=run.seconds, **more)
    return _with_caustic(picture, looked_up)


def _with_caustic(picture: CameraPicture, looked_up: tuple[int, float] | None) -> CameraPicture:
    return picture if looked_up is None else replace(picture, caustic_photons=looked_up[0], caustic_relmse=looked_up[1])


def _caustic(
    scene: Scene, width: int, height: int, max_depth: int, plan: CausticPlan, folder: Path | None, progress: Progress
) -> tuple[SpectralCaustic, float]:
    """The caustic as far as `plan` asks for, and the noise it leaves in the picture."""
    from .caustic_cache import CachedCaustic

    any_number = replace(plan, photons=0, target_relmse=0.0)
    key = camera_scene_key(scene, width, height, max_depth, any_number)
    return CachedCaustic(scene, width, height, max_depth, plan, key, folder).grown(
        lambda done, text: progress(_CAUSTIC_SHARE * done, text)
    )
