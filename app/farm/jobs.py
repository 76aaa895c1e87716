"""A job and the workers that do it: its tasks are distributed from first to last, what a dead worker had is done again,
and every result is kept once."""

from __future__ import annotations

import os
import socket
import statistics
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ..base.atomic import make_output_folder
from ..base.errors import UserError
from ..base.locks import locked

TRIES = 3
"""Of a task that fails with what is no sentence to the user."""
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
    """What a crew says of a task: its share done, or that it has ended, in one of two ways."""

    task: Task
    share: float = 0.0
    result: Any = None
    is_done: bool = False
    error: Exception | None = None


class Crew(Protocol):
    """Those who work."""

    def share(self, value: Any) -> None:
        """What all tasks from now on are about."""

    def size(self) -> int:
        """How many can work at once at present."""

    def submit(self, task: Task) -> None:
        """Have a task done; what comes of it is reported by `news`."""

    def drop(self, task: Task) -> None:
        """Forget a task; nothing more is reported of it."""

    def news(self, timeout_s: float) -> list[News]:
        """What has happened, waiting no longer than that. Raises `UserError` where there is no crew any more."""


@dataclass
class _Running:
    """A task that a worker has, or that waits at one."""

    began_s: float | None = None
    """When a worker began with it."""
    share: float = 0.0


class Foreman:
    """Distributes the tasks of one job."""

    def __init__(self, crew: Crew, job: Job, stop: Callable[[], bool] = lambda: False) -> None:
        self._crew, self._job, self._stop = crew, job, stop
        self.done = 0
        """Tasks that have been done."""
        self._seconds: dict[str, list[float]] = {}
        """That they took, by their kind."""
        self._due: deque[Task] = deque()
        self._running: dict[Task, _Running] = {}
        self._tried: Counter[Task] = Counter()
        self._shown = 0.0

    def run(self, progress: Callable[[float, str], None]) -> bool:
        """Have everything done; False where `stop()` turned true before. Raises `UserError` where a task cannot be
        done, the crew is lost, or the job's own methods do."""
        try:
            self._add(self._job.begin())
            self._crew.share(self._job.shared)
            while self._due or self._running:
                if self._stop():
                    return False
                # As many again wait at the workers, so that none is idle while a result travels.
                while self._due and len(self._running) < max(2 * self._crew.size(), 1):
                    task = self._due.popleft()
                    self._running[task] = _Running()
                    self._crew.submit(task)
                for news in self._crew.news(_WAIT_S):
                    self._follow(news)
                progress(*self._progress())
            return True
        finally:
            for task in self._running:
                self._crew.drop(task)
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
        running = [(task.kind, each.share) for task, each in self._running.items()]
        self._shown = max(self._shown, share_done(self._job.guesses, self._seconds, waiting, running))
        size = self._crew.size()
        count = self.done + waiting.total()
        return self._shown, f"{self.done} of {count} done, {size or 'no'} worker{'s' * (size != 1)}"

    def _follow(self, news: News) -> None:
        task, now = news.task, time.monotonic()
        running = self._running.get(task)
        if running is None:
            return
        if not news.is_done:
            # A worker that was killed left its task to another, which begins anew.
            if running.began_s is None or news.share < running.share:
                running.began_s = now
            running.share = news.share
            return
        del self._running[task]
        if news.error is not None:
            self._failed(task, news.error)
            return
        self._seconds.setdefault(task.kind, []).append(now - (running.began_s or now))
        self.done += 1
        self._add(self._job.take(task, news.result, self._crew.size()))

    def _failed(self, task: Task, error: Exception) -> None:
        self._tried[task] += 1
        if task.optional:
            self.done += 1
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
