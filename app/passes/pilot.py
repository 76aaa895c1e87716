"""A few thousand photons ahead of everything else, to learn what a pass needs.

The same lattice points are traced as one band, at several single wavelengths, and from the rim
of an extended light. That tells where light lands (the maps are fitted to it), how far a chord
in the spectral coordinate is from the true path (the number of bands), and how far an extended
light blurs what it casts (the number of points on it).
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..gpu.packed_records import read_records
from ..gpu.records import LATTICE_BIT, MAX_BANDS
from ..model.scene import Scene
from ..model.tint_bands import TOLERANCE as TINT_TOLERANCE
from .emission_domain import EmissionDomain
from .landings import Landings, by_receiver
from .lattice_slice import Band, LatticeSlice
from .trace import SPLIT_THRESHOLD, Batch, FluxTally, TracePass

PHOTONS = 4096
PLACES = (0.02, 0.25, 0.75, 0.98)
"""Spectral coordinates traced one by one."""
MAX_DEPTH = 12
"""Specular events of a pilot photon: what comes after them is too faint to fit anything to, unless most light is still
on its way then."""
RIM = ((1.0, 0.5), (0.5, 1.0))
"""Places on an extended light, its middle being (0.5, 0.5)."""
OTHER_SIDES = ((0.0, 0.5), (0.5, 0.0), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
"""Further ones, of a light whose middle does not speak for the rest."""
PARTED = 0.1
"""Share of light that goes another way from a light's rim than from its middle, from which on the middle does not."""
BAND_TOLERANCE = 0.2
"""In no channel may a chord miss the true path by more than this share of its photon's own footprint (root mean square
over the channel's light), and by less where that is narrower than half a pixel: a miss is then what is left of a
picture's error, while every band more blurs by more than it mends where footprints are broad."""
GROUND_TOLERANCE = 0.1
"""`BAND_TOLERANCE` of photons behind ground glass, whose footprints no band widens, for up to half a pixel."""
MOSTLY_GROUND = 0.9
"""Share of the light behind ground glass from which on it is given bands: they blur the rest."""
FOLLOWED = 0.93
"""Share of each channel's light that keeps to it; the rest is weak branches, which are wide and dim."""
LEAST_BROAD = 0.3
"""Half pixels. Narrower footprints are no reason for more bands: they are blurred alike by the pixel. What a chord may
miss still shrinks as they do: bands then grow as the fifth root of the photons, and the picture's error goes on
falling."""
FEW_OF_A_BAND = 2000.0
"""Photons that land. Of fewer, the edges of what they draw are rough, and rougher with every band: no more are taken
than keep nine tenths of each channel's light within `COARSE_TOLERANCE` texels of the chord, root mean square, or less
where footprints are narrower than `NARROW_TEXELS`."""
COARSE_TOLERANCE = 0.11
NARROW_TEXELS = 0.125
COARSEST_TINTS = 0.1
"""At most this much of a tint is missed, however few photons there are."""
KEPT_THRESHOLDS = (0.003, 0.03, 0.1)
"""Shares of a photon's power below which roulette decides, where parts that weak add little work; the first that
does."""
MOST_MORE_FLIGHTS = 1.4
"""How many times the flights of a pilot that may take."""
_FULL = 0.8
"""Share of a queue's room that a pilot may fill: its few points are not every batch."""
_FLIGHTS_OF_EVERY = 8
"""Only one in so many points is traced to count flights: weak branches are many, and this is but a ratio."""
_FOR_MAPS_OF_EVERY = 4
"""Likewise where all that is asked is where light lands."""
MAX_LIGHT_POINTS = 256
FEWEST_COPIES = 3.4
"""With fewer, a single one from the lamp's middle errs by less: it lacks the lamp's variance r²/4 but for its own
footprint's s², and M copies have M s² too much; r²/4 - s² = M s² at r = 4.2 s, where M = 0.8 r / s is 3.4."""
FEWEST_COVERED = 14.0
"""`FEWEST_COPIES` for photons that know how broad the lamp is (`Features.lamp_columns`): footprints of a single point
are then as broad as its light, and copies only distinguish that from a disc's."""
MAX_POINTS = 1 << 16
"""Lattice points of a pilot, however little of the domain holds glass."""
MORE = 16
"""Times as many where none came to a receiver, before that is said."""
PARTED_COPIES = 12.0
"""Points on a light all of whose light parts, for each root of photons in `MIN_LATTICE`: both what a lattice blurs and
what lies between two points then shrink with more photons."""
MIN_LATTICE = 1024
"""Points a sub-lattice keeps, however many an extended light would like: with fewer, surfaces are not straight any more
over a footprint."""


