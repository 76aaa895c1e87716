"""The caustic as the eye's reference looks it up: histograms of photons on flat receivers, by place and wavelength.

A pilot of camera paths finds which sides of which receivers are seen, directly or through glass, and how
finely; a pilot of photons finds where light lands there. Every such side gets a coarse window over all that is seen of it
and a fine one over the light; where they overlap only the fine one counts. Receivers must be flat; a curved one that glass throws light on raises UserError.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from app.errors import UserError
from app.model.scene import Diffuse, Scene
from app.truth import caustic_kernel, eye_kernel, photon_emission, photon_scene
from app.truth.eye_kernel import CausticTables
from app.truth.eye_scene import Spectra, spectra
from app.truth.eye_start import camera_start
from app.truth.photon_emission import Domain
from app.truth.photon_emit import GRID
from app.truth.photon_kernel import scrambled
from app.truth.photon_run import PARTS, RELMSE_EPSILON
from app.truth.photon_scene import Colours, PhotonScene

_PILOT = 1 << 16
_CHUNK = 1 << 17
_PILOT_NM = 550.0
_FLAT = 1e-6
"""Share of a receiver's size that its corners may leave a plane."""
_SPREAD = 0.005
"""Of the pilot's power beyond each side of a fine window."""
_FLOOR = 0.05
"""Of the photons: shared evenly by all domains, whatever the pilot found."""
_TEXELS_A_PIXEL = 3.0
_COARSE = 0.05
"""Texels of the coarse window, against the fine one's …"""
_LEAST_COARSE = 1 << 14
"""… and at least."""

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
    spectra: Spectra
    """Wavelengths whose `bin` numbers the tables' bins."""
    relmse: float
    """Own error of the fine windows' texels, averaged over blocks of the side of a pixel: mean[var/(E² + ε)] on power."""
    landed_w: float
    """Power on the counted sides."""
    outside_w: float
    """Of it, power beyond the windows (where the camera's pilot saw nothing)."""

    def irradiance(self, side: int, window: int) -> np.ndarray:
        """W/unit² of each bin on a side's window (0 coarse, 1 fine), float32 (rows, columns, bins); row 0 at the window's lower corner."""
        columns, rows = self.tables.size[side, window]
        first = self.tables.first[side, window]
        return self.tables.irradiance[first : first + rows * columns * self.tables.bins].reshape(rows, columns, self.tables.bins)


def no_caustic(scene: Scene) -> CausticTables:
    """Tables that hold no light."""
    return _tables(np.full((len(scene.objects), 2), -1, np.int32), np.zeros((1, 3, 3)), np.zeros((1, 2, 2)), np.ones((1, 2, 2)), np.zeros((1, 2, 2), np.int64), 1)


def build_caustic(scene: Scene, width: int, height: int, plan: CausticPlan | None = None, progress: Progress = lambda fraction, text: None) -> SpectralCaustic:
    """Trace `plan.photons` and sort them, for pictures of about `width` × `height` pixels by the scene's camera.

    Raises UserError where light lands by way of glass or mirrors on a curved diffuse object.
    """
    plan = plan or CausticPlan()
    return _Build(scene, width, height, plan).run(progress)


