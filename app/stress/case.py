"""What a stress case is: one difficulty swept through its severities, each measured against what is promised.

A case is a function that yields one `Measurement` per severity; `case` gives it its name and its sweep. The promises
are the same everywhere: nothing is ever NaN or infinite, flux closes, every fall-back is counted, and each error stays
within the bound that the case states for that severity.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..gpu.context import Context

EPSILON = float(np.finfo(np.float32).eps)
"""float32's spacing at 1, 2⁻²³; one rounding errs by at most half of it, relatively."""
FLUX_CLOSURE = 1e-3
"""Largest |emitted − everything that ended| / emitted, counted by what each part carries over its band."""


@dataclass(frozen=True)
class Measurement:
    """One severity of one case."""

    severity: float
    """As a number; larger need not be harder."""
    label: str
    """The severity for people, with its unit: "1e-3 rad"."""
    nonfinite: int
    """Values that were NaN or infinite, over everything that was examined."""
    errors: dict[str, float] = field(default_factory=dict)
    """Largest error by quantity: "position", "column n", "energy", …; relative unless its name says a unit."""
    bounds: dict[str, float] = field(default_factory=dict)
    """The promise for each error; an error without a bound is shown, not judged."""
    flux_imbalance: float | None = None
    """None where no light was traced."""
    fallbacks: dict[str, int] = field(default_factory=dict)
    """How often each fall-back was taken."""
    dropped: int = 0
    """Photons seen to have lost their footprint (or were otherwise degraded), counted independently of `fallbacks`."""
    note: str = ""

    def broken(self) -> list[str]:
        """The promises that do not hold, as sentences; empty when all is well."""
        found = []
        if self.nonfinite:
            found.append(f"{self.nonfinite} values are not finite")
        if self.flux_imbalance is not None and not self.flux_imbalance <= FLUX_CLOSURE:
            found.append(f"flux does not close: {self.flux_imbalance:.2e} > {FLUX_CLOSURE:.0e}")
        for name, bound in self.bounds.items():
            if not self.errors[name] <= bound:
                found.append(f"error of {name} {self.errors[name]:.2e} > {bound:.2e}")
        counted = sum(self.fallbacks.values())
        if self.dropped > counted:
            found.append(f"{self.dropped} photons were degraded but only {counted} fall-backs counted")
        return found


Measured = Iterator[Measurement]
Run = Callable[..., Measured]
"""Measures in a `Context` the severities of a sweep, each yielded as it is done so that progress is shown."""


@dataclass(frozen=True)
class Case:
    """One stiff case."""

    name: str
    """Short and unique, for the command line: "tir-margin"."""
    title: str
    """A sentence for the report."""
    why: str
    """What fails here in a careless renderer, and how it is prevented."""
    severity_name: str
    """What the sweep changes, with its unit."""
    run: Run
    sweep: Sequence[Any]
    """The severities, or rows that hold one each."""

    @property
    def steps(self) -> int:
        """How many severities there are."""
        return len(self.sweep)

    def measure(self, context: Context) -> Measured:
        """Every severity of the sweep."""
        return self.run(context, self.sweep)

    def only(self, *sweep: Any) -> Case:
        """The same over another sweep."""
        return replace(self, sweep=sweep)


def case(name: str, severity_name: str, sweep: Sequence[Any]) -> Callable[[Run], Case]:
    """Makes a function a case; the first paragraph of its docstring is the title, the rest `why`."""

    def made(run: Run) -> Case:
        title, _, why = inspect.cleandoc(run.__doc__ or "").partition("\n\n")
        title = " ".join(title.split()).removesuffix(".")
        return Case(name, title, " ".join(why.split()), severity_name, run, sweep)

    return made


# ---- errors and bounds -----------------------------------------------------------------------

Held = Mapping[str, tuple[ArrayLike, ArrayLike | None]]
"""By quantity: the error of each row (or one number), and the bound of each (or one); None: shown, not judged."""


def measured(severity: float, label: str, held: Held, arrays: Iterable[ArrayLike] = (), note: str = "") -> Measurement:
    """A measurement of numbers alone; `arrays` must be finite."""
    return Measurement(float(severity), label, not_finite(arrays), *judged(held), note=note)


def judged(held: Held) -> tuple[dict[str, float], dict[str, float]]:
    """(errors, bounds) of a `Measurement`, of each quantity its worst row; what has no row is left out."""
    errors: dict[str, float] = {}
    bounds: dict[str, float] = {}
    for name, (error, bound) in held.items():
        if np.size(error):
            errors[name], of_worst = worst(error, np.inf if bound is None else bound)
            if bound is not None:
                bounds[name] = of_worst
    return errors, bounds


def worst(error: ArrayLike, bound: ArrayLike) -> tuple[float, float]:
    """(error, its bound) of the row (N,) that comes closest to its bound, or exceeds it most.

    An error that is not finite is the worst there is.
    """
    error = np.asarray(error, np.float64).ravel()
    bound = np.broadcast_to(np.asarray(bound, np.float64), error.shape)
    finite = np.isfinite(error)
    if not finite.all():
        return float("inf"), float(bound[np.argmin(finite)])
    at = int(np.argmax(error / np.maximum(bound, 1e-300)))
    return float(error[at]), float(bound[at])


def not_finite(arrays: Iterable[ArrayLike]) -> int:
    """How many values are NaN or infinite."""
    return sum(int(np.count_nonzero(~np.isfinite(a))) for a in arrays)


def not_finite_in(records: np.ndarray) -> int:
    """How many floating point values of structured records are NaN or infinite."""
    assert records.dtype.names is not None
    return not_finite(records[name] for name in records.dtype.names if records.dtype[name].base.kind == "f")


def length(vectors: np.ndarray) -> np.ndarray:
    """Euclidean length over the last axis."""
    return np.linalg.norm(vectors, axis=-1)
