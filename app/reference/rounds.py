"""How references grow and are kept: rounds of PARTS independent parts, a thread each, of about half a second.

What they keep in the user's cache folder is arrays in one `.npz` a key, the least recently used forgotten. A cache may
only save time: a damaged file is as good as none, and a folder that cannot be written costs the saving alone.
"""

from __future__ import annotations

import os
import struct
import time
import tokenize
import zipfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..base import files, paths
from ..base.atomic import atomic_output
from ..base.errors import UserError

PARTS = 8
"""Independent randomisations; also the most threads that are of use."""
_ROUND_SECONDS = 0.5
_CHECK_SHARE = 0.1
"""Share of the time that may pass until the error is worked out again."""

Progress = Callable[[float, str], None]
Cancelled = Callable[[], bool]


class Estimate(Protocol):
    """A picture that knows its own error."""

    @property
    def amount(self) -> int:
        """Photons, or samples a pixel, in it."""

    @property
    def relmse(self) -> float:
        """Its error."""

    def is_within(self, target_relmse: float) -> bool:
        """Whether that is known to be no larger."""


EstimateT = TypeVar("EstimateT", bound=Estimate)


@dataclass(frozen=True)
class Limits:
    """Where a reference may stop: at the first that is reached."""

    amount: int | None = None
    """Photons, or samples a pixel, of all the run's."""
    seconds: float | None = None
    """From now on."""
    target_relmse: float | None = None

    def are_met_by(self, picture: Estimate) -> bool:
        """Whether a picture needs no more, whatever the time."""
        enough = self.amount is not None and picture.amount >= self.amount
        return enough or (self.target_relmse is not None and picture.is_within(self.target_relmse))


@dataclass
class Pace:
    """How many units a part does in a round, so that rounds take about half a second."""

    units: int = 1

    def learn(self, units: int, took_s: float, seconds_left: float | None) -> None:
        """A round of `units` took `took_s`; `seconds_left` counted from its start."""
        wanted = _ROUND_SECONDS if seconds_left is None else min(_ROUND_SECONDS, max(seconds_left - took_s, 1e-3))
        if units == self.units and took_s < 0.6 * wanted:
            self.units = 2 * units
        while self.units > 1 and took_s * self.units / units > 1.5 * wanted:
            self.units //= 2


def trace_parts(trace_part: Callable[[int, int], None], units: int) -> float:
    """`trace_part(part, units)` for every part, side by side; seconds it took. An interrupt keeps the parts that were
    finished."""
    started = time.perf_counter()
    with ThreadPoolExecutor(min(PARTS, os.cpu_count() or 1)) as pool:
        jobs: list[Future] = []
        try:
            jobs = [pool.submit(trace_part, part, units) for part in range(PARTS)]
            for job in jobs:
                job.result()
        finally:
            for job in jobs:
                job.cancel()
    return time.perf_counter() - started


