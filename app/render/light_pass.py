"""The light pass of a rendering: survey, maps, then passes in rounds of emit → trace → splat.

What a survey finds (`LightSurvey`: pilots, beams) says where maps must lie and how a pass divides its photons
(`Planner`). A pass (`PassRounds`) adds beams and batches of photons (`PhotonBatches`) to the maps (`LightMaps`).

What varies from one kind of rendering to another is an argument: what maps are fitted to (`MapFit`), how finely
lattices are divided (`Division`), where photons are kept (`PhotonRecords`).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import replace

import moderngl
import numpy as np

from ..features.features import Features
from ..gpu import shader
from ..gpu.context import Context
from ..gpu.limits import check_brush, check_splats
from ..gpu.scene_buffers import SceneBuffers
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.caustic_maps import CausticMaps
from ..passes.contact_lines import contact_words
from ..passes.landings import Landings
from ..passes.map_layout import MapLayout, check_map_receiver, layout_maps
from ..passes.pilot import Pilot
from ..passes.trace import TracePass
from .light_maps import LightMaps
from .light_plan import SMALLEST_BATCH, Division, LightPlan, Planner, spans_of
from .light_stats import LightStats, PassStep
from .light_survey import LightSurvey
from .map_fit import MapFit
from .pass_rounds import PassRounds, roulette_word
from .pass_sizes import FIRST_KERNEL, PROGRESSIVE, SHRINKING, emphasis, kernel_scale
from .photon_batches import Deposit, PhotonBatches, batch_size
from .photon_records import NoRecords, PhotonRecords
from .sampling import MovingBeams
from .shown_spectra import ShownSpectra, ShownTables

_LEAST_IN_FRAMES = 1024
"""Rays in flight, at least, of a pass that takes little of every frame."""


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
        moving: MovingBeams | None = None,
    ) -> None:
        """`fit` None fits maps to the scene's camera and the picture of `settings`. `photon_records` becomes the light
        pass's own. `moving`: the pass takes little of every frame of a window: beams are first found as fast as
        while something is dragged, on a thread of their own, and where they carry all, maps are fitted to those instead
        of pilots; extended lights make do with fewer points."""
        check_splats(context.limits)
        if features.local_gain:
            check_brush(context.limits)
        self.context = context
        self.scene = scene
        self.settings = settings
        self.features = features
        self._has_contacts = features.contact_lines
        """Contact lines are possible; maps say whether they hold any."""
        self.buffers = buffers
        self.fit = fit or MapFit(scene.camera, settings.width, settings.height)
        """What `maps` are fitted to."""
        self.stats = LightStats()
        self._elsewhere = LightStats()
        """What others counted whose sums were taken over (`take`)."""
        self._division = division or Division()
        in_frames = moving is not None
        # With fewer than `SMALLEST_BATCH` rays in flight the plan depends on their number.
        batch = max(batch_size(context, features, settings.batch), _LEAST_IN_FRAMES if in_frames else SMALLEST_BATCH)
        self.trace = TracePass(context, features, buffers, batch, settings.max_depth)
        self.shown = ShownSpectra(context.ctx, scene, buffers, settings.bins)
        self.survey = LightSurvey(context, scene, features, buffers, self.trace, self.shown, self._division, moving)
        self.batches = PhotonBatches(context, self.trace, self.shown, photon_records or NoRecords(), in_frames)
        self._shrinks = features.method == SHRINKING
        self.smoothing = settings.smoothing * (FIRST_KERNEL if self._shrinks else 1.0)
        """Standard deviation of a footprint in lattice spacings; where passes shrink it, of the first one's."""
        self.widening = 1.0
        """Footprints of what is traced are so many times wider still, in pictures on the way to a better one."""
        self._made: LightMaps | None = None
        self.before_maps: Callable[[MapLayout], None] = lambda layout: None
        """Called before maps are made, which take the most memory; may refuse them."""
        self._planned: tuple[int, tuple[int, int] | None] | None = None
        """Photons and anchors of the plan."""

    # ---- once for a scene --------------------------------------------------------------------

    def prepare(self) -> None:
        """Pilots and maps, once for a scene. Afterwards `layout` and `atlas` exist, and `features` are those of the
        maps too."""
        for _ in self.preparing():
            pass

    def preparing(self) -> Iterator[str | None]:
        """`prepare`, pausing often with the name of what is done now (None: as before); a caller that draws meanwhile
        may bind what it likes."""
        yield from self.survey.steps()
        yield None
        shows_map = self.settings.layer.startswith("map:")
        self.map_receiver = check_map_receiver(self.scene, self.buffers, self.settings.layer[4:]) if shows_map else None
        layout = self.layout_for(self.fit)
        yield None
        self.lay_out(self.fit, layout)

    def lay_out(self, fit: MapFit, layout: MapLayout | None = None) -> None:
        """Maps fitted to where light lands and to `fit`, whose `layout` may be there already; empty."""
        if (before := self.give_maps()) is not None:
            before.release()
        self.fit = fit
        layout = layout or self.layout_for(fit)
        self.before_maps(layout)
        words = None
        if self._has_contacts:
            words = contact_words(self.context.ctx, self.buffers, layout, fit.view)
        self._made = LightMaps(self.context.ctx, layout, self.features, words)
        self.features = self.maps.features
        if self.survey.beam_light is not None:
            self.survey.beam_light.lay_out(self.maps.layout)

    def give_maps(self) -> LightMaps | None:
        """The maps that there are become the caller's, to show them until others are filled."""
        given, self._made = self._made, None
        return given

    def layout_for(self, fit: MapFit) -> MapLayout:
        """The layout of maps fitted to `fit`."""
        return self.layout_about(self.survey.landings(fit), fit)

    def layout_about(self, landings: dict[int, Landings], fit: MapFit) -> MapLayout:
        """The layout of maps fitted to `fit` and to such landings."""
        layout = layout_maps(
            replace(self.scene, camera=fit.view),
            self.buffers,
            landings,
            (fit.width, fit.height),
            self.shown.reflectance_class,
            self.map_receiver,
            fineness=fit.fineness_for(self.features.targets),
            window=None if fit.window is None else self.buffers.space.to_gpu(fit.window),
        )
        if not fit.avoids_powers_of_two:
            return layout
        width, height = (side + (side & (side - 1) == 0) for side in layout.size)
        return replace(layout, size=(width, height))

    # ---- what there is -----------------------------------------------------------------------

    @property
    def bin_edges_nm(self) -> np.ndarray | None:
        """Edges of a spectral picture's bins."""
        edges = self.shown.channels.edges_nm
        return None if edges is None else np.array(edges)

    @property
    def maps(self) -> LightMaps:
        """What light is added to."""
        assert self._made is not None, "prepare() comes first"
        return self._made

    @property
    def layout(self) -> MapLayout:
        """Places of the maps in the atlas."""
        return self.maps.layout

    @property
    def map_window(self) -> np.ndarray | None:
        """What the map of the settings' layer shows, as `MapFit.window`; None for charts and for pictures."""
        if self.map_receiver is None or not (windows := self.layout.windows[self.map_receiver]):
            return None
        corners = np.stack([windows[0].low, windows[0].high])
        return self.buffers.space.to_world(self.layout.frames[self.map_receiver].at(corners))

    def caustic_maps(self, textures: Sequence[moderngl.Texture] | None = None) -> CausticMaps:
        """The summed maps as the camera reads them; `textures` where they are not `resolved_textures`."""
        self.batches.settled()
        return self.maps.caustic_maps(textures)

    # ---- work --------------------------------------------------------------------------------

    def begin(self, photons: int, seed: int) -> None:
        """Empty maps and a plan for passes of about `photons`; what was summed and counted before is forgotten.

        Afterwards `plans` and `tables` exist. Pilots and maps stay, so a rendering may be begun again and again."""
        self.seed = seed
        self.stats, self._elsewhere = LightStats(), LightStats()
        self.maps.clear()
        self.batches.begin()
        if self.survey.beam_light is not None:
            self.survey.beam_light.begin()
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
        # Where they do not say it, beams carry everything.
        tells, pilots, beams = self.survey.tells_lattices, self.survey.pilots, self.survey.beam_light
        self.plans = self._planner(pilots).plans(photons, self._texel_size(), anchors) if tells else []
        for plan in self.plans:
            name = self.scene.lights[plan.index].name
            self.stats.bands[name], self.stats.light_points[name] = len(plan.bands), plan.light_points
        self.batches.records.begin(self.shown, spans_of(self.plans, len(self.scene.lights)), photons)
        if beams is not None:
            self.plans = [
                replace(plan, beam_objects=beams.carried.get(plan.index, ()))
                for plan in self.plans
                if not self.survey.is_carried(plan.index)
            ]

    def _planner(self, pilots: dict[int, Pilot]) -> Planner:
        return Planner(
            self.scene,
            self.settings,
            self.features,
            self.buffers,
            self.survey.domains,
            pilots,
            self.trace.batch,
            self._division,
        )

    def sample_plans(self, photons: int) -> Generator[str | None, None, list[LightPlan]]:
        """Plans for about `photons` as if there were no beams."""
        pilots = yield from self.survey.sample_pilots()
        return self._planner(pilots).plans(photons, self._texel_size())

    def run_pass(self, number: int, photons: int, paused: Callable[[float], object]) -> None:
        """One shifted set of lattices with about `photons` points over all lights. `paused(fraction)` is called after
        every slice."""
        for step in self.pass_steps(number, photons):
            paused(step.fraction)

    def pass_of(self, number: int, photons: int) -> PassRounds:
        """Pass `number` of about `photons`, as it is planned now."""
        weight = photons * emphasis(photons, self._first_photons)
        return PassRounds(
            self.survey, self.plans, self.batches, self.deposit(number), number, photons, weight, self.seed
        )

    def pass_steps(
        self, number: int, photons: int, first_round: int = 0, first_group: int = 0, stride: int = 1
    ) -> Iterator[PassStep]:
        """A whole pass, pausing after every event of the rays and after every splatting; a caller that draws meanwhile
        may bind what it likes. See `PassRounds.steps`."""
        yield from self.pass_of(number, photons).steps(first_round, first_group, stride)

    def deposit(self, number: int) -> Deposit:
        """Where photons of pass `number` go."""
        coarsening = self.widening * (kernel_scale(number) if self._shrinks else 1.0)
        return Deposit(self.maps, self.stats, self.smoothing * coarsening)

    def beam_steps_again(self, photons: float) -> Iterator[None]:
        """Add what beams of a pass of so many photons add to the maps, as they are shown now; nothing is left to
        photons."""
        if self.survey.beams is not None and photons > 0.0:
            for _ in self.survey.beams.steps(photons, photons, roulette_word(self.seed, 0), self.maps, tails=False):
                yield

    def splat_steps(
        self,
        photons: moderngl.Buffer,
        count: int,
        coarsening: float = 1.0,
        tables: ShownTables | None = None,
    ) -> Iterator[None]:
        """Add photon records to the maps, with footprints `coarsening` times as wide, see `Splatting.steps`. `tables`
        of another plan than the one begun."""
        into = Deposit(self.maps, self.stats, self.smoothing * coarsening)
        yield from self.batches.splat(photons, count, into, tables)

    def settling(self) -> Iterator[None]:
        """Sum up what is pending, so that the maps can be shown at once."""
        yield from self.batches.settling(self.maps.atlas, self.stats)

    def _texel_size(self) -> np.ndarray:
        """What each receiver's finest window resolves, GPU units."""
        receivers = range(len(self.layout.receivers))
        return np.array([self.layout.resolved_width(r) for r in receivers]) * self.buffers.space.scale

    def show_gains(self, scene: Scene | None) -> None:
        """Splat from now on with the brush's dabs of `scene`; None without."""
        if scene is not None:
            check_brush(self.context.limits)
        if (scene is not None) != self.features.local_gain:
            self.features = replace(self.features, local_gain=scene is not None)
            self.maps.take(self.features)
        self.shown.show_gains(scene)

    def finish(self) -> None:
        """Sum what is pending and fetch the counters."""
        self.batches.settled()
        self.maps.atlas.flush()
        self.stats.buffers = {
            "scene": self.buffers.bytes,
            "photon queue": self.trace.bytes,
            "splats": self.maps.splatter.bytes,
            "map sums": 16 * len(self.maps.atlas.total_textures) * self.maps.atlas.size[0] * self.maps.atlas.size[1],
            "map scratch": self.maps.atlas.scratch_bytes,
        }
        counts = self.maps.splatter.footprints.counts()
        elsewhere = self._elsewhere
        self.stats.splats_w = counts["splats_w"] + elsewhere.splats_w
        self.stats.outside_map_w = counts["outside_map_w"] + elsewhere.outside_map_w
        self.stats.footprints_dropped = int(counts["footprints_dropped"]) + elsewhere.footprints_dropped
        self.stats.dropped_w = counts["dropped_w"] + elsewhere.dropped_w

    def take(self, sums: Iterable[np.ndarray], photon_weight: float, stats: LightStats) -> None:
        """After `begin`, instead of passes: what others traced for these maps.

        `sums`: for every texture of the atlas in turn, float32 (height, width, 4); `stats`: what they counted."""
        self.maps.atlas.ready_totals()
        for texture, values in zip(self.maps.atlas.total_textures, sums, strict=True):
            texture.write(np.ascontiguousarray(values, np.float32))
        self.maps.photon_weight = photon_weight
        self._elsewhere = stats
        self.stats = replace(stats, bands=self.stats.bands, light_points=self.stats.light_points)

    def settle(self) -> None:
        """After `finish`, where nothing is traced any more: what remains is what is read."""
        self.trace.release_buffers()
        self.maps.settle()

    def release(self) -> None:
        """Free everything."""
        shader.release(self.batches, self.shown, self._made, self.survey)
