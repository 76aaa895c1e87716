"""The light half of a rendering: pilot, bands, maps, then rounds of emit → trace → splat.

The pilot is a few thousand photons per light, traced at several wavelengths. It says where light
lands (so the maps are fitted before anything is deposited) and how far the spectral columns are
from the truth (so the spectrum is cut into as few bands as that error allows).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import moderngl
import numpy as np

from app.gpu import records
from app.gpu.context import Context
from app.gpu.map_atlas import MapAtlas, Tile
from app.gpu.scene_buffers import SceneBuffers
from app.gpu.splat_tables import SplatTables
from app.model.features import Features
from app.model.scene import Dielectric, Diffuse, Mirror, Scene
from app.model.settings import RenderSettings
from app.model.spectral_tables import SpectralAxis
from app.passes.emission_domain import EmissionDomain, emission_domain
from app.passes.map_layout import Landings, MapLayout, check_map_receiver, layout_maps
from app.passes.splat import Splatter
from app.passes.trace import Band, Batch, FluxTally, LatticeSlice, TracePass

PILOT_PHOTONS = 4096
PILOT_PLACES = (0.02, 0.25, 0.5, 0.75, 0.98)
MAX_BANDS = 32
BAND_TOLERANCE_TEXELS = 0.35
"""Chord and true path may differ by this much (or by the same share of a footprint) in a band."""
DEFAULT_BATCH = 1 << 16
_SHIFT_GENERATORS = (3242174889, 2447445414, 3141592653, 1640531527, 2246822519)


@dataclass
class LightStats:
    """What the light half did."""

    tally: FluxTally = field(default_factory=FluxTally)
    photons: int = 0
    splats: int = 0
    bands: dict[str, int] = field(default_factory=dict)
    trace_seconds: float = 0.0
    splat_seconds: float = 0.0
    outside_map_w: float = 0.0
    footprints_dropped: int = 0


@dataclass(frozen=True)
class LightPlan:
    """One light's share of every pass."""

    index: int
    domain: EmissionDomain
    bands: tuple[Band, ...]
    share: float
    """Share of the photons."""


