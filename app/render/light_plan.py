"""How a pass divides its photons: over the lights, over spectral bands, over points on an extended light."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from ..base.random_words import PASS_GENERATORS, Dimension, random_word, shift
from ..features.features import Features
from ..gpu.records import MAX_BANDS
from ..gpu.scene_buffers import SceneBuffers
from ..model.optics.spectral_tables import CumulativeSpectrum
from ..model.scene import Scene
from ..model.settings import RenderSettings, divides_spectrum
from ..model.tint_bands import TOLERANCE, cut_by_tints, ends_of
from ..passes.emission_domain import EmissionDomain
from ..passes.lattice_slice import Band, LatticeSlice, Part
from ..passes.pilot import MAX_LIGHT_POINTS, Pilot, PilotFit

SMALLEST_BATCH = MAX_BANDS * MAX_LIGHT_POINTS
"""One point of every sub-lattice a light may have."""
CRYSTAL_BANDS = 6
"""Bands of light that meets crystals, at least: a wave that only part of a band has is wrong in all of it."""
SPECTRUM_CELLS = 512
"""Even cells of x in which it is known where each channel's light is."""


@dataclass(frozen=True)
class LightPlan:
    """One light's share of every pass."""

    index: int
    domain: EmissionDomain
    bands: tuple[Band, ...]
    light_points: int
    share: float
    """Share of the photons."""
    beam_objects: tuple[int, ...] = ()
    """Objects whose light beams carry, not photons."""
    lamp_step: float = 0.0
    """`LatticeSlice.lamp_step` if the light had a single point."""

    @property
    def lattices(self) -> int:
        """Sub-lattices: one a band and point on the light."""
        return len(self.bands) * self.light_points

    def lattice_count(self, photons: int) -> int:
        """Points of each sub-lattice over the whole rectangle, so that about the light's share of `photons` starts."""
        return max(1, round(photons * self.share / self.lattices / self.domain.active_share))

    def part(self, seed: int, number: int, photons: int, weight: float | None = None) -> Part:
        """All of pass `number`'s lattices for about `photons`, the pass's `weight` by default."""
        lattice = self.lattice_count(photons)
        u, v, light_u, light_v, spectral = (shift(seed, self.index, number, dimension) for dimension in PASS_GENERATORS)
        key = random_word(seed, self.index, number, Dimension.BRANCH)
        piece = LatticeSlice(
            self.index,
            self.bands,
            lattice,
            0,
            1,
            lattice,
            (u, v),
            (light_u, light_v),
            spectral,
            key,
            self.light_points,
            weight=float(photons) if weight is None else weight,
            beam_objects=self.beam_objects,
            lamp_step=self.lamp_step / self.light_points**0.5,
        )
        return piece, self.domain


def spans_of(plans: Iterable[LightPlan], lights: int) -> list[list[tuple[float, float]]]:
    """Ends of the bands of each of so many lights; of one without a plan, all of x."""
    limits = {plan.index: [(b.x_lo, b.x_hi) for b in plan.bands] for plan in plans}
    return [limits.get(i, [(0.0, 1.0)]) for i in range(lights)]


@dataclass(frozen=True)
class Division:
    """How finely sub-lattices are divided at least, whatever a plan needs by itself: for frames whose lattices shall
    be the same."""

    counts: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    """Spectral bands and points of each light."""

    @staticmethod
    def finest(needs: Iterable[Mapping[int, tuple[int, int]]]) -> Division:
        """The finest that any of several frames needs."""
        counts: dict[int, tuple[int, int]] = {}
        for need in needs:
            for light, (bands, points) in need.items():
                before = counts.get(light, (1, 1))
                counts[light] = max(before[0], bands), max(before[1], points)
        return Division(counts)

    def of(self, plan: LightPlan, power: CumulativeSpectrum | None) -> LightPlan:
        """`plan` divided so; `power` of the light, None where bands stay as they are."""
        least_bands, least_points = self.counts.get(plan.index, (1, 1))
        points = max(plan.light_points, least_points)
        bands = plan.bands
        if power is not None and least_bands > len(bands):
            edges = np.linspace(bands[0].x_lo, bands[-1].x_hi, least_bands + 1).tolist()
            bands = tuple(Band(lo, hi, 0.5 * (lo + hi), float(power.band(lo, hi)[3])) for lo, hi in pairwise(edges))
        return replace(plan, bands=bands, light_points=points)


