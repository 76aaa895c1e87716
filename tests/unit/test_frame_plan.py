"""The plan of a frame's light on devices that are made up here: fast, slow, stalling, and with another scene."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from types import SimpleNamespace

import numpy as np
import pytest
from spectrasplat.render.viewer import frame_planner
from spectrasplat.render.viewer.frame_plan import DEPTHS, FEWEST, FIRST, MOST, SIDES, FramePlan, Spent
from spectrasplat.render.viewer.frame_planner import FramePlanner

FRAME_S = 1 / 60
Device = Callable[[int, FramePlan], Spent]


def device(
    each_s: float, fixed_s: float = 2e-4, maps_s: float = 3e-4, rest_s: float = 2e-3, noise: float = 0.0
) -> Device:
    rng = np.random.default_rng(7)

    def frame(_number: int, plan: FramePlan) -> Spent:
        def scattered(spent: float) -> float:
            return spent * math.exp(noise * rng.standard_normal())

        depth = (plan.depth / 8) ** 0.3
        return Spent(
            plan.photons,
            scattered(fixed_s + each_s * depth * plan.photons),
            scattered(maps_s * plan.side**2),
            scattered(rest_s),
        )

    return frame


def shown(device: Device, frames: int, plan: FramePlan | None = None, late: int = 0) -> list[tuple[FramePlan, Spent]]:
    """Frames one after the other; what one took is known before the next, or `late` frames later."""
    plan, done = plan or FramePlan(), []
    for number in range(frames):
        done.append((plan, device(number, plan)))
        if number >= late:
            plan = plan.after(done[number - late][1], FRAME_S)
    return done


def taken(spent: Spent) -> float:
    return spent.light + spent.maps + spent.rest


def photons(frames: Sequence[tuple[FramePlan, Spent]]) -> np.ndarray:
    return np.array([plan.photons for plan, _ in frames])


@pytest.mark.parametrize(
    ("each_s", "rest_s"), [(4e-9, 2e-3), (2e-8, 4e-3), (3e-7, 6e-3)], ids=["H200", "3060", "integrated"]
)
@pytest.mark.parametrize("noise", [0.0, 0.15])
def test_the_rate_is_held_and_the_time_is_used(each_s: float, rest_s: float, noise: float) -> None:
    frames = shown(device(each_s, rest_s=rest_s, noise=noise), 200)
    late = np.array([taken(spent) for _, spent in frames[80:]])
    assert np.median(late) <= FRAME_S and np.percentile(late, 95) <= 1.25 * FRAME_S
    assert np.median(late) >= 0.6 * FRAME_S
    if not noise:  # it comes to rest, but for another depth or size of maps
        assert len({*photons(frames[150:])}) == 1


def test_a_slow_device_gets_the_fewest_and_shorter_paths() -> None:
    frames = shown(device(4e-5, fixed_s=5e-3, rest_s=8e-3), 200)
    assert frames[-1][0].photons == FEWEST and frames[-1][0].depth == DEPTHS[0]


def test_dear_maps_become_smaller_once() -> None:
    frames = shown(device(4e-8, maps_s=8e-3), 200)
    assert [plan.side for plan, _ in frames[60:]] == [SIDES[0]] * 140


def test_it_grows_by_half_at_most_and_shrinks_at_once() -> None:
    rising = photons(shown(device(4e-9), 100))
    assert np.all(rising[1:] <= 1.51 * rising[:-1]) and rising.max() > 20 * FIRST
    plan = FramePlan(photons=1 << 20, usual=1 << 20)
    for _ in range(3):
        plan = plan.after(Spent(1 << 20, 0.2), FRAME_S)
    assert plan.photons < 1.1 * (1 << 20) * FRAME_S / 0.2


@pytest.mark.parametrize("every", [10, 3])
def test_a_stall_says_nothing(every: int) -> None:
    usual = device(2e-8)

    def stalling(number: int, plan: FramePlan) -> Spent:
        spent = usual(number, plan)
        return Spent(spent.photons, spent.light + 0.1, spent.maps, spent.rest) if number % every == 5 % every else spent

    steady, stalled = photons(shown(usual, 120))[60:], photons(shown(stalling, 120))[60:]
    assert np.median(stalled) > 0.8 * np.median(steady)
    spared = np.flatnonzero(stalled < 0.8 * steady) + 60
    assert {*spared % every} <= {(5 + 1) % every}, "but for the next frame, where it might have been more than a stall"


@pytest.mark.parametrize("dearer", [3, 10, 25])
@pytest.mark.parametrize("each_s", [4e-9, 2e-8, 3e-7], ids=["H200", "3060", "integrated"])
def test_no_two_frames_stall_when_light_gets_dearer(dearer: int, each_s: float) -> None:
    before, after = device(each_s, noise=0.1), device(dearer * each_s, noise=0.1)
    frames = shown(lambda number, plan: (after if number >= 60 else before)(number, plan), 120)
    late = np.array([taken(spent) for _, spent in frames])
    assert np.count_nonzero(late > 0.05) <= (dearer > 3)
    assert np.all(late[70:] <= 1.6 * FRAME_S)


def test_a_camera_that_takes_the_frame_leaves_light_little_at_once() -> None:
    usual, beside_glass = device(2e-8), device(2e-8, rest_s=0.03)
    frames = shown(lambda number, plan: (beside_glass if number >= 60 else usual)(number, plan), 64)
    assert frames[61][0].photons < 0.2 * frames[60][0].photons


def test_another_scene_is_followed_within_ten_frames() -> None:
    cheap, dear = device(4e-9), device(1e-7)

    def changing(number: int, plan: FramePlan) -> Spent:
        return (dear if 60 <= number < 140 else cheap)(number, plan)

    frames = shown(changing, 240)
    assert all(taken(spent) <= 1.05 * FRAME_S for _, spent in frames[70:140])
    assert photons(frames)[-1] > 5 * photons(frames)[139]


@pytest.mark.parametrize("late", [0, 1, 8])
def test_however_late_times_come_it_does_not_swing(late: int) -> None:
    settled = photons(shown(device(2e-8, noise=0.05), 200, late=late))[100:]
    assert settled.max() < 1.5 * settled.min()


def test_what_cannot_be_is_ignored() -> None:
    plan = FramePlan()
    for wrong in (math.nan, math.inf, -1.0):
        assert plan.after(Spent(1000, wrong), FRAME_S) == plan
        assert plan.after(Spent(1000, 1e-3, rest=wrong), FRAME_S) == plan
    assert plan.after(Spent(0, 1e-3), FRAME_S) == plan
    for frame_s in (0.0, -1.0, math.nan):
        assert plan.after(Spent(1000, 1e-3), frame_s) == plan
    assert FEWEST <= plan.after(Spent(1000, 0.0), FRAME_S).photons <= MOST
    for _ in range(12):
        plan = plan.after(Spent(1, 1e9), 1e-9)
    assert plan.photons == FEWEST


def planner(works: bool = True) -> tuple[FramePlanner, SimpleNamespace]:
    timers = SimpleNamespace(work=works, frame=None, hear=lambda: None)
    return FramePlanner(SimpleNamespace(timers=timers, finish=lambda: time.sleep(2e-3))), timers  # type: ignore[arg-type]


def test_a_frame_is_learnt_of_once_all_its_times_are_known() -> None:
    plans, timers = planner()
    plans.begin()
    times = timers.frame
    times.awaited = 1
    plans.count("moved", FIRST, FRAME_S)
    plans.end()
    assert timers.frame is None
    plans.begin()
    plans.end()
    assert plans["moved"] == FramePlan()
    times.seconds, times.awaited = {"trace": 0.02, "splat": 0.02, "camera": 0.004}, 0
    plans.begin()
    assert plans["moved"].known == (Spent(FIRST, 0.04, 0.0, 0.004),) and plans["moved"].photons < FIRST
    assert plans["stored"] == plans["refining"] == FramePlan()
    plans.restart()
    assert plans["moved"] == FramePlan()


def test_a_device_that_nobody_waits_for_gets_no_light_while_it_is_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    plans, timers = planner()
    clock, free_at, running, spent = 0.0, 0.0, [], []
    monkeypatch.setattr(frame_planner, "time", SimpleNamespace(perf_counter=lambda: clock))

    def hear() -> None:
        for done, times, seconds in running:
            if done <= clock and times.awaited:
                times.seconds, times.awaited = seconds, 0

    timers.hear = hear
    for number in range(120):
        plans.begin()
        photons = plans["moved"].photons
        took = {"trace": (25.0 if number >= 60 else 1.0) * 2e-8 * photons, "camera": 2e-3}
        free_at = max(free_at, clock) + sum(took.values())
        timers.frame.awaited = 1
        running.append((free_at, timers.frame, took))
        spent.append(sum(took.values()))
        plans.count("moved", photons, FRAME_S)
        plans.end()
        clock += FRAME_S
    assert np.count_nonzero(np.array(spent) > 0.05) <= 4


def test_what_one_frame_traces_and_the_next_one_splats_counts_together() -> None:
    plans, timers = planner()
    for photons, seconds in ((0, {"trace": 3e-3}), (1000, {"splat": 2e-3, "camera": 9e-3})):
        plans.begin()
        timers.frame.seconds = seconds
        plans.count("refining", photons, FRAME_S)
        plans.end()
    plans.begin()
    assert plans["refining"].known == (Spent(1000, pytest.approx(5e-3), 0.0, 0.0),)


def test_without_timers_the_clock_serves() -> None:
    plans, _ = planner(works=False)
    plans.begin()
    plans.count("stored", 1000, FRAME_S)
    plans.end()
    plans.begin()
    (spent,) = plans["stored"].known
    assert 2e-3 <= spent.light < 0.1 and 2e-3 <= spent.rest < 0.1
