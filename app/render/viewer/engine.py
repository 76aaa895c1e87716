"""A rendering that is never finished: it follows its inputs, answers in time, and gets better while nothing changes.

`set` says what is wanted, `advance` works on it for a while. The difference of the wanted inputs to
those that the photons stand for decides what is redone: nothing, camera samples, splats or tracing. Work is cut
into pieces of a few milliseconds, so that a frame's budget is kept on a software renderer too.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...base.errors import UserError
from ...gpu import shader
from ...passes.camera import CausticMaps
from ...passes.pick import Picker, PickHit
from ..light_maps import LightMaps
from .building import Budget, Shown, build
from .inputs import DirtyLevel, LiveInputs
from .invalidation import dirty_level, looks_other
from .live_camera import LiveCamera, solo_scene
from .live_light import LiveLight
from .photon_queries import StoredPhotons, caustic_spectrum, reach_of, world_photons
from .refit import is_judged, wants_new_maps
from .stats import LiveStats

if TYPE_CHECKING:
    import moderngl

    from ...gpu.context import Context
    from ...gpu.scene_buffers import SceneBuffers

STILL_S = 0.5
"""Without a change for so long, what was only approximated is done properly."""
CALM_S = 0.12
"""Without a change for so long, a coarse picture is replaced by a full one."""
ANSWER_S = 0.03
"""What a coarse picture may take beyond a frame's budget."""
LOOK_S = 0.02
"""What a coarse picture should take on a software renderer."""
CAMERA_SHARE = 0.4
"""Of a frame, where photons are traced as well."""