@dataclass(frozen=True)
class Planner:
    """What a plan is made from."""

    scene: Scene
    settings: RenderSettings
    features: Features
    buffers: SceneBuffers
    domains: dict[int, EmissionDomain]
    pilots: dict[int, Pilot]
    batch: int = SMALLEST_BATCH
    """Rays in flight at once: a sub-lattice of each kind must have a point in them."""
    division: Division = Division()

    def plans(self, photons: int, texel: np.ndarray, anchors: tuple[int, int] | None = None) -> list[LightPlan]:
        """Photons, bands and points of each light that reaches a receiver; `texel`: side of each receiver's finest
        window, GPU units. `anchors`: seed and number of a pass whose bands begin and end elsewhere than those of
        others; None: they are equally wide."""
        power = {
            i: max(float(self.buffers.light_power[i].band(0.0, 1.0)[1]) * d.measure * d.active_share, 0.0)
            for i, d in self.domains.items()
        }
        lit = [i for i in self.domains if power[i] > 0.0 and len(self.pilots[i].whole)]
        total = sum(power[i] for i in lit)
        plans = []
        for i in lit:
            # Half by power, half evenly: a dim light must not be left coarse.
            share = 0.5 * power[i] / total + 0.5 / len(lit)
            budget = int(photons * share)
            fit = PilotFit(
                self.pilots[i],
                texel,
                self.buffers.variable_table,
                *self._light_between_ends(i),
                self.settings.smoothing,
                budget,
                self.domains[i].active_share,
                self.features.lamp_columns,
                self.features.has_lobe_columns,
            )
            aside = 0.0 if anchors is None else shift(anchors[0], i, anchors[1], Dimension.SPECTRAL) / 2.0**32 - 0.5
            bands = self._bands(i, fit, aside)
            points = (
                fit.light_points(len(bands))
                if self.features.footprints
                else self._scattered_points(i, len(bands), budget)
            )
            points = max(1, min(points, self.batch // len(bands)))
            # A footprint's standard deviation is its side times the smoothing.
            has_columns = self.features.lamp_columns and self.scene.lights[i].has_extent
            lamp_step = 1.0 / self.settings.smoothing if has_columns else 0.0
            plan = LightPlan(i, self.domains[i], bands, points, share, lamp_step=lamp_step)
            power_of = self.buffers.light_power[i] if self.features.spectral_groups else None
            plans.append(self.division.of(plan, power_of))
        return plans

    def _scattered_points(self, light: int, bands: int, budget: int) -> int:
        """Points on an extended light for photons without footprints, which need no lattice of their own."""
        return (
            min(SMALLEST_BATCH // bands, max(1, budget // (16 * bands))) if self.scene.lights[light].has_extent else 1
        )

    def _light_between_ends(self, light: int) -> tuple[np.ndarray, tuple[float, float]]:
        """`light` and `ends` of a `PilotFit`: X, Y and Z, and where bins are kept, the dim as well as the bright, W."""
        ends = ends_of(self.scene.lights[light].spectral_power, self.buffers.axis)
        below = self.buffers.light_power[light].at(np.linspace(*ends, SPECTRUM_CELLS + 1))
        cells = np.abs(np.diff(below[:, : 4 if self.settings.bins else 3], axis=0))
        return cells / np.maximum(cells.sum(axis=0), 1e-300), ends

    def _bands(self, light: int, fit: PilotFit, aside: float) -> tuple[Band, ...]:
        """`aside`: how far the borders between bands are shifted, in bands."""
        power = self.buffers.light_power[light]
        axis = self.buffers.axis
        lo_nm, hi_nm = self.scene.lights[light].spectral_power.support_nm()
        if hi_nm - lo_nm < 1e-6:
            x = float(axis.x_of_nm(lo_nm))
            return (Band(x, x, x, float(power.values[-1, 3])),)
        method = self.settings.method
        if method.startswith("regular"):
            edges_nm = np.linspace(max(lo_nm, 380.0), min(hi_nm, 780.0), int(method.split("-")[1]) + 1)
            edges = axis.x_of_nm(edges_nm)
            middles = axis.x_of_nm(0.5 * (edges_nm[:-1] + edges_nm[1:]))
        else:
            least = max(CRYSTAL_BANDS if self.features.crystals else 1, self.settings.least_bands)
            count = max(fit.band_count(), least) if divides_spectrum(method) and self.features.spectral_groups else 1
            ends = ends_of(self.scene.lights[light].spectral_power, axis)
            edges = np.linspace(*ends, count + 1)
            edges[1:-1] += aside * (edges[1] - edges[0])
            if not self.features.random_wavelength and len(self.buffers.tints):
                spectrum = self.scene.lights[light].spectral_power
                tolerance, bins = fit.tint_tolerance(), self.settings.bins
                if self.features.beams and not self.features.spectral_groups:
                    tolerance = TOLERANCE  # what beams leave to photons has their bands: `beams.sources.colour_edges`
                edges = cut_by_tints(ends, count, MAX_BANDS, self.buffers.tints, spectrum, axis, tolerance, bins)
            middles = 0.5 * (edges[:-1] + edges[1:])
        return tuple(
            Band(float(lo), float(hi), float(mid), float(power.band(lo, hi)[3]))
            for lo, hi, mid in zip(edges[:-1], edges[1:], middles, strict=True)
        )
