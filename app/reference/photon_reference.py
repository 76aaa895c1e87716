"""The converged picture that `bench` and the tests measure errors against.

It shares no code with the shaders, the emission lattice, the splats, the maps or the camera pass:
exact float64 intersections, a random wavelength, one photon one pixel, no footprint. The caustic
layer alone: light that reached a diffuse surface by glass or mirrors, on what the camera sees
directly.

References are kept by the content of their scene, and grow: asked for less error, more photons are
added. One `.npz` a scene, size and depth in the user's cache folder holds the sums of all
independent parts and how far each went, so that a later call goes on with fresh points of the same sequences.
"""

from __future__ import annotations

from pathlib import Path

from ..model.content_key import scene_key as model_scene_key
from ..model.scene import Scene
from .kept import kept_path, load_kept, save_kept
from .photon_run import TALLY_SIZE, ReferencePicture, ReferenceRun, summed
from .rounds import PARTS, Cancelled, Progress, continue_run

REFERENCE_VERSION = 1
"""Grows whenever the same scene would give another picture."""
_SEED = 1


def scene_key(scene: Scene, width: int, height: int, max_depth: int) -> str:
    """SHA-256 over everything the picture depends on: names, notes and the background do not count."""
    return model_scene_key(scene, REFERENCE_VERSION, width, height, max_depth)


def render_reference(
    scene: Scene,
    width: int,
    height: int,
    *,
    max_depth: int = 64,
    photons: int | None = None,
    seconds: float | None = None,
    target_relmse: float | None = None,
    seed: int = 1,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
) -> ReferencePicture:
    """The caustic layer of `scene`, until `photons`, `seconds` or `target_relmse` is reached, whichever comes first.

    What was done when `cancelled()` turned true is kept. Raises ValueError without any limit, UserError
    without numba or where too many solids nest.
    """
    progress(0.0, "preparing")
    return continue_run(
        ReferenceRun(scene, width, height, max_depth, seed), photons, seconds, target_relmse, progress, cancelled
    )


def cached_reference(
    scene: Scene,
    width: int,
    height: int,
    *,
    max_depth: int = 64,
    photons: int | None = None,
    seconds: float | None = None,
    target_relmse: float | None = None,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
    folder: Path | None = None,
) -> ReferencePicture:
    """The stored picture where it is good enough, otherwise what is stored and more photons, stored again.

    Limits as in `render_reference`; `photons` counts those that are stored, `seconds` only the time spent
    now: with `seconds` alone every call adds. A damaged file is ignored; a folder that cannot be written
    costs only the saving. An interrupt (KeyboardInterrupt) stores what is done and goes on upwards.
    """
    path = kept_path(scene_key(scene, width, height, max_depth), folder)
    stored = load_kept(
        path,
        {
            "sums": (PARTS, height, width, 3),
            "units": (PARTS,),
            "tallies": (PARTS, TALLY_SIZE),
            "seconds": (),
            "unit": (),
        },
    )
    if stored is not None:
        picture = summed(
            stored["sums"], stored["units"], stored["tallies"], int(stored["unit"]), float(stored["seconds"])
        )
        if _suffices(picture, photons, target_relmse):
            return picture
    progress(0.0, "preparing")
    run = ReferenceRun(scene, width, height, max_depth, _SEED)
    if stored is not None and int(stored["unit"]) == run.unit:
        run.sums[:], run.units[:], run.tallies[:] = stored["sums"], stored["units"], stored["tallies"]
        run.seconds = float(stored["seconds"])
    before = run.photons
    try:
        return continue_run(run, photons, seconds, target_relmse, progress, cancelled)
    finally:
        if run.photons > before:
            save_kept(path, sums=run.sums, units=run.units, tallies=run.tallies, seconds=run.seconds, unit=run.unit)


def _suffices(picture: ReferencePicture, photons: int | None, target_relmse: float | None) -> bool:
    enough = photons is not None and picture.photons >= photons
    return enough or (target_relmse is not None and picture.is_within(target_relmse))
