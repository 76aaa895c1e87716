"""Who is given what: nothing is lost, nothing taken twice, what is late is begun again, and the bar tells the time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.farm.jobs import TRIES, Foreman, News, Task, share_done

from tests.unit.farm_simulation import (
    ListedJob,
    SimulatedCrew,
    difference,
    merge_tree,
    simulate,
    without_copies,
    write_parts,
)


@pytest.mark.parametrize(
    ("workers", "parts"),
    [(50, 150), pytest.param(1000, 1000, marks=pytest.mark.slow), pytest.param(250, 1000, marks=pytest.mark.slow)],
)
def test_every_part_is_taken_once(workers: int, parts: int) -> None:
    crew = SimulatedCrew(workers, late=0.04, deaths=0.04)
    taken, tally, shown = simulate(crew, parts)
    assert sorted(taken) == list(range(1, parts + 1))
    assert crew.died >= 3 and tally.copied >= 2, "else it shows nothing"
    assert shown == sorted(shown) and shown[-1] == 1.0


@pytest.mark.parametrize(("workers", "parts"), [(50, 200), pytest.param(250, 1000, marks=pytest.mark.slow)])
def test_copies_end_what_stragglers_hold_up(workers: int, parts: int) -> None:
    with_copies, without = SimulatedCrew(workers, late=0.01), SimulatedCrew(workers, late=0.01)
    _, tally, _ = simulate(with_copies, parts)
    with without_copies():
        simulate(without, parts)
    assert with_copies.now < 0.7 * without.now
    wasted = 1.0 - sum(tally.seconds["part"]) / with_copies.busy_s
    assert wasted < 0.06


def test_nothing_is_copied_where_none_is_late() -> None:
    _, tally, _ = simulate(SimulatedCrew(40, late=0.0, deaths=0.0), 200)
    assert tally.copied == 0


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

    def share(self, value: Any) -> None:
        pass

    def clock(self) -> float:
        return 0.0

    def size(self) -> int:
        return 1

    def submit(self, task: Task, attempt: int) -> None:
        end = self.ends[task.number].pop(0)
        is_error = isinstance(end, Exception)
        self.told.append(News(task, attempt, result=end, is_done=True, error=end if is_error else None))
        if not is_error:
            self.told.append(self.told[-1])  # told twice, as by a worker that was thought dead

    def drop(self, task: Task, attempt: int) -> None:
        self.dropped.append(task.number)

    def news(self, timeout_s: float) -> list[News]:
        told, self.told = self.told, []
        return told


def run(crew: Scripted, tasks: list[Task]) -> list[tuple[int, Any]]:
    """What was taken."""
    job = ListedJob(tasks)
    assert Foreman(crew, job).run(lambda share, text: None) is not None
    return job.taken


def test_what_fails_is_tried_again_and_what_is_told_twice_counts_once() -> None:
    crew = Scripted({1: [RuntimeError("driver"), "one"], 2: ["two"]})
    assert sorted(run(crew, [Task("part", 1), Task("part", 2)])) == [(1, "one"), (2, "two")]


def test_what_fails_again_and_again_is_a_sentence() -> None:
    with pytest.raises(UserError, match=r"part 1 failed 3 times, at last with 'RuntimeError: driver'"):
        run(Scripted({1: [RuntimeError("driver")] * TRIES}), [Task("part", 1)])
    with pytest.raises(UserError, match="too dark"):
        run(Scripted({1: [UserError("too dark")]}), [Task("part", 1)])
    assert run(Scripted({1: [RuntimeError("driver")]}), [Task("part", 1, optional=True)]) == []


def test_the_bar_weighs_by_time() -> None:
    guesses = {"part": 1.0, "the picture": 1.0}
    for seconds, waiting, running, share in (
        ({}, {"part": 4, "the picture": 1}, [("part", 0.5)], 0.1),
        ({"part": [30.0, 10.0]}, {"part": 2, "the picture": 1}, [], 0.4),
        ({"part": [30.0, 10.0, 20.0, 20.0], "the picture": [80.0]}, {}, [], 1.0),
        ({}, {}, [], 0.0),
    ):
        assert share_done(guesses, seconds, waiting, running) == pytest.approx(share)


def test_the_bar_never_goes_back() -> None:
    """Neither where what is done brings more to do than was known of."""

    class Growing(ListedJob):
        def take(self, task: Task, result: Any, workers: int) -> list[Task]:
            super().take(task, result, workers)
            return [Task("part", number) for number in range(2, 9)] if task.number == 1 else []

    shown: list[float] = []
    crew = Scripted({number: [number] for number in range(1, 9)})
    assert Foreman(crew, Growing([Task("part", 1)])).run(lambda share, text: shown.append(share)) is not None
    assert shown == sorted(shown) and len(shown) > 2
