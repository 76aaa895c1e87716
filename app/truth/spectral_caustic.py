"""The caustic as the eye's reference looks it up: histograms of photons on flat receivers, by place and wavelength.

The photons start as those of the light's reference do. A pilot of camera paths, through glass too, finds which sides of which
receivers are seen and how finely; a pilot of photons finds where light lands there (`caustic_windows`). Receivers must be
flat: a curved one that is both lit by way of glass and seen raises UserError.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from app.errors import UserError
from app.model.scene import Scene
from app.truth import caustic_kernel, eye_kernel, photon_emission, photon_scene
from app.truth.caustic_windows import (
    TEXELS_A_PIXEL,
    Landed,
    Seen,
    fit_windows,
    free_areas,
    no_caustic,
    receiver_planes,
    within,
)
from app.truth.eye_kernel import CausticTables
from app.truth.eye_optics import scratch
from app.truth.eye_scene import line_wavelengths
from app.truth.eye_start import camera_start
from app.truth.photon_emission import Domain
from app.truth.photon_emit import GRID
from app.truth.photon_kernel import scrambled
from app.truth.photon_run import PARTS, RELMSE_EPSILON
from app.truth.photon_scene import Colours

__all__ = ["CausticPlan", "SpectralCaustic", "build_caustic", "no_caustic"]

_PILOT = 1 << 16
_CHUNK = 1 << 17
_PILOT_NM = 550.0
_FLOOR = 0.05
"""Of the photons: shared evenly by all domains, whatever the pilot found."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class CausticPlan:
    """How a `SpectralCaustic` is to be made."""

    photons: int = 1 << 26
    bins: int = 48
    """Over 380 to 780 nm; every line of a light has one of its own besides."""
    texel_size: float | None = None
    """Units, of the fine windows; None: a third of what a pixel covers there."""
    max_texels: int = 1 << 18
    """Of all fine windows together; beyond it texels grow."""
    max_depth: int = 64
    seed: int = 1


@dataclass(frozen=True, eq=False)
class SpectralCaustic:
    """Spectral irradiance by glass and mirrors on the flat receivers that a camera sees."""

    plan: CausticPlan
    tables: CausticTables
    relmse: float
    """Own error of the fine windows' texels, averaged over blocks of the side of a pixel: mean[var/(E² + ε)] on power."""
    landed_w: float
    """Power on all receivers."""
    outside_w: float
    """Of it, power where the camera's pilot saw nothing."""

    def irradiance(self, side: int, window: int) -> np.ndarray:
        """W/unit² of each bin on a side's window (0 coarse, 1 fine), float32 (rows, columns, bins); row 0 at the window's lower corner."""
        columns, rows = self.tables.size[side, window]
        first = self.tables.first[side, window]
        return self.tables.irradiance[first : first + rows * columns * self.tables.bins].reshape(rows, columns, self.tables.bins)


def build_caustic(scene: Scene, width: int, height: int, plan: CausticPlan | None = None, progress: Progress = lambda fraction, text: None) -> SpectralCaustic:
    """Trace `plan.photons` and sort them, for pictures of about `width` × `height` pixels by the scene's camera.

    Raises UserError where light comes by way of glass or mirrors to a curved diffuse object that is seen.
    """
    return _Build(scene, width, height, plan or CausticPlan()).run(progress)