@dataclass(frozen=True)
class Pilot:
    """Photon records of one light's pilot traces."""

    lattice_count: int
    whole: np.ndarray
    """All wavelengths as one band, anchored at x = 0.5."""
    spectral: list[np.ndarray]
    """One at each of `PLACES` (empty where nothing disperses)."""
    rim: list[np.ndarray]
    """One from each of `RIM`, and of `OTHER_SIDES` where light parts (empty for a light without extent)."""
    flights: tuple[int, ...] = (0,) * (1 + len(KEPT_THRESHOLDS))
    """Flights of all rays of `whole`, as roulette is played by default, and with each of `KEPT_THRESHOLDS`."""
    fullness: tuple[float, ...] = (0.0,) * len(KEPT_THRESHOLDS)
    """Largest share of the queues' room with each of `KEPT_THRESHOLDS`."""

    @cached_property
    def parted(self) -> float:
        """Share of the light that comes another way, or to another receiver, from the light's rim than from its middle,
        or only from one of the two: the most of any place there."""
        return max((_parted(self.whole, record) for record in self.rim), default=0.0)


def pilot_steps(
    trace: TracePass,
    scene: Scene,
    light: int,
    domain: EmissionDomain,
    power_w: float,
    spectral: bool,
    *,
    for_maps: bool,
) -> Generator[None, None, Pilot]:
    """Trace the pilots of one light, pausing after every event of the rays; `power_w`: its whole power per unit
    weight. `for_maps`: all that is asked is where light lands, which a quarter of the points tells, and the spectrum's
    ends."""
    count = min(max(1, int(PHOTONS / domain.active_share)), MAX_POINTS)

    def traced(
        band: Band,
        depth: int,
        place: tuple[float, float] = (0.5, 0.5),
        split_threshold: float | None = None,
        every: int = _FOR_MAPS_OF_EVERY if for_maps else 1,
    ) -> Generator[None, None, tuple[np.ndarray, FluxTally, int, float]]:
        found, tally, flights, fullness = [trace.photon.zeros(0)], FluxTally(), 0, 0.0

        def keep(batch: Batch, _: bool) -> None:
            nonlocal flights, fullness
            found.append(read_records(trace.photon, trace.photons, batch.photons))
            tally.merge(batch.tally)
            flights += batch.flights
            fullness = max(fullness, batch.fullness)

        # In as many slices as the batch needs: what a pilot finds must not depend on it.
        slices = -(-count // trace.batch)
        piece = LatticeSlice(
            light, (band,), count, 0, 1, count, (0, 0), (0, 0), 0, 1, light_place=place, keeps_bands=True
        )
        for i in range(slices):
            part = piece.every(every, 0).every(slices, i), domain
            yield from trace.whole([part], keep, depth, split_threshold)
        return np.concatenate(found), tally, flights, fullness

    depth, everything = MAX_DEPTH, Band(0.0, 1.0, 0.5, power_w)
    whole, tally, flights, _ = yield from traced(everything, depth)
    if not len(whole) and tally.emitted:  # perhaps its receiver is small
        count *= MORE
        whole, tally, flights, _ = yield from traced(everything, depth)
    if tally.ended["lost_depth"] > tally.ended["deposited"]:
        depth = trace.max_depth
        whole, _, flights, _ = yield from traced(everything, depth)
    kept, fullness = [], []
    for threshold in () if for_maps else KEPT_THRESHOLDS:
        _, _, some, full = yield from traced(everything, depth, split_threshold=threshold, every=_FLIGHTS_OF_EVERY)
        kept.append(some * _FLIGHTS_OF_EVERY)
        fullness.append(full)
    at_places: list[np.ndarray] = []
    from_rim: list[np.ndarray] = []
    for x in (PLACES[:: len(PLACES) - 1] if for_maps else PLACES) if spectral else ():
        record, *_ = yield from traced(Band(x, x, x, power_w), depth)
        at_places.append(record)
    for place in RIM + OTHER_SIDES if scene.lights[light].has_extent else ():
        if len(from_rim) == len(RIM) and max(_parted(whole, record) for record in from_rim) < PARTED:
            break
        record, *_ = yield from traced(everything, depth, place)
        from_rim.append(record)
    if not len(whole) and from_rim:  # something hides the glass from the light's middle
        whole = max(from_rim, key=len)
    return Pilot(count, whole, at_places, from_rim, (flights, *kept), tuple(fullness))


def split_threshold(pilots: Iterable[Pilot]) -> float:
    """Share of a photon's power below which roulette decides: so low that weak branches keep lattices of their own,
    with footprints as narrow as those of strong ones, where that costs little and the queues have room."""
    pilots = list(pilots)
    by_default = sum(pilot.flights[0] for pilot in pilots)
    for i, threshold in enumerate(KEPT_THRESHOLDS):
        kept = sum(pilot.flights[1 + i] for pilot in pilots)
        if all(pilot.fullness[i] < _FULL for pilot in pilots) and kept <= MOST_MORE_FLIGHTS * by_default:
            return threshold
    return SPLIT_THRESHOLD


def landings_of(pilots: Iterable[Pilot]) -> dict[int, Landings]:
    """Where pilot photons landed, by receiver."""
    records = [photons for pilot in pilots for photons in (pilot.whole, *pilot.spectral, *pilot.rim) if len(photons)]
    if not records:
        return {}
    return by_receiver(np.concatenate(records))


@dataclass(frozen=True)
class PilotFit:
    """What a pilot says about the lattices a light needs."""

    pilot: Pilot
    texel: np.ndarray
    """Texel side of each receiver's finest map, GPU units."""
    variables: np.ndarray
    """Spectral variables over x, (groups, samples)."""
    light: np.ndarray
    """Shares of each channel's light in even cells between `ends`, (cells, channels); each channel's add up to 1."""
    ends: tuple[float, float]
    """x between which the light has power."""
    smoothing: float
    budget: int
    """Photons of the light in a pass."""
    active_share: float
    """Share of a pass's lattices that is emitted (`EmissionDomain`)."""
    lamp_columns: bool = False
    """Footprints are at least as broad as what the light's other points cast."""
    lobe_columns: bool = False
    """Footprints behind ground glass are as broad as gaps between the light of one microfacet and the next."""

    def band_count(self) -> int:
        """Bands needed so that nearly all of every channel's light keeps the chord's error below the tolerance."""
        whole = self.pilot.whole
        errors, photons, shares = [], [], []
        for place, record, share in zip(PLACES, self.pilot.spectral, self._light_about_places(), strict=True):
            mine, theirs = same_paths(whole, record)
            if not len(mine):
                continue
            predicted = mine["position"] + self._sweep(mine, place)
            miss = np.linalg.norm(predicted - theirs["position"], axis=1)
            spread = np.linalg.norm(theirs["position"] - mine["position"], axis=1)
            # A pair that went separate ways (over an edge, round a facet) says nothing about curvature.
            together = miss < 2.0 * np.maximum(spread, 1e-12)
            errors.append((miss / (2.0 * place - 1.0) ** 2 / self.texel[mine["receiver"]])[together])
            photons.append(mine[together])
            shares.append(np.broadcast_to(share, (len(errors[-1]), share.size)))
        # The chord itself: halfway between the band's ends it should meet the anchor.
        sag = 0.5 * (self._sweep(whole, 0.0) + self._sweep(whole, 1.0))
        errors.append(np.linalg.norm(sag, axis=1) / self.texel[whole["receiver"]])
        photons.append(whole)
        shares.append(np.ones((len(whole), self.light.shape[1])))
        if not sum(map(len, errors)):
            return 1
        error, met, share = map(np.concatenate, (errors, photons, shares))
        axis, flux, ground = self._longer(met) / self.texel[met["receiver"]], met["flux_w"], self._ground(met)
        behind, whole_flux, count = flux[ground].sum(), flux.sum(), 1
        if behind <= FOLLOWED * whole_flux and not ground.all():
            weights = (share * flux[:, None])[~ground]
            count = self._lattice_bands(error[~ground], axis[~ground], weights)
        # Elsewhere they blur the rest.
        if behind >= MOSTLY_GROUND * whole_flux and ground.any():
            count = max(count, self._ground_bands(error[ground], axis[ground], flux[ground]))
        return count

    def _light_about_places(self) -> np.ndarray:
        """Share of each channel's light whose nearest of `PLACES` each is, (places, channels)."""
        cells = (np.arange(len(self.light)) + 0.5) / len(self.light)
        nearest = np.abs(np.interp(cells, (0.0, 1.0), self.ends)[:, None] - np.array(PLACES)).argmin(axis=1)
        return np.array([self.light[nearest == place].sum(axis=0) for place in range(len(PLACES))])

    def _misses(self, count: int) -> np.ndarray:
        """Root mean square over each channel's light of what chords of `count` bands miss, over what the chord of a
        single one misses at the spectrum's ends, (channels,)."""
        cells = (np.arange(len(self.light)) + 0.5) / len(self.light)
        aside = 2.0 * abs(self.ends[1] - self.ends[0]) * (cells - (np.floor(cells * count) + 0.5) / count)
        return np.sqrt(aside**4 @ self.light)

    def _lattice_bands(self, error: np.ndarray, axis: np.ndarray, weights: np.ndarray) -> int:
        """Bands for photons whose footprints widen with every band: `error` of the chord of one band and longer `axis`
        of footprints, texels, both (n,); `weights` in each channel, (n, channels)."""
        followed, most = FOLLOWED * weights.sum(axis=0), 0.9 * weights.sum(axis=0)
        for count in range(1, MAX_BANDS):
            missed, coarsening = error[:, None] * self._misses(count), self._coarsening(count)
            own = self.smoothing * coarsening * axis[:, None]
            is_met = missed <= BAND_TOLERANCE * own * np.clip(own, LEAST_BROAD, 1.0)
            if ((weights * is_met).sum(axis=0) >= followed).all():
                return count
            narrow = min(self._broad_texels(count) / NARROW_TEXELS, 1.0)
            is_met = missed <= COARSE_TOLERANCE * narrow**2
            is_rough = len(self.pilot.whole) / coarsening**2 < FEW_OF_A_BAND
            if is_rough and ((weights * is_met).sum(axis=0) >= most).all():
                return count
        return MAX_BANDS

    def _ground_bands(self, error: np.ndarray, axis: np.ndarray, weight: np.ndarray) -> int:
        """Bands for photons behind ground glass, whose footprints are as broad as all bands' photons together leave
        gaps: a band more blurs nothing of them."""
        relative = _weighted_quantile(error / axis, weight, FOLLOWED)
        narrower = lobe_part(self.budget) / lobe_part(self.pilot.lattice_count * self.active_share)
        broad = self.smoothing * narrower * _weighted_quantile(axis, weight, 0.9)
        tolerance = GROUND_TOLERANCE * np.clip(broad, LEAST_BROAD, 1.0)
        return int(np.clip(np.ceil(np.sqrt(relative / (self.smoothing * narrower * tolerance))), 1, MAX_BANDS))

    def tint_tolerance(self) -> float:
        """What straight weights may miss of a tint (`cut_by_tints`), which shrinks as footprints do: with few photons
        every band widens them, and that errs by more than a tint that is resolved coarsely."""
        return min(TINT_TOLERANCE * max(1.0, (2.0 * self._broad_texels(1)) ** 3), COARSEST_TINTS)

    def light_points(self, bands: int) -> int:
        """Points on an extended light that see all ways that its light takes, and whose copies footprints bridge."""
        points = self._bridged_points(bands)
        if self.pilot.parted >= PARTED:
            lattices = max(self.budget, 1) / (bands * MIN_LATTICE)
            points = max(points, int(PARTED_COPIES * self.pilot.parted * lattices**0.5), 2)
        return min(points + (points > 1) * points % 2, MAX_LIGHT_POINTS)  # each with its mirror image: lib/lattice.glsl

    def _bridged_points(self, bands: int) -> int:
        """So many that footprints just bridge the copies they make; 1 where copies would blur more than they part."""
        whole = self.pilot.whole
        shifts, weights = [], []
        for record in self.pilot.rim:
            mine, theirs = same_paths(whole, record)
            shift = np.linalg.norm(theirs["position"] - mine["position"], axis=1)
            widened = np.where(self._ground(mine), self._coarsening(1), self._coarsening(bands))
            footprint = np.linalg.norm(mine["dposition_ds"], axis=1) * widened
            usable = footprint > 0.0
            shifts.append(shift[usable] / footprint[usable])
            weights.append(mine["flux_w"][usable])
        if not sum(map(len, shifts)):
            return 1
        ratio = _weighted_quantile(np.concatenate(shifts), np.concatenate(weights), 0.5)
        # M copies over a disc of radius r lie r sqrt(pi / M) apart, and a footprint's standard deviation is
        # smoothing * h sqrt(M): equal to 0.45 of the distance at M = 0.8 r / (smoothing h).
        copies = 0.8 * ratio / self.smoothing
        count = int(min(np.ceil(copies), MAX_LIGHT_POINTS, self.budget // (bands * MIN_LATTICE)))
        if min(copies, count) < (FEWEST_COVERED if self.lamp_columns else FEWEST_COPIES):
            return 1
        return count

    def _coarsening(self, lattices: int) -> float:
        """Spacing of a sub-lattice of the pass over that of the pilot."""
        points = max(self.budget, 1) / (lattices * self.active_share)
        return float(np.sqrt(self.pilot.lattice_count / points))

    def _broad_texels(self, lattices: int) -> float:
        """Standard deviation along the longer axis of a footprint that a tenth of the flux exceeds, texels."""
        whole = self.pilot.whole
        broad = _weighted_quantile(self._longer(whole) / self.texel[whole["receiver"]], whole["flux_w"], 0.9)
        return self.smoothing * broad * self._coarsening(lattices)

    def _ground(self, photons: np.ndarray) -> np.ndarray:
        """Which of them have a lobe's footprints, which are on no lattice, bool (n,)."""
        return (photons["flags"] >> LATTICE_BIT == 0) & self.lobe_columns

    @staticmethod
    def _longer(photons: np.ndarray) -> np.ndarray:
        """The longer axis of footprints, GPU units per spacing of the pilot's lattice."""
        s, t = photons["dposition_ds"].astype(float), photons["dposition_dt"].astype(float)
        ss, tt, st = (np.einsum("ni,ni->n", a, b) for a, b in ((s, s), (t, t), (s, t)))
        return np.sqrt(np.maximum(0.5 * (ss + tt) + np.sqrt(0.25 * (ss - tt) ** 2 + st**2), 1e-30))

    def _sweep(self, photons: np.ndarray, x: float) -> np.ndarray:
        """Displacement of photons from their anchor to x by their spectral columns, GPU space (n, 3)."""
        samples = np.linspace(0.0, 1.0, self.variables.shape[1])
        moved = np.zeros((len(photons), 3))
        for g, row in enumerate(self.variables):
            step = np.interp(x, samples, row) - np.interp(photons["x_anchor"], samples, row)
            moved += photons[f"dposition_dvar{g}"][:, :3] * step[:, None]
        return moved


def same_paths(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Records of two traces that took the same branches to the same receiver, pairwise."""

    def keys(records: np.ndarray) -> np.ndarray:
        return (records["photon_id"].astype(np.uint64) << np.uint64(32)) | records["branch_key"].astype(np.uint64)

    _, in_a, in_b = np.intersect1d(keys(a), keys(b), return_indices=True)
    same = a["receiver"][in_a] == b["receiver"][in_b]
    return a[in_a[same]], b[in_b[same]]


def _parted(middle: np.ndarray, rim: np.ndarray) -> float:
    """`Pilot.parted` of two traces of the same lattice."""
    both = np.concatenate([middle, rim])
    _, way = np.unique(both[["branch_key", "receiver"]], return_inverse=True)
    flux_w = both["flux_w"].astype(float)
    sign = np.repeat((1.0, -1.0), (len(middle), len(rim)))
    return float(np.abs(np.bincount(way, sign * flux_w)).sum() / flux_w.sum()) if flux_w.any() else 1.0


def lobe_part(paths: float) -> float:
    """Share of a lobe's width as broad as which one of so many photons is drawn (`lobe_part`,
    lib/rough_surface.glsl)."""
    return min(4.4 * max(paths, 1.0) ** (-1.0 / 6.0), 1.1)


def _weighted_quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    order = np.argsort(values)
    running = np.cumsum(weights[order])
    return float(values[order][min(np.searchsorted(running, share * running[-1]), len(order) - 1)])
