"""Jobs and who does them, from first to last: what a dead worker had is done again, what is late is begun a second
time, and every result is taken once.

The rule for stragglers is that of backup tasks (Dean and Ghemawat, MapReduce, OSDI 2004, section 3.6): once nothing
waits any more and a worker is free, the job that is latest gets another copy, and the first result counts.
"""

from __future__ import annotations

import statistics
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..base.errors import UserError
from .weighing import Weighing

TRIES = 3
"""Of a job that fails with what is no sentence to the user."""
LATE = 2.0
"""A job is late that has run so many times as long as half of its kind did."""
COPIES = 3
"""Of one job at once, at most: a copy may be late too."""
ENOUGH = 3
"""Jobs of a kind that must be done before one is called late."""
_WORTH_S = 3.0
"""What is left of a job, at least, that is begun a second time."""
_WAIT_S = 0.2


@dataclass(frozen=True, eq=False)
class Job:
    """A piece of work."""

    kind: str
    """Those of one kind take about as long as each other."""
    number: int
    call: Any = None
    """What the crew does for it."""
    optional: bool = False
    """Whether all goes on where it fails."""
    urgent: bool = False

    @property
    def name(self) -> str:
        """What it is called in sentences."""
        return self.kind if self.kind.startswith("the ") else f"{self.kind} {self.number}"


@dataclass(frozen=True)
class News:
    """What a crew says of an attempt at a job: its share done, or that it has ended, in one of two ways."""

    job: Job
    attempt: int
    share: float = 0.0
    result: Any = None
    is_done: bool = False
    error: Exception | None = None


class Crew(Protocol):
    """Those who work."""

    def clock(self) -> float:
        """Seconds."""

    def size(self) -> int:
        """How many can work at once at present."""

    def submit(self, job: Job, attempt: int) -> None:
        """Have a job done; what comes of it is told by `news`."""

    def drop(self, job: Job, attempt: int) -> None:
        """Forget an attempt; nothing more is told of it."""

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
    failed: int = 0
    """Attempts that ended in an error."""
    taken_s: float = 0.0
    """Spent on taking results."""
    seconds: dict[str, list[float]] = field(default_factory=dict)
    """Of every job that was done, by its kind."""


class Foreman:
    """Hands out jobs and takes what comes of them."""

    def __init__(self, crew: Crew, weighing: Weighing, stop: Callable[[], bool] = lambda: False) -> None:
        self.crew, self.weighing, self._stop = crew, weighing, stop
        self.tally = Tally()
        self._due: deque[Job] = deque()
        self._running: dict[Job, dict[int, _Attempt]] = {}
        self._tried: dict[Job, int] = {}
        self._attempts = 0

    def add(self, jobs: Iterable[Job], *, expected: bool = False) -> None:
        """More to do; may be called while results are taken. `expected`: the weighing counts them already."""
        for job in jobs:
            if not expected:
                self.weighing.add(job.kind)
            if job.urgent:
                self._due.appendleft(job)
            else:
                self._due.append(job)

    def run(self, take: Callable[[Job, Any], None], tell: Callable[[float, str], None]) -> bool:
        """Have everything done; `take` gets each job's result once. False where `stop()` turned true before. Raises
        `UserError` where a job cannot be done, the crew is lost, or `take` does."""
        try:
            while self._due or self._running:
                if self._stop():
                    return False
                self._hand_out()
                for news in self.crew.news(_WAIT_S):
                    self._follow(news, take)
                tell(self.weighing.share(self._shares()), self._words())
            return True
        finally:
            for job, attempts in self._running.items():
                for attempt in attempts:
                    self.crew.drop(job, attempt)
            self._running = {}

    def _words(self) -> str:
        size = self.crew.size()
        return f"{self.tally.done} of {self.weighing.count} done, {size or 'no'} worker{'s' * (size != 1)}"

    def _shares(self) -> Iterable[tuple[str, float]]:
        """The kind of every job that runs, and how far it is."""
        return ((job.kind, max(a.share for a in attempts.values())) for job, attempts in self._running.items())

    def _hand_out(self) -> None:
        size = self.crew.size()
        # As many again wait at the workers, so that none stands idle while a result travels.
        while self._due and sum(map(len, self._running.values())) < max(2 * size, 1):
            self._begin(self._due.popleft())
        if not self._due:
            free = size - sum(map(len, self._running.values()))
            for job in self._late()[: max(free, 0)]:
                self.tally.copied += 1
                self._begin(job)

    def _begin(self, job: Job) -> None:
        self._attempts += 1
        self._running.setdefault(job, {})[self._attempts] = _Attempt()
        self.crew.submit(job, self._attempts)

    def _late(self) -> list[Job]:
        """Jobs that one copy more would end earlier, the latest first."""
        now, found = self.crew.clock(), []
        usual = {kind: statistics.median(of) for kind, of in self.tally.seconds.items() if len(of) >= ENOUGH}
        for job, attempts in self._running.items():
            begun = [(now - a.began_s, a.share) for a in attempts.values() if a.began_s is not None]
            if job.kind not in usual or len(begun) < len(attempts) or len(begun) == COPIES:
                continue
            spent = min(spent for spent, _ in begun)
            left = min(spent * (1.0 - share) / share if share > 0.0 else float("inf") for spent, share in begun)
            if spent > LATE * usual[job.kind] and left > max(usual[job.kind], _WORTH_S):
                found.append((left, job))
        return [job for _, job in sorted(found, key=lambda pair: -pair[0])]

    def _follow(self, news: News, take: Callable[[Job, Any], None]) -> None:
        attempt = self._running.get(news.job, {}).get(news.attempt)
        if attempt is None:
            return  # of a copy that came second
        if not news.is_done:
            # A worker that was killed left its job to another, which begins anew.
            if attempt.began_s is None or news.share < attempt.share:
                attempt.began_s = self.crew.clock()
            attempt.share = news.share
            return
        if news.error is not None:
            self._failed(news)
            return
        for other in self._running.pop(news.job):
            if other != news.attempt:
                self.crew.drop(news.job, other)
        now = self.crew.clock()
        seconds = now - (attempt.began_s if attempt.began_s is not None else now)
        self.tally.seconds.setdefault(news.job.kind, []).append(seconds)
        self.weighing.finish(news.job.kind, seconds)
        self.tally.done += 1
        take(news.job, news.result)
        self.tally.taken_s += self.crew.clock() - now

    def _failed(self, news: News) -> None:
        job, error = news.job, news.error
        assert error is not None
        self.tally.failed += 1
        self._tried[job] = self._tried.get(job, 0) + 1
        del self._running[job][news.attempt]
        if self._running[job]:
            return  # its other copy goes on
        del self._running[job]
        if job.optional:
            self.weighing.finish(job.kind, 0.0)
            self.tally.done += 1
        elif isinstance(error, UserError):
            raise error
        elif self._tried[job] < TRIES:
            self._due.appendleft(job)
        else:
            raise UserError(
                f"{job.name} failed {TRIES} times, at last with '{type(error).__name__}: {error}': see what the "
                "workers print, or do it alone to see more"
            ) from error
