"""The caustic as the camera's reference looks it up: histograms of photons on flat receivers, by place and wavelength.

The photons start as those of the light's reference do. A pilot of camera paths, through glass too, finds which sides of
which receivers are seen and how finely; a pilot of photons finds where light lands there (`caustic_windows`). Receivers
must be flat: a curved one that is both lit by way of glass and seen raises UserError. `caustic_cache` keeps what was
traced.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.errors import UserError
from ..model.scene import Scene
from . import camera_kernel, photon_kernel, photon_scene
from .camera_kernel import CausticTables
from .camera_scene import camera_start, line_wavelengths
from .caustic_windows import (
    TEXELS_A_PIXEL,
    Landed,
    VisiblePoints,
    fit_windows,
    free_areas,
    no_caustic,
    receiver_planes,
    within,
)
from .photon_emission import refined, scene_domains
from .photon_emit import GRID
from .photon_scene import Colours
from .rounds import PARTS, RELMSE_EPSILON, TALLY_SIZE, Progress, trace_parts
from .sampling import Sequence, scrambled, scratch
from .viewpoint import viewpoint

__all__ = ["CausticPlan", "CausticRun", "SpectralCaustic", "build_caustic", "no_caustic"]

_PILOT = 1 << 16
_PILOT_NM = 550.0
_FLOOR = 0.05
"""Share of the photons that all domains share evenly, whatever the pilot found."""
_UNIT = 1 << 11
"""Photons of a part's smallest step, over all domains, about."""
_MAX_UNITS = 64
"""A part does at a time: landed photons take memory."""
_HALVES = 2
"""Sums are kept of even and odd parts, whose difference is the noise."""


@dataclass(frozen=True)
class CausticPlan:
    """How a `SpectralCaustic` is to be made."""

    photons: int = 1 << 26
    """At least so many …"""
    target_relmse: float = 0.0
    """… or fewer, where `caustic_cache` finds that they leave no more noise in the picture than this, as relMSE."""
    bins: int = 48
    """Over 380 to 780 nm; every line of a light has one of its own besides."""
    texel_size: float | None = None
    """Units, of the fine windows; None: half of what a pixel covers there."""
    max_texels: int = 1 << 18
    """Most texels of all fine windows together; beyond it texels grow."""
    max_depth: int = 64
    seed: int = 1


@dataclass(frozen=True, eq=False)
class SpectralCaustic:
    """Spectral irradiance by glass and mirrors on the flat receivers that a camera sees."""

    plan: CausticPlan
    tables: CausticTables
    halves: np.ndarray
    """float32 (2, texels × bins): `tables.irradiance` as either half of the photons has it."""
    photons: int
    landed_w: float
    """Power on all receivers."""
    outside_w: float
    """Power on receivers where the camera's pilot saw nothing."""

    def irradiance(self, side: int, window: int) -> np.ndarray:
        """W/unit² of each bin on a side's window (0 coarse, 1 fine), float32 (rows, columns, bins); row 0 at the
        window's lower corner."""
        return _window(self.tables, self.tables.irradiance, side, window)

    def half(self, number: int) -> SpectralCaustic:
        """The caustic by the photons of one half alone."""
        alone = self.halves[number]
        return SpectralCaustic(
            self.plan,
            self.tables._replace(irradiance=alone),
            np.broadcast_to(alone, self.halves.shape),
            self.photons // _HALVES,
            self.landed_w,
            self.outside_w,
        )

    @cached_property
    def relmse(self) -> float:
        """Own error of the fine windows, averaged over blocks of the side of a pixel: mean[var/(E² + ε)] on power."""
        error, count = 0.0, 0
        for side in range(len(self.tables.first)):
            mean, apart = (
                _blocks(_window(self.tables, values, side, 1))
                for values in (self.tables.irradiance, self.halves[0] - self.halves[1])
            )
            epsilon = RELMSE_EPSILON * float(mean.mean()) ** 2 if mean.size else 0.0
            if epsilon > 0.0:
                error += float((0.25 * apart**2 / (mean**2 + epsilon)).sum())
                count += mean.size
        return error / count if count else 0.0


def build_caustic(
    scene: Scene,
    width: int,
    height: int,
    plan: CausticPlan | None = None,
    progress: Progress = lambda fraction, text: None,
) -> SpectralCaustic:
    """Trace `plan.photons`, up to whole rounds, and sort them, for pictures of about `width` × `height` pixels by the
    scene's camera.

    Raises UserError where light comes by way of glass or mirrors to a curved diffuse object that is seen.
    """
    plan = plan or CausticPlan()
    run = CausticRun(scene, width, height, plan)
    while run.photons < plan.photons and not run.exhausted:
        run.advance(plan.photons - run.photons)
        progress(min(run.photons / plan.photons, 1.0), f"caustic, {run.photons / 1e6:.1f} M photons")
    return run.caustic()