class LiveEngine:
    """Owns everything of one live rendering; `context` stays the caller's and must be current in every call."""

    def __init__(self, context: Context, budget: Budget | None = None) -> None:
        self.context = context
        self.budget = budget or Budget.of(context)
        self._target_photons = 32_000_000
        self.refine_when_still = True
        """Trace again with the new glass once nothing changes, where the picture followed an edit to first order
        only."""
        self.playing = True
        """Photons accumulate."""
        self.problem: str | None = None
        """Why the last change could not be shown (bad shader, maps too large); the picture before it stays."""
        shader.keep_programs(context.ctx)
        self._camera_pass = LiveCamera(context)
        self._wanted: LiveInputs | None = None
        self._inputs: LiveInputs | None = None
        """What the picture shows."""
        self._shown: Shown | None = None
        self._building: Iterator[Shown] | None = None
        self._being_built: LiveInputs | None = None
        self._repair: Iterator[None] | None = None
        """Splats that are due again; goes before the job."""
        self._job: Iterator[None] | None = None
        self._maps: CausticMaps | None = None
        self._picker: Picker | None = None
        self._changed_at = 0.0
        self._interacting = False
        self._urgent = False
        self._retrace = False
        self._rays_before = 0
        self._quick_photons = 1 << 13
        self._shows_quick_maps = False
        self._maps_wait = False
        """Better maps are there, but the camera is within a cycle of bands."""
        self._times = {"trace": 0.0, "splat": 0.0, "camera": 0.0}
        self._history: list[tuple[float, int, float]] = []
        self._published_photons = 0.0

    @property
    def target_photons(self) -> int:
        """Photons after which nothing more is traced."""
        return self._target_photons

    @target_photons.setter
    def target_photons(self, photons: int) -> None:
        self._target_photons = photons
        if self._shown is not None and photons != self._shown.accumulation.target:
            accumulation = self._shown.accumulation
            accumulation.aim_at(photons, self._largest)
            if self._job is None and not accumulation.is_done:
                self._job = accumulation.steps()

    @property
    def _largest(self) -> int:
        return min(self.budget.largest_photons, max(self._target_photons, self.budget.first_photons))

    # ---- what is wanted ----------------------------------------------------------------------

    def set(self, inputs: LiveInputs) -> DirtyLevel:
        """Want `inputs` from now on; returns what that asks for. The work is done by `advance`."""
        before = self._wanted
        if before is not None and dirty_level(before, before, inputs) == DirtyLevel.NOTHING:
            self._wanted = inputs
            return DirtyLevel.NOTHING
        self._wanted = inputs
        self._changed_at = time.perf_counter()
        self._urgent = True
        if self._shown is None or self._inputs is None:
            return DirtyLevel.BUILD
        return dirty_level(self._shown.traced, self._inputs, inputs)

    def retrace(self) -> None:
        """Trace with the glass that is shown, where the picture followed an edit to first order only."""
        self._retrace = self._shown is not None and self._shown.light.first_order

    def rebuild(self) -> None:
        """Compile every program again (shaders changed on disk). Raises `ShaderError`, and the present ones stay, where
        that fails."""
        shader.drop_programs(self.context.ctx)
        self.problem = None
        self._start_building(self._wanted)
        while self._building is not None:
            try:
                self._build(float("inf"))
            except (shader.ShaderError, UserError):
                self._building = self._being_built = None
                raise

    # ---- work --------------------------------------------------------------------------------

    def advance(self, budget_s: float, interacting: bool = False) -> None:
        """Work for about `budget_s` seconds. `interacting`: something is being dragged, so answer at once and
        coarsely."""
        started = time.perf_counter()
        deadline = started + budget_s
        self._times = dict.fromkeys(self._times, 0.0)
        if self._wanted is None:
            return
        if self._interacting and not interacting:
            self._changed_at, self._urgent = started, True
        self._interacting = interacting
        try:
            waited = self._urgent and self._finishes_answer
            self._follow(budget_s)
            self._work(deadline, budget_s)
            if waited and not self._finishes_answer and time.perf_counter() < deadline - 0.5 * budget_s:
                self._follow(budget_s)
                self._work(deadline, budget_s)
        except (shader.ShaderError, UserError) as error:
            self._building = self._being_built = None
            self.problem = str(error)

    def _work(self, deadline: float, budget_s: float) -> None:
        if self._building is not None:
            self._build(
                deadline
                - (CAMERA_SHARE * budget_s if self._maps is not None and self._camera_pass.owes_picture else 0.0)
            )
        elif self._has_work and not self._answering:
            camera_waits = not self._camera_pass.is_done
            self._run_job(deadline - (CAMERA_SHARE * budget_s if camera_waits else 0.0))
        if self._maps is not None and self._inputs is not None:
            # A coarse picture that is owed is finished in this frame: what was moved must be seen to move.
            owed = ANSWER_S if self._camera_pass.is_coarse else 0.25 * budget_s
            end = max(deadline, time.perf_counter() + owed) if self._camera_pass.owes_picture else deadline
            self._times["camera"] += self._camera_pass.advance(end, one_sample=self._interacting)
            if self._last_maps_wait and not self._camera_pass.is_within_cycle:
                self._publish_maps()
            calm = not self._interacting and time.perf_counter() - self._changed_at > CALM_S
            if calm and self._camera_pass.is_coarse and not self._camera_pass.owes_picture:
                self._restart_camera(same_view=True)

    @property
    def _has_work(self) -> bool:
        return self._repair is not None or (self._job is not None and self.playing)

    @property
    def _answering(self) -> bool:
        """A drag gets the whole budget: what its next step throws away is not begun."""
        return self._interacting and (self._camera_pass.owes_picture or self._shows_quick_maps)

    @property
    def _finishes_answer(self) -> bool:
        """Where not even the smallest picture fits a frame, one that has begun is finished first: else nothing would be
        seen to move."""
        return self._interacting and self._camera_pass.is_coarse and self._camera_pass.owes_picture

    def _follow(self, budget_s: float) -> None:
        """Bring what is shown nearer to what is wanted."""
        wanted, shown = self._wanted, self._shown
        assert wanted is not None
        if shown is None or self._inputs is None:
            if self._building is None and self.problem is None:
                self._start_building(wanted)
            elif self.problem is not None and self._urgent:
                self.problem = None
                self._start_building(wanted)
            self._urgent = False
            return
        still = not self._interacting and time.perf_counter() - self._changed_at > STILL_S
        if self._retrace or (still and self.refine_when_still and shown.light.first_order):
            self._retrace = False
            if self._building is None:
                self._start_building(wanted)
            return
        if self._urgent and self._finishes_answer:
            return
        if self._urgent:
            self._urgent = False
            self._answer(dirty_level(shown.traced, self._inputs, wanted), budget_s)
        elif self._building is None and self._fits_badly(shown.light, wanted, still):
            self._camera_pass.pause()
            self._maps = None
            shown.light.fit_to(wanted)
            self._show_again(shown)

    def _show_again(self, shown: Shown) -> None:
        """The stored photons are splatted again, also where nothing is traced any more; then tracing goes on."""
        self._repair = shown.accumulation.show_stored()
        self._job = shown.accumulation.resumed()

    def _fits_badly(self, light: LiveLight, wanted: LiveInputs, still: bool) -> bool:
        """Whether maps should be laid out anew: they are only a first answer, or the camera has come near."""
        return (light.is_coarse and not self._interacting) or (still and wants_new_maps(light, wanted))

    def _answer(self, cost: DirtyLevel, budget_s: float) -> None:
        wanted, shown = self._wanted, self._shown
        assert wanted is not None and shown is not None and self._inputs is not None
        if cost >= DirtyLevel.TRACE:
            # A build that runs is finished first and shown; then the newest wish is looked at again.
            if self._building is None:
                self.problem = None
                self._start_building(wanted)
            else:
                self._urgent = wanted is not self._being_built
            cost = DirtyLevel.LOOK if self._only_camera_besides(wanted) else DirtyLevel.NOTHING
        if cost == DirtyLevel.SPLAT:
            shown.light.show(wanted)
            shown_before, self._inputs = self._inputs, wanted
            if looks_other(shown_before, wanted):
                self._look_at(wanted, shown.light)
            self._answer_quickly(0.4 * budget_s)
            self._show_again(shown)
            return
        elif cost == DirtyLevel.LOOK:
            if self._building is None:
                if wanted.scene is not self._inputs.scene:
                    self._look_at(wanted, shown.light)
                self._inputs = wanted
            else:
                self._inputs = replace(self._inputs, camera=wanted.camera, width=wanted.width, height=wanted.height)
        else:
            return
        self._restart_camera(same_view=False)

    def _answer_quickly(self, seconds: float) -> None:
        """As many stored photons as can be splatted in about `seconds`, in coarse maps of their own, as the picture for
        now."""
        assert self._shown is not None and self._inputs is not None
        started = time.perf_counter()
        maps = self._shown.light.splat_quickly(self._quick_photons)
        if maps is None:
            return
        self._set_maps(maps)
        self._shows_quick_maps = True
        took = time.perf_counter() - started
        self._quick_photons = int(
            np.clip(self._quick_photons * np.clip(seconds / max(took, 1e-4), 0.5, 2.0), 1 << 12, 1 << 24)
        )
        self._restart_camera(same_view=False)

    def _only_camera_besides(self, wanted: LiveInputs) -> bool:
        assert self._inputs is not None
        return wanted.camera != self._inputs.camera or (wanted.width, wanted.height) != (
            self._inputs.width,
            self._inputs.height,
        )

    def _restart_camera(self, *, same_view: bool, finer_maps: bool = False) -> None:
        if self._maps is None or self._inputs is None:
            return
        # One coarse answer now; `advance` asks again in full size when things are still. Where photons are splatted
        # again, they want time too.
        software = LOOK_S if not self._shows_quick_maps else 0.6 * LOOK_S
        seconds = None if same_view else software if self.context.is_software else 0.004
        view = self._inputs.camera, self._inputs.width, self._inputs.height
        self._camera_pass.restart(*view, self._maps, seconds=seconds, same_view=same_view, finer_maps=finer_maps)

    # ---- building ----------------------------------------------------------------------------

    def _start_building(self, wanted: LiveInputs | None) -> None:
        if wanted is None:
            return
        self._being_built = wanted
        self._building = build(
            self.context, self.budget, wanted, self._largest, self._target_photons, self._publish_maps
        )

    def _build(self, deadline: float) -> None:
        assert self._building is not None
        while time.perf_counter() < deadline:
            built = next(self._building, None)
            if self.context.traits.work_is_queued:
                # What is only queued keeps no deadline.
                self.context.finish()
            if built is not None:
                self._swap(built)
                return

    def _swap(self, built: Shown) -> None:
        # What does not compile (or fit) leaves everything as it was: the programs of the camera come first.
        picker = None
        try:
            picker = Picker(self.context, built.light.buffers)
            self._look_at(built.traced, built.light)
        except BaseException:
            if picker is not None:
                picker.release()
            built.light.release()
            raise
        before, self._shown = self._shown, built
        self._building, self._repair, self._job, self._maps_wait = None, None, built.steps, False
        self._inputs, self._being_built = built.traced, None
        if before is not None:
            self._rays_before += before.light.trace.rays_traced
            before.light.release()
        if self._picker is not None:
            self._picker.release()
        self._picker = picker
        self._publish_maps()
        # What was wished for meanwhile is looked at in the next frame.
        self._urgent = self._wanted is not built.traced

    def _look_at(self, inputs: LiveInputs, light: LiveLight) -> None:
        scene = replace(solo_scene(inputs.scene, inputs.solo_nm), camera=inputs.camera)
        self._camera_pass.look_at(light.buffers, scene, light.reflectances, light.map_channels)

    # ---- light -------------------------------------------------------------------------------

    def _run_job(self, deadline: float) -> None:
        assert self._shown is not None
        stats = self._shown.light.stats
        before = stats.trace_seconds, stats.splat_seconds, stats.photons
        while time.perf_counter() < deadline:
            if self._repair is not None:
                if next(self._repair, self) is self:
                    self._repair = None
            elif self._job is None or not self.playing:
                break
            elif next(self._job, self) is self:
                self._job = None
        stats = self._shown.light.stats
        traced = max(stats.trace_seconds - before[0], 0.0)
        splatted = max(stats.splat_seconds - before[1], 0.0)
        self._times["trace"] += traced
        self._times["splat"] += splatted
        self._history = [h for h in self._history if h[0] > time.perf_counter() - 1.0]
        self._history.append((time.perf_counter(), max(stats.photons - before[2], 0), traced + splatted))

    def _publish_maps(self) -> None:
        """The maps as they are become what the camera looks at; more photons of the same kind wait until it has seen
        every band of the spectrum."""
        assert self._shown is not None
        maps, number = self._shown.light.maps, self._shown.accumulation.number
        assert maps is not None
        splatted_anew = self._shows_quick_maps or self._repair is not None
        self._maps_wait = (
            number > 1 and not splatted_anew and not self._interacting and self._camera_pass.is_within_cycle
        )
        if self._maps_wait:
            return
        self._set_maps(maps)
        self._shows_quick_maps = False
        self._restart_camera(
            same_view=not self._interacting and self._camera_pass.scale == 1.0, finer_maps=number <= 1 or splatted_anew
        )

    @property
    def _last_maps_wait(self) -> bool:
        """Maps wait that no further photons will replace."""
        return self._maps_wait and self._job is None and self._repair is None and not self._shows_quick_maps

    def _set_maps(self, maps: LightMaps) -> None:
        assert self._shown is not None
        self._maps = CausticMaps(
            self._shown.light.camera_textures(maps), maps.receivers, maps.atlas.placements, maps.scale
        )
        self._published_photons = maps.photon_weight

    # ---- what there is -----------------------------------------------------------------------

    @property
    def picture(self) -> moderngl.Texture | None:
        """RGBA32F, linear Rec.709 radiance (lm/(sr unit²) for white), top row first; None before the first."""
        return self._camera_pass.picture

    @property
    def picture_version(self) -> int:
        """Changes whenever the picture does."""
        return self._camera_pass.version

    @property
    def camera_samples(self) -> int:
        """A still picture is finished after so many a pixel."""
        return self._camera_pass.target_samples

    @camera_samples.setter
    def camera_samples(self, samples: int) -> None:
        self._camera_pass.target_samples = samples

    @property
    def inputs(self) -> LiveInputs | None:
        """What the picture shows, or is about to."""
        return self._inputs

    @property
    def stats(self) -> LiveStats:
        """This moment's."""
        context, camera_pass = self.context, self._camera_pass
        common = LiveStats(
            renderer=context.renderer,
            is_software=context.is_software,
            camera_samples=float(camera_pass.shown_samples),
            resolution_scale=camera_pass.scale,
            camera_bands=camera_pass.shown_bands,
            camera_fallbacks=camera_pass.fallbacks,
        )
        if self._shown is None:
            return common
        light = self._shown.light
        tally = light.stats.tally
        seconds = sum(h[2] for h in self._history)
        return replace(
            common,
            rays_traced=self._rays_before + light.trace.rays_traced,
            photons=int(self._published_photons),
            photons_stored=light.photons_stored,
            passes=self._shown.accumulation.number,
            trace_s=self._times["trace"],
            splat_s=self._times["splat"],
            camera_s=self._times["camera"],
            photons_per_second=sum(h[1] for h in self._history) / seconds if seconds > 0.0 else 0.0,
            first_order=light.first_order,
            converged=self.is_idle,
            bytes=light.bytes,
            fallbacks=dict(tally.fallbacks),
            lost={name: flux / tally.emitted for name, flux in tally.ended.items()} if tally.emitted else {},
            bands=dict(light.stats.bands),
        )

    @property
    def is_idle(self) -> bool:
        """Nothing is left to do until an input changes."""
        waits = self._building is not None or self._urgent or self._has_work or self._last_maps_wait
        refines = self._shown is not None and self.refine_when_still and self._shown.light.first_order
        unjudged = (
            self._shown is not None and self._wanted is not None and not is_judged(self._shown.light, self._wanted)
        )
        return self._wanted is None or not (waits or refines or unjudged or not self._camera_pass.is_done)

    def pick(self, x: float, y: float) -> PickHit | None:
        """First surface at (x, y) of the picture, 0 to 1 from its top left corner; None beyond everything."""
        if self._picker is None or self._inputs is None:
            return None
        return self._picker.pick(self._inputs.camera, self._inputs.width, self._inputs.height, x, y)

    def stored_photons(self, limit: int = 200_000) -> StoredPhotons:
        """About `limit` stored photons in world space, as they are shown."""
        if self._shown is None or self._inputs is None:
            return StoredPhotons.none()
        return world_photons(self._shown.light, self._inputs, limit)

    def caustic_spectrum(
        self, receiver: int, position: np.ndarray, bins: int = 40
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Shape of the caustic's spectrum at a world position on object `receiver`: wavelengths (bins,) nm, relative
        irradiance (bins,)."""
        if self._shown is None or self._inputs is None or receiver not in self._shown.light.buffers.receivers:
            return None
        spectra = [light.spectral_power.density for light in self._inputs.scene.lights]
        radius = reach_of(self._shown.light, receiver)
        return caustic_spectrum(self.stored_photons(), receiver, position, radius, spectra, bins)

    @property
    def buffers(self) -> SceneBuffers | None:
        """The traced scene on the device, for overlays that ask it more (ray fans)."""
        return self._shown.light.buffers if self._shown else None

    def release(self) -> None:
        """Free everything."""
        self._building = None
        if self._shown is not None:
            self._shown.light.release()
        if self._picker is not None:
            self._picker.release()
        self._camera_pass.release()
        shader.forget_programs(self.context.ctx)
        self._shown = self._job = self._repair = self._maps = self._picker = None
