"""When the viewer does what, without a device: dragging, stillness, builds that newer wishes overtake, waiting maps,
failures."""

from __future__ import annotations

from dataclasses import replace

import pytest
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.schedule import (
    CALM_S,
    STILL_S,
    Action,
    Built,
    CameraState,
    CameraWorked,
    Event,
    Examined,
    FrameBegan,
    Happened,
    MapsReady,
    Schedule,
    ShowMaps,
    SplattingBegan,
    step,
)

DONE = CameraState()
OWED = CameraState(is_coarse=True, owes_picture=True, is_done=False, is_full_size=False)
COARSE = replace(OWED, owes_picture=False)
MID_CYCLE = CameraState(is_within_cycle=True, is_done=False)
SHOWN = Schedule(shows_scene=True, maps_are_coarse=False)
"""A scene whose light is complete."""


def run(schedule: Schedule, *events: Event, now: float = 0.0) -> tuple[Schedule, list[Action | ShowMaps]]:
    """What a row of events comes to."""
    done: list[Action | ShowMaps] = []
    for event in events:
        schedule, actions = step(schedule, event, now)
        done += actions
    return schedule, done


def asked(level: DirtyLevel, camera: CameraState = DONE, moves_view: bool = False) -> Examined:
    return Examined(camera, level, moves_view)


def test_the_first_wish_is_built_once() -> None:
    schedule, done = run(
        Schedule(), Happened.WISHED, Examined(level=DirtyLevel.BUILD), Examined(level=DirtyLevel.BUILD)
    )
    assert done == [Action.BUILD] and schedule.building and not schedule.wish_is_due
    schedule, done = run(schedule, Built(), MapsReady(1, DONE))
    assert done == [ShowMaps(same_view=True, finer_maps=True)]
    assert schedule.shows_scene and schedule.tracing and schedule.maps_are_coarse and not schedule.building


@pytest.mark.parametrize(
    ("level", "actions"),
    [
        (DirtyLevel.NOTHING, []),
        (DirtyLevel.CAMERA, [Action.FOLLOW_CAMERA]),
        (DirtyLevel.SPLAT, [Action.FOLLOW_PHOTONS]),
        (DirtyLevel.TRACE, [Action.BUILD]),
        (DirtyLevel.BUILD, [Action.BUILD]),
    ],
)
def test_a_wish_costs_what_it_asks_for_and_once(level: DirtyLevel, actions: list[Action]) -> None:
    schedule, done = run(SHOWN, Happened.WISHED, asked(level), asked(level))
    assert done == actions and not schedule.wish_is_due


def test_a_camera_that_moves_while_photons_are_made_is_followed_at_once() -> None:
    _, done = run(SHOWN, Happened.WISHED, asked(DirtyLevel.TRACE, moves_view=True))
    assert done == [Action.BUILD, Action.MOVE_CAMERA]
    # What else is only seen waits for what is built.
    _, done = run(replace(SHOWN, building=True), Happened.WISHED, asked(DirtyLevel.CAMERA))
    assert done == [Action.MOVE_CAMERA]


def test_a_build_is_finished_and_shown_before_a_newer_wish() -> None:
    schedule, _ = run(SHOWN, Happened.WISHED, asked(DirtyLevel.TRACE))
    schedule, done = run(schedule, Happened.WISHED, asked(DirtyLevel.TRACE), asked(DirtyLevel.TRACE))
    assert done == [] and schedule.building and schedule.wish_is_due
    schedule, done = run(schedule, Built(), asked(DirtyLevel.TRACE))
    assert done == [Action.BUILD] and schedule.building and not schedule.wish_is_due


def test_a_build_nobody_overtook_leaves_nothing_due() -> None:
    schedule, _ = run(SHOWN, Happened.WISHED, asked(DirtyLevel.TRACE), Built())
    assert not schedule.wish_is_due and not schedule.wish_is_newer


def test_a_drag_finishes_the_preview_it_owes_first() -> None:
    schedule, done = run(SHOWN, FrameBegan(True), Happened.WISHED, asked(DirtyLevel.SPLAT, OWED))
    assert done == [] and schedule.wish_is_due and schedule.finishes_preview(OWED)
    _, done = run(schedule, asked(DirtyLevel.SPLAT, COARSE))
    assert done == [Action.FOLLOW_PHOTONS]


