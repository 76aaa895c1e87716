"""What a stress case is: a sweep of severities, each measured and held against promises.

A case yields one `Measurement` per severity. The promises are the same everywhere: nothing is
ever NaN or infinite, flux closes, every fall-back is counted, and each error stays within the
bound that the case states for that severity.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from ..gpu.context import Context

FLUX_CLOSURE = 1e-3
"""Largest |emitted − everything that ended| / emitted, counted by what each part carries over its band. The case
gem-bands has up to 6e-4, all others below 1e-4."""


@dataclass(frozen=True)
class Measurement:
    """One severity of one case."""

    severity: float
    """Place on the plot's axis; larger need not be harder."""
    label: str
    """The severity for people, with its unit: "1e-3 rad"."""
    nonfinite: int
    """Values that were NaN or infinite, over everything that was looked at."""
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
            error = self.errors[name]
            if not error <= bound:
                found.append(f"error of {name} {error:.2e} > {bound:.2e}")
        if self.dropped > sum(self.fallbacks.values()):
            found.append(
                f"{self.dropped} photons were degraded but only {sum(self.fallbacks.values())} fall-backs counted"
            )
        return found


@dataclass(frozen=True)
class Case:
    """One stiff case."""

    name: str
    """Short and unique, for the command line: "tir-margin"."""
    title: str
    """A sentence for the report."""
    why: str
    """What goes wrong here in a careless renderer, and what is done about it."""
    severity_name: str
    """The plot's horizontal axis, with its unit."""
    measure: Callable[[Context], Iterator[Measurement]]
    """Yields as each severity is done, so that progress is shown."""
    steps: int = 1
    """Severities it will yield."""
    logarithmic: bool = True
    """Whether the axis is logarithmic."""