class PartsRun(ABC, Generic[EstimateT]):
    """A picture's sums by PARTS independent parts, that grow by rounds of about half a second."""

    def __init__(self, shape: tuple[int, ...], tally_size: int) -> None:
        self.sums = np.zeros((PARTS, *shape))
        self.units = np.zeros(PARTS, np.int64)
        """Units that each part has done."""
        self.tallies = np.zeros((PARTS, tally_size))
        self.seconds = 0.0
        self._pace = Pace()

    @property
    def unit(self) -> int:
        """What counts as one unit: so many photons, or a sample of every pixel."""
        return 1

    @property
    def amount(self) -> int:
        """Photons, or samples a pixel, so far."""
        return int(self.units.sum()) * self.unit

    @property
    @abstractmethod
    def amount_words(self) -> str:
        """The same for people."""

    @property
    @abstractmethod
    def exhausted(self) -> bool:
        """Whether nothing can be added."""

    @abstractmethod
    def picture(self) -> EstimateT:
        """What has been gathered; black without variance before the first round."""

    @abstractmethod
    def _trace_part(self, part: int, units: int) -> None: ...

    def _most_units(self) -> int:
        """A part may do in a round."""
        return 2**31

    def advance(self, amount_left: int | None = None, seconds_left: float | None = None) -> None:
        """One round of all parts, or what is left. An interrupt keeps the parts that were finished."""
        units = min(self._pace.units, self._most_units())
        if amount_left is not None:
            units = min(units, max(1, -(-amount_left // (self.unit * PARTS))))
        took = trace_parts(self._trace_part, units)
        self.seconds += took
        self._pace.learn(units, took, seconds_left)

    def kept(self) -> dict[str, object]:
        """What a file holds of the run."""
        return {"sums": self.sums, "units": self.units, "tallies": self.tallies, "seconds": self.seconds}

    def restore(self, stored: Mapping[str, np.ndarray]) -> None:
        """Go on from what `kept` gave."""
        self.sums[:], self.units[:], self.tallies[:] = stored["sums"], stored["units"], stored["tallies"]
        self.seconds = float(stored["seconds"])


def continue_run(run: PartsRun[EstimateT], limits: Limits, progress: Progress, cancelled: Cancelled) -> EstimateT:
    """Add rounds to `run` up to the first limit.

    What was done when `cancelled()` turned true is kept. Raises ValueError without any limit.
    """
    amount, seconds, target_relmse = limits.amount, limits.seconds, limits.target_relmse
    if amount is None and seconds is None and target_relmse is None:
        raise ValueError("a reference needs a limit: an amount, seconds or target_relmse")
    started = time.perf_counter()
    checked, error, enough = -1.0, np.inf, False
    while True:
        spent = time.perf_counter() - started
        reached = [0.0]
        if amount is not None:
            reached.append(run.amount / amount)
        if seconds is not None:
            reached.append(spent / seconds)
        if target_relmse is not None and run.amount:
            if checked < 0.0 or spent - checked > _CHECK_SHARE * spent:
                picture = run.picture()
                checked, error, enough = spent, picture.relmse, picture.is_within(target_relmse)
            reached.append(1.0 if enough else min(target_relmse / max(error, target_relmse), 0.99))
        done = max(reached)
        progress(min(done, 1.0), run.amount_words + (f", relMSE {error:.1e}" if np.isfinite(error) else ""))
        if done >= 1.0 or run.exhausted or cancelled():
            return run.picture()
        run.advance(None if amount is None else amount - run.amount, None if seconds is None else seconds - spent)


_CACHE_BYTES = 2 << 30
_DAMAGED = (
    OSError,
    ValueError,
    TypeError,
    AttributeError,
    KeyError,
    EOFError,
    MemoryError,
    RuntimeError,  # "encrypted", and compression that is not known
    SyntaxError,
    tokenize.TokenError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""What numpy and zipfile raise over damage."""


def kept_path(key: str, folder: Path | None) -> Path | None:
    """The file of a key in `folder` (None: the user's cache); None where no folder can be had."""
    try:
        folder = folder or paths.cache_dir() / "reference"
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder / f"{key}.npz"


def load_kept(path: Path | None, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray] | None:
    """The arrays that `shapes` names; None when the file is missing, damaged or holds other shapes."""
    if path is None or not files.is_file(path):
        return None
    try:
        with path.open("rb") as file, np.load(file) as stored:
            values = {name: stored[name] for name in shapes}
    except _DAMAGED:
        return None
    if any(values[name].shape != shape for name, shape in shapes.items()):
        return None
    with suppress(OSError):
        os.utime(path)  # the cache forgets the least recently used
    return values


def save_kept(path: Path | None, **arrays: object) -> None:
    """Put `arrays` in the place of what `path` held, whole or not at all."""
    if path is None:
        return
    with suppress(OSError, UserError):
        with atomic_output(path, lasting=False) as temporary:
            np.savez(temporary, **arrays)  # type: ignore[arg-type]
        paths.forget_oldest(path.parent, ".npz", size=_CACHE_BYTES)


def continue_kept(
    path: Path | None,
    shapes: Mapping[str, tuple[int, ...]],
    picture_of: Callable[[Mapping[str, np.ndarray]], EstimateT],
    begin: Callable[[Mapping[str, np.ndarray] | None], PartsRun[EstimateT]],
    limits: Limits,
    progress: Progress,
    cancelled: Cancelled,
) -> EstimateT:
    """The picture of what `path` holds, where that is good enough, otherwise of that and more, stored again.

    `picture_of` makes it from the arrays that `shapes` names; `begin` gives the run that goes on from them (None: from
    nothing). An interrupt (KeyboardInterrupt) stores what is done and goes on upwards.
    """
    stored = load_kept(path, shapes)
    if stored is not None and limits.are_met_by(picture := picture_of(stored)):
        return picture
    run = begin(stored)
    before = run.amount
    try:
        return continue_run(run, limits, progress, cancelled)
    finally:
        if run.amount > before:
            save_kept(path, **run.kept())
