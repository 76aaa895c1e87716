"""The light pass of a rendering: pilot, bands, maps, then rounds of emit → trace → splat.

The pilot is a few thousand photons per light, traced at several wavelengths. It says where light
lands (so the maps are fitted before anything is deposited) and how far the spectral columns are
from the reference (so the spectrum is cut into as few bands as that error allows).

What varies from one kind of rendering to another is handed in: what maps are fitted to (`MapFit`), how finely
lattices are divided (`Division`), where photons are kept (`PhotonRecords`), how work is cut (`Pace`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import replace

import moderngl
import numpy as np

from ..base.random_words import Dimension, random_word
from ..gpu import splat_tables
from ..gpu.context import Context
from ..gpu.dispatch_budget import DISPATCH_S, DispatchBudget
from ..gpu.limits import check_brush, check_splats
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..model.features import Features
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.beam_emission import BeamEmission
from ..passes.caustic_maps import CausticMaps
from ..passes.contact_lines import contact_words
from ..passes.emission_domain import EmissionDomain, emission_domain
from ..passes.guided_emission import guided
from ..passes.map_atlas import MapAtlas
from ..passes.map_layout import Landings, MapLayout, Window, check_map_receiver, layout_maps, pixel_side
from ..passes.picture_window import PictureWindow
from ..passes.pilot import Pilot, landings_of, pilot_steps, split_threshold
from ..passes.plane_frame import plane_frame
from ..passes.splat import Splatter
from ..passes.trace import Batch, LatticeSlice, TracePass
from . import shrinking
from .batch_size import batch_size
from .beam_light import SEARCHING, BeamLight, BeamStats, MovingBeams, carries_everything
from .handed_rays import handed_rays
from .light_maps import LightMaps
from .light_plan import Division, LightPlan, Planner
from .light_stats import LightStats, PassStep
from .map_fit import MapFit
from .pass_sizes import PROGRESSIVE, emphasis
from .photon_records import NoRecords, PhotonRecords, RoundOf
from .shown_spectra import ShownSpectra, ShownTables
from .splatting import Pace, Splatting
from .thrown_photons import Keep, thrown

BEAM_ROUND = 1 << 19
"""Photons' worth of beams, where they carry everything, after which a pass may be left."""
BEAM_LEAST = 1 << 17
"""Photons, at least, whose beams are found at once, where photons are traced besides."""
SMALLEST_PORTION = 1 << 10
"""Rays of a batch that are not divided further, however slow the device is."""


