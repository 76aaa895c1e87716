"""Who is given what: nothing is lost, nothing taken twice, what is late is begun again, and the bar tells the time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.farm.jobs import TRIES, Foreman, Job, News
from spectrasplat.farm.weighing import Weighing

from tests.unit.farm_simulation import SimulatedCrew, difference, merge_tree, simulate, without_copies, write_parts


@pytest.mark.parametrize(
    ("workers", "parts"),
    [(50, 150), pytest.param(1000, 1000, marks=pytest.mark.slow), pytest.param(250, 1000, marks=pytest.mark.slow)],
)
def test_every_part_is_taken_once(workers: int, parts: int) -> None:
    crew = SimulatedCrew(workers, late=0.04, deaths=0.04)
    taken, foreman, shown = simulate(crew, parts)
    assert sorted(taken) == list(range(1, parts + 1))
    assert crew.died >= 3 and foreman.tally.copied >= 2, "else it shows nothing"
    assert shown == sorted(shown) and shown[-1] == 1.0


@pytest.mark.parametrize(("workers", "parts"), [(50, 200), pytest.param(250, 1000, marks=pytest.mark.slow)])
def test_copies_end_what_stragglers_hold_up(workers: int, parts: int) -> None:
    with_copies, without = SimulatedCrew(workers, late=0.01), SimulatedCrew(workers, late=0.01)
    _, foreman, _ = simulate(with_copies, parts)
    with without_copies():
        simulate(without, parts)
    assert with_copies.now < 0.7 * without.now
    wasted = 1.0 - sum(foreman.tally.seconds["part"]) / with_copies.busy_s
    assert wasted < 0.06


def test_nothing_is_copied_where_none_is_late() -> None:
    _, foreman, _ = simulate(SimulatedCrew(40, late=0.0, deaths=0.0), 200)
    assert foreman.tally.copied == 0


@pytest.mark.parametrize(("parts", "fan_in"), [(40, 7), pytest.param(1000, 32, marks=pytest.mark.slow)])
def test_files_merge_in_a_tree(parts: int, fan_in: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each part once, to 1e-6 of the flat sum: rounded to float32 once a level."""
    paths = write_parts(tmp_path, parts, side=4)
    merged, levels, _ = merge_tree(tmp_path, paths, fan_in)
    assert levels == 2
    assert difference(merged, paths) < 1e-6
    capsys.readouterr()


class Scripted:
    """A crew of one that does as it is told: for each job the ends of its attempts, in turn."""

    def __init__(self, ends: dict[int, list[Any]]) -> None:
        self.ends, self.told, self.dropped = ends, [], []

    def clock(self) -> float:
        return 0.0

    def size(self) -> int:
        return 1

    def submit(self, job: Job, attempt: int) -> None:
        end = self.ends[job.number].pop(0)
        is_error = isinstance(end, Exception)
        self.told.append(News(job, attempt, result=end, is_done=True, error=end if is_error else None))
        if not is_error:
            self.told.append(self.told[-1])  # told twice, as by a worker that was thought dead

    def drop(self, job: Job, attempt: int) -> None:
        self.dropped.append(job.number)

    def news(self, timeout_s: float) -> list[News]:
        told, self.told = self.told, []
        return told


def run(crew: Scripted, jobs: list[Job]) -> list[tuple[int, Any]]:
    """What was taken."""
    taken: list[tuple[int, Any]] = []
    foreman = Foreman(crew, Weighing({"part": 1.0}))
    foreman.add(jobs)
    foreman.run(lambda job, result: taken.append((job.number, result)), lambda share, text: None)
    return taken


def test_what_fails_is_tried_again_and_what_is_told_twice_counts_once() -> None:
    crew = Scripted({1: [RuntimeError("driver"), "one"], 2: ["two"]})
    assert sorted(run(crew, [Job("part", 1), Job("part", 2)])) == [(1, "one"), (2, "two")]


def test_what_fails_again_and_again_is_a_sentence() -> None:
    with pytest.raises(UserError, match=r"part 1 failed 3 times, at last with 'RuntimeError: driver'"):
        run(Scripted({1: [RuntimeError("driver")] * TRIES}), [Job("part", 1)])
    with pytest.raises(UserError, match="too dark"):
        run(Scripted({1: [UserError("too dark")]}), [Job("part", 1)])
    assert run(Scripted({1: [RuntimeError("driver")]}), [Job("part", 1, optional=True)]) == []


def test_the_bar_weighs_by_time() -> None:
    weighing = Weighing({"part": 1.0, "the picture": 1.0})
    weighing.add("part", 4)
    weighing.add("the picture")
    assert weighing.share([("part", 0.5)]) == pytest.approx(0.1)
    weighing.finish("part", 30.0)
    weighing.finish("part", 10.0)
    assert weighing.share([]) == pytest.approx(0.4)
    weighing.finish("part", 20.0)
    weighing.finish("part", 20.0)
    weighing.finish("the picture", 80.0)
    assert weighing.share([]) == 1.0
    weighing.add("part", 10)
    assert weighing.share([]) == 1.0, "it never goes back"
