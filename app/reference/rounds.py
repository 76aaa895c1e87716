"""How references grow and are kept: rounds of PARTS independent parts, a thread each, of about half a second.

The user's cache folder holds their arrays in one `.npz` a key; the least recently used is deleted first. A cache may
only save time: a damaged file counts as none, and where a folder cannot be written nothing is kept.
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
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..base import files, paths
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..model.optics.colorimetry import rgb709_to_xyz, xyz_to_rgb709

PARTS = 8
"""Independent randomisations; also the most threads that are of use."""
_ROUND_SECONDS = 0.5
_CHECK_SHARE = 0.1
"""Share of the time that may pass until the error is worked out again."""

Progress = Callable[[float, str], None]


TALLY_SIZE = 9
"""Numbers of a part's tally, most of them what became of its paths."""
RELMSE_EPSILON = 1e-2
"""ε of relMSE = mean[(I − R)²/(R² + ε)] as a share of mean(R)², on XYZ over all pixels and channels."""


def relative_variance(values: np.ndarray, variance: np.ndarray) -> float:
    """mean[variance / (values² + ε)], as relMSE weighs errors; 0 where all is black."""
    epsilon = RELMSE_EPSILON * float(values.mean()) ** 2 if values.size else 0.0
    return float(np.mean(variance / (values**2 + epsilon))) if epsilon > 0.0 else 0.0


@dataclass(frozen=True)
class Picture:
    """A converged picture and what is known of its error; row 0 on top."""

    xyz: np.ndarray
    """float64 (H, W, 3): CIE XYZ, the mean over each pixel; Y in lm/(sr unit²)."""
    variance: np.ndarray
    """float64 (H, W, 3): of `xyz` as an estimate, from its independent parts."""
    amount: int
    """Photons, or samples of each pixel."""
    seconds: float
    """Time spent tracing."""
    fates: dict[str, float]
    """What became of the paths, see `Kind.fates`."""
    black_amount: int = 0
    """Blackness is believed from this amount on."""
    caustic_photons: int = 0
    """Photons of the caustic that was looked up."""
    caustic_relmse: float = 0.0
    """What the caustic's noise adds to the picture's own error, about, where it was measured: a part of `variance`."""

    @cached_property
    def rgb(self) -> np.ndarray:
        """Linear Rec.709, float64 (H, W, 3)."""
        return xyz_to_rgb709(self.xyz)

    @cached_property
    def relmse(self) -> float:
        """The picture's own error, mean[var/(R² + ε)]; 0 for a black picture."""
        return relative_variance(self.xyz, self.variance)

    def is_within(self, target_relmse: float) -> bool:
        """Whether the error is known to be no larger."""
        return self.relmse <= target_relmse and (bool(self.xyz.any()) or self.amount >= self.black_amount)


@dataclass(frozen=True)
class Kind:
    """What a reference's sums and tallies mean."""

    fates: tuple[str, ...]
    """Names of the first numbers of a tally."""
    per_pixel: bool
    """Fates are shares of the paths of all pixels, else amounts for each unit."""
    is_rgb: bool
    """Sums are linear Rec.709, else XYZ."""
    black_amount: int
    has_halves: bool = False
    """Even parts have something in common, and odd ones: they are two independent pictures."""


@dataclass(frozen=True)
class Limits:
    """Where a reference may stop: at the first that is reached."""

    amount: int | None = None
    """Photons, or samples a pixel, of all the run's."""
    seconds: float | None = None
    """From now on."""
    target_relmse: float | None = None

    def are_met_by(self, picture: Picture) -> bool:
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


