"""The converged picture that `bench` and the tests measure errors against.

It shares no code with the shaders, the emission lattice, the splats, the maps or the eye pass:
exact float64 intersections, a random wavelength, one photon one pixel, no footprint. The caustic
layer alone: light that reached a diffuse surface by glass or mirrors, on what the camera sees
directly.

References are kept by the content of their scene, and grow: asked for less error, more photons are
added. One `.npz` a scene, size and depth in the user's cache folder holds the sums of all
independent parts and how far each went, so that a later call goes on with fresh points of the same sequences.
"""

from __future__ import annotations

import hashlib
import os
import zipfile
from contextlib import suppress
from dataclasses import astuple
from pathlib import Path

import numpy as np

from app import paths
from app.atomic import atomic_output
from app.errors import UserError
from app.model.colorimetry import VISIBLE_NM
from app.model.scene import Dielectric, Diffuse, Mirror, Scene
from app.truth.photon_run import (
    PARTS,
    TALLY_SIZE,
    Cancelled,
    Progress,
    ReferencePicture,
    ReferenceRun,
    continue_run,
    summed,
)

REFERENCE_VERSION = 1
"""Grows whenever the same scene would give another picture."""
_CACHE_BYTES = 2 << 30
_SEED = 1


def scene_key(scene: Scene, width: int, height: int, max_depth: int) -> str:
    """SHA-256 over everything the picture depends on: names, notes and the background do not count."""
    digest = hashlib.sha256()

    def add(label: str, *values: object) -> None:
        digest.update(f"\n{label}:".encode())
        for value in values:
            if isinstance(value, np.ndarray):
                digest.update(f"{value.dtype.str}{value.shape}".encode())
                digest.update(np.ascontiguousarray(value))
            else:
                digest.update(f"{value!r};".encode())

    add("version", REFERENCE_VERSION, width, height, max_depth)
    add("camera", *astuple(scene.camera))
    for light in scene.lights:
        spectrum = light.spectral_power
        fields = {name: value for name, value in vars(light).items() if name not in ("name", "spectral_power")}
        add("light", spectrum.density, spectrum.lines, *(_plain(fields[name]) for name in sorted(fields)))
    for item in scene.objects:
        mesh = item.mesh
        add("mesh", mesh.vertices, mesh.triangles, np.asarray(item.object_to_world, float))
        add("normals", mesh.corner_normals if mesh.corner_normals is not None else None)
        add("material", type(item.material).__name__)
        match item.material:
            case Dielectric(dispersion=dispersion, absorption=absorption, priority=priority):
                add("glass", dispersion.index(VISIBLE_NM), priority, None if absorption is None else absorption.coefficient)
            case Mirror(reflectance_rgb=rgb):
                add("mirror", *(float(v) for v in rgb))
            case Diffuse(reflectance_rgb=rgb, reflectance=reflectance):
                add("diffuse", *(float(v) for v in rgb), reflectance)
    return digest.hexdigest()


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
    return continue_run(ReferenceRun(scene, width, height, max_depth, seed), photons, seconds, target_relmse, progress, cancelled)


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
    path = _path(scene_key(scene, width, height, max_depth), folder)
    stored = _load(path, (height, width))
    if stored is not None:
        picture = summed(stored["sums"], stored["units"], stored["tallies"], int(stored["unit"]), float(stored["seconds"]))
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
        if path is not None and run.photons > before:
            _save(path, run)


_FIELDS = ("sums", "units", "tallies", "seconds", "unit")


def _path(key: str, folder: Path | None) -> Path | None:
    try:
        folder = folder or paths.cache_dir() / "reference"
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder / f"{key}.npz"


def _load(path: Path | None, picture: tuple[int, int]) -> dict[str, np.ndarray] | None:
    """What `_save` wrote; None when it is missing, damaged or of another shape."""
    if path is None or not path.is_file():
        return None
    try:
        with path.open("rb") as file, np.load(file) as stored:
            values = {name: stored[name] for name in _FIELDS}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    shapes = {"sums": (PARTS, *picture, 3), "units": (PARTS,), "tallies": (PARTS, TALLY_SIZE), "seconds": (), "unit": ()}
    if any(values[name].shape != shape for name, shape in shapes.items()):
        return None
    with suppress(OSError):
        os.utime(path)  # the cache forgets the least recently used
    return values


def _save(path: Path, run: ReferenceRun) -> None:
    with suppress(OSError, UserError):  # an unwritable or full cache only costs time
        with atomic_output(path) as temporary:
            np.savez(temporary, sums=run.sums, units=run.units, tallies=run.tallies, seconds=run.seconds, unit=run.unit)
        _forget_oldest(path.parent, path)


def _forget_oldest(folder: Path, newest: Path) -> None:
    """Keep the most recently used references within _CACHE_BYTES, the newest in any case."""
    states = [(path, path.stat()) for path in folder.glob("*.npz")]
    states.sort(key=lambda item: item[1].st_mtime_ns, reverse=True)
    used = 0
    for path, state in states:
        used += state.st_size
        if used > _CACHE_BYTES and path != newest:
            path.unlink(missing_ok=True)


def _suffices(picture: ReferencePicture, photons: int | None, target_relmse: float | None) -> bool:
    enough = photons is not None and picture.photons >= photons
    return enough or (target_relmse is not None and picture.is_within(target_relmse))


def _plain(value: object) -> object:
    """A light's field so that equal values print alike (1 and 1.0, tuples of numpy numbers)."""
    if isinstance(value, str | bool) or value is None:
        return value
    return tuple(float(v) for v in np.ravel(value))