def test_a_drag_begins_no_work_that_its_next_step_throws_away() -> None:
    dragging, _ = run(replace(SHOWN, tracing=True), FrameBegan(True), Happened.PREVIEW_SHOWN)
    assert dragging.yields_to_camera(DONE)
    assert dragging.yields_to_camera(OWED)
    assert not replace(dragging, shows_preview=False).yields_to_camera(COARSE)
    assert not replace(dragging, interacting=False).yields_to_camera(OWED)


def test_the_end_of_a_drag_is_a_wish() -> None:
    schedule, _ = run(SHOWN, FrameBegan(True), now=1.0)
    assert not schedule.wish_is_due
    schedule, _ = run(schedule, FrameBegan(False), now=2.0)
    assert schedule.wish_is_due and schedule.changed_at == 2.0


def test_what_followed_to_first_order_is_traced_once_still() -> None:
    schedule, _ = run(
        SHOWN, Happened.WISHED, asked(DirtyLevel.SPLAT), SplattingBegan(first_order=True), Happened.SPLATTING_ENDED
    )
    schedule, _ = run(schedule, Happened.TRACING_ENDED)
    early, done = run(schedule, Examined(), now=0.9 * STILL_S)
    assert done == [] and not early.is_idle(DONE)
    assert run(replace(schedule, interacting=True), Examined(), now=2 * STILL_S)[1] == []
    late, done = run(schedule, Examined(), now=1.1 * STILL_S)
    assert done == [Action.BUILD]
    assert not run(late, Built())[0].first_order


def test_who_does_not_want_that_asks_for_it() -> None:
    schedule = replace(SHOWN, first_order=True, refines_when_still=False)
    assert run(schedule, Examined(), now=9.0)[1] == [Action.JUDGE_MAPS] and schedule.is_idle(DONE)
    assert run(schedule, Happened.RETRACE_ASKED, Examined())[1] == [Action.BUILD]
    assert run(SHOWN, Happened.RETRACE_ASKED, Examined())[1] == []  # nothing to gain


def test_coarse_maps_are_refitted_when_nothing_is_dragged_and_others_judged_when_still() -> None:
    coarse = replace(SHOWN, maps_are_coarse=True)
    assert run(coarse, Examined())[1] == [Action.REFIT_MAPS]
    assert run(replace(coarse, interacting=True), Examined())[1] == []
    assert run(replace(coarse, building=True), Examined())[1] == []
    refitted, _ = run(coarse, SplattingBegan(first_order=False, refitted=True))
    assert not refitted.maps_are_coarse and refitted.splatting and refitted.tracing
    assert run(refitted, Examined())[1] == []
    assert run(refitted, Examined(), now=1.1 * STILL_S)[1] == [Action.JUDGE_MAPS]


def test_splatting_again_leaves_coarse_maps_coarse() -> None:
    coarse = replace(SHOWN, maps_are_coarse=True)
    assert run(coarse, SplattingBegan(first_order=True))[0].maps_are_coarse


def test_better_maps_wait_for_a_cycle_of_bands() -> None:
    tracing = replace(SHOWN, tracing=True)
    waiting, done = run(tracing, MapsReady(2, MID_CYCLE))
    assert done == [] and waiting.maps_wait and not waiting.last_maps_wait
    # Newer ones are on their way: these are left out.
    assert run(waiting, CameraWorked(DONE))[1] == []
    last, _ = run(waiting, Happened.TRACING_ENDED)
    assert last.last_maps_wait and not last.is_idle(MID_CYCLE)
    assert run(last, CameraWorked(MID_CYCLE))[1] == []
    assert run(last, CameraWorked(DONE))[1] == [Action.OFFER_MAPS]
    shown, done = run(last, MapsReady(2, DONE))
    assert done == [ShowMaps(same_view=True, finer_maps=False)] and not shown.maps_wait and shown.is_idle(DONE)


