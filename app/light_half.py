"""The light half of a rendering: pilot, bands, maps, then rounds of emit → trace → splat.

The pilot is a few thousand photons per light, traced at several wavelengths. It says where light
lands (so the maps are fitted before anything is deposited) and how far the spectral columns are
from the truth (so the spectrum is cut into as few bands as that error allows).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import moderngl
import numpy as np

from app.gpu import records
from app.gpu.context import Context
from app.gpu.map_atlas import MapAtlas
from app.gpu.records import MAX_BANDS
from app.gpu.scene_buffers import SceneBuffers
from app.gpu.splat_tables import SplatTables
from app.model.features import Features
from app.model.scene import Dielectric, Diffuse, Mirror, Scene
from app.model.settings import RenderSettings
from app.model.spectral_tables import SpectralAxis
from app.passes.accumulate import LevelsFold, SeamFold, copy_texture
from app.passes.emission_domain import EmissionDomain, emission_domain
from app.passes.map_layout import MapLayout, check_map_receiver, layout_maps
from app.passes.pilot import (
    MAX_LIGHT_POINTS,
    Pilot,
    PilotFit,
    has_extent,
    landings_of,
    run_pilot,
)
from app.passes.splat import Splatter
from app.passes.trace import Band, Batch, FluxTally, LatticeSlice, TracePass

DEFAULT_BATCH = 1 << 16
SMALLEST_BATCH = MAX_BANDS * MAX_LIGHT_POINTS
"""One point of every sub-lattice a light may have."""
TINTED_BANDS = 16
"""Least number of bands where glass absorbs or mirrors are coloured."""
_SHIFT_GENERATORS = (1116352409, 1899447441, 3141592653, 1640531527, 1359893119)


class Releasable(Protocol):
    """Anything that holds GPU memory."""

    def release(self) -> None: ...


@dataclass
class LightStats:
    """What the light half did."""

    tally: FluxTally = field(default_factory=FluxTally)
    photons: int = 0
    splats: int = 0
    bands: dict[str, int] = field(default_factory=dict)
    light_points: dict[str, int] = field(default_factory=dict)
    trace_seconds: float = 0.0
    splat_seconds: float = 0.0
    outside_map_w: float = 0.0
    footprints_dropped: int = 0
    dropped_w: float = 0.0
    """Flux of those photons, splatted as one texel each."""


@dataclass(frozen=True)
class LightPlan:
    """One light's share of every pass."""

    index: int
    domain: EmissionDomain
    bands: tuple[Band, ...]
    light_points: int
    share: float
    """Share of the photons."""

    @property
    def lattices(self) -> int:
        """Sub-lattices: one a band and point on the light."""
        return len(self.bands) * self.light_points


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
        batch = max(min(batch, _largest_batch(context, features)), SMALLEST_BATCH)
        self.trace = TracePass(context, features, buffers, batch, settings.max_depth)
        self.variables = context.ctx.buffer(np.ascontiguousarray(buffers.variable_table if buffers.groups.count else np.zeros((1, 2), "f4")).tobytes())
        self.reflectances, self.reflectance_class = reflectance_classes(scene, buffers)
        self._weight_sum = 0.0
        self._prepared: list[Releasable] = []
        self._tables: SplatTables | None = None
        self._spans: list[list[tuple[float, float]]] = []

    def prepare(self) -> None:
        """Pilots and maps, once for a scene. Afterwards `layout` and `atlas` exist, and `features` are those of the maps too."""
        specular = [self.buffers.space.to_gpu(m.corners()) for m, o in zip(self.buffers.world_meshes, self.scene.objects, strict=True) if isinstance(o.material, Dielectric | Mirror)]
        triangles = np.concatenate(specular) if specular else np.zeros((0, 3, 3))
        domains = {i: emission_domain(light, self.scene, self.buffers.space, triangles) for i, light in enumerate(self.scene.lights)}
        domains = {i: d for i, d in domains.items() if d is not None}
        pilots = {i: run_pilot(self.trace, self.scene, i, domain, self._full_power(i), self._needs_spectral_pilot) for i, domain in domains.items()}
        self._domains, self._pilots = domains, pilots
        picture = (self.settings.width, self.settings.height)
        shows_map = self.settings.layer.startswith("map:")
        self.map_receiver = check_map_receiver(self.scene, self.buffers, self.settings.layer[4:]) if shows_map else None
        self.layout: MapLayout = layout_maps(self.scene, self.buffers, landings_of(pilots.values()), picture, self.reflectance_class, self.map_receiver)
        # Only the pilot tells whether a fine window pays: without one no splat is drawn twice.
        self.features = replace(self.features, nested_windows=any(len(windows) > 1 for windows in self.layout.windows.values()))
        ctx = self.context.ctx
        self.splatter = Splatter(ctx, self.features)
        self.bin_edges_nm = None if self.settings.bins is None else np.linspace(380.0, 780.0, self.settings.bins + 1)
        self.atlas = MapAtlas(ctx, self.layout.size, self.layout.placements, self.features.targets)
        self.receivers = ctx.buffer(np.ascontiguousarray(self.layout.receivers).tobytes())
        self._resolved = [ctx.texture(self.atlas.size, 4, dtype="f4") for _ in range(self.features.targets)]
        self._levels_fold = LevelsFold(ctx, self.layout.folds)
        self._seam_fold = SeamFold(ctx, [(self.layout.tiles[r][0], charts) for r, charts in self.layout.charts.items()])
        self._prepared = [self.splatter, self.atlas, self.receivers, *self._resolved, self._levels_fold, self._seam_fold]

    def begin(self, photons: int, seed: int) -> None:
        """Empty maps and a plan for passes of about `photons`; what was summed and counted before is forgotten.

        Afterwards `plans` and `tables` exist. Pilots and maps stay, so a rendering may be begun again and again."""
        self.seed = seed
        self.stats = LightStats()
        self._weight_sum = 0.0
        self.atlas.clear()
        self.splatter.reset_counts()
        self.plans = self._plan(photons)
        limits = {plan.index: [(b.x_lo, b.x_hi) for b in plan.bands] for plan in self.plans}
        spans = [limits.get(i, [(0.0, 1.0)]) for i in range(len(self.scene.lights))]
        if spans != self._spans:
            if self._tables is not None:
                self._tables.release()
            channels = "xyz" if self.bin_edges_nm is None else self.bin_edges_nm.tolist()
            spectra = [light.spectral_power for light in self.scene.lights]
            self._tables = SplatTables.build(self.context.ctx, self.buffers.axis, spectra, self.reflectances, spans, channels)
            self._spans = spans

    @property
    def tables(self) -> SplatTables:
        """The spectral tables of the plan that was begun."""
        assert self._tables is not None
        return self._tables

    @property
    def _tinted(self) -> bool:
        """Something on the way changes a spectrum's shape."""
        return self.features.absorption or (self.features.mirrors and self.features.spectral_weights)

    @property
    def _needs_spectral_pilot(self) -> bool:
        return bool(self.features.spectral_groups) or self.features.point_spectrum

    def _full_power(self, light: int) -> float:
        """Radiant power of a light's whole spectrum per unit weight, W."""
        return float(self.buffers.light_power[light].band(0.0, 1.0)[3])

    @property
    def map_scale(self) -> float:
        """Factor from what the atlas has summed to energy per texel."""
        return 1.0 / self._weight_sum if self._weight_sum else 0.0

    def run_pass(self, number: int, photons: int, proceed: Callable[[float], bool]) -> bool:
        """One shifted set of lattices with about `photons` points over all lights.

        It is traced in rounds, each an even sub-lattice of the whole, so that a pass that is stopped
        between rounds is complete everywhere, only coarser. `proceed(fraction)` is asked after
        every slice; returns False when it said stop.
        """
        if not self.plans:
            return True
        counts = [self._lattice_count(plan, photons) for plan in self.plans]
        rounds = max(-(-n // (self.trace.batch // plan.lattices)) for n, plan in zip(counts, self.plans, strict=True))
        for j in range(rounds):
            go_on = True
            for i, (plan, lattice) in enumerate(zip(self.plans, counts, strict=True)):
                points = len(range(j, lattice, rounds))
                if points:
                    self._slice(self._lattice_slice(plan, number, lattice, j, rounds, points, float(photons)), plan.domain)
                go_on = proceed((j * len(counts) + i + 1) / (rounds * len(counts)))
            self._weight_sum += photons / rounds
            if not go_on and j + 1 < rounds:
                return False
        return True

    def _slice(self, piece: LatticeSlice, domain: EmissionDomain) -> None:
        started = time.perf_counter()
        batch = self.trace.run(piece, domain)
        traced = time.perf_counter()
        self.splatter.run(self.trace.photons, batch.photons, self.variables, self.tables, self.atlas, self.receivers, self.settings.smoothing)
        if self.context.is_software:
            self.context.finish()
        self.stats.trace_seconds += traced - started
        self.stats.splat_seconds += time.perf_counter() - traced
        self._account(batch)

    def _account(self, batch: Batch) -> None:
        self.stats.photons += batch.emitted_photons
        self.stats.splats += batch.photons
        self.stats.tally.merge(batch.tally)

    def _lattice_slice(self, plan: LightPlan, number: int, lattice: int, first: int, stride: int, points: int, weight: float) -> LatticeSlice:
        # Successive passes follow a Kronecker sequence, so their union is again even.
        start = (self.seed * 0x9E3779B1 + plan.index * 0x85EBCA6B) & 0xFFFFFFFF
        shifts = [(start + (number + 1) * g) & 0xFFFFFFFF for g in _SHIFT_GENERATORS]
        seed = (self.seed + 7919 * number) & 0xFFFFFFFF
        return LatticeSlice(
            plan.index, plan.bands, lattice, first, stride, points, (shifts[0], shifts[1]), (shifts[2], shifts[3]), shifts[4], seed, plan.light_points, weight=weight
        )

    def _lattice_count(self, plan: LightPlan, photons: int) -> int:
        """Points of each sub-lattice over the whole rectangle, so that about the light's share of photons starts."""
        return max(1, int(round(photons * plan.share / plan.lattices / plan.domain.active_share)))

    def _plan(self, photons: int) -> list[LightPlan]:
        """Photons, bands and points of each light that reaches a receiver."""
        domains, pilots = self._domains, self._pilots
        power = {i: max(float(self.buffers.light_power[i].band(0.0, 1.0)[1]) * d.measure * d.active_share, 0.0) for i, d in domains.items()}
        lit = [i for i in domains if power[i] > 0.0 and len(pilots[i].whole)]
        total = sum(power[i] for i in lit)
        plans = []
        for i in lit:
            # Half by power, half evenly: a dim light must not be left coarse.
            share = 0.5 * power[i] / total + 0.5 / len(lit)
            budget = int(photons * share)
            fit = PilotFit(pilots[i], self._texel_size(), self.buffers.variable_table, self.settings.smoothing, budget)
            bands = self._bands(i, fit)
            points = fit.light_points(len(bands)) if self.features.footprints else self._scattered_points(i, len(bands), budget)
            plans.append(LightPlan(i, domains[i], bands, points, share))
            self.stats.bands[self.scene.lights[i].name] = len(bands)
            self.stats.light_points[self.scene.lights[i].name] = plans[-1].light_points
        return plans

    def _scattered_points(self, light: int, bands: int, budget: int) -> int:
        """Points on an extended light for photons without footprints, which need no lattice of their own."""
        return min(SMALLEST_BATCH // bands, max(1, budget // (16 * bands))) if has_extent(self.scene.lights[light]) else 1

    def _bands(self, light: int, fit: PilotFit) -> tuple[Band, ...]:
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
            count = fit.band_count() if method == "srd" and self.features.spectral_groups else 1
            lo_nm, hi_nm = max(lo_nm - 0.5, 380.0), min(hi_nm + 0.5, 780.0)
            edges = np.linspace(float(axis.x_of_nm(lo_nm)), float(axis.x_of_nm(hi_nm)), count + 1)
            if self._tinted and count < TINTED_BANDS:
                # Three weights a band cannot follow a colour over the whole spectrum; steps even in both measures.
                nm = np.linspace(lo_nm, hi_nm, 401)
                even = 0.5 * (nm - lo_nm) / (hi_nm - lo_nm) + 0.5 * (axis.x_of_nm(nm) - edges[0]) / (edges[-1] - edges[0])
                edges = axis.x_of_nm(np.interp(np.linspace(0.0, 1.0, TINTED_BANDS + 1), even, nm))
            middles = 0.5 * (edges[:-1] + edges[1:])
        return tuple(
            Band(float(lo), float(hi), float(mid), float(power.band(lo, hi)[3])) for lo, hi, mid in zip(edges[:-1], edges[1:], middles, strict=True)
        )

    def _texel_size(self) -> np.ndarray:
        """Texel side of each receiver's finest window, GPU units."""
        sides = []
        for record in self.layout.receivers:
            area = self.layout.placements["texel_area"][record["placement"]]
            sides.append(np.sqrt(area) * self.buffers.space.scale)
        return np.array(sides)

    def resolved_textures(self) -> list[moderngl.Texture]:
        """The summed maps for look-ups: wide texels added to fine ones, charts' seams folded home."""
        self.atlas.flush()
        ctx = self.context.ctx
        total = self.atlas.total_textures
        if self.layout.charts:
            self._seam_fold.run(total, self._resolved)
        else:
            for source, target in zip(total, self._resolved, strict=True):
                copy_texture(ctx, source, target)
        self._levels_fold.run(self._resolved)
        return self._resolved

    def _read_resolved(self) -> np.ndarray:
        """All maps put together, float32 (height, width, channels)."""
        width, height = self.atlas.size
        layers = []
        for texture in self.resolved_textures():
            layer = np.empty((height, width, 4), np.float32)
            texture.read_into(layer)
            layers.append(layer)
        return np.concatenate(layers, axis=-1)

    def resolved_map(self, receiver: int) -> np.ndarray:
        """A receiver's finest map: float32 (height, width, channels), row 0 at texel y = 0."""
        x0, y0, x1, y1 = self.layout.tiles[receiver][0].rect
        return self._read_resolved()[y0:y1, x0:x1]

    def map_flux(self) -> float:
        """What the maps hold where they are read: the sum of XYZ maps' last channel (W), or of all bins."""
        total = self._read_resolved()
        total = total[..., 3] if self.bin_edges_nm is None else total.sum(axis=-1)
        flux = 0.0
        for receiver, tiles in self.layout.tiles.items():
            charts = self.layout.charts.get(receiver)
            for level, tile in enumerate(tiles):
                x0, y0, x1, y1 = tile.rect
                energy = total[y0:y1, x0:x1].astype(float)
                if charts is not None:
                    energy = energy[charts.owner >= 0]
                elif level:
                    energy = self._outside_finer(receiver, level, energy)
                flux += energy.sum()
        return flux

    def _outside_finer(self, receiver: int, level: int, energy: np.ndarray) -> np.ndarray:
        """Energy of a coarse window without the part that the finer window is read for."""
        fine, coarse = self.layout.windows[receiver][level - 1 : level + 1]
        height, width = energy.shape
        share = [
            np.clip(np.minimum(high_f, edges[1:]) - np.maximum(low_f, edges[:-1]), 0.0, None) / np.diff(edges)
            for low_f, high_f, edges in (
                (fine.low[0], fine.high[0], np.linspace(coarse.low[0], coarse.high[0], width + 1)),
                (fine.low[1], fine.high[1], np.linspace(coarse.low[1], coarse.high[1], height + 1)),
            )
        ]
        return energy * (1.0 - share[1][:, None] * share[0])

    def finish(self) -> None:
        """Sum what is pending and fetch the counters."""
        self.atlas.flush()
        counts = self.splatter.counts()
        self.stats.outside_map_w = counts["outside_map_w"]
        self.stats.footprints_dropped = int(counts["footprints_dropped"])
        self.stats.dropped_w = counts["dropped_w"]

    def release(self) -> None:
        """Free everything."""
        self.trace.release()
        self.variables.release()
        for owned in self._prepared:
            owned.release()
        if self._tables is not None:
            self._tables.release()


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
