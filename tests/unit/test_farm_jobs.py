"""Who is given what: nothing is lost, nothing taken twice, what fails is tried again, and the bar tells the time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.farm.jobs import TRIES, Foreman, News, Task, share_done
from spectrasplat.render.light_stats import LightStats
from spectrasplat.render.part_file import merged_sums, read_header, write_part
from spectrasplat.render.parts import Part, PartHeader, Share, _plain


def parts(folder: Path, count: int) -> list[Path]:
    """Files of `count` parts with maps whose numbers span many magnitudes."""
    generator, paths = np.random.default_rng(2), []
    stats = _plain(LightStats(photons=1000))
    for index in range(1, count + 1):
        sums = generator.lognormal(0.0, 3.0, (4, 4, 4)).astype(np.float32)
        share = Share(index, count)
        header = PartHeader("some", "some.toml", "k" * 64, {}, share, count, "l" * 64, (4, 4), 1, 1000.0, stats, "none")
        paths.append(folder / f"part{index:04}.ssp")
        write_part(paths[-1], Part(header, [sums]))
    return paths


@pytest.mark.parametrize(("count", "fan_in"), [(40, 7), pytest.param(1000, 32, marks=pytest.mark.slow)])
def test_files_merge_in_a_tree(count: int, fan_in: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each part once, to 1e-6 of the flat sum: rounded to float32 once a level."""
    level = paths = parts(tmp_path, count)
    while len(level) > 1:
        groups = [level[at : at + fan_in] for at in range(0, len(level), fan_in)]
        level = [group[0].with_suffix(f".{len(groups)}.ssp") for group in groups]
        for group, target in zip(groups, level, strict=True):
            assert main(["merge", *map(str, group), "-o", str(target)]) == 0
    capsys.readouterr()
    header = read_header(level[0])
    assert sorted(header.indices) == list(range(1, count + 1))
    flat = sum(next(merged_sums([path], header)).astype(np.float64) for path in paths)
    assert np.abs(next(merged_sums(level, header)) - flat).max() < 1e-6 * flat.max()


class Crew:
    """Of one that does as it is told: for each task the ends of its attempts, in turn."""

    def __init__(self, ends: dict[int, list[Any]]) -> None:
        self.ends, self.told, self.dropped = ends, [], []

    def share(self, value: Any) -> None:
        pass

    def size(self) -> int:
        return 1

    def submit(self, task: Task) -> None:
        end = self.ends[task.number].pop(0)
        is_error = isinstance(end, Exception)
        self.told += [News(task), News(task, 0.5)]
        self.told.append(News(task, result=end, is_done=True, error=end if is_error else None))
        if not is_error:
            self.told.append(self.told[-1])  # told twice, as by a worker that was thought dead

    def drop(self, task: Task) -> None:
        self.dropped.append(task.number)

    def news(self, timeout_s: float) -> list[News]:
        told, self.told = self.told, []
        return told


class ListedJob:
    """Tasks that are all known from the start, or follow the first; what each brought is listed."""

    guesses: Mapping[str, float] = {"part": 1.0}
    shared = None

    def __init__(self, tasks: Iterable[Task], rest: Iterable[Task] = ()) -> None:
        self.tasks, self.rest = list(tasks), list(rest)
        self.taken: list[tuple[int, Any]] = []

    def begin(self) -> Iterable[Task]:
        return self.tasks

    def take(self, task: Task, result: Any, workers: int) -> Iterable[Task]:
        self.taken.append((task.number, result))
        rest, self.rest = self.rest, []
        return rest

    def ahead(self) -> Mapping[str, int]:
        return {}


def run(crew: Crew, tasks: list[Task]) -> list[tuple[int, Any]]:
    """What was taken."""
    job = ListedJob(tasks)
    assert Foreman(crew, job).run(lambda share, text: None)
    return job.taken


def test_what_fails_is_tried_again_and_what_is_told_twice_counts_once() -> None:
    crew = Crew({1: [RuntimeError("driver"), "one"], 2: ["two"]})
    assert sorted(run(crew, [Task("part", 1), Task("part", 2)])) == [(1, "one"), (2, "two")]


def test_what_fails_again_and_again_is_a_sentence() -> None:
    with pytest.raises(UserError, match=r"part 1 failed 3 times, at last with 'RuntimeError: driver'"):
        run(Crew({1: [RuntimeError("driver")] * TRIES}), [Task("part", 1)])
    with pytest.raises(UserError, match="too dark"):
        run(Crew({1: [UserError("too dark")]}), [Task("part", 1)])
    assert run(Crew({1: [RuntimeError("driver")]}), [Task("part", 1, optional=True)]) == []


def test_what_runs_is_dropped_where_all_is_stopped() -> None:
    crew, stops = Crew({1: ["one"], 2: ["two"], 3: ["three"]}), iter([False, True])
    crew.news = lambda timeout_s: []
    assert not Foreman(crew, ListedJob([Task("part", n) for n in (1, 2, 3)]), lambda: next(stops)).run(lambda *_: None)
    assert crew.dropped == [1, 2], "two for a worker, the third was not begun"


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
    shown: list[float] = []
    job = ListedJob([Task("part", 1)], [Task("part", number) for number in range(2, 9)])
    crew = Crew({number: [number] for number in range(1, 9)})
    assert Foreman(crew, job).run(lambda share, text: shown.append(share))
    assert shown == sorted(shown) and len(shown) > 2