@pytest.mark.parametrize(
    ("schedule", "passes", "is_other"),
    [
        (SHOWN, 1, False),
        (replace(SHOWN, shows_preview=True), 2, False),
        (replace(SHOWN, splatting=True), 2, False),
        (replace(SHOWN, interacting=True), 2, False),
        (SHOWN, 2, True),
    ],
)
def test_finer_or_other_maps_do_not_wait(schedule: Schedule, passes: int, is_other: bool) -> None:
    shown, (action,) = step(schedule, MapsReady(passes, MID_CYCLE, is_other), 0.0)
    assert isinstance(action, ShowMaps) and not shown.maps_wait and not shown.shows_preview
    assert action.same_view == (not schedule.interacting)
    assert action.finer_maps == (not schedule.interacting)


def test_a_coarse_picture_is_refined_when_calm() -> None:
    assert run(SHOWN, CameraWorked(COARSE), now=0.9 * CALM_S)[1] == []
    assert run(SHOWN, CameraWorked(OWED), now=2 * CALM_S)[1] == []
    assert run(replace(SHOWN, interacting=True), CameraWorked(COARSE), now=2 * CALM_S)[1] == []
    assert run(SHOWN, CameraWorked(COARSE), now=1.1 * CALM_S)[1] == [Action.REFINE_PICTURE]


def test_pausing_stops_tracing_but_not_what_an_edit_asks_for() -> None:
    paused = replace(SHOWN, tracing=True, playing=False)
    assert not paused.has_photon_work and paused.is_idle(DONE)
    assert replace(paused, splatting=True).has_photon_work
    assert replace(paused, playing=True).has_photon_work


def test_what_failed_is_not_tried_again_by_itself() -> None:
    schedule, _ = run(Schedule(), Happened.WISHED, Examined(level=DirtyLevel.BUILD), Happened.FAILED)
    assert run(schedule, Examined(level=DirtyLevel.BUILD))[1] == [] and schedule.is_idle(DONE)
    again, done = run(schedule, Happened.WISHED, Examined(level=DirtyLevel.BUILD))
    assert done == [Action.BUILD] and not again.failed
    # Neither is a refinement, which would fail in every frame.
    refining = replace(SHOWN, first_order=True, failed=True)
    assert run(refining, Examined(), now=9.0)[1] == [Action.JUDGE_MAPS] and refining.is_idle(DONE)


def test_idle_is_when_nothing_is_left() -> None:
    assert SHOWN.is_idle(DONE)
    assert not SHOWN.is_idle(COARSE)
    for busy in ("building", "wish_is_due", "splatting", "tracing", "first_order"):
        assert not replace(SHOWN, **{busy: True}).is_idle(DONE), busy


def test_the_first_picture_of_a_scene_comes_before_better_maps() -> None:
    first = replace(OWED, is_coarse=False, owes_first=True)
    schedule = replace(SHOWN, maps_are_coarse=True, tracing=True)
    assert schedule.yields_to_camera(first)
    assert run(schedule, Examined(first), now=9.0)[1] == []
    assert run(schedule, Examined(replace(first, owes_first=False)), now=9.0)[1] == [Action.REFIT_MAPS]


def moving(level: DirtyLevel = DirtyLevel.TRACE, camera: CameraState = DONE) -> Examined:
    return Examined(camera, level, moves_things=True)


def test_what_is_held_and_moved_is_followed_until_it_is_let_go() -> None:
    schedule, done = run(replace(SHOWN, tracing=True, splatting=True), FrameBegan(True), Happened.WISHED, moving())
    assert done == [Action.FOLLOW_MOVE]
    assert schedule.moved and not (schedule.building or schedule.has_photon_work or schedule.will_retrace)
    schedule, done = run(schedule, FrameBegan(False), moving())
    assert done == [Action.BUILD]
    schedule, done = run(schedule, Happened.FAILED, moving(DirtyLevel.NOTHING), now=2 * STILL_S)
    assert done == [] and schedule.moved, "old photons are never shown in what was moved"
    assert not run(schedule, Built())[0].moved


def test_a_move_goes_before_what_is_being_built() -> None:
    building, _ = run(SHOWN, Happened.WISHED, asked(DirtyLevel.TRACE))
    schedule, done = run(building, FrameBegan(True), Happened.WISHED, moving())
    assert done == [Action.FOLLOW_MOVE] and not schedule.building
    # A number that is typed is no drag.
    assert run(SHOWN, Happened.WISHED, moving())[1] == [Action.BUILD]
