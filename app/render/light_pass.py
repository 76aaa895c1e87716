"""The light pass of a rendering: pilot, bands, maps, then rounds of emit → trace → splat.

The pilot is a few thousand photons per light, traced at several wavelengths. It says where light
lands (so the maps are fitted before anything is deposited) and how far the spectral columns are
from the reference (so the spectrum is cut into as few bands as that error allows).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np

from ..gpu import records
from ..gpu.context import Context
from ..gpu.gain_buffers import GainBuffers
from ..gpu.map_channels import MapChannels, tents
from ..gpu.reindex import ReindexBuffer, Reindexing, Spans
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.splat_tables import SplatTables
from ..model.features import Features
from ..model.optics.spectral_tables import SpectralAxis
from ..model.optics.spectrum import Spectrum
from ..model.scene import Camera, Scene
from ..model.settings import RenderSettings
from ..passes.emission_domain import EmissionDomain, emission_domain
from ..passes.footprint import SpectralVariables
from ..passes.map_atlas import MapAtlas
from ..passes.map_layout import COARSE_TILE_MAX, FINE_TILE_MAX, MapLayout, check_map_receiver, layout_maps
from ..passes.pilot import Pilot, landings_of, pilot_steps
from ..passes.splat import Splatter
from ..passes.trace import Batch, FluxTally, LatticeSlice, TracePass
from .light_maps import LightMaps
from .light_plan import SMALLEST_BATCH, Planner

DEFAULT_BATCH = 1 << 16


@dataclass
class LightStats:
    """What the light pass did."""

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
class ShownTables:
    """The spectra as splats see them, and which wavelengths belong to which paths."""

    tables: SplatTables
    reindex: ReindexBuffer | None

    def release(self) -> None:
        """Free both."""
        self.tables.release()
        if self.reindex is not None:
            self.reindex.release()


@dataclass(frozen=True)
class PassStep:
    """A pause within a pass."""

    fraction: float
    """Share of the pass that is done."""
    round_done: bool
    """What is summed up is an even lattice: the maps may be shown."""


@dataclass(frozen=True)
class RoundOf:
    """Where a batch belongs."""

    number: int
    """Pass."""
    index: int
    count: int
    """Round `index` of `count`, each an even sub-lattice."""
    is_last_light: bool


class LightPass:
    """Owns the light pass's passes and the caustic maps of one scene."""

    tile_max = (FINE_TILE_MAX, COARSE_TILE_MAX)
    """Longest sides of the maps' fine and coarse windows, texels."""
    min_batch = SMALLEST_BATCH
    """With fewer rays in flight the plan would depend on the batch."""

    def __init__(
        self, context: Context, scene: Scene, settings: RenderSettings, features: Features, buffers: SceneBuffers
    ) -> None:
        self.context = context
        self.scene = scene
        self.settings = settings
        self.features = features
        self.buffers = buffers
        self.stats = LightStats()
        batch = settings.batch or DEFAULT_BATCH * (1 if context.is_software else 4)
        batch = max(min(batch, _largest_batch(context, features)), self.min_batch)
        self.trace = TracePass(context, features, buffers, batch, settings.max_depth)
        self.variables = SpectralVariables.build(context.ctx, buffers.variables)
        self.gains = (
            GainBuffers(context.ctx, scene, buffers.receivers, buffers.space, buffers.axis)
            if features.local_gain
            else None
        )
        self.reflectances, self.reflectance_class = reflectance_classes(scene, buffers)
        edges = None if settings.bins is None else tuple(np.linspace(380.0, 780.0, settings.bins + 1).tolist())
        self.map_channels = tents(buffers.axis, features.map_tents) if features.map_tents else MapChannels(edges)
        """What the maps' channels stand for."""
        self.maps: LightMaps | None = None
        self.waits = context.is_software
        """Wait for the device at every pause: times are then what the work took, and a budget is kept."""
        self.splat_part = 1 << 30
        """Photons splatted without a pause."""
        self._shown_spectra: Sequence[Spectrum] = [light.spectral_power for light in scene.lights]
        self._reindexing = (
            Reindexing.of(buffers.axis.glasses[0], buffers.axis.glasses[0]) if features.reindexed else None
        )
        self._tables: ShownTables | None = None
        self._spans: Spans = []

    def prepare(self) -> None:
        """Pilots and maps, once for a scene. Afterwards `layout` and `atlas` exist, and `features` are those of the
        maps too."""
        for _ in self.preparing():
            pass

    def preparing(self) -> Iterator[None]:
        """`prepare`, pausing often: whoever draws meanwhile may bind what it likes."""
        specular = [
            self.buffers.space.to_gpu(m.corners())
            for m, o in zip(self.buffers.world_meshes, self.scene.objects, strict=True)
            if o.material.is_specular
        ]
        triangles = np.concatenate(specular) if specular else np.zeros((0, 3, 3))
        domains = {
            i: emission_domain(light, self.scene, self.buffers.space, triangles)
            for i, light in enumerate(self.scene.lights)
        }
        self.domains: dict[int, EmissionDomain] = {i: d for i, d in domains.items() if d is not None}
        self.pilots: dict[int, Pilot] = {}
        for i, domain in self.domains.items():
            yield
            self.pilots[i] = yield from pilot_steps(
                self.trace, self.scene, i, domain, self._full_power(i), self._needs_spectral_pilot
            )
        yield
        shows_map = self.settings.layer.startswith("map:")
        self.map_receiver = check_map_receiver(self.scene, self.buffers, self.settings.layer[4:]) if shows_map else None
        self.lay_out(self.scene.camera)

    def lay_out(self, camera: Camera) -> None:
        """Maps fitted to where light lands and to what `camera` sees of it; empty."""
        if self.maps is not None:
            self.maps.release()
        self.maps = self.maps_for(camera, self.settings.width, self.settings.height, self.tile_max)
        self.features = self.maps.features

    def maps_for(
        self, camera: Camera, width: int, height: int, tile_max: tuple[int, int] = (FINE_TILE_MAX, COARSE_TILE_MAX)
    ) -> LightMaps:
        """Maps fitted to what `camera` sees in a picture of `width` × `height`; the caller's to release. `tile_max`:
        see `layout_maps`."""
        seen = replace(self.scene, camera=camera)
        landings = landings_of(self.pilots.values())
        layout = layout_maps(
            seen, self.buffers, landings, (width, height), self.reflectance_class, self.map_receiver, tile_max=tile_max
        )
        return LightMaps(self.context.ctx, layout, self.features)

    @property
    def bin_edges_nm(self) -> np.ndarray | None:
        """Edges of the bins that a spectral picture asks for."""
        return None if self.map_channels.edges_nm is None else np.array(self.map_channels.edges_nm)

    @property
    def _maps(self) -> LightMaps:
        assert self.maps is not None, "prepare() comes first"
        return self.maps

    @property
    def layout(self) -> MapLayout:
        """Where the maps lie."""
        return self._maps.layout

    @property
    def atlas(self) -> MapAtlas:
        """What splats are added to."""
        return self._maps.atlas

    @property
    def receivers(self) -> moderngl.Buffer:
        """RECEIVER records."""
        return self._maps.receivers

    @property
    def splatter(self) -> Splatter:
        """The splat pass of the maps."""
        return self._maps.splatter

    @property
    def map_scale(self) -> float:
        """Factor from what the maps have summed to energy per texel."""
        return self._maps.scale

    def resolved_textures(self) -> list[moderngl.Texture]:
        """The summed maps for lookups: wide texels added to fine ones, charts' seams folded home."""
        return self._maps.resolved_textures()

    def resolved_map(self, receiver: int) -> np.ndarray:
        """A receiver's finest map: float32 (height, width, channels), row 0 at texel y = 0."""
        return self._maps.receiver(receiver)

    def map_flux(self) -> float:
        """What the maps hold where they are read: the sum of XYZ maps' last channel (W), or of all bins."""
        return self._maps.flux(self.bin_edges_nm is None)

    def begin(self, photons: int, seed: int) -> None:
        """Empty maps and a plan for passes of about `photons`; what was summed and counted before is forgotten.

        Afterwards `plans` and `tables` exist. Pilots and maps stay, so a rendering may be begun again and again."""
        self.seed = seed
        self.stats = LightStats()
        self._maps.clear()
        planner = Planner(
            self.scene, self.settings, self.features, self.buffers, self.domains, self.pilots, self.trace.batch
        )
        self.plans = planner.plans(photons, self._texel_size())
        for plan in self.plans:
            name = self.scene.lights[plan.index].name
            self.stats.bands[name], self.stats.light_points[name] = len(plan.bands), plan.light_points
        limits = {plan.index: [(b.x_lo, b.x_hi) for b in plan.bands] for plan in self.plans}
        spans = [limits.get(i, [(0.0, 1.0)]) for i in range(len(self.scene.lights))]
        if spans != self._spans:
            if self._tables is not None:
                self._tables.release()
            self._spans, self._tables = spans, self._tables_of(spans)

    def _tables_of(self, spans: Spans, width: int | None = None) -> ShownTables:
        channels = self.map_channels
        ctx, spectra, reindexing = self.context.ctx, self._shown_spectra, self._reindexing
        if reindexing is None:
            return ShownTables(
                SplatTables.build(ctx, self.buffers.axis, spectra, self.reflectances, spans, channels, width), None
            )
        shown = reindexing.spans(spans, self.buffers.axis, spectra)
        tables = SplatTables.build(ctx, reindexing.axis, spectra, self.reflectances, shown, channels, width)
        return ShownTables(tables, ReindexBuffer(ctx, reindexing, spans, shown, spectra, tables.classes))

    @property
    def tables(self) -> ShownTables:
        """The spectral tables of the plan that was begun."""
        assert self._tables is not None
        return self._tables

    @property
    def _needs_spectral_pilot(self) -> bool:
        return bool(self.features.spectral_groups) or self.features.point_spectrum

    def _full_power(self, light: int) -> float:
        """Radiant power of a light's whole spectrum per unit weight, W."""
        return float(self.buffers.light_power[light].band(0.0, 1.0)[3])

    def run_pass(self, number: int, photons: int, proceed: Callable[[float], bool]) -> bool:
        """One shifted set of lattices with about `photons` points over all lights.

        It is traced in rounds, each an even sub-lattice of the whole, so that a pass that is stopped
        between rounds is complete everywhere, only coarser. `proceed(fraction)` is asked after
        every slice; returns False when it said stop.
        """
        go_on, done = True, 0.0
        for step in self.pass_steps(number, photons):
            if step.fraction > done:
                done = step.fraction
                go_on = proceed(done)
            if step.round_done and not go_on and done < 1.0:
                return False
        return True

    def pass_steps(self, number: int, photons: int, first_round: int = 0) -> Generator[PassStep, None, None]:
        """`run_pass`, pausing after every event of the rays and after every splatting: whoever draws meanwhile may bind
        what it likes.

        `first_round`: where a pass goes on that was left before."""
        if not self.plans:
            return
        counts = [plan.lattice_count(photons) for plan in self.plans]
        rounds = max(-(-n // (self.trace.batch // plan.lattices)) for n, plan in zip(counts, self.plans, strict=True))
        slices = rounds * len(self.plans)
        for j in range(first_round, rounds):
            for i, (plan, lattice) in enumerate(zip(self.plans, counts, strict=True)):
                done = j * len(self.plans) + i
                points = len(range(j, lattice, rounds))
                if points:
                    piece = plan.piece(self.seed, number, lattice, j, rounds, points, float(photons))
                    for _ in self._slice(piece, plan.domain, RoundOf(number, j, rounds, i + 1 == len(self.plans))):
                        yield PassStep(done / slices, False)
                if i + 1 < len(self.plans):
                    yield PassStep((done + 1) / slices, False)
            self._maps.photon_weight += photons / rounds
            yield PassStep((j + 1) / rounds, True)

    def _slice(self, piece: LatticeSlice, domain: EmissionDomain, of: RoundOf) -> Iterator[None]:
        started = time.perf_counter()
        steps = self.trace.steps(piece, domain)
        while True:
            try:
                next(steps)
            except StopIteration as finished:
                batch: Batch = finished.value
                break
            if (
                self.waits and not self.context.is_software
            ):  # there the queue's length is read at every step, which waits
                self.context.finish()
            self.stats.trace_seconds += time.perf_counter() - started
            yield
            started = time.perf_counter()
        self.stats.trace_seconds += time.perf_counter() - started
        self.keep(batch, of)
        yield
        yield from self.splat_steps(self.trace.photons, batch.photons)
        self._account(batch)

    def keep(self, batch: Batch, of: RoundOf) -> None:
        """Called with every batch while `trace.photons` holds it; a live rendering stores the records."""

    def splat_steps(
        self,
        photons: moderngl.Buffer,
        count: int,
        coarsening: float = 1.0,
        tables: ShownTables | None = None,
        maps: LightMaps | None = None,
        stride: int = 1,
    ) -> Iterator[None]:
        """Add every `stride`-th photon record to the maps, with footprints `coarsening` times as wide, pausing after
        every `splat_part` of them.

        `count`: of those that are added. `tables` of another plan than the one begun, `maps` of another layout than the
        light pass's own."""
        maps, tables = maps or self._maps, tables or self.tables
        smoothing = self.settings.smoothing * coarsening
        for start in range(0, count, self.splat_part):
            started = time.perf_counter()
            part = min(self.splat_part, count - start)
            maps.splatter.run(
                photons,
                part,
                self.variables,
                tables.tables,
                maps.atlas,
                maps.receivers,
                smoothing,
                self.gains,
                start * stride,
                stride,
                tables.reindex,
            )
            if self.waits:
                self.context.finish()
            self.stats.splat_seconds += time.perf_counter() - started
            if start + part < count:
                yield

    def _account(self, batch: Batch) -> None:
        self.stats.photons += batch.emitted_photons
        self.stats.splats += batch.photons
        self.stats.tally.merge(batch.tally)

    def _texel_size(self) -> np.ndarray:
        """Texel side of each receiver's finest window, GPU units."""
        sides = []
        for record in self.layout.receivers:
            area = self.layout.placements["texel_area"][record["placement"]]
            sides.append(np.sqrt(area) * self.buffers.space.scale)
        return np.array(sides)

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
        for owned in (self.maps, self.gains, self._tables):
            if owned is not None:
                owned.release()


def reflectance_classes(scene: Scene, buffers: SceneBuffers) -> tuple[list[np.ndarray | None], dict[int, int]]:
    """Distinct spectral reflectances to fold into the tables (None: none), and each receiver's class."""
    classes: list[np.ndarray | None] = [None]
    chosen: dict[int, int] = {}
    for receiver, index in enumerate(buffers.receivers):
        material = scene.objects[index].material
        if material.reflectance is None:
            chosen[receiver] = 0
            continue
        chosen[receiver] = next(
            (i for i, known in enumerate(classes) if known is not None and np.array_equal(known, material.reflectance)),
            len(classes),
        )
        if chosen[receiver] == len(classes):
            classes.append(material.reflectance)
    return classes, chosen


def spectral_axis(scene: Scene, features: Features) -> SpectralAxis:
    """The axis of a rendering: by the scene's glasses, or plain wavelength for methods linear in λ."""
    if not features.spectral_groups or features.merged_groups and features.spectral_groups == 1:
        return SpectralAxis.build([])
    return SpectralAxis.build([o.material.dispersion for o in scene.objects if o.material.dispersion is not None])


def _largest_batch(context: Context, features: Features) -> int:
    """Lattice points whose queue fits the device's largest storage buffer."""
    from ..passes.trace import RAY_ROOM

    ray = records.ray_record(features.defines()["COLUMNS"]).stride
    limit = context.limits.storage_block_bytes
    return max(64, int(limit // (2 * RAY_ROOM * ray)) // 64 * 64)
