"""The two passes of the renderer that a bench measures, and the words and stages that differ between them.

What one rendering costs is counted in photons for the light pass and in camera samples a pixel for the camera pass; all
else that runner and report do is the same for both.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MeasuredPass:
    """How one pass is measured, and what its parts are called."""

    key: str
    """As in `BenchSettings.measured_pass`."""
    unit: str
    """What a budget counts, in full."""
    units: str
    """The same in a table's heading."""
    time: str
    """Name of the time that is counted."""
    stages: tuple[str, ...]
    """Stages that the report shows."""
    counted: tuple[str, ...]
    """Those of them whose sum is that time."""
    setup: tuple[str, ...]
    """What is made once and not counted, as `Curve.setup_seconds` names it."""
    uncounted: tuple[str, ...]
    """Stages of every rendering that are not counted and not among `stages`, but listed in the table of costs."""
    compared_seconds: tuple[float, ...]
    """Times at which errors are read and compared, as far as a run reaches."""
    pictures: tuple[tuple[str, float], ...]
    """Endings of the names of the equal-time pictures, and the share of the time after which each is made; the last
    picture first."""


LIGHT = MeasuredPass(
    "light",
    "photons",
    "photons",
    "photon time",
    stages=("trace", "splat", "resolve"),
    counted=("trace", "splat"),  # putting the maps together is part of display, the same for every method
    setup=("start", "buffers", "compile", "pilot", "first run"),
    uncounted=("plan",),
    compared_seconds=(0.1, 1.0),
    pictures=(("", 1.0), (" early", 0.1)),
)

CAMERA = MeasuredPass(
    "camera",
    "camera samples a pixel",
    "samples",
    "camera time",
    stages=("bands", "lookups"),
    counted=("bands", "lookups"),
    setup=("start", "light pass", "buffers", "compile"),
    uncounted=(),
    compared_seconds=(0.5, 1.0, 5.0),
    pictures=(("", 1.0), (" early", 0.05), (" first", 0.025)),
)

MEASURED_PASSES = {measured.key: measured for measured in (LIGHT, CAMERA)}
COUNTED_STAGES = frozenset(stage for each in MEASURED_PASSES.values() for stage in each.counted)
"""No name of a counted stage of one pass is that of an uncounted one of the other."""