class LightPass:
    """Owns the light pass's passes and the caustic maps of one scene."""

    def __init__(
        self,
        context: Context,
        scene: Scene,
        settings: RenderSettings,
        features: Features,
        buffers: SceneBuffers,
        *,
        fit: MapFit | None = None,
        division: Division | None = None,
        photon_records: PhotonRecords | None = None,
        pace: Pace | None = None,
        moving: MovingBeams | None = None,
    ) -> None:
        """`fit` None fits maps to the scene's camera and the picture of `settings`. `photon_records` becomes the light
        pass's own. `moving`: beams are first found as fast as while something is dragged, and where they carry all,
        maps are fitted to those instead of pilots."""
        check_splats(context.limits)
        if features.local_gain:
            check_brush(context.limits)
        self.context = context
        self.scene = scene
        self.settings = settings
        self.features = features
        self._has_contacts = features.contact_lines
        """Before maps tell whether they hold any."""
        self.buffers = buffers
        self.fit = fit or MapFit(scene.camera, settings.width, settings.height)
        """What `maps` are fitted to."""
        self.stats = LightStats()
        self._elsewhere = LightStats()
        """Of `take`."""
        self._division = division or Division()
        self._records = photon_records or NoRecords()
        self._pace = pace or Pace.of(context)
        batch = max(batch_size(context, features, settings.batch), self._pace.min_batch)
        self.trace = TracePass(context, features, buffers, batch, settings.max_depth)
        self.shown = ShownSpectra(context.ctx, scene, buffers, settings.bins)
        self._splatting = Splatting(context, self.shown, self._pace)
        self._shrinks = features.method == shrinking.METHOD
        self.smoothing = settings.smoothing * (shrinking.FIRST_KERNEL if self._shrinks else 1.0)
        """Standard deviation of a footprint in lattice spacings; where passes shrink it, of the first one's."""
        self._sample_pilots: dict[int, Pilot] = {}
        """Where nothing else asks for them."""
        self.widening = 1.0
        """Footprints of what is traced are so many times wider still, in pictures on the way to a better one."""
        self.maps: LightMaps | None = None
        self.before_maps: Callable[[MapLayout], None] = lambda layout: None
        """Asked before maps are made, which take the most memory; may refuse them."""
        self._beams: BeamLight | None = None
        self._moving = moving
        self.dispatch_seconds = DISPATCH_S
        """What the first event of a batch may take where the device queues work: smaller batches follow one that took
        longer."""
        self._planned: tuple[int, tuple[int, int] | None] | None = None
        """Photons and anchors of the plan."""
        self._portion = DispatchBudget(self.trace.batch, SMALLEST_PORTION, self.trace.batch)
        """Rays of the next batch."""
        self._traced_once = False
        """A first event of all tells of compiling."""

    # ---- once for a scene --------------------------------------------------------------------

    def prepare(self) -> None:
        """Pilots and maps, once for a scene. Afterwards `layout` and `atlas` exist, and `features` are those of the
        maps too."""
        for _ in self.preparing():
            pass

    def preparing(self) -> Iterator[str | None]:
        """`prepare`, pausing often with what it is at (None: as before): whoever draws meanwhile may bind what it
        likes."""
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
        if self.features.beams and self.domains:
            yield SEARCHING
            self._beams = BeamLight(
                self.context,
                self.scene,
                self.buffers,
                self.shown,
                self.trace.max_depth,
                beside=self._pace.searches_beside,
            )
            yield None
            yield from self._beams.surveying(self._moving)
            yield "following the first photons"
        self.pilots: dict[int, Pilot] = {}
        if self._moving is None or not self.only_beams:
            self.pilots = yield from self._pilot_steps()
        yield None
        shows_map = self.settings.layer.startswith("map:")
        self.map_receiver = check_map_receiver(self.scene, self.buffers, self.settings.layer[4:]) if shows_map else None
        self.lay_out(self.fit)

    def _pilot_steps(self) -> Generator[str | None, None, dict[int, Pilot]]:
        pilots: dict[int, Pilot] = {}
        for i, domain in self.domains.items():
            yield None
            pilots[i] = yield from pilot_steps(
                self.trace, self.scene, i, domain, self._full_power(i), self._needs_spectral_pilot
            )
        if not self._division.counts:
            # Frames of an animation have to agree about it.
            self.trace.split_threshold = split_threshold(pilots.values())
            self.domains = {i: guided(domain, pilots[i]) for i, domain in self.domains.items()}
        return pilots

    def lay_out(self, fit: MapFit) -> None:
        """Maps fitted to where light lands and to `fit`; empty."""
        if self.maps is not None:
            self.maps.release()
        self.maps, self.fit = None, fit
        layout = self.layout_for(fit)
        self.before_maps(layout)
        words = None
        if self._has_contacts:
            words = contact_words(self.context.ctx, self.buffers, layout, fit.view)
        self.maps = LightMaps(self.context.ctx, layout, self.features, words)
        self.features = self.maps.features
        if self._beams is not None:
            self._beams.lay_out(self.maps.layout)

    def layout_for(self, fit: MapFit) -> MapLayout:
        """Where maps fitted to `fit` lie."""
        if self._beams is not None and not self.pilots:
            landings = self._beams.landings()
        else:
            landings = landings_of(fit.landings(list(self.pilots.values()), self.buffers.space))
        return self.layout_about(landings, fit)

    def layout_about(self, landings: dict[int, Landings], fit: MapFit) -> MapLayout:
        """Where maps fitted to `fit` lie, if light lands so."""
        layout = layout_maps(
            replace(self.scene, camera=fit.view),
            self.buffers,
            landings,
            (fit.width, fit.height),
            self.reflectance_class,
            self.map_receiver,
            fineness=fit.fineness_for(self.features.targets),
        )
        if not fit.avoids_powers_of_two:
            return layout
        width, height = (side + (side & (side - 1) == 0) for side in layout.size)
        return replace(layout, size=(width, height))

    @property
    def _needs_spectral_pilot(self) -> bool:
        return bool(self.features.spectral_groups) or self.features.point_spectrum

    def _full_power(self, light: int) -> float:
        """Radiant power of a light's whole spectrum per unit weight, W."""
        return float(self.buffers.light_power[light].band(0.0, 1.0)[3])

    # ---- what there is -----------------------------------------------------------------------

    @property
    def map_channels(self) -> MapChannels:
        """What the maps' channels stand for."""
        return self.shown.channels

    @property
    def reflectances(self) -> list[np.ndarray | None]:
        """Spectral reflectances that are folded into the tables; None: none."""
        return self.shown.reflectances

    @property
    def reflectance_class(self) -> dict[int, int]:
        """Each receiver's of `reflectances`."""
        return self.shown.reflectance_class

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

    def caustic_maps(self, textures: Sequence[moderngl.Texture] | None = None) -> CausticMaps:
        """The summed maps as the camera reads them; `textures` where they are not `resolved_textures`."""
        return self._maps.caustic_maps(textures)

    def resolved_textures(self) -> list[moderngl.Texture]:
        """The summed maps for lookups: wide texels added to fine ones, charts' seams folded home."""
        return self._maps.resolved_textures()

    def resolved_map(self, receiver: int) -> np.ndarray:
        """A receiver's finest map: float32 (height, width, channels), row 0 at texel y = 0."""
        return self._maps.receiver(receiver)

    def map_flux(self) -> float:
        """What the maps hold where they are read: the sum of XYZ maps' last channel (W), or of all bins."""
        return self._maps.flux(self.bin_edges_nm is None)

    @property
    def tables(self) -> ShownTables:
        """The spectral tables of the plan that was begun."""
        return self._records.tables.full

    def forget_tables(self) -> None:
        """Make spectral tables anew when they are next asked for, as a process that renders once does."""
        self._records.release()
        splat_tables.forget_blurred()

    # ---- work --------------------------------------------------------------------------------

    def begin(self, photons: int, seed: int) -> None:
        """Empty maps and a plan for passes of about `photons`; what was summed and counted before is forgotten.

        Afterwards `plans` and `tables` exist. Pilots and maps stay, so a rendering may be begun again and again."""
        self.seed = seed
        self.stats, self._elsewhere = LightStats(), LightStats()
        self._maps.clear()
        if self._beams is not None:
            self._beams.begin()
        self._first_photons, self._planned = photons, None
        self.plan(photons, 0)

    def go_on_from(self, photons: int, stats: LightStats) -> None:
        """Be as after passes of `photons` that counted `stats`; the maps are empty, until the caller brings back what
        was summed."""
        self.begin(photons, self.seed)
        self.stats = stats

    def plan(self, photons: int, number: int) -> None:
        """Plan pass `number`, of about `photons`; what was summed before stays, each pass with its own weight
        (`pass_sizes.emphasis`). Where bands are the same in all passes of so many photons, they share one plan."""
        anchors = (self.seed, number) if self.features.method == PROGRESSIVE else None
        if self._planned == (photons, anchors):
            return
        self._planned = photons, anchors
        # Without pilots beams carry everything.
        planner = self._planner(self.pilots)
        self.plans = planner.plans(photons, self._texel_size(), anchors) if self.pilots else []
        for plan in self.plans:
            name = self.scene.lights[plan.index].name
            self.stats.bands[name], self.stats.light_points[name] = len(plan.bands), plan.light_points
        limits = {plan.index: [(b.x_lo, b.x_hi) for b in plan.bands] for plan in self.plans}
        spans = [limits.get(i, [(0.0, 1.0)]) for i in range(len(self.scene.lights))]
        self._records.begin(self.shown, spans, photons)
        if self._beams is not None:
            self.plans = [
                replace(plan, beam_objects=self._beams.carried.get(plan.index, ()))
                for plan in self.plans
                if not self._is_carried(plan.index)
            ]

    def _planner(self, pilots: dict[int, Pilot]) -> Planner:
        return Planner(
            self.scene,
            self.settings,
            self.features,
            self.buffers,
            self.domains,
            pilots,
            self.trace.batch,
            self._division,
        )

    def sample_steps(self, photons: int, keep: Keep) -> Iterator[str | None]:
        """Trace about `photons` as if there were no beams and hand them to `keep`; the maps stay as they are."""
        plans = yield from self.sample_plans(photons)
        yield from thrown(self.trace, self.settings.seed, plans, photons, keep)

    def sample_plans(self, photons: int) -> Generator[str | None, None, list[LightPlan]]:
        """Of `sample_steps`."""
        self._sample_pilots = self.pilots or self._sample_pilots or (yield from self._pilot_steps())
        return self._planner(self._sample_pilots).plans(photons, self._texel_size())

    def run_pass(self, number: int, photons: int, proceed: Callable[[float], bool]) -> bool:
        """One shifted set of lattices with about `photons` points over all lights. `proceed(fraction)` is asked after
        every slice; returns False when it said stop, see `steps_until`."""
        goes_on, done = True, 0.0
        steps = self.steps_until(number, photons, lambda: not goes_on)
        while True:
            try:
                fraction = next(steps)
            except StopIteration as finished:
                return finished.value
            if fraction > done:
                done = fraction
                goes_on = proceed(done)

    def steps_until(self, number: int, photons: int, stop: Callable[[], bool]) -> Generator[float, None, bool]:
        """A pass, pausing with the share done; returns False when `stop` left part of it undone.

        It is traced in rounds, each an even sub-lattice of the whole, so that a pass that is stopped between rounds is
        complete everywhere, only coarser."""
        for step in self.pass_steps(number, photons):
            yield step.fraction
            if step.round_done and step.fraction < 1.0 and stop():
                return False
        return True

    def rounds(self, photons: int) -> int:
        """Into how many rounds a pass is divided."""
        if not self.plans:
            return -(-photons // BEAM_ROUND) if self.has_beams else 0
        return max(-(-plan.lattice_count(photons) // (self.trace.batch // plan.lattices)) for plan in self.plans)

    def rounds_together(self, photons: int) -> int:
        """How many rounds have their beams together: few photons' worth of beams are coarse ones."""
        if not (self.plans and self.has_beams):
            return 1
        return max(1, -(-BEAM_LEAST * self.rounds(photons) // photons))

    def pass_steps(
        self, number: int, photons: int, first_round: int = 0, first_group: int = 0, stride: int = 1
    ) -> Iterator[PassStep]:
        """A whole pass, pausing after every event of the rays and after every splatting: whoever draws meanwhile may
        bind what it likes.

        `first_round`: where a pass goes on that was left before. `first_group`, `stride`: of the groups of rounds that
        have their beams together, this one and every so manieth after it, where others trace the rest."""
        rounds, weight = self.rounds(photons), photons * emphasis(photons, self._first_photons)
        if not self.plans:
            for j in range(first_round + first_group, rounds, stride):
                for step in self._beam_steps(number, photons, weight, RoundOf(number, j, rounds, True)):
                    yield PassStep((j + step.fraction) / rounds, False)
                self._maps.photon_weight += weight / rounds
                self.stats.photons += photons * (j + 1) // rounds - photons * j // rounds
                yield PassStep((j + 1) / rounds, True)
            return
        counts = [plan.lattice_count(photons) for plan in self.plans]
        slices = rounds * len(self.plans)
        together = self.rounds_together(photons)
        for j in range(first_round, rounds):
            if (j // together - first_group) % stride:
                continue
            if j == first_round or j % together == 0:
                end = min((j // together + 1) * together, rounds)
                of = RoundOf(number, j, rounds, False)
                yield from self._beam_steps(number, photons, weight, of, j / rounds, end - j)
            for i, (plan, lattice) in enumerate(zip(self.plans, counts, strict=True)):
                done = j * len(self.plans) + i
                points = len(range(j, lattice, rounds))
                if points:
                    part = plan.slice(self.seed, number, lattice, j, rounds, points, weight)
                    for piece, is_last in self._portions(part):
                        of = RoundOf(number, j, rounds, is_last and i + 1 == len(self.plans))
                        for _ in self.batch_steps(self.trace.steps(piece, plan.domain), of, rays=piece.count):
                            yield PassStep(done / slices, False)
                if i + 1 < len(self.plans):
                    yield PassStep((done + 1) / slices, False)
            self._maps.photon_weight += weight / rounds
            yield PassStep((j + 1) / rounds, (j + 1) % together == 0 or j + 1 == rounds)

    def _portions(self, part: LatticeSlice) -> Iterator[tuple[LatticeSlice, bool]]:
        """`part`, in portions that the device has shown to manage in time, and whether each is the last."""
        lattices, first, left = part.count // part.points, part.first, part.points
        while left:
            points = min(left, max(self._portion.units // lattices, 1))
            yield replace(part, first=first, points=points), points == left
            first, left = first + points * part.stride, left - points

    @property
    def has_work(self) -> bool:
        """A pass throws some light."""
        return bool(self.plans) or self.has_beams

    @property
    def has_beams(self) -> bool:
        """Beams carry part of the light."""
        return self._beams is not None and bool(self._beams.carried)

    @property
    def only_beams(self) -> bool:
        """No light needs photons but for what beams hand to them."""
        return self.has_beams and all(self._is_carried(i) for i in self.domains)

    def _is_carried(self, light: int) -> bool:
        assert self._beams is not None
        return carries_everything(self.scene, self._beams.carried.get(light, ()))

    @property
    def beams(self) -> BeamLight | None:
        """What finds and draws them; None where there are none."""
        return self._beams if self.has_beams else None

    @property
    def beam_stats(self) -> BeamStats | None:
        """What beams did; None without any."""
        return self.beams.stats if self.beams is not None else None

    def _beam_steps(
        self, number: int, photons: int, weight: float, of: RoundOf, done: float = 0.0, rounds: int = 1
    ) -> Iterator[PassStep]:
        """The beams of so many `rounds` from one on, and what they hand to photons; `weight`: of the whole pass."""
        beams, nth = self.beams, number * of.count + of.index
        if beams is None:
            return
        share, weight = photons * rounds / of.count, weight * rounds / of.count
        before = beams.stats.find_seconds, beams.stats.draw_seconds
        for part in beams.steps(share, weight, self._word(nth), self._maps):
            yield PassStep(done if self.plans else part, False)
        after = beams.stats.find_seconds, beams.stats.draw_seconds
        self.stats.trace_seconds += after[0] - before[0]
        self.stats.splat_seconds += after[1] - before[1]
        thrown = beams.tally(weight)
        self.stats.tally.merge(thrown)
        self.stats.polygons_w += thrown.ended["deposited"]
        if beams.found is None or beams.found.pieces is None:
            return
        for tails in (False, True):
            pieces, started = beams.found.pieces, time.perf_counter()
            pieces = pieces.where(pieces.is_tail == tails)
            if not len(pieces):
                continue
            emission = BeamEmission(self.buffers, self.trace.ray, pieces, self._records.tables.spans)
            most = self._portion.units
            for light, rays in handed_rays(emission, beams.stats.entered_w, share, weight, most, self.seed, nth):
                self.stats.trace_seconds += time.perf_counter() - started
                for _ in self.batch_steps(self.trace.carry_on(rays, light), of, of_tails=tails):
                    yield PassStep(done, False)
                started = time.perf_counter()

    def beam_steps_again(self, photons: float) -> Iterator[None]:
        """Add what beams of a pass of so many photons throw to the maps, as they are shown now; nothing is handed to
        photons."""
        if self.beams is not None and photons > 0.0:
            for _ in self.beams.steps(photons, photons, self._word(0), self._maps, hands=False):
                yield

    def _word(self, number: int) -> int:
        """Roulette's seed in round `number` of all passes."""
        return random_word(self.seed, 0, number, Dimension.BRANCH)

    def batch_steps(
        self, steps: Generator[None, None, Batch], of: RoundOf, *, of_tails: bool = False, rays: int = 0
    ) -> Iterator[None]:
        """Trace a batch (`TracePass.steps`, `carry_on`), keep and splat what landed, and count it. `of_tails`: photons
        that carry on weak beams, for which a pass has photons besides. `rays`: of the lattice, in this batch."""
        queued, is_first = self.context.traits.work_is_queued, True
        started = time.perf_counter()
        while True:
            try:
                if self._pace.waits:
                    with self.context.timers.timing("trace"):
                        next(steps)
                else:
                    next(steps)
            except StopIteration as finished:
                batch: Batch = finished.value
                break
            if queued and (self._pace.waits or is_first):
                self.context.finish()
            took, is_compiled = time.perf_counter() - started, self._traced_once
            self.stats.trace_seconds += took
            if queued and is_first and rays and is_compiled:
                self._portion.learn(rays, took, self.dispatch_seconds)
            is_first, self._traced_once = False, True
            yield
            started = time.perf_counter()
        self.stats.trace_seconds += time.perf_counter() - started
        if self._records.takes_tails or not of_tails:
            self._records.keep(self.trace.photons, batch, self.trace.photon.stride, of)
        yield
        yield from self.splat_steps(
            self.trace.photons,
            batch.photons,
            self.widening * (shrinking.kernel_scale(of.number) if self._shrinks else 1.0),
        )
        self.stats.photons += 0 if of_tails else batch.emitted_photons
        self.stats.splats += batch.photons
        self.stats.tally.merge(batch.tally.without_beams)

    def splat_steps(
        self,
        photons: moderngl.Buffer,
        count: int,
        coarsening: float = 1.0,
        tables: ShownTables | None = None,
        maps: LightMaps | None = None,
        stride: int = 1,
    ) -> Iterator[None]:
        """Add every `stride`-th photon record to the maps, with footprints `coarsening` times as wide, see
        `Splatting.steps`. `tables` of another plan than the one
        begun, `maps` of another layout than the light pass's own."""
        before, stats = self._splatting.seconds, self.stats
        for _ in self._splatting.steps(
            photons, count, maps or self._maps, tables or self.tables, self.smoothing * coarsening, stride
        ):
            stats.splat_seconds += self._splatting.seconds - before
            yield
            before = self._splatting.seconds
        stats.splat_seconds += self._splatting.seconds - before

    def settling(self) -> Iterator[None]:
        """Sum up what is pending, so that the maps can be shown at once."""
        before, stats = self._splatting.seconds, self.stats
        yield from self._splatting.summing(self.atlas)
        stats.splat_seconds += self._splatting.seconds - before

    def _texel_size(self) -> np.ndarray:
        """What each receiver's finest window tells apart, GPU units."""
        receivers = range(len(self.layout.receivers))
        return np.array([self.layout.width_told(r) for r in receivers]) * self.buffers.space.scale

    @property
    def lit_receivers(self) -> list[int]:
        """Receivers that pilot photons landed on."""
        return sorted(landings_of(self.pilots.values()))

    def window_pixels(self, receiver: int, window: Window | PictureWindow) -> float:
        """Longest side of a flat receiver's window, pixels of the picture that maps are fitted to."""
        if isinstance(window, PictureWindow):
            return float(window.pixels.max())
        points = self.buffers.space.to_gpu(self.buffers.world_meshes[self.buffers.receivers[receiver]].vertices)
        size = self.fit.width, self.fit.height
        pixel = pixel_side(self.fit.view, self.buffers, plane_frame(points), window, size)
        return float(window.size.max()) / pixel

    def show_gains(self, scene: Scene | None) -> None:
        """Splat from now on with the brush's dabs of `scene`; None without."""
        if scene is not None:
            check_brush(self.context.limits)
        if (scene is not None) != self.features.local_gain:
            self.features = replace(self.features, local_gain=scene is not None)
            self._maps.take(self.features)
        self.shown.show_gains(scene)

    def finish(self) -> None:
        """Sum what is pending and fetch the counters."""
        self.atlas.flush()
        self.stats.buffers = {
            "scene": self.buffers.bytes,
            "photon queue": self.trace.bytes,
            "splats": self.splatter.bytes,
            "map sums": 16 * len(self.atlas.total_textures) * self.atlas.size[0] * self.atlas.size[1],
            "map scratch": 16 * len(self.atlas.scratch_textures) * self.atlas.size[0] * self.atlas.size[1],
        }
        counts = self.splatter.counts()
        elsewhere = self._elsewhere
        self.stats.splats_w = counts["splats_w"] + elsewhere.splats_w
        self.stats.outside_map_w = counts["outside_map_w"] + elsewhere.outside_map_w
        self.stats.footprints_dropped = int(counts["footprints_dropped"]) + elsewhere.footprints_dropped
        self.stats.dropped_w = counts["dropped_w"] + elsewhere.dropped_w

    def take(self, sums: Iterable[np.ndarray], photon_weight: float, stats: LightStats) -> None:
        """After `begin`, instead of passes: what others traced for these maps.

        `sums`: for every texture of the atlas in turn, float32 (height, width, 4); `stats`: what they counted."""
        for texture, values in zip(self.atlas.total_textures, sums, strict=True):
            texture.write(np.ascontiguousarray(values, np.float32))
        self._maps.photon_weight = photon_weight
        self._elsewhere = stats
        self.stats = replace(stats, bands=self.stats.bands, light_points=self.stats.light_points)

    @property
    def photon_weight(self) -> float:
        """What was deposited is energy times this."""
        return self._maps.photon_weight

    def settle(self) -> None:
        """After `finish`, where nothing is traced any more: what remains is what is read."""
        self.trace.release_buffers()
        self._maps.settle()

    def release(self) -> None:
        """Free everything."""
        for owned in (self.trace, self._records, self._splatting, self.shown, self.maps, self._beams):
            if owned is not None:
                owned.release()
