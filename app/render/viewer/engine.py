"""A rendering that is never finished: it follows its inputs, shows a preview in time, and gets better while nothing
changes.

`set` says what is wanted, `advance` works on it for a while. What is done when is decided by `Schedule`: the engine
reports what happens to it, and carries out its actions. Work is cut into parts of a few milliseconds, so that a frame's
budget is kept on a software renderer too.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...base.errors import UserError
from ...edit.live_inputs import LiveInputs
from ...edit.state import TARGET_PHOTONS
from ...gpu import shader
from ...gpu.context import Context
from ...gpu.device_traits import Budget
from ...model.panorama_lights import with_panorama_lights
from ...passes.caustic_maps import CausticMaps
from ..light_maps import LightMaps
from ..sampling import MovingBeams
from ..solo import scene_seen
from . import schedule as events
from .building import Shown, build
from .dirty_level import DirtyLevel
from .engine_answers import EngineAnswers
from .frame_plan import FramePlan
from .frame_planner import FramePlanner, Kind
from .invalidation import appearance_differs, dirty_level, lights_differ, moves_view, only_moves
from .live_camera import DIRECT_S, MOVED_S
from .live_light import LiveLight
from .refit import needs_new_maps
from .schedule import Action, Happened, ShowMaps
from .stats import light_counts

PREVIEW_OVERRUN_S = 0.25
"""What a coarse picture may take beyond a frame's budget."""
PREVIEW_S = 0.016
"""What a coarse picture should take on a software renderer."""
PREVIEW_GPU_S = 0.004
"""What a coarse picture should take on a GPU."""
FIRST_PREVIEW, PREVIEW_PHOTONS = 1 << 13, (1 << 12, 1 << 24)
"""Photons of a coarse picture: of the first one, and at least and at most."""
HELD = 4
"""First passes' photons, at most, for which what is shown stays although the same light is being traced anew."""
CAMERA_SHARE = 0.4
"""The camera's share of a frame in which photons are traced as well."""

REFIT_SHARE = 0.5
"""Least share of a frame for maps that are filled while a moving camera sees the former ones."""

ENVIRONMENT_SHARE = 0.3
"""Least share of a frame for the environment's light until all of it is known."""


