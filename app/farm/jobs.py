"""A job and the workers that do it: its tasks are distributed from first to last, what a dead worker had is done again,
what is late is begun a second time, and every result is kept once.

The rule for stragglers is that of backup tasks (Dean and Ghemawat, MapReduce, OSDI 2004, section 3.6): once nothing
waits any more and a worker is free, the task that is latest gets another copy, and the first result counts.
"""

from __future__ import annotations

import os
import socket
import statistics
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from ..base.atomic import make_output_folder
from ..base.errors import UserError
from ..base.locks import locked

TRIES = 3
"""Times that a task is tried that fails with what is no sentence to the user."""
LATE = 2.0
"""A task is late that has run so many times as long as half of its kind did."""
COPIES = 3
"""Copies of one task at once, at most: a copy may be late too."""
ENOUGH = 3
"""Tasks of a kind that must be done before one is called late."""
_WORTH_S = 3.0
"""What is left of a task, at least, that is begun a second time."""
_WAIT_S = 0.2
_LOCK = ".farm"


@dataclass(frozen=True, eq=False)
class Task:
    """What one worker does in one go."""

    kind: str
    """Those of one kind take about as long as each other."""
    number: int
    call: Any = None
    """A function of this package and its arguments: see `desk.do`."""
    optional: bool = False
    """Whether the job goes on where it fails."""
    urgent: bool = False

    @property
    def name(self) -> str:
        """What it is called in sentences."""
        return self.kind if self.kind.startswith("the ") else f"{self.kind} {self.number}"


class Job(Protocol):
    """Tasks, and a place where their results are kept: whatever stops it, the same job goes on from those."""

    guesses: Mapping[str, float]
    """The kinds of its tasks: how long one takes in units of the others'."""
    shared: Any
    """What all tasks are about."""

    def begin(self) -> Iterable[Task]:
        """Tasks for what is not kept yet. Raises `UserError`."""

    def take(self, task: Task, result: Any, workers: int) -> Iterable[Task]:
        """Keep a task's result, once; returns the tasks that can follow now. Raises `UserError`."""

    def ahead(self) -> Mapping[str, int]:
        """How many tasks of each kind will follow that neither `begin` nor `take` has returned yet."""


@dataclass(frozen=True)
class News:
    """What a crew says of an attempt at a task: its share done, or that it has ended, in one of two ways."""

    task: Task
    attempt: int
    share: float = 0.0
    result: Any = None
    is_done: bool = False
    error: Exception | None = None


class Crew(Protocol):
    """Those who work."""

    def share(self, value: Any) -> None:
        """What all tasks from now on are about."""

    def clock(self) -> float:
        """Seconds."""

    def size(self) -> int:
        """How many can work at once at present."""

    def submit(self, task: Task, attempt: int) -> None:
        """Have a task done; what comes of it is reported by `news`."""

    def drop(self, task: Task, attempt: int) -> None:
        """Forget an attempt; nothing more is reported of it."""

    def news(self, timeout_s: float) -> list[News]:
        """What has happened, waiting no longer than that. Raises `UserError` where there is no crew any more."""


@dataclass
class _Attempt:
    """One that runs, or waits at a worker."""

    began_s: float | None = None
    """When a worker began with it."""
    share: float = 0.0


@dataclass
class Tally:
    """What came to pass."""

    done: int = 0
    copied: int = 0
    """Further copies that were begun."""
    seconds: dict[str, list[float]] = field(default_factory=dict)
    """Seconds of every task that was done, by its kind."""