class PartsRun(ABC):
    """A picture's sums by PARTS independent parts, that grow by rounds of about half a second."""

    kind: Kind
    unit_words: tuple[float, str]
    """What one of the words for the amount is worth, and the words: (1e6, "M photons")."""

    def __init__(self, width: int, height: int) -> None:
        self.sums = np.zeros((PARTS, height, width, 3))
        self.units = np.zeros(PARTS, np.int64)
        """Units that each part has done."""
        self.tallies = np.zeros((PARTS, TALLY_SIZE))
        self.seconds = 0.0
        self.caustic_noted: tuple[int, float] = 0, 0.0
        """Photons of the caustic that is looked up, and what its noise adds to the picture's relMSE."""
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
    def exhausted(self) -> bool:
        """Whether nothing can be added."""

    @abstractmethod
    def _trace_part(self, part: int, units: int) -> None: ...

    def _most_units(self) -> int:
        """A part may do in a round."""
        return 2**31

    def picture(self) -> Picture:
        """What has been gathered; black without variance before the first round."""
        return summed(self.kept(), self.kind)

    def advance(self, amount_left: int | None = None, seconds_left: float | None = None) -> None:
        """One round of all parts, or what is left. An interrupt keeps the parts that were finished."""
        units = min(self._pace.units, self._most_units())
        if amount_left is not None:
            units = min(units, max(1, -(-amount_left // (self.unit * PARTS))))
        took = trace_parts(self._trace_part, units)
        self.seconds += took
        self._pace.learn(units, took, seconds_left)

    def kept(self) -> dict[str, ArrayLike]:
        """What a file holds of the run."""
        values = self.sums, self.units, self.tallies, self.seconds, self.unit, *self.caustic_noted
        return dict(zip(_KEPT, values, strict=True))

    def restore(self, stored: Mapping[str, np.ndarray]) -> None:
        """Go on from what `kept` gave; not where a unit was another one then."""
        if int(stored["unit"]) == self.unit:
            self.sums[:], self.units[:], self.tallies[:] = stored["sums"], stored["units"], stored["tallies"]
            self.seconds = float(stored["seconds"])
            self.caustic_noted = int(stored["caustic_photons"]), float(stored["caustic_relmse"])


_KEPT = ("sums", "units", "tallies", "seconds", "unit", "caustic_photons", "caustic_relmse")


def summed(kept: Mapping[str, ArrayLike], kind: Kind) -> Picture:
    """The picture of what `PartsRun.kept` gave."""
    sums, units, tallies, seconds, unit, photons, relmse = (np.asarray(kept[name]) for name in _KEPT)
    total = max(int(units.sum()), 1)
    fates = tallies.sum(axis=0) / (total * sums[0, :, :, 0].size if kind.per_pixel else total)
    if kind.is_rgb:
        sums = rgb709_to_xyz(sums)
    if kind.has_halves:
        sums, units = (np.stack([values[half::2].sum(axis=0) for half in range(2)]) for values in (sums, units))
    mean = sums.sum(axis=0) / total
    variance, used = np.zeros_like(mean), np.flatnonzero(units)
    if len(used) > 1:
        for part in used:
            variance += units[part] / total * (sums[part] / units[part] - mean) ** 2
        variance /= len(used) - 1
    names = {name: float(value) for name, value in zip(kind.fates, fates, strict=False)}
    amount = int(units.sum()) * int(unit)
    return Picture(mean, variance, amount, float(seconds), names, kind.black_amount, int(photons), float(relmse))


def continue_run(run: PartsRun, limits: Limits, progress: Progress = lambda fraction, text: None) -> Picture:
    """Add rounds to `run` up to the first limit. Raises ValueError without any."""
    amount, seconds, target_relmse = limits.amount, limits.seconds, limits.target_relmse
    if amount is None and seconds is None and target_relmse is None:
        raise ValueError("a reference needs a limit: an amount, seconds or target_relmse")
    started, (one, words) = time.perf_counter(), run.unit_words
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
        known = f", relMSE {error:.1e}" if np.isfinite(error) else ""
        progress(min(done, 1.0), f"{run.amount / one:{'.1f' if one > 1 else '.0f'}} {words}{known}")
        if done >= 1.0 or run.exhausted:
            return run.picture()
        run.advance(None if amount is None else amount - run.amount, None if seconds is None else seconds - spent)


# -- the cache ----------------------------------------------------------------------------


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
    kind: Kind,
    size: tuple[int, int],
    begin: Callable[[], PartsRun],
    limits: Limits,
    progress: Progress,
) -> Picture:
    """The picture (`size`: width, height) of what `path` holds, where that is good enough, otherwise of that and more,
    stored again.

    An interrupt (KeyboardInterrupt) stores what is done and is raised again.
    """
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(_KEPT, ())
    shapes |= {"sums": (PARTS, size[1], size[0], 3), "units": (PARTS,), "tallies": (PARTS, TALLY_SIZE)}
    stored = load_kept(path, shapes)
    if stored is not None and limits.are_met_by(picture := summed(stored, kind)):
        return picture
    run = begin()
    if stored is not None:
        run.restore(stored)
    before = run.amount
    try:
        return continue_run(run, limits, progress)
    finally:
        if run.amount > before:
            save_kept(path, **run.kept())