class CausticRun:
    """Photons of one caustic, added round by round; `caustic()` at any time."""

    def __init__(self, scene: Scene, width: int, height: int, plan: CausticPlan) -> None:
        """Sends the pilots, which set the windows and where photons start. Raises UserError as `build_caustic` does."""
        self.scene, self.plan = scene, plan
        self.photon_scene, centre = photon_scene.photon_scene(scene)
        self.camera = viewpoint(scene.camera, width, height, centre)
        self.planes = receiver_planes(scene, self.photon_scene)
        self.domains, self.colours = scene_domains(scene, self.photon_scene, centre)
        lines = line_wavelengths(scene)
        self.bins = plan.bins + len(lines)
        self.bands = [_band_of(plan.bins, colour, lines) for colour in self.colours]
        self.tables, self.wanted, self.counts = self._prepared()
        self._sequences = [[scrambled(plan.seed, part, d) for d in range(len(self.domains))] for part in range(PARTS)]
        self.sums = np.zeros((_HALVES, len(self.tables.irradiance)), np.float32)
        """W a unit and texel, by bins."""
        self.units = np.zeros(PARTS, np.int64)
        self.flux = np.zeros((PARTS, 2))
        """W a unit that landed, and beyond all windows."""
        self._counting = threading.Lock()

    @property
    def unit(self) -> int:
        """Photons of a unit."""
        return int(self.counts.sum())

    @property
    def photons(self) -> int:
        """Photons so far."""
        return int(self.units.sum()) * self.unit

    @property
    def exhausted(self) -> bool:
        """Whether there is nothing to trace."""
        return not self.unit

    def advance(self, photons_left: int) -> None:
        """One round of all parts, or what is left. An interrupt keeps the parts that were finished."""
        trace_parts(self._trace_part, min(_MAX_UNITS, max(1, -(-photons_left // (self.unit * PARTS)))))

    def caustic(self) -> SpectralCaustic:
        """What has been gathered."""
        by_half = np.array([self.units[half::_HALVES].sum() for half in range(_HALVES)])
        halves = self.sums / np.maximum(by_half, 1).astype(np.float32)[:, None]
        for side in np.flatnonzero(self.wanted).tolist():
            for window in range(2):
                area = free_areas(self.tables, side, window).reshape(self.tables.size[side, window, ::-1])[..., None]
                for values in halves:
                    irradiance = _window(self.tables, values, side, window)
                    np.divide(irradiance, area, out=irradiance, where=area > 0.0, casting="same_kind")
        total = max(int(self.units.sum()), 1)
        tables = self.tables._replace(irradiance=np.tensordot((by_half / total).astype(np.float32), halves, 1))
        landed, outside = self.flux.sum(axis=0) / total
        return SpectralCaustic(self.plan, tables, halves, self.photons, float(landed), float(outside))

    def _trace_part(self, part: int, units: int) -> None:
        found = [
            self._land(d, self._sequences[part][d], int(self.units[part]) * n, units * n, 1.0 / n)
            for d, n in enumerate(self.counts.tolist())
        ]
        with self._counting:
            for landed in found:
                self.flux[part] += (
                    float(landed.watts.sum()),
                    camera_kernel.gather(self.tables, *landed, len(landed.watts), self.sums[part % _HALVES]),
                )
            self.units[part] += units

    def _prepared(self) -> tuple[CausticTables, np.ndarray, np.ndarray]:
        """Windows, the sides that have any, and photons of each domain in a unit (D,), by the pilots; none where
        nothing is lit and seen."""
        seen = self._seen()
        pilot = [
            self._land(d, scrambled(self.plan.seed, PARTS, d), 0, _PILOT, 1.0 / _PILOT)
            for d in range(len(self.domains))
        ]
        nothing = no_caustic(self.scene), np.zeros(0, bool), np.zeros(0, np.int64)
        if not pilot or not len(seen.side):
            return nothing
        lit = Landed(*(np.concatenate(parts) for parts in zip(*pilot, strict=True)))
        self._refuse_curved(seen, lit)
        tables, wanted = fit_windows(self.planes, seen, lit, self.bins, self._texel, self.plan.max_texels)
        counts = self._aim(pilot, tables, wanted)
        return (tables, wanted, counts) if counts.any() else nothing

    def _seen(self) -> VisiblePoints:
        bounces = self.scene.render.bounces
        points = np.empty((_PILOT * (bounces + 1), 4))
        which = np.empty((len(points), 2), np.int32)
        found = camera_kernel.seen_points(
            self.photon_scene,
            self.camera,
            camera_start(self.scene, self.photon_scene),
            scrambled(self.plan.seed, PARTS + 1, 0),
            _PILOT,
            _PILOT_NM,
            self.plan.max_depth,
            bounces,
            self.planes.side,
            points,
            which,
            scratch(),
        )
        return VisiblePoints(points[:found, :3], points[:found, 3], which[:found, 0])

    def _land(self, d: int, sequence: Sequence, first: int, count: int, share: float) -> Landed:
        found = Landed(np.empty((count, 3)), np.empty(count), np.empty((count, 4), np.int32))
        landed = photon_kernel.land(
            self.photon_scene,
            self.domains[d],
            self.colours[d],
            self.bands[d],
            self.planes.side,
            sequence,
            first,
            count,
            share,
            self.plan.max_depth,
            np.zeros(TALLY_SIZE),
            *found,
            scratch(),
        )
        return Landed(*(values[:landed] for values in found))

    def _refuse_curved(self, seen: VisiblePoints, lit: Landed) -> None:
        for side in np.intersect1d(seen.side, lit.ends[:, 0]):
            if not self.planes.is_flat[side]:
                name = self.scene.objects[self.planes.owner[side]].name
                raise UserError(
                    f"scene '{self.scene.name}': light from glass falls on '{name}', which is not flat, and the "
                    "camera's reference looks caustics up on flat receivers only; make it flat, or black"
                )

    def _texel(self, distance: float) -> float:
        if self.plan.texel_size is not None:
            return self.plan.texel_size
        pixel = 2.0 * self.camera.half_height / self.camera.height
        return (pixel if self.camera.orthographic else pixel * distance) / TEXELS_A_PIXEL

    def _aim(self, pilot: list[Landed], tables: CausticTables, wanted: np.ndarray) -> np.ndarray:
        """Sets the domains' densities by the pilot's photons in the windows; photons of each domain in a unit, none
        where it had none there."""
        weight = []
        for d, found in enumerate(pilot):
            useful = np.zeros(len(found.watts), bool)
            for side in np.flatnonzero(wanted).tolist():
                here = np.flatnonzero(found.ends[:, 0] == side)
                useful[here[within(tables, side, self.planes.flat(side, found.points[here]))]] = True
            importance = np.zeros((GRID, GRID))
            np.add.at(importance, (found.ends[useful, 2], found.ends[useful, 3]), found.watts[useful] ** 2)
            self.domains[d] = refined(self.domains[d], importance)
            weight.append(math.sqrt(float(importance.sum())))
        total = sum(weight)
        if total <= 0.0:
            return np.zeros(len(weight), np.int64)
        shares = [(1.0 - _FLOOR) * w / total + _FLOOR / len(weight) for w in weight]
        return np.array([max(int(_UNIT * share), 1) for share in shares])


def _band_of(bins: int, colour: Colours, lines: list[float]) -> np.ndarray:
    """Bin of each atom of a light's spectrum, as `camera_scene.spectra` numbers them: int32 (A,)."""
    cell = np.clip(np.rint(colour.start_nm + 0.5 * colour.width_nm).astype(int) - 380, 0, 400)
    line = bins + np.searchsorted(np.array(lines, float), colour.start_nm)
    return np.where(colour.width_nm > 0.0, cell * bins // 401, line).astype(np.int32)


def _window(tables: CausticTables, values: np.ndarray, side: int, window: int) -> np.ndarray:
    """A side's window of `values` (texels × bins,), as (rows, columns, bins)."""
    columns, rows = tables.size[side, window]
    first = tables.first[side, window]
    return values[first : first + rows * columns * tables.bins].reshape(rows, columns, tables.bins)


def _blocks(values: np.ndarray) -> np.ndarray:
    """Sums over all bins (rows, columns, bins) in blocks of about a pixel's side."""
    block = int(TEXELS_A_PIXEL)
    rows, columns = len(values) // block, values.shape[1] // block
    power = values[: rows * block, : columns * block].sum(axis=2, dtype=np.float64)
    return power.reshape(rows, block, columns, block).sum(axis=(1, 3))