class Foreman:
    """Distributes the tasks of one job."""

    def __init__(self, crew: Crew, job: Job, stop: Callable[[], bool] = lambda: False) -> None:
        self._crew, self._job, self._stop = crew, job, stop
        self.tally = Tally()
        self._due: deque[Task] = deque()
        self._running: dict[Task, dict[int, _Attempt]] = {}
        self._tried: Counter[Task] = Counter()
        self._attempts = 0
        self._shown = 0.0

    def run(self, progress: Callable[[float, str], None]) -> Tally | None:
        """Have everything done; None where `stop()` turned true before. Raises `UserError` where a task cannot be done,
        the crew is lost, or the job's own methods do."""
        try:
            self._add(self._job.begin())
            self._crew.share(self._job.shared)
            while self._due or self._running:
                if self._stop():
                    return None
                self._distribute()
                for news in self._crew.news(_WAIT_S):
                    self._follow(news)
                progress(*self._progress())
            return self.tally
        finally:
            for task, attempts in self._running.items():
                for attempt in attempts:
                    self._crew.drop(task, attempt)
            self._running = {}

    def _add(self, tasks: Iterable[Task]) -> None:
        for task in tasks:
            if task.urgent:
                self._due.appendleft(task)
            else:
                self._due.append(task)

    def _progress(self) -> tuple[float, str]:
        """The share that is done, which never goes back, and words."""
        waiting = Counter(self._job.ahead()) + Counter(task.kind for task in (*self._due, *self._running))
        running = [(task.kind, max(each.share for each in of.values())) for task, of in self._running.items()]
        self._shown = max(self._shown, share_done(self._job.guesses, self.tally.seconds, waiting, running))
        size = self._crew.size()
        count = self.tally.done + waiting.total()
        return self._shown, f"{self.tally.done} of {count} done, {size or 'no'} worker{'s' * (size != 1)}"

    def _distribute(self) -> None:
        size = self._crew.size()
        # As many again wait at the workers, so that none is idle while a result travels.
        while self._due and self._count_running() < max(2 * size, 1):
            self._begin(self._due.popleft())
        if not self._due:
            free = size - self._count_running()
            for task in self._late()[: max(free, 0)]:
                self.tally.copied += 1
                self._begin(task)

    def _count_running(self) -> int:
        return sum(map(len, self._running.values()))

    def _begin(self, task: Task) -> None:
        self._attempts += 1
        self._running.setdefault(task, {})[self._attempts] = _Attempt()
        self._crew.submit(task, self._attempts)

    def _late(self) -> list[Task]:
        """Tasks that one copy more would end earlier, the latest first."""
        now, found = self._crew.clock(), []
        usual = {kind: statistics.median(of) for kind, of in self.tally.seconds.items() if len(of) >= ENOUGH}
        for task, attempts in self._running.items():
            begun = [(now - a.began_s, a.share) for a in attempts.values() if a.began_s is not None]
            if task.kind not in usual or len(begun) < len(attempts) or len(begun) == COPIES:
                continue
            spent = min(spent for spent, _ in begun)
            left = min(spent * (1.0 - share) / share if share > 0.0 else float("inf") for spent, share in begun)
            if spent > LATE * usual[task.kind] and left > max(usual[task.kind], _WORTH_S):
                found.append((left, task))
        return [task for _, task in sorted(found, key=lambda pair: -pair[0])]

    def _follow(self, news: News) -> None:
        task = news.task
        attempt = self._running.get(task, {}).get(news.attempt)
        if attempt is None:
            return  # of a copy that came second
        if not news.is_done:
            # A worker that was killed left its task to another, which begins anew.
            if attempt.began_s is None or news.share < attempt.share:
                attempt.began_s = self._crew.clock()
            attempt.share = news.share
            return
        if news.error is not None:
            self._failed(task, news.attempt, news.error)
            return
        for other in self._running.pop(task):
            if other != news.attempt:
                self._crew.drop(task, other)
        now = self._crew.clock()
        seconds = now - (attempt.began_s if attempt.began_s is not None else now)
        self.tally.seconds.setdefault(task.kind, []).append(seconds)
        self.tally.done += 1
        self._add(self._job.take(task, news.result, self._crew.size()))

    def _failed(self, task: Task, attempt: int, error: Exception) -> None:
        self._tried[task] += 1
        del self._running[task][attempt]
        if self._running[task]:
            return  # its other copy goes on
        del self._running[task]
        if task.optional:
            self.tally.done += 1
        elif isinstance(error, UserError):
            raise error
        elif self._tried[task] < TRIES:
            self._due.appendleft(task)
        else:
            raise UserError(
                f"{task.name} failed {TRIES} times, at last with '{type(error).__name__}: {error}': see what the "
                "workers print, or do it alone to see more"
            ) from error


def share_done(
    guesses: Mapping[str, float],
    seconds: Mapping[str, list[float]],
    waiting: Mapping[str, int],
    running: Iterable[tuple[str, float]],
) -> float:
    """Share of all work that is done, in time: a task takes as long as those of its kind did, and until one is done as
    long as is guessed. `seconds` that tasks took, by kind; `waiting`: tasks that are not done, of which those in
    `running` have done a share."""
    spent = sum(map(sum, seconds.values()))
    guessed = sum(guesses[kind] * len(of) for kind, of in seconds.items())
    unit = spent / guessed if guessed else 1.0
    each = {kind: statistics.fmean(seconds[kind]) if kind in seconds else unit * guesses[kind] for kind in guesses}
    done = spent + sum(each[kind] * share for kind, share in running)
    total = spent + sum(each[kind] * count for kind, count in waiting.items())
    return min(done / total, 1.0) if total > 0.0 else 0.0


@contextmanager
def held(folder: Path, output: Path) -> Iterator[None]:
    """Make the folder in which results are kept, and hold it. Raises `UserError` where another process does, or it
    cannot be made."""
    make_output_folder(folder)
    lock = folder / _LOCK
    with ExitStack() as stack:
        try:
            is_ours = stack.enter_context(locked(lock, wait=False))
        except OSError as error:
            raise UserError(f"cannot write in {folder}: {error.strerror}; choose another place") from error
        if not is_ours:
            raise UserError(f"another farm is at work on {output} ({_who(lock)}): wait for it, or choose another -o")
        now = time.strftime("%H:%M", time.localtime())
        with suppress(OSError):  # a disk that is full is reported when a result is written
            lock.write_text(f"process {os.getpid()} on {socket.gethostname()} since {now}", encoding="utf-8")
        try:
            yield
        finally:
            with suppress(OSError):
                lock.unlink(missing_ok=True)
                folder.rmdir()  # where nothing was kept in it


def _who(lock: Path) -> str:
    try:
        return lock.read_bytes()[:200].decode("utf-8", errors="replace").strip() or "another process"
    except OSError:
        return "another process"