class _Build:
    """One build: the scene's arrays, the pilots' windows, then the photons."""

    def __init__(self, scene: Scene, width: int, height: int, plan: CausticPlan) -> None:
        self.scene, self.plan = scene, plan
        self.photons, centre = photon_scene.photon_scene(scene)
        self.camera = photon_scene.eye(scene.camera, width, height, centre)
        self.start = camera_start(scene, self.photons)
        self.spectra = spectra(scene, plan.bins)
        self.bins = plan.bins + len({nm for light in scene.lights for nm, power in light.spectral_power.lines if power > 0.0})
        self.sides, self.frames, self.extents, self.curved = _planes(scene, self.photons)
        self.domains, self.colours = self._domains(centre)
        self.bands = [_band_of(self.plan.bins, c, self.scene) for c in self.colours]

    def run(self, progress: Progress) -> SpectralCaustic:
        landings = [self._land(d, PARTS, 0, _PILOT, 1.0 / _PILOT) for d in range(len(self.domains))]
        self._refuse_curved(landings)
        tables, wanted = self._windows(landings)
        shares = self._aim(landings, tables, wanted)
        sums = np.zeros(len(tables.irradiance))
        texels = len(sums) // self.bins
        parts = np.zeros((PARTS, texels))
        outside = landed = 0.0
        for done, (part, found) in enumerate(self._chunks(shares), start=1):
            points, watts, ends = found
            outside += caustic_kernel.gather(tables, points, watts, ends, len(watts), sums, parts[part])
            landed += float(watts.sum())
            progress(min(done * _CHUNK / self.plan.photons, 1.0), "caustic for the eye's reference")
        relmse = _relmse(tables, parts)
        for side in range(len(tables.first)):
            for window in range(2):
                size = int(np.prod(tables.size[side, window]))
                values = sums[tables.first[side, window] :][: size * self.bins].reshape(size, self.bins)
                area = _areas(tables, side, window)
                np.divide(values, area[:, None], out=values, where=area[:, None] > 0.0)
        tables.irradiance[:] = sums
        return SpectralCaustic(self.plan, tables, self.spectra, relmse, landed, outside)

    def _domains(self, centre: np.ndarray) -> tuple[list[Domain], list[Colours]]:
        specular = photon_scene.specular_corners(self.photons)
        reach = float(np.linalg.norm(self.photons.corners[:, :3], axis=1).max() + np.linalg.norm(self.photons.corners[:, 3:].reshape(-1, 3), axis=1).max())
        classes, _ = photon_scene.reflectance_classes(self.scene)
        domains: list[Domain] = []
        colours: list[Colours] = []
        for light in self.scene.lights:
            if light.spectral_power.power_w() > 0.0:
                found = photon_emission.domains(light, specular, centre, reach)
                domains += found
                colours += [photon_scene.colours(light.spectral_power, classes)] * len(found)
        return domains, colours

    def _land(self, d: int, part: int, first: int, count: int, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        points, watts, ends = np.empty((count, 3)), np.empty(count), np.empty((count, 4), np.int32)
        landed = caustic_kernel.land(
            self.photons, self.domains[d], self.colours[d], self.bands[d], self.sides, scrambled(self.plan.seed, part, d),
            first, count, share, self.plan.max_depth, points, watts, ends,
        )  # fmt: skip
        return points[:landed], watts[:landed], ends[:landed]

    def _refuse_curved(self, landings: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
        for _, _, ends in landings:
            for side in np.unique(ends[:, 0]):
                if side in self.curved:
                    name = self.scene.objects[self.curved[side]].name
                    raise UserError(
                        f"scene '{self.scene.name}': glass throws light on '{name}', which is not flat, and the eye's reference "
                        "looks caustics up on flat receivers only; make it flat, or black"
                    )

    def _windows(self, landings: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> tuple[CausticTables, np.ndarray]:
        """Tables of zeros fitted to what is seen and lit, and the sides that are both, bool (S,)."""
        points, which = np.empty((_PILOT, 4)), np.empty((_PILOT, 2), np.int32)
        found = eye_kernel.seen_points(
            self.photons, self.camera, self.start, scrambled(self.plan.seed, PARTS + 1, 0), _PILOT, _PILOT_NM, self.plan.max_depth, self.sides, points, which
        )
        points, which = points[:found], which[:found]
        sides = len(self.frames)
        low, high, size = np.zeros((sides, 2, 2)), np.ones((sides, 2, 2)), np.zeros((sides, 2, 2), np.int64)
        texel = np.ones(sides)
        wanted = np.zeros(sides, bool)
        lit = [np.concatenate(parts) for parts in zip(*landings, strict=True)] if landings else [np.zeros((0, 3)), np.zeros(0), np.zeros((0, 4), np.int32)]
        for side in range(sides):
            seen = self._flat(side, points[which[:, 0] == side, :3])
            here = lit[2][:, 0] == side
            if not len(seen) or not here.any():
                continue
            low[side, 0], high[side, 0] = _grown(seen.min(axis=0), seen.max(axis=0), 0.1, self.extents[side])
            place, watt = self._flat(side, lit[0][here]), lit[1][here]
            inside = np.all((place >= low[side, 0]) & (place <= high[side, 0]), axis=1)
            if not inside.any():
                continue
            wanted[side] = True
            box = np.array([_quantiles(place[inside, k], watt[inside], _SPREAD) for k in range(2)])
            low[side, 1], high[side, 1] = _grown(box[:, 0], box[:, 1], 0.05, np.array([low[side, 0], high[side, 0]]))
            within = np.all((seen >= low[side, 1]) & (seen <= high[side, 1]), axis=1)
            way = points[which[:, 0] == side, 3]
            texel[side] = self.plan.texel_size or self._pixel(float(np.median(way[within] if within.any() else way))) / _TEXELS_A_PIXEL
        span = np.maximum(high - low, 1e-300)
        total = float(np.sum(np.prod(span[wanted, 1], axis=1) / texel[wanted] ** 2))
        grow = math.sqrt(max(total / self.plan.max_texels, 1.0))
        for side in np.flatnonzero(wanted):
            size[side, 1] = np.maximum(np.ceil(span[side, 1] / (texel[side] * grow) - 1e-9), 1)
            texels = max(_COARSE * float(np.prod(size[side, 1])), _LEAST_COARSE)
            size[side, 0] = np.maximum(np.ceil(span[side, 0] * math.sqrt(texels / np.prod(span[side, 0]))), 1)
        numbers = np.where(self.sides >= 0, np.where(wanted[np.maximum(self.sides, 0)], self.sides, -1), -1) if sides else self.sides
        if not sides:
            return no_caustic(self.scene), wanted
        return _tables(numbers.astype(np.int32), self.frames, low, np.maximum(size, 1) / span, size, self.bins), wanted

    def _pixel(self, distance: float) -> float:
        side = 2.0 * self.camera.half_height / self.camera.height
        return side if self.camera.orthographic else side * distance

    def _flat(self, side: int, points: np.ndarray) -> np.ndarray:
        return (points - self.frames[side, 0]) @ self.frames[side, 1:].T

    def _aim(self, landings: list[tuple[np.ndarray, np.ndarray, np.ndarray]], tables: CausticTables, wanted: np.ndarray) -> list[int]:
        """Densities by what the pilot's photons brought to the windows; photons of each domain (of a part)."""
        weight = []
        for d, (points, watts, ends) in enumerate(landings):
            importance = np.zeros((GRID, GRID))
            useful = np.zeros(len(watts), bool)
            for side in np.flatnonzero(wanted):
                here = np.flatnonzero(ends[:, 0] == side)
                place = self._flat(side, points[here])
                window = tables.low[side, 0], tables.low[side, 0] + tables.size[side, 0] / tables.texels_per_unit[side, 0]
                useful[here[np.all((place >= window[0]) & (place <= window[1]), axis=1)]] = True
            np.add.at(importance, (ends[useful, 2], ends[useful, 3]), watts[useful] ** 2)
            self.domains[d] = photon_emission.refined(self.domains[d], importance)
            weight.append(math.sqrt(float(importance.sum())))
        total = sum(weight)
        if total <= 0.0:
            return [0] * len(weight)
        shares = [(1.0 - _FLOOR) * w / total + _FLOOR / len(weight) for w in weight]
        return [max(int(self.plan.photons * share) // PARTS, 1) for share in shares]

    def _chunks(self, shares: list[int]) -> Iterator[tuple[int, tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        """Landed photons of every chunk with the number of its part; domains without light to the windows are left out."""
        jobs = [
            (part, d, first, min(_CHUNK, count - first), 1.0 / (PARTS * count))
            for d, count in enumerate(shares) for part in range(PARTS) for first in range(0, count, _CHUNK)
        ]  # fmt: skip
        threads = min(PARTS, os.cpu_count() or 1)
        with ThreadPoolExecutor(threads) as pool:
            for at in range(0, len(jobs), 4 * threads):  # a few at a time: landed photons take memory
                batch = jobs[at : at + 4 * threads]
                for job, found in zip(batch, pool.map(lambda j: self._land(j[1], *(j[0], *j[2:])), batch), strict=True):
                    yield job[0], found


def _tables(side: np.ndarray, frame: np.ndarray, low: np.ndarray, texels_per_unit: np.ndarray, size: np.ndarray, bins: int) -> CausticTables:
    counts = np.prod(size, axis=2).ravel() * bins
    first = np.concatenate([[0], np.cumsum(counts)])
    return CausticTables(
        side, np.ascontiguousarray(frame), low, texels_per_unit, size.astype(np.int64), first[:-1].reshape(len(size), 2).astype(np.int64), np.zeros(int(first[-1]), np.float32), bins
    )


def _areas(tables: CausticTables, side: int, window: int) -> np.ndarray:
    """Unit² of each texel (row by row) that no finer window covers: what its light falls on."""
    step = 1.0 / tables.texels_per_unit[side, window]
    whole, covered = [], []
    for axis in range(2):
        count = tables.size[side, window, axis]
        edges = tables.low[side, window, axis] + step[axis] * np.arange(count + 1)
        low = tables.low[side, 1, axis]
        high = low + tables.size[side, 1, axis] / tables.texels_per_unit[side, 1, axis]
        whole.append(np.full(count, step[axis]))
        covered.append(np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0.0, step[axis]))
    area = np.outer(whole[1], whole[0]).ravel()
    if window == 1:
        return area
    left = area - np.outer(covered[1], covered[0]).ravel()
    return np.where(left > 1e-9 * area, left, 0.0)


def _planes(scene: Scene, photons: PhotonScene) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[int, int]]:
    """Numbers of all receivers' sides (O, 2), their planes (S, 3, 3), extents on them (S, 2, 2), and side -> object where curved."""
    sides = np.full((len(scene.objects), 2), -1, np.int32)
    frames, extents, curved = [], [], {}
    for index, item in enumerate(scene.objects):
        if not isinstance(item.material, Diffuse):
            continue
        chosen = photons.owner == index
        corners = photons.corners[chosen].reshape(-1, 3, 3).copy()
        corners[:, 1:] += corners[:, :1]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
        flat = corners.reshape(-1, 3)
        length = float(np.linalg.norm(normal))
        normal = normal / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        height = (flat - flat[0]) @ normal
        # Both ways round a sheet would hide which side light is on.
        is_flat = length > 0.0 and np.ptp(height) <= _FLAT * np.ptp(flat, axis=0).max() and bool((photons.normals[chosen] @ normal > 0.5).all())
        frame = photon_emission.frame_of(normal, None)
        plane = (flat - flat[0]) @ frame[:2].T
        for back in range(2):
            sides[index, back] = len(frames)
            if not is_flat:
                curved[len(frames)] = index
            frames.append(np.stack([flat[0], frame[0], frame[1]]))
            extents.append(np.array([plane.min(axis=0), plane.max(axis=0)]))
    return sides, np.array(frames), np.array(extents), curved


def _band_of(bins: int, colour: Colours, scene: Scene) -> np.ndarray:
    """Bin of each atom of a light's spectrum, as `eye_scene.spectra` numbers them: int32 (A,)."""
    lines = sorted({nm for light in scene.lights for nm, power in light.spectral_power.lines if power > 0.0})
    middle = colour.start_nm + 0.5 * colour.width_nm
    cell = np.clip(np.rint(middle).astype(int) - 380, 0, 400)
    line = bins + np.searchsorted(np.array(lines, float), colour.start_nm)
    return np.where(colour.width_nm > 0.0, cell * bins // 401, line).astype(np.int32)


def _grown(low: np.ndarray, high: np.ndarray, share: float, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A box with a margin on all sides, within `limit` (2, 2)."""
    margin = share * (high - low) + 1e-9 * (limit[1] - limit[0])
    return np.maximum(low - margin, limit[0]), np.minimum(high + margin, limit[1])


def _quantiles(values: np.ndarray, weights: np.ndarray, beyond: float) -> tuple[float, float]:
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    return float(values[order[np.searchsorted(share, beyond)]]), float(values[order[min(np.searchsorted(share, 1.0 - beyond), len(order) - 1)]])


def _relmse(tables: CausticTables, parts: np.ndarray) -> float:
    """Of the fine windows, in blocks of three texels a side: what a pixel sees."""
    error, count = 0.0, 0
    block = int(_TEXELS_A_PIXEL)
    for side in range(len(tables.first)):
        columns, rows = (tables.size[side, 1] // block * block).tolist()
        if rows == 0 or columns == 0:
            continue
        first, (width, height) = int(tables.first[side, 1] // tables.bins), tables.size[side, 1].tolist()
        images = parts[:, first : first + width * height].reshape(PARTS, height, width)[:, :rows, :columns]
        images = images.reshape(PARTS, rows // block, block, columns // block, block).sum(axis=(2, 4))
        mean = images.sum(axis=0)
        variance = PARTS * images.var(axis=0, ddof=1)
        epsilon = RELMSE_EPSILON * float(mean.mean()) ** 2
        if epsilon > 0.0:
            error += float((variance / (mean**2 + epsilon)).sum())
            count += mean.size
    return error / count if count else 0.0