class LightHalf:
    """Owns the light half's passes and the caustic maps of one scene."""

    def __init__(self, context: Context, scene: Scene, settings: RenderSettings, features: Features, buffers: SceneBuffers) -> None:
        self.context = context
        self.scene = scene
        self.settings = settings
        self.features = features
        self.buffers = buffers
        self.stats = LightStats()
        batch = settings.batch or DEFAULT_BATCH * (1 if context.is_software else 4)
        self.trace = TracePass(context, features, buffers, min(batch, _largest_batch(context, features)), settings.max_depth)
        self.splatter = Splatter(context.ctx, features)
        self.variables = context.ctx.buffer(np.ascontiguousarray(buffers.variable_table if buffers.groups.count else np.zeros((1, 2), "f4")).tobytes())
        self.reflectances, self.reflectance_class = reflectance_classes(scene, buffers)
        self._weight_sum = 0.0

    def prepare(self) -> None:
        """Pilot, maps and spectral tables. Afterwards `layout`, `atlas`, `tables` and `plans` exist."""
        specular = [self.buffers.space.to_gpu(m.corners()) for m, o in zip(self.buffers.world_meshes, self.scene.objects, strict=True) if isinstance(o.material, Dielectric | Mirror)]
        triangles = np.concatenate(specular) if specular else np.zeros((0, 3, 3))
        domains = {i: emission_domain(light, self.scene, self.buffers.space, triangles) for i, light in enumerate(self.scene.lights)}
        domains = {i: d for i, d in domains.items() if d is not None}
        pilots = {i: self._pilot(i, domain) for i, domain in domains.items()}
        picture: tuple[int, int] | None = (self.settings.width, self.settings.height)
        map_receiver = None
        if self.settings.layer.startswith("map:"):
            map_receiver = check_map_receiver(self.scene, self.buffers, self.settings.layer[4:])
        self.map_receiver = map_receiver
        landings = _landings([p for pilot in pilots.values() for p in pilot])
        self.layout: MapLayout = layout_maps(self.scene, self.buffers, landings, picture, self.reflectance_class, map_receiver)
        self.plans = self._plan(domains, pilots)
        limits = [[(b.x_lo, b.x_hi) for b in plan.bands] for plan in self.plans]
        used = {plan.index: n for n, plan in enumerate(self.plans)}
        spans = [limits[used[i]] if i in used else [(0.0, 1.0)] for i in range(len(self.scene.lights))]
        channels = "xyz" if self.settings.bins is None else list(np.linspace(380.0, 780.0, self.settings.bins + 1))
        ctx = self.context.ctx
        self.bin_edges_nm = None if channels == "xyz" else np.asarray(channels)
        self.tables = SplatTables.build(ctx, self.buffers.axis, [light.spectral_power for light in self.scene.lights], self.reflectances, spans, channels)
        self.atlas = MapAtlas(ctx, self.layout.size, self.layout.placements, self.features.targets)
        self.receivers = ctx.buffer(np.ascontiguousarray(self.layout.receivers).tobytes())
        self.splatter.reset_counts()

    @property
    def map_scale(self) -> float:
        """Factor from what the atlas has summed to energy per texel."""
        return 1.0 / self._weight_sum if self._weight_sum else 0.0

    def run_pass(self, number: int, photons: int, proceed: Callable[[float], bool]) -> bool:
        """One shifted lattice of about `photons` points over all lights and bands.

        The lattice is traced in rounds, each an even sub-lattice of the whole, so that a pass that
        is stopped between rounds is still complete everywhere, only coarser. `proceed(fraction)`
        is asked between slices; returns False when it said stop.
        """
        if not self.plans:
            return True
        counts = {(plan.index, b): self._lattice_count(plan, photons) for plan in self.plans for b in range(len(plan.bands))}
        rounds = max(1, max(-(-n // self.trace.batch) for n in counts.values()))
        slices = rounds * len(counts)
        done = 0
        for j in range(rounds):
            for plan in self.plans:
                for b, band in enumerate(plan.bands):
                    lattice = counts[plan.index, b]
                    count = len(range(j, lattice, rounds))
                    if count:
                        self._slice(plan, b, band, number, lattice, j, rounds, count, photons)
                    done += 1
                    if not proceed(done / slices) and done < slices:
                        if j == 0:
                            continue  # a first round is needed for a picture at all
                        if (done % len(counts)) == 0:
                            self._weight_sum += photons / rounds
                            return False
            self._weight_sum += photons / rounds
        return True

    def _slice(self, plan: LightPlan, b: int, band: Band, number: int, lattice: int, first: int, stride: int, count: int, photons: int) -> None:
        started = time.perf_counter()
        piece = self._lattice_slice(plan.index, b, band, number, lattice, first, stride, count, weight=float(photons))
        batch = self.trace.run(piece, plan.domain)
        traced = time.perf_counter()
        self.splatter.run(self.trace.photons, batch.photons, self.variables, self.tables, self.atlas, self.receivers, self.settings.smoothing)
        if self.context.is_software:
            self.context.finish()
        self.stats.trace_seconds += traced - started
        self.stats.splat_seconds += time.perf_counter() - traced
        self._account(batch, photons)

    def _account(self, batch: Batch, photons: int) -> None:
        self.stats.photons += batch.emitted_photons
        self.stats.splats += batch.photons
        self.stats.tally.merge(batch.tally)

    def _lattice_slice(
        self, light: int, b: int, band: Band, number: int, lattice: int, first: int, stride: int, count: int, weight: float
    ) -> LatticeSlice:
        # Every band of every pass has its own shift; successive passes follow a Kronecker sequence,
        # so their union is again even.
        step = number * MAX_BANDS * 2 + b + 97 * light + 1
        seed = self.settings.seed & 0xFFFFFFFF
        start = (seed * 0x9E3779B1) & 0xFFFFFFFF
        shifts = [int((start + step * g) & 0xFFFFFFFF) for g in _SHIFT_GENERATORS]
        return LatticeSlice(light, b, band, lattice, first, count, (shifts[0], shifts[1]), (shifts[2], shifts[3]), shifts[4], (seed + 7919 * number) & 0xFFFFFFFF, stride, weight)

    def _lattice_count(self, plan: LightPlan, photons: int) -> int:
        """Lattice points over the whole rectangle, so that about the band's share of photons starts."""
        wanted = photons * plan.share / len(plan.bands)
        return max(1, int(round(wanted / plan.domain.active_share)))

    def _pilot(self, light: int, domain: EmissionDomain) -> list[np.ndarray]:
        """Photon records of the same lattice traced as one band and at `PILOT_PLACES` (the list's later entries)."""
        power = self.buffers.light_power[light]
        count = max(1, int(PILOT_PHOTONS / domain.active_share))
        count = min(count, self.trace.batch)
        bands = [Band(0.0, 1.0, 0.5, float(power.band(0.0, 1.0)[3]))]
        bands += [Band(x, x, x, bands[0].power_w) for x in PILOT_PLACES]
        if not self.features.spectral_groups and not self.features.point_spectrum:
            bands = bands[:1]
        found = []
        for band in bands:
            piece = self._lattice_slice(light, 0, band, 0, count, 0, 1, count, weight=1.0)
            batch = self.trace.run(piece, domain)
            raw = self.trace.photons.read(size=batch.photons * self.trace.photon.stride) if batch.photons else b""
            found.append(np.frombuffer(raw, self.trace.photon.dtype))
        return found

    def _plan(self, domains: dict[int, EmissionDomain], pilots: dict[int, list[np.ndarray]]) -> list[LightPlan]:
        power = {i: max(float(self.buffers.light_power[i].band(0.0, 1.0)[1]) * domains[i].measure * domains[i].active_share, 0.0) for i in domains}
        total = sum(power.values())
        plans = []
        for i, domain in domains.items():
            if power[i] <= 0.0 or not any(len(p) for p in pilots[i]):
                continue
            share = 0.5 * power[i] / total + 0.5 / len(domains)
            plans.append((i, domain, self._bands(i, pilots[i], share), share))
        scale = sum(p[3] for p in plans)
        for i, _, bands, _ in plans:
            self.stats.bands[self.scene.lights[i].name] = len(bands)
        return [LightPlan(i, domain, bands, share / scale) for i, domain, bands, share in plans]

    def _bands(self, light: int, pilot: list[np.ndarray], share: float) -> tuple[Band, ...]:
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
            count = 1 if method != "srd" or not self.features.spectral_groups else self._band_count(pilot, share)
            edges = np.linspace(float(axis.x_of_nm(max(lo_nm - 0.5, 380.0))), float(axis.x_of_nm(min(hi_nm + 0.5, 780.0))), count + 1)
            middles = 0.5 * (edges[:-1] + edges[1:])
        return tuple(
            Band(float(lo), float(hi), float(mid), float(power.band(lo, hi)[3])) for lo, hi, mid in zip(edges[:-1], edges[1:], middles, strict=True)
        )

    def _band_count(self, pilot: list[np.ndarray], share: float) -> int:
        """Bands needed so that the chord's error stays below the tolerance for nine tenths of the flux."""
        whole = pilot[0]
        if len(whole) == 0:
            return 1
        texel = self._texel_size()
        errors, weights = [], []
        for place, record in zip(PILOT_PLACES, pilot[1:], strict=True):
            mine, theirs = _same_paths(whole, record)
            if len(mine) == 0 or abs(place - 0.5) < 0.2:
                continue
            predicted = mine["position"] + self._sweep(mine, place)
            miss = np.linalg.norm(predicted - theirs["position"], axis=1)
            spread = np.linalg.norm(theirs["position"] - mine["position"], axis=1)
            # A pilot pair that lands in another world altogether says nothing about curvature.
            same = miss < np.maximum(spread, 1e-12) * 2.0
            errors.append(miss[same] / ((place - 0.5) / 0.5) ** 2 / texel[mine["receiver"][same]])
            weights.append(mine["flux_w"][same])
        if not errors or not sum(map(len, errors)):
            return 1
        error, weight = np.concatenate(errors), np.concatenate(weights)
        order = np.argsort(error)
        running = np.cumsum(weight[order])
        typical = error[order][np.searchsorted(running, 0.9 * running[-1])]
        # Footprints grow with the square root of the bands: no need for a chord much truer than those.
        footprint = np.median(np.linalg.norm(whole["dposition_ds"], axis=1) / texel[whole["receiver"]])
        budget = (self.settings.photons or self.scene.render.photons) * share
        for count in range(1, MAX_BANDS + 1):
            blur = self.settings.smoothing * footprint * np.sqrt(PILOT_PHOTONS * count / budget)
            if typical / count**2 <= BAND_TOLERANCE_TEXELS * max(1.0, blur):
                return count
        return MAX_BANDS

    def _sweep(self, photons: np.ndarray, x: float) -> np.ndarray:
        """Displacement of photons from their anchor to x by their spectral columns, GPU space (n, 3)."""
        table = self.buffers.variable_table
        samples = np.linspace(0.0, 1.0, table.shape[1])
        moved = np.zeros((len(photons), 3))
        for g, row in enumerate(table):
            step = np.interp(x, samples, row) - np.interp(photons["x_anchor"], samples, row)
            moved += photons[f"dposition_dvar{g}"][:, :3] * step[:, None]
        return moved

    def _texel_size(self) -> np.ndarray:
        """Texel side of each receiver's finest window, GPU units."""
        sides = []
        for record in self.layout.receivers:
            area = self.layout.placements["texel_area"][record["placement"]]
            sides.append(np.sqrt(area) * self.buffers.space.scale)
        return np.array(sides)

    def resolved_textures(self) -> list[moderngl.Texture]:
        """The summed maps for look-ups."""
        self.atlas.flush()
        return self.atlas.total_textures

    def resolved_tile(self, tile: Tile) -> np.ndarray:
        """A tile of the summed maps: float32 (height, width, channels), row 0 at texel y = 0."""
        return self.atlas.read_tile(tile)

    def finish(self) -> None:
        """Sum what is pending and fetch the counters."""
        self.atlas.flush()
        counts = self.splatter.counts()
        self.stats.outside_map_w = counts["outside_map_w"]
        self.stats.footprints_dropped = int(counts["footprints_dropped"])

    def release(self) -> None:
        """Free everything."""
        self.trace.release()
        self.splatter.release()
        for name in ("tables", "atlas", "receivers", "variables"):
            if hasattr(self, name):
                getattr(self, name).release()


def reflectance_classes(scene: Scene, buffers: SceneBuffers) -> tuple[list[np.ndarray | None], dict[int, int]]:
    """Distinct spectral reflectances to fold into the tables (None: none), and each receiver's class."""
    classes: list[np.ndarray | None] = [None]
    chosen: dict[int, int] = {}
    for receiver, index in enumerate(buffers.receivers):
        material = scene.objects[index].material
        assert isinstance(material, Diffuse)
        if material.reflectance is None:
            chosen[receiver] = 0
            continue
        chosen[receiver] = next((i for i, known in enumerate(classes) if known is not None and np.array_equal(known, material.reflectance)), len(classes))
        if chosen[receiver] == len(classes):
            classes.append(material.reflectance)
    return classes, chosen


def spectral_axis(scene: Scene, features: Features) -> SpectralAxis:
    """The axis of a rendering: by the scene's glasses, or plain wavelength for methods linear in λ."""
    if not features.spectral_groups or features.merged_groups and features.spectral_groups == 1:
        return SpectralAxis.build([])
    return SpectralAxis.build([o.material.dispersion for o in scene.objects if isinstance(o.material, Dielectric)])


def _largest_batch(context: Context, features: Features) -> int:
    """Lattice points whose queue fits the device's largest storage buffer."""
    from app.passes.trace import RAY_ROOM

    ray = records.ray_record(features.defines()["COLUMNS"]).stride
    limit = context.limits.storage_block_bytes
    return max(64, int(limit // (2 * RAY_ROOM * ray)) // 64 * 64)


def _landings(pilots: list[np.ndarray]) -> dict[int, Landings]:
    """Where pilot photons landed, per receiver; flux averaged over the wavelengths traced."""
    found: dict[int, Landings] = {}
    photons = np.concatenate(pilots) if pilots else None
    if photons is None or not len(photons):
        return found
    for receiver in np.unique(photons["receiver"]):
        mine = photons[photons["receiver"] == receiver]
        found[int(receiver)] = Landings(mine["position"].astype(float), mine["flux_w"].astype(float))
    return found


def _same_paths(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Records of both traces that took the same branches to the same receiver."""
    def keys(records_: np.ndarray) -> np.ndarray:
        return (records_["photon_id"].astype(np.uint64) << np.uint64(32)) | records_["branch_key"].astype(np.uint64)

    _, in_a, in_b = np.intersect1d(keys(a), keys(b), return_indices=True)
    same = a["receiver"][in_a] == b["receiver"][in_b]
    return a[in_a[same]], b[in_b[same]]