class LiveEngine(EngineAnswers):
    """Owns everything of one live rendering; `context` stays the caller's and must be current in every call."""

    def __init__(self, context: Context, budget: Budget | None = None) -> None:
        shader.keep_programs(context.ctx)
        super().__init__(context)
        self.budget = budget or context.traits.viewer
        self.preview_seconds = PREVIEW_S if context.is_software else PREVIEW_GPU_S
        """What a coarse picture should take."""
        self._target_photons = TARGET_PHOTONS
        self._splatting: Iterator[None] = iter(())
        self._tracing: Iterator[None] = iter(())
        self._maps: CausticMaps | None = None
        self._preview_photons = FIRST_PREVIEW
        self._frame_s = 0.0
        self._planner = FramePlanner(context) if budget is None and context.traits.work_is_queued else None
        """Where given, says how many photons a frame has; where not, batches and previews have sizes of their own."""
        self._moving = MovingBeams()

    # ---- what is wanted ----------------------------------------------------------------------

    @property
    def playing(self) -> bool:
        """Photons accumulate."""
        return self.schedule.playing

    @playing.setter
    def playing(self, playing: bool) -> None:
        self.schedule = replace(self.schedule, playing=playing)

    @property
    def refine_when_still(self) -> bool:
        """Trace again with the new glass once nothing changes, where the picture followed an edit to first order
        only."""
        return self.schedule.refines_when_still

    @refine_when_still.setter
    def refine_when_still(self, refines: bool) -> None:
        self.schedule = replace(self.schedule, refines_when_still=refines)

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
            if not (self.schedule.tracing or self.schedule.moved or accumulation.is_done):
                self._tracing = accumulation.steps()
                self._tell(Happened.TRACING_BEGAN)

    @property
    def _largest(self) -> int:
        least = max(self.budget.first_photons, self.budget.finest_photons)
        return min(self.budget.largest_photons, max(self._target_photons, least))

    def set(self, inputs: LiveInputs) -> DirtyLevel:
        """Want `inputs` from now on; returns what has to be redone. The work is done by `advance`."""
        if (scene := with_panorama_lights(inputs.scene)) is not inputs.scene:
            inputs = replace(inputs, scene=scene)
        before, self._wanted = self._wanted, inputs
        if before is not None and dirty_level(before, before, inputs) == DirtyLevel.NOTHING:
            return DirtyLevel.NOTHING
        self._tell(Happened.WISHED)
        return self._level

    def retrace(self) -> None:
        """Trace with the glass that is shown, where the picture followed an edit to first order only."""
        self._tell(Happened.RETRACE_ASKED)

    def rebuild(self) -> None:
        """Compile every program again (shaders changed on disk). Raises `ShaderError`, and the present ones stay, where
        that fails."""
        shader.drop_programs(self.context.ctx)
        self.problem = None
        self.schedule = replace(self.schedule, first_order=False)  # no fine light is waited for
        if self._wanted is None:
            return
        self._tell(Happened.BUILD_ASKED)
        while self.schedule.building:
            try:
                self._build(float("inf"))
            except (shader.ShaderError, UserError):
                self._building.drop()
                self._tell(Happened.FAILED)
                raise

    # ---- work --------------------------------------------------------------------------------

    def advance(self, budget_s: float, interacting: bool = False) -> None:
        """Work for about `budget_s` seconds. `interacting`: something is being dragged, so show at once and
        coarsely."""
        started = time.perf_counter()
        deadline = started + budget_s
        self._tally.begin_frame()
        if self._wanted is None:
            return
        on_device = dict(self.context.timers.seconds)
        self._frame_s = budget_s
        if self._planner is not None:
            self._planner.begin()
        try:
            self._tell(events.FrameBegan(interacting))
            waited = self.schedule.wish_is_due and self.schedule.finishes_preview(self._camera)
            self._follow(budget_s)
            self._work(deadline, budget_s)
            finishes = self.schedule.finishes_preview(self._camera)
            if waited and not finishes and time.perf_counter() < deadline - 0.5 * budget_s:
                self._follow(budget_s)
                self._work(deadline, budget_s)
        except (shader.ShaderError, UserError) as error:
            self._building.drop()
            self.problem = str(error)
            self._tell(Happened.FAILED)
        if self._planner is not None:
            self._planner.end()
        self._tally.seconds |= self.context.timers.since(on_device, waits=False)

    def _follow(self, budget_s: float) -> None:
        """Bring what is shown nearer to what is wanted."""
        assert self._wanted is not None
        due, traced = self.schedule.wish_is_due, None if self._shown is None else self._shown.traced
        level = self._level if due else DirtyLevel.NOTHING
        moves = due and moves_view(self._inputs, self._wanted)
        held = due and self.schedule.interacting and level >= DirtyLevel.TRACE
        things = held and traced is not None and only_moves(traced, self._wanted)
        self._tell(events.Examined(self._camera, level, moves, things), budget_s)

    def _work(self, deadline: float, budget_s: float) -> None:
        sees, camera = not self._camera_pass.is_paused and self._inputs is not None, self._camera
        reserved = CAMERA_SHARE * budget_s
        if self.schedule.building:
            self._build(deadline - (reserved if sees and camera.owes_picture else 0.0))
        elif not shader.compiled_by(self.context.ctx, deadline):
            return  # what is shown stays until the next can be drawn
        elif (
            self.schedule.has_photon_work
            and not self.schedule.yields_to_camera(camera)
            and not self._camera_pass.is_becoming_whole
        ):
            self._work_on_photons(deadline - (0.0 if camera.is_done else reserved))
        self._work_on_environment(deadline, budget_s)
        if self._camera_pass.is_paused or self._inputs is None:
            return
        # A coarse picture that is owed is finished in this frame: what was moved must be seen to move.
        camera = self._camera
        owed = PREVIEW_OVERRUN_S if camera.is_coarse else 0.25 * budget_s
        end = max(deadline, time.perf_counter() + owed) if camera.owes_picture else deadline
        self._tally.seconds["camera"] += self._camera_pass.advance(end, one_sample=self.schedule.interacting)
        self._awaits_picture &= self._camera.owes_picture
        self._tell(events.CameraWorked(self._camera))
        if self.schedule.interacting and self.schedule.splatting and self._shown and self._shown.light.shows_outdated:
            # A camera that moves for long shall not see the former maps all the while.
            self._work_on_photons(max(deadline, time.perf_counter() + REFIT_SHARE * budget_s), only_stored=True)

    # ---- schedule ----------------------------------------------------------------------------

    def _tell(self, event: events.Event, budget_s: float = 0.0) -> None:
        """Let the schedule follow `event`, and do what it says."""
        self.schedule, actions = events.step(self.schedule, event, time.perf_counter())
        for action in actions:
            self._carry_out(action, budget_s)

    def _carry_out(self, action: Action | ShowMaps, budget_s: float) -> None:
        assert self._wanted is not None
        match action:
            case Action.BUILD:
                self.problem = None
                if self._planner is not None and self._level == DirtyLevel.BUILD:
                    self._planner.restart()
                if self._shown is not None and self._shown.light.light_pass.survey.beams is not None:
                    self._shown.light.light_pass.survey.beams.pause()
                sizes = self._first_budget, self._wanted, self._largest, self._target_photons
                self._building.begin(build(self.context, *sizes, self._maps_ready, self._moving, self._held_photons))
            case Action.FOLLOW_PHOTONS:
                self._follow_photons(self._wanted, 0.4 * budget_s)
            case Action.FOLLOW_CAMERA | Action.MOVE_CAMERA:
                self._follow_camera(self._wanted, view_only=action == Action.MOVE_CAMERA)
            case Action.FOLLOW_MOVE:
                self._follow_move(self._wanted)
            case Action.REFIT_MAPS:
                self._refit(self._wanted)
            case Action.JUDGE_MAPS:
                if self._shown is not None and needs_new_maps(self._shown.light, self._wanted):
                    self._refit(self._wanted)
            case Action.OFFER_MAPS:
                self._maps_ready()
            case Action.REFINE_PICTURE:
                self._restart_camera(same_view=True)
            case ShowMaps(same_view, finer_maps):
                assert self._shown is not None
                self._awaits_picture = self._shows_former
                self._set_maps(self._shown.light.light_pass.maps)
                # Other light is shown as soon as can be, better light when it is as smooth.
                self._restart_camera(same_view=same_view and not self._awaits_picture, finer_maps=finer_maps)

    @property
    def _first_budget(self) -> Budget:
        """Sizes of the first picture of a scene."""
        if self._planner is None:
            return self.budget
        portion = self._planner["refining"].photons
        return replace(self.budget, first_photons=min(self.budget.first_photons, 4 * portion), portion=portion)

    @property
    def _held_photons(self) -> int:
        """Photons of a pass as fine as which light is to be that replaces what follows the same edit to first order."""
        if self._shown is None or self._inputs is None or self.schedule.moved or not self.schedule.first_order:
            return 0
        same = self._wanted is not None and dirty_level(self._inputs, self._inputs, self._wanted) < DirtyLevel.SPLAT
        return min(self._shown.accumulation.finest, HELD * self._shown.accumulation.first) if same else 0

    def _maps_ready(self) -> None:
        """The maps as they are are worth showing."""
        assert self._shown is not None
        self._tell(events.MapsReady(self._shown.accumulation.number, self._camera))

    # ---- what actions do ---------------------------------------------------------------------

    def _follow_photons(self, wanted: LiveInputs, seconds: float) -> None:
        shown, before = self._shown, self._inputs
        assert shown is not None and before is not None
        self._building.drop()
        shown.light.show(wanted)
        self._inputs = wanted
        if appearance_differs(before, wanted):
            self._take_scene(wanted, shown.light)
        if shown.light.holds_shown:
            shown.accumulation.bring_back()
            self._show_for_now(shown.light.light_pass.maps)
        elif self.schedule.interacting or lights_differ(before, wanted):
            self._show_preview(seconds)
        else:  # the maps there are stay until all photons are in the next
            self._restart_camera(same_view=True)
        self._splat_again(shown)

    def _follow_camera(self, wanted: LiveInputs, *, view_only: bool) -> None:
        shown, before = self._shown, self._inputs
        assert shown is not None and before is not None
        if view_only:
            self._inputs = replace(before, camera=wanted.camera, width=wanted.width, height=wanted.height)
        else:
            if wanted.scene is not before.scene:
                self._take_scene(wanted, shown.light)
            self._inputs = wanted
        self._restart_camera(same_view=False)

    def _follow_move(self, wanted: LiveInputs) -> None:
        shown = self._shown
        assert shown is not None
        self._building.drop()
        self._splatting, self._tracing = iter(()), iter(())
        self._camera_pass.pause()
        if shown.light.light_pass.survey.beams is not None:
            shown.light.light_pass.survey.beams.pause()
        plan = None if self._planner is None else self._planner["moved"]
        maps = shown.light.move(replace(wanted.scene, camera=wanted.camera), plan)
        if maps is None:
            self._tell(Happened.BUILD_ASKED)
            return
        self._count("moved", int(maps.photon_weight), self._frame_s)
        self._camera_pass.move(shown.light.buffers, scene_seen(wanted.scene, wanted.camera, wanted.solo_nm))
        self._inputs = wanted
        self._set_maps(maps)
        self._restart_camera(same_view=False)

    def _refit(self, wanted: LiveInputs) -> None:
        assert self._shown is not None
        # A camera that moves meanwhile sees the former maps; no other picture is made of these.
        self._camera_pass.pause()
        self._shown.light.fit_to(wanted)
        self._splat_again(self._shown, refitted=True)

    def _splat_again(self, shown: Shown, *, refitted: bool = False) -> None:
        """Splat the stored photons, also where tracing has ended; then tracing continues."""
        self._splatting = shown.accumulation.show_stored()
        self._tracing = shown.accumulation.resumed()
        self._tell(events.SplattingBegan(shown.light.first_order, refitted))

    def _show_preview(self, seconds: float) -> None:
        """As many stored photons as can be splatted in about `seconds`, in coarse maps of their own, as the picture for
        now."""
        assert self._shown is not None
        started, light, planner = time.perf_counter(), self._shown.light, self._planner
        plan = FramePlan(self._preview_photons) if planner is None else planner["stored"]
        maps = light.splat_preview(plan.photons, plan.side)
        if maps is None:
            return
        self._show_for_now(maps)
        self._count("stored", light.preview_photons, self._frame_s)
        if planner is not None:
            return
        took = time.perf_counter() - started - self._shown.light.beam_seconds
        self._preview_photons = int(
            np.clip(self._preview_photons * np.clip(seconds / max(took, 1e-4), 0.5, 2.0), *PREVIEW_PHOTONS)
        )

    def _show_for_now(self, maps: LightMaps) -> None:
        """A coarse picture at once: samples of other light are not mixed with those of this one."""
        self._set_maps(maps)
        self._tell(Happened.PREVIEW_SHOWN)
        self._restart_camera(same_view=False)

    def _restart_camera(self, *, same_view: bool, finer_maps: bool = False) -> None:
        if self._maps is None or self._inputs is None:
            return
        # One coarse picture now; the schedule orders another one in full size when nothing moves. Where photons are
        # splatted again, they want time too.
        shared = self.context.is_software and self.schedule.shows_preview
        seconds = None if same_view else (0.6 if shared else 1.0) * self.preview_seconds
        view = self._inputs.camera, self._inputs.width, self._inputs.height
        direct_s = MOVED_S if self.schedule.moved else DIRECT_S
        self._camera_pass.restart(
            *view, self._maps, seconds=seconds, same_view=same_view, finer_maps=finer_maps, direct_s=direct_s
        )

    def _set_maps(self, maps: LightMaps) -> None:
        assert self._shown is not None
        with self.context.timers.timing("resolve"):
            self._maps = self._shown.light.caustic_maps(maps)
        self._shown.light.drop_outdated()
        if not self.schedule.moved:  # places on what is moved stay where it was
            self._shown.light.bounce_caustics(self._maps)
        self._published_photons = maps.photon_weight

    def _take_scene(self, inputs: LiveInputs, light: LiveLight) -> None:
        scene = scene_seen(inputs.scene, inputs.camera, inputs.solo_nm)
        light_pass = light.light_pass
        light.take_seen(scene)
        self._camera_pass.take_scene(light.buffers, scene, light_pass.shown.reflectances, light_pass.shown.channels)

    # ---- building ----------------------------------------------------------------------------

    def _build(self, deadline: float) -> None:
        if (built := self._building.advance(deadline)) is not None:
            self._swap(built)

    def _swap(self, built: Shown) -> None:
        # What does not compile (or fit) leaves everything as it was: the programs of the camera come first.
        try:
            self._take_scene(built.traced, built.light)
        except BaseException:
            built.light.release()
            raise
        before, self._shown = self._shown, built
        self._building.drop()
        self._splatting, self._tracing = iter(()), built.steps
        shown, self._inputs = self._inputs, built.traced
        is_other = self.schedule.splatting or (
            shown is not None and dirty_level(shown, shown, built.traced) >= DirtyLevel.SPLAT
        )
        if before is not None:
            self._rays_before += before.light.light_pass.trace.rays_traced
            before.light.release()
        self._awaits_picture = is_other and before is not None
        self._tell(events.Built(built.light.is_coarse))
        self._tell(events.MapsReady(built.accumulation.number, self._camera, is_other))

    # ---- light -------------------------------------------------------------------------------

    def _work_on_photons(self, deadline: float, *, only_stored: bool = False) -> None:
        """Splat what is due, then trace, but for `only_stored`."""
        assert self._shown is not None
        light_pass = self._shown.light.light_pass
        before, most, splats = light_counts(light_pass.stats), math.inf, self.schedule.splatting
        if self._planner is not None:
            most = light_pass.batches.portion = self._planner["refining"].photons
        while (
            time.perf_counter() < deadline
            and self.schedule.has_photon_work
            and light_pass.stats.photons - before[2] < most
        ):
            if only_stored and not self.schedule.splatting:
                break
            work = self._splatting if self.schedule.splatting else self._tracing
            if next(work, self) is self:
                self._tell(Happened.SPLATTING_ENDED if self.schedule.splatting else Happened.TRACING_ENDED)
        self._tally.note_light(before, light_pass.stats)
        if not splats:
            room = 1.0 if self._camera.is_done else 1.0 - CAMERA_SHARE
            self._count("refining", max(light_pass.stats.photons - before[2], 0), room * self._frame_s)

    def _count(self, kind: Kind, photons: int, frame_s: float) -> None:
        """This frame has had so many photons, within so many seconds."""
        self._tally.photons = photons or self._tally.photons
        if self._planner is not None:
            self._planner.count(kind, photons, frame_s)

    def _work_on_environment(self, deadline: float, budget_s: float) -> None:
        """A part of a frame or what is left of it, while the camera has a picture to show: for the environment's light,
        then for what surfaces give each other."""
        if self._shown is None or self.schedule.building or self._camera.owes_picture:
            return
        # The rest of it would begin the picture anew each time that more is known, and share frames with it.
        awaits_maps = self._camera_pass.is_paused and self.schedule.has_photon_work
        if (self._camera_pass.is_becoming_whole or awaits_maps) and self._shown.light.shows_gathered:
            return
        end = max(deadline - CAMERA_SHARE * budget_s, time.perf_counter() + ENVIRONMENT_SHARE * budget_s)
        seconds, interacting = 0.5 * ENVIRONMENT_SHARE * budget_s, self.schedule.interacting
        found = self._shown.light.gather(end, seconds, interacting, self.schedule.moved)
        if found and not self._camera_pass.is_paused:
            self._restart_camera(same_view=not interacting)

    def release(self) -> None:
        """Free everything."""
        self._building.drop()
        if self._shown is not None:
            self._shown.light.release()
        self._camera_pass.release()
        shader.forget_programs(self.context.ctx)
        self._splatting = self._tracing = iter(())
        self._shown = self._maps = None
