"""What a run of `bench --features` has found, as features.json holds it."""

from __future__ import annotations

import msgspec


class Percent(msgspec.Struct, frozen=True):
    """A cost, % of the time without the feature, and the interval of the median."""

    median: float
    low: float
    high: float


class FeatureCost(msgspec.Struct, frozen=True):
    """One feature in one scene."""

    feature: str
    included: bool
    reason: str
    bytes: str
    """What it adds to records and tables; empty where it is out."""
    trace: Percent | None
    splat: Percent | None
    """None where there is nothing to compare."""
    map_difference: float | None
    """Σ|a − b| / Σ|a| of the maps with and without, where they must agree."""
    note: str


class ProgramSize(msgspec.Struct, frozen=True):
    """One compiled text."""

    name: str
    lines: int
    flattened_lines: int
    features: list[str]
    """Whose symbols occur in it."""


class Absence(msgspec.Struct, frozen=True):
    """The proof for one feature."""

    feature: str
    included: bool
    symbols: tuple[str, ...]
    programs: tuple[str, ...]
    """Where any of the symbols occurs."""
    holds: bool


class FeatureReport(msgspec.Struct):
    """One run."""

    version: str
    date: str
    scene: str
    renderer: str
    clock: str
    photons: int
    repeats: int
    trace_seconds: float
    splat_seconds: float
    """Of the scene as it is."""
    records: str
    costs: list[FeatureCost]
    programs: list[ProgramSize]
    proof: list[Absence]
    complete: bool = True
