"""Where light goes, as arrays: the photons of a picture, and fans of single rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.errors import UserError
from ..edit.stored_photons import StoredPhotons
from ..model.naming import place_of
from ..model.optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM
from .arguments import Count, check_scene, whole
from .device import Cancel, Progress, Report, run
from .scene import Scene
from .session import Session

if TYPE_CHECKING:
    from ..gpu.context import Context

MAX_RAYS, MAX_REFLECTIONS = 100_000, 20


@dataclass(frozen=True)
class Fan:
    """A flat fan of rays from a light through an object, each ray at every wavelength."""

    wavelengths_nm: NDArray[np.float64]
    """(W,)."""
    points: NDArray[np.float64]
    """(rays, W, P, 3), world: the corners of every path from its start on, NaN after its last one."""

    @property
    def lengths(self) -> NDArray[np.int64]:
        """(rays, W): how many points each path has."""
        lengths: NDArray[np.int64] = np.isfinite(self.points[..., 0]).sum(axis=-1)
        return lengths

    @property
    def directions(self) -> NDArray[np.float64]:
        """(rays, W, 3): unit direction of every path's last segment."""
        last = self.lengths[..., None, None] - 1
        end, before = (np.take_along_axis(self.points, at, axis=2)[:, :, 0] for at in (last, last - 1))
        unit: NDArray[np.float64] = (end - before) / np.linalg.norm(end - before, axis=-1, keepdims=True)
        return unit


def trace(
    scene: Scene,
    *,
    photons: Count | None = None,
    seed: int | None = None,
    limit: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> StoredPhotons:
    """Trace `photons` and return those that landed after at least one refraction or reflection; see `Photons`.

    `limit`: return about so many of them, evenly chosen and each standing for more light. Raises `UserError`.
    """
    with Session(scene, size=(16, 16), photons=photons, seed=seed, spp=1) as session:
        return session.photons(limit, progress=progress, cancel=cancel)


def fan(
    scene: Scene,
    through: str,
    *,
    light: str | None = None,
    rays: int = 9,
    wavelengths_nm: Sequence[float] = (LINE_F_NM, LINE_D_NM, LINE_C_NM),
    reflections: int = 0,
) -> Fan:
    """Rays from a light (default: that which shines on it most) through object `through`, spread in the plane in which
    it bends light. No ray branches: each is refracted, or reflected where it must be, up to the first surface that is
    neither glass nor mirror; one that leaves the scene ends a scene's radius beyond its last surface. `reflections`:
    within glass, before a ray may leave it; 1 and 2 in a drop of water make the two rainbows.

    Raises `UserError` where a name is unknown or the light misses the object.
    """
    check_scene(scene)
    model = scene._model
    placed = place_of(through, [item.name for item in model.objects], f"scene '{model.name}' has no object")
    source = None
    if light is not None:
        source = place_of(light, [item.name for item in model.lights], f"scene '{model.name}' has no light")
    nm = np.asarray(wavelengths_nm, np.float64).reshape(-1)
    if not len(nm) or not ((nm >= 380.0) & (nm <= 780.0)).all():
        raise UserError("wavelengths_nm must be one or more wavelengths between 380 and 780 nm")
    whole(f"rays, at {len(nm)} wavelengths", rays, 1, MAX_RAYS // len(nm))
    whole("reflections", reflections, 0, MAX_REFLECTIONS)

    def work(context: Context, report: Report, stopped: Cancel) -> Fan:
        from ..model.settings import RenderSettings
        from ..passes.ray_fan import RayFan
        from ..passes.ray_paths import RayPaths
        from ..render.device_scene import scene_buffers

        buffers = scene_buffers(context, model, RenderSettings(any_view=True))
        try:
            tracer = RayFan(RayPaths(context, buffers))
            try:
                lines = [
                    line.points for line in tracer.trace(source, placed, rays, nm.tolist(), reflections=reflections)
                ]
            finally:
                tracer.release()
        finally:
            buffers.release()
        if not lines:
            raise UserError(f"no light of scene '{model.name}' reaches '{through}': aim one at it, or name another")
        points = np.full((len(lines), max(map(len, lines)), 3), np.nan)
        for row, line in zip(points, lines, strict=True):
            row[: len(line)] = line
        return Fan(nm, points.reshape(-1, len(nm), *points.shape[1:]))

    return run(work)