class _Build:
    """One build: the scene's arrays, the pilots' windows, then the photons."""

    def __init__(self, scene: Scene, width: int, height: int, plan: CausticPlan) -> None:
        self.scene, self.plan = scene, plan
        self.photons, centre = photon_scene.photon_scene(scene)
        self.camera = photon_scene.eye(scene.camera, width, height, centre)
        self.planes = receiver_planes(scene, self.photons)
        self.domains, self.colours = self._domains(centre)
        lines = line_wavelengths(scene)
        self.bins = plan.bins + len(lines)
        self.bands = [_band_of(plan.bins, colour, lines) for colour in self.colours]

    def run(self, progress: Progress) -> SpectralCaustic:
        seen = self._seen()
        pilot = [self._land(d, PARTS, 0, _PILOT, 1.0 / _PILOT) for d in range(len(self.domains))]
        if not pilot or not len(seen.side):
            return SpectralCaustic(self.plan, no_caustic(self.scene), 0.0, 0.0, 0.0)
        lit = Landed(*(np.concatenate(parts) for parts in zip(*pilot, strict=True)))
        self._refuse_curved(seen, lit)
        tables, wanted = fit_windows(self.planes, seen, lit, self.bins, self._texel, self.plan.max_texels)
        sums = np.zeros(len(tables.irradiance))
        parts = np.zeros((PARTS, len(sums) // self.bins))
        outside = landed = 0.0
        for done, (part, found) in enumerate(self._chunks(self._aim(pilot, tables, wanted)), start=1):
            outside += caustic_kernel.gather(tables, *found, len(found.watts), sums, parts[part])
            landed += float(found.watts.sum())
            progress(min(done * _CHUNK / self.plan.photons, 1.0), "caustic for the eye's reference")
        for side in np.flatnonzero(wanted):
            for window in range(2):
                texels = int(np.prod(tables.size[side, window]))
                values = sums[tables.first[side, window] :][: texels * self.bins].reshape(texels, self.bins)
                area = free_areas(tables, side, window)[:, None]
                np.divide(values, area, out=values, where=area > 0.0)
        tables.irradiance[:] = sums
        return SpectralCaustic(self.plan, tables, _relmse(tables, parts), landed, outside)

    def _domains(self, centre: np.ndarray) -> tuple[list[Domain], list[Colours]]:
        specular = photon_scene.specular_corners(self.photons)
        corners = self.photons.corners
        reach = float(np.linalg.norm(corners[:, :3], axis=1).max() + np.linalg.norm(corners[:, 3:].reshape(-1, 3), axis=1).max())
        classes, _ = photon_scene.reflectance_classes(self.scene)
        domains: list[Domain] = []
        colours: list[Colours] = []
        for light in self.scene.lights:
            if light.spectral_power.power_w() > 0.0:
                found = photon_emission.domains(light, specular, centre, reach)
                domains += found
                colours += [photon_scene.colours(light.spectral_power, classes)] * len(found)
        return domains, colours

    def _seen(self) -> Seen:
        points, which = np.empty((_PILOT, 4)), np.empty((_PILOT, 2), np.int32)
        found = eye_kernel.seen_points(
            self.photons, self.camera, camera_start(self.scene, self.photons), scrambled(self.plan.seed, PARTS + 1, 0),
            _PILOT, _PILOT_NM, self.plan.max_depth, self.planes.side, points, which, scratch(),
        )  # fmt: skip
        return Seen(points[:found, :3], points[:found, 3], which[:found, 0])

    def _land(self, d: int, part: int, first: int, count: int, share: float) -> Landed:
        found = Landed(np.empty((count, 3)), np.empty(count), np.empty((count, 4), np.int32))
        landed = caustic_kernel.land(
            self.photons, self.domains[d], self.colours[d], self.bands[d], self.planes.side, scrambled(self.plan.seed, part, d),
            first, count, share, self.plan.max_depth, *found, scratch(),
        )  # fmt: skip
        return Landed(*(values[:landed] for values in found))

    def _refuse_curved(self, seen: Seen, lit: Landed) -> None:
        for side in np.intersect1d(seen.side, lit.ends[:, 0]):
            if not self.planes.is_flat[side]:
                name = self.scene.objects[self.planes.owner[side]].name
                raise UserError(
                    f"scene '{self.scene.name}': glass throws light on '{name}', which is not flat, and the eye's reference "
                    "looks caustics up on flat receivers only; make it flat, or black"
                )

    def _texel(self, distance: float) -> float:
        if self.plan.texel_size is not None:
            return self.plan.texel_size
        pixel = 2.0 * self.camera.half_height / self.camera.height
        return (pixel if self.camera.orthographic else pixel * distance) / TEXELS_A_PIXEL

    def _aim(self, pilot: list[Landed], tables: CausticTables, wanted: np.ndarray) -> list[int]:
        """Sets the domains' densities by what the pilot brought to the windows; photons of each domain in a part."""
        weight = []
        for d, found in enumerate(pilot):
            useful = np.zeros(len(found.watts), bool)
            for side in np.flatnonzero(wanted):
                here = np.flatnonzero(found.ends[:, 0] == side)
                useful[here[within(tables, side, self.planes.flat(side, found.points[here]))]] = True
            importance = np.zeros((GRID, GRID))
            np.add.at(importance, (found.ends[useful, 2], found.ends[useful, 3]), found.watts[useful] ** 2)
            self.domains[d] = photon_emission.refined(self.domains[d], importance)
            weight.append(math.sqrt(float(importance.sum())))
        total = sum(weight)
        if total <= 0.0:
            return [0] * len(weight)
        shares = [(1.0 - _FLOOR) * w / total + _FLOOR / len(weight) for w in weight]
        return [max(int(self.plan.photons * share) // PARTS, 1) for share in shares]

    def _chunks(self, counts: list[int]) -> Iterator[tuple[int, Landed]]:
        """Landed photons of every chunk, with the number of its part; always in the same order."""
        jobs = [
            (d, part, first, min(_CHUNK, count - first), 1.0 / (PARTS * count))
            for d, count in enumerate(counts) for part in range(PARTS) for first in range(0, count, _CHUNK)
        ]  # fmt: skip
        threads = min(PARTS, os.cpu_count() or 1)
        with ThreadPoolExecutor(threads) as pool:
            for at in range(0, len(jobs), 4 * threads):  # a few at a time: landed photons take memory
                batch = jobs[at : at + 4 * threads]
                for job, found in zip(batch, pool.map(lambda job: self._land(*job), batch), strict=True):
                    yield job[1], found


def _band_of(bins: int, colour: Colours, lines: list[float]) -> np.ndarray:
    """Bin of each atom of a light's spectrum, as `eye_scene.spectra` numbers them: int32 (A,)."""
    cell = np.clip(np.rint(colour.start_nm + 0.5 * colour.width_nm).astype(int) - 380, 0, 400)
    line = bins + np.searchsorted(np.array(lines, float), colour.start_nm)
    return np.where(colour.width_nm > 0.0, cell * bins // 401, line).astype(np.int32)


def _relmse(tables: CausticTables, parts: np.ndarray) -> float:
    """Of the fine windows, in blocks of about a pixel's side, from the power (PARTS, texels) of independent parts."""
    error, count = 0.0, 0
    block = int(TEXELS_A_PIXEL)
    for side in range(len(tables.first)):
        width, height = tables.size[side, 1].tolist()
        columns, rows = width // block, height // block
        first = int(tables.first[side, 1] // tables.bins)
        images = parts[:, first : first + width * height].reshape(PARTS, height, width)[:, : rows * block, : columns * block]
        images = images.reshape(PARTS, rows, block, columns, block).sum(axis=(2, 4))
        mean = images.mean(axis=0)
        epsilon = RELMSE_EPSILON * float(mean.mean()) ** 2 if mean.size else 0.0
        if epsilon > 0.0:
            error += float((images.var(axis=0, ddof=1) / PARTS / (mean**2 + epsilon)).sum())
            count += mean.size
    return error / count if count else 0.0
