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

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..model.scene import Scene
from ..model.scene_key import scene_key
from .code_key import code_key
from .exact_shapes import description
from .kept import continue_kept, kept_path
from .photon_run import TALLY_SIZE, ReferencePicture, ReferenceRun, summed
from .rounds import PARTS, Cancelled, Limits, Progress, continue_run

_SEED = 1


def reference_key(scene: Scene, width: int, height: int, max_depth: int) -> str:
    """SHA-256 over everything the picture depends on, the code that makes it included."""
    return scene_key(scene, code_key("photon_run"), description(scene), width, height, max_depth)


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
    limits = Limits(photons, seconds, target_relmse)
    return continue_run(ReferenceRun(scene, width, height, max_depth, seed), limits, progress, cancelled)


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

    def picture_of(stored: Mapping[str, np.ndarray]) -> ReferencePicture:
        values = stored["sums"], stored["units"], stored["tallies"]
        return summed(*values, int(stored["unit"]), float(stored["seconds"]))

    def begin(stored: Mapping[str, np.ndarray] | None) -> ReferenceRun:
        progress(0.0, "preparing")
        run = ReferenceRun(scene, width, height, max_depth, _SEED)
        if stored is not None and int(stored["unit"]) == run.unit:
            run.restore(stored)
        return run

    path = kept_path(reference_key(scene, width, height, max_depth), folder)
    shapes = {"sums": (PARTS, height, width, 3), "units": (PARTS,), "tallies": (PARTS, TALLY_SIZE)}
    shapes |= {"seconds": (), "unit": ()}
    limits = Limits(photons, seconds, target_relmse)
    return continue_kept(path, shapes, picture_of, begin, limits, progress, cancelled)
