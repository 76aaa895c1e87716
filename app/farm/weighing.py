"""One share done for jobs of several kinds, each weighing what it takes in time: by what those of its kind took that
are done, and until then by a guess."""

from __future__ import annotations

from collections.abc import Iterable, Mapping


class Weighing:
    """Counts what there is to do; `guesses`: how long a job of each kind takes in units of the others'."""

    def __init__(self, guesses: Mapping[str, float]) -> None:
        self._guesses = dict(guesses)
        self._waiting: dict[str, int] = {}
        self._done: dict[str, list[float]] = {}
        self._last = 0.0

    @property
    def count(self) -> int:
        """Of all jobs so far."""
        return sum(self._waiting.values()) + sum(map(len, self._done.values()))

    def add(self, kind: str, count: int = 1) -> None:
        """So many jobs more."""
        self._waiting[kind] = self._waiting.get(kind, 0) + count

    def finish(self, kind: str, seconds: float) -> None:
        """A job less; `seconds` that it took."""
        self._waiting[kind] -= 1
        self._done.setdefault(kind, []).append(seconds)

    def share(self, running: Iterable[tuple[str, float]]) -> float:
        """Share of all work that is done, in time; it never goes back, whatever was guessed. `running`: kind and own
        share of each job that runs."""
        spent = {kind: sum(seconds) for kind, seconds in self._done.items()}
        counted = {kind: len(seconds) for kind, seconds in self._done.items()}
        guessed = sum(self._guesses[kind] * number for kind, number in counted.items())
        unit = sum(spent.values()) / guessed if guessed else 1.0
        each = {
            kind: spent[kind] / counted[kind] if counted.get(kind) else unit * self._guesses[kind]
            for kind in {*self._waiting, *self._done}
        }
        done = sum(spent.values()) + sum(each[kind] * share for kind, share in running)
        total = sum(spent.values()) + sum(each[kind] * number for kind, number in self._waiting.items())
        self._last = max(self._last, min(done / total, 1.0) if total > 0.0 else 0.0)
        return self._last
