"""The light of a live rendering: a light pass whose photons are stored, and shown through an edited scene without being
traced again."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...base.generators import mapped
from ...edit.live_inputs import LiveInputs
from ...features.features import Features
from ...gpu import shader
from ...gpu.context import Context
from ...gpu.scene_buffers import SceneBuffers
from ...model.scene import Scene
from ...model.settings import RenderSettings
from ...passes.bounce_light import BounceLightPass
from ...passes.caustic_maps import CausticMaps
from ...passes.environment_light import EnvironmentLightPass
from ...passes.map_layout import LIVE
from ..device_scene import scene_buffers
from ..light_maps import LightMaps
from ..light_pass import LightPass
from ..light_plan import spans_of
from ..map_fit import PREVIEW_FINENESS, MapFit
from ..photon_batches import traced_besides
from ..sampling import MovingBeams
from ..shown_spectra import PassTables
from ..solo import solo, solo_scene
from .frame_plan import FramePlan
from .invalidation import shown_glasses
from .kept_light import KeptLight
from .moved_light import MovedLight
from .photon_store import PhotonStore
from .spectrum_guess import SpectrumGuess
from .stored_passes import StoredPass, StoredPasses
from .widening import needs_widening, widening

BEAM_SECONDS = 0.03
"""What finding and drawing beams should take while something is dragged."""


class LiveLight:
    """Photons of one traced scene and how they are shown. Owns the scene's buffers as well."""

    def __init__(
        self,
        context: Context,
        scene: Scene,
        settings: RenderSettings,
        capacity_bytes: int,
        moving: MovingBeams | None = None,
        buffers: SceneBuffers | None = None,
    ) -> None:
        """The first maps are fitted to the scene's camera and the size in `settings`, with the windows of a
        preview. `moving`: how fine beams are while something is dragged; `buffers`: the scene's, where they are made.
        """
        self._context = context
        self.buffers = buffers or scene_buffers(context, scene, settings)
        self.stored = StoredPasses(context.ctx, capacity_bytes, context.traits.work_is_queued)
        self._capacity_bytes = capacity_bytes
        self._sample: StoredPass | None = None
        """Photons that answer questions about what beams carry."""
        self._kept = KeptLight()
        self._shown: LiveInputs | None = None
        self.moving = moving or MovingBeams()
        fit = MapFit(scene.camera, settings.width, settings.height, PREVIEW_FINENESS, avoids_powers_of_two=True)
        self.light_pass = LightPass(
            context,
            scene,
            settings,
            self.buffers.features,
            self.buffers,
            fit=fit,
            photon_records=self.stored,
            moving=self.moving,
        )
        self.environment: EnvironmentLightPass | None = None
        """Light of what is beyond everything, where the scene has it."""
        if self.buffers.features.environment_lights:
            self.environment = EnvironmentLightPass(context, self.buffers, settings.seed)
        self.bounces: BounceLightPass | None = None
        """What receivers give each other, where the scene has it switched on."""
        if self.buffers.features.bounces:
            self.bounces = BounceLightPass(context, self.buffers, self.environment, settings.seed)
        self._seen: Scene | None = None
        """Colours and spectra with which environment and bounces are gathered."""
        self.may_have_beams = Features.of(scene, replace(settings, local_gain=False)).beams
        """Beams carry light while nothing is painted."""
        self.beam_seconds = 0.0
        """What beams took in the last preview."""
        self.finest = 0
        """Photons of the finest pass that there will be; 0: the one that there is."""
        self._widens = needs_widening(scene)
        self.judged_view: object = None
        """The view for which `refit` judged the maps last."""
        self._preview: LightMaps | None = None
        self._preview_side = 1.0
        self.preview_photons = 0
        """Records that were splatted into the last preview."""
        self._moved: MovedLight | None = None
        self._guess: SpectrumGuess | None = None
        self._outdated: list[LightMaps | SpectrumGuess] = []
        """Maps of another layout that are shown until the present ones are filled."""
        self.is_coarse = True
        """The maps are those of a first preview: `fit_to` makes proper ones."""

    @property
    def first_order(self) -> bool:
        """What is shown has another dispersion than what was traced."""
        return bool(self.light_pass.shown.changed)

    def caustic_maps(self, maps: LightMaps) -> CausticMaps:
        """`maps`, this light's, as the camera reads them: what was splatted in colour only gets a likely spectrum."""
        textures = maps.resolved_textures()
        if maps is not self.light_pass.maps and self.light_pass.features.map_tents:
            if self._guess is not None and self._guess.textures[0].size != maps.atlas.size:
                self._guess.release()
                self._guess = None
            if self._guess is None:
                channels, lights = self.light_pass.shown.channels, self.light_pass.scene.lights
                self._guess = SpectrumGuess(self._context.ctx, channels, lights, maps.atlas.size)
            self._guess.run(textures[0])
            textures = [*textures, *self._guess.textures]
        known = self._gathered
        return replace(maps.caustic_maps(textures), environment=known[-1].texture if known else None)

    # ---- what is shown -----------------------------------------------------------------------

    def show(self, inputs: LiveInputs) -> None:
        """Take over dispersion, spectra, solo, smoothing and local gain of `inputs`; maps keep what was
        deposited until they are splatted again.

        `inputs.scene` must be one that these photons can follow (`invalidation.dirty_level` below TRACE).
        """
        glasses = shown_glasses(self.light_pass.scene, inputs.scene)
        if glasses is None:
            raise ValueError("these photons cannot follow the scene: it must be traced")
        self._shown = inputs
        shown = self.light_pass.shown
        spectra = [
            light.spectral_power if inputs.solo_nm is None else solo(light.spectral_power, inputs.solo_nm)
            for light in inputs.scene.lights
        ]
        self.light_pass.smoothing = inputs.smoothing
        self._show_gains(inputs)
        stale = shown.show_spectra(spectra)
        before = shown.changed
        forgets = shown.show_glass({a: b for a, b in glasses.items() if a != b})
        if forgets or stale:
            self.stored.forget_tables()
            if self._sample is not None:
                self._sample.tables.outdate()
        beams = self.light_pass.survey.beams
        if beams is not None and (stale or shown.changed != before):
            beams.show(solo_scene(inputs.scene, inputs.solo_nm))

    def _show_gains(self, inputs: LiveInputs) -> None:
        light_pass = self.light_pass
        before = light_pass.features.local_gain
        wanted = (
            inputs.local_gain
            and light_pass.features.spectral_groups > 0
            and any(o.local_dispersion for o in inputs.scene.objects)
        )
        light_pass.show_gains(inputs.scene if wanted else None)
        if wanted != before and self._preview is not None:
            self._preview.take(self._preview_features)

    @property
    def _preview_features(self) -> Features:
        features = self.light_pass.features
        return replace(features, map_tents=0)

    def fit_to(self, inputs: LiveInputs) -> None:
        """Maps laid out for the camera and picture size of `inputs`; empty, to be filled from the stored photons.
        The former ones can be shown until `drop_outdated`."""
        self.is_coarse = False
        self.drop_outdated()
        before = self.light_pass.give_maps(), self._preview, self._guess
        self._outdated = [owned for owned in before if owned is not None]
        self._preview = self._guess = None
        self._kept.release()
        if self.light_pass.survey.beams is not None and self.only_beams:
            self.light_pass.survey.beams.survey_again()
        self.light_pass.lay_out(self.fit_of(inputs))

    @property
    def shows_outdated(self) -> bool:
        """The maps that are shown are of before `fit_to`."""
        return bool(self._outdated)

    def drop_outdated(self) -> None:
        """The maps of before `fit_to` are no longer shown."""
        shader.release(*self._outdated)
        self._outdated = []

    @staticmethod
    def fit_of(inputs: LiveInputs) -> MapFit:
        """Proper maps for what `inputs` shows."""
        return MapFit(inputs.camera, inputs.width, inputs.height, LIVE, avoids_powers_of_two=True)

    def keep(self, photons: int, number: int) -> None:
        """Remember the maps, which `number` passes of `photons` have filled, for after one wavelength was shown
        alone."""
        if self.only_beams and self._shown is not None:
            self._kept.keep(self.light_pass, self._shown, photons, number)

    @property
    def holds_shown(self) -> bool:
        """What was kept is the light of what is shown."""
        return self._shown is not None and self._kept.holds(self.light_pass, self._shown)

    def bring_back(self) -> tuple[int, int]:
        """Make the maps what they were, where `holds_shown`; returns photons of the last pass and the number of such
        passes."""
        return self._kept.bring_back(self.light_pass)

    def move(self, scene: Scene, plan: FramePlan | None = None) -> LightMaps | None:
        """A few photons through `scene`, in which things have moved: buffers are moved there, and what is
        stored or accumulated no longer belongs to them. None, and nothing done, where buffers cannot be moved. `plan`:
        how many photons, as in `MovedLight.follow`."""
        if scene is not self.buffers.scene and not self.buffers.move(scene):
            return None
        if self._moved is None:
            self._moved = MovedLight(self._context, self.light_pass, self._preview_features)
        photons = self._moved.photons if plan is None else plan.photons
        return self._moved.follow(scene, self.widening(photons), plan)

    def widening(self, photons: float) -> float:
        """How much wider footprints are in pictures by so few photons."""
        return widening(photons, self.finest) if self._widens else 1.0

    # ---- stored photons ----------------------------------------------------------------------

    @property
    def photons_stored(self) -> int:
        """Records that can be splatted again."""
        return self.stored.fullest.store.photons if self.stored.fullest else 0

    def splat_stored(self, *, of_running: bool = False) -> Iterator[None]:
        """Empty maps, then the stored photons as they are shown now, pausing after every slab, and beams as fine as
        those.

        Where only the first rounds are stored, footprints are as much wider. `of_running`: those of the running pass as
        they are, so that it can go on. Nothing is shown where nothing is stored.
        """
        kept, maps = self.stored.running if of_running else self.stored.fullest, self.light_pass.maps
        maps.clear()
        if kept is None:
            return
        store = kept.store
        if of_running:
            store.drop_unfinished()
        share = store.rounds / store.rounds_of_pass
        if self.only_beams:
            share = 1.0
        for slab in store.first_slabs(store.rounds):
            coarsening = 1.0 if of_running else share**-0.5
            coarsening *= self.widening(kept.pass_photons * (1.0 if of_running else share))
            yield from self.light_pass.splat_steps(slab.buffer, slab.count, coarsening, kept.tables.full)
            yield
        yield from self.light_pass.beam_steps_again(kept.pass_photons * share)
        maps.photon_weight = kept.pass_photons * share

    def splat_preview(self, photons: int, side: float = 1.0) -> LightMaps | None:
        """About so many stored photons (`preview_photons`) as they are shown now, in small maps of their own
        (`MapFit.preview` with `side`), and the strongest beams; None where there is nothing.

        For while something is dragged: the maps that accumulate are left alone. On devices that splat fast, photons
        that answer questions stand for beams too.
        """
        kept, light_pass, beams = self.stored.fullest, self.light_pass, self.light_pass.survey.beams
        if self._sample is not None and self._sample.store.rounds and self._context.traits.moves_by_photons:
            kept, beams = self._sample, None
        has_photons = kept is not None and bool(kept.store.rounds)
        if not has_photons and (beams is None or not self.only_beams):
            return None
        if self._preview is None or side != self._preview_side:
            shader.release(self._preview)
            layout, self._preview_side = light_pass.layout_for(light_pass.fit.preview(side)), side
            self._preview = LightMaps(self._context.ctx, layout, self._preview_features)
        self._preview.clear()
        self._preview.photon_weight, self.preview_photons = 1.0, 0
        if kept is not None and has_photons:
            self._splat_some(kept, photons, self._preview)
        started = time.perf_counter()
        if beams is not None:
            beams.draw_moving(self._preview, self._preview.photon_weight, self.moving, BEAM_SECONDS)
        self.beam_seconds = time.perf_counter() - started
        return self._preview

    def _splat_some(self, kept: StoredPass, photons: int, maps: LightMaps) -> None:
        slabs, stride, share = kept.store.some(photons)
        wider = share**-0.5 * self.widening(kept.pass_photons * share)
        steps, smoothing = self.light_pass.batches.splatting.steps, self.light_pass.smoothing * wider
        for slab in slabs:
            self.preview_photons += -(-slab.count // stride)
            for _ in steps(slab.buffer, -(-slab.count // stride), maps, kept.tables.preview, smoothing, stride):
                pass
        if not self._context.traits.work_is_queued:
            self._context.finish()  # how long it took decides how many are splatted next time
        maps.photon_weight = kept.pass_photons * share

    # ---- the environment, and what receivers give each other ---------------------------------

    @property
    def _gathered(self) -> list[EnvironmentLightPass | BounceLightPass]:
        """Light that is gathered, one after the other."""
        return [light for light in (self.environment, self.bounces) if light is not None]

    def gather(self, end: float, seconds: float, interacting: bool, moved: bool) -> bool:
        """Gather more of it until `end` (`time.perf_counter`), in dispatches of so many `seconds`; whether so much more
        is known that it is shown. While something is dragged only the first of another environment is gathered, and
        while things are `moved` only the environment: places on them stay where they were."""
        found = False
        for light in self._gathered:
            if light.is_done:
                continue
            if (light is self.bounces and (interacting or moved)) or (interacting and light.shown):
                break
            for _ in light.steps(seconds):
                if time.perf_counter() >= end or (interacting and light.is_worth_showing):
                    break
            if light.is_worth_showing:
                found = True
                self.show_gathered()
            if not light.is_done:
                break
        return found

    def show_gathered(self) -> None:
        """What is known becomes what the camera looks up."""
        for light in self._gathered:
            light.show()

    def take_seen(self, scene: Scene) -> None:
        """Other colours, spectra or another environment of the same things."""
        self._seen = scene
        for light in self._gathered:
            light.take(scene)

    def bounce_caustics(self, maps: CausticMaps) -> None:
        """Surfaces reflect other caustics to each other from now on."""
        if self.bounces is not None and self._seen is not None:
            self.bounces.take(self._seen, maps, self.light_pass.shown.channels)

    @property
    def shows_gathered(self) -> bool:
        """Something is shown of all that may be gathered now."""
        return next((light.shown > 0 for light in self._gathered if not light.is_done), True)

    @property
    def knows_gathered(self) -> bool:
        """All of it was gathered."""
        return all(light.is_done for light in self._gathered)

    # ---- beams -------------------------------------------------------------------------------

    @property
    def only_beams(self) -> bool:
        """Beams carry all light, but for what they leave to photons."""
        return self.light_pass.survey.only_beams

    def show_survey(self) -> None:
        """The beams that were found first, in the light pass's maps."""
        assert self.light_pass.survey.beams is not None
        self.light_pass.survey.beams.draw_found(self.light_pass.maps, self.moving.threshold)

    def sample(self, photons: int) -> Iterator[None]:
        """Trace photons that answer questions (`stored_records`) about what beams carry; nothing where there are
        some."""
        light_pass = self.light_pass
        if not light_pass.survey.has_beams or self.has_records:
            return
        plans = yield from mapped(light_pass.sample_plans(photons), lambda step: None)
        tables = PassTables(light_pass.shown, spans_of(plans, len(light_pass.scene.lights)))
        shader.release(self._sample)
        store = PhotonStore(self._context.ctx, self._capacity_bytes, self._context.traits.work_is_queued)
        self._sample = StoredPass(store, tables, photons)
        yield from traced_besides(light_pass.trace, light_pass.settings.seed, plans, photons, store.keep)

    @property
    def _asked(self) -> StoredPass | None:
        """Photons of all light, beams' too."""
        return self._sample if self.light_pass.survey.has_beams else self.stored.fullest

    @property
    def has_records(self) -> bool:
        """`stored_records` knows something."""
        return self._asked is not None and self._asked.store.rounds > 0

    def stored_records(self, limit: int) -> np.ndarray:
        """About `limit` stored records (`gpu.records.photon_record`) of all light, beams' too."""
        photon = self.light_pass.trace.photon
        return photon.zeros(0) if self._asked is None else self._asked.store.read(limit, photon)

    def stored_weight(self, limit: int) -> float:
        """What the flux of `stored_records(limit)` is power times."""
        return 0.0 if self._asked is None else self._asked.pass_photons * self._asked.store.some(limit)[2]

    @property
    def bytes(self) -> int:
        """Device memory of photons, queues, maps and scene."""
        there = self.light_pass.maps, self._preview, *self._outdated
        maps = sum(maps.bytes for maps in there if isinstance(maps, LightMaps))
        maps += sum(light.bytes for light in self._gathered)
        photons = self.stored.bytes + (0 if self._sample is None else self._sample.store.bytes)
        return photons + self.light_pass.trace.bytes + self.buffers.bytes + maps + self._kept.bytes

    def release(self) -> None:
        """Free everything, the stored photons and the scene's buffers too."""
        self.drop_outdated()
        owners = (
            self._sample,
            self._kept,
            self._moved,
            self._preview,
            self._guess,
            self.bounces,
            self.environment,
            self.light_pass,
            self.buffers,
        )
        shader.release(*owners)
