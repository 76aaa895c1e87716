"""The two passes of the renderer that a bench measures, and the words, stages and demands that differ between them.

What one rendering costs is counted in photons for the light pass and in camera samples a pixel for the camera pass; all
else that runner, claims and report do is the same for both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class MeasuredPass:
    """How one pass is measured and spoken of."""

    key: str
    """As in `BenchSettings.measured_pass`."""
    unit: str
    """What a budget counts, in full."""
    units: str
    """The same in a table's heading."""
    each: str
    """One of them."""
    time: str
    """Name of the time that is counted."""
    stages: tuple[str, ...]
    """Stages that the report shows."""
    counted: tuple[str, ...]
    """Those of them whose sum is that time."""
    stage_names: Mapping[str, str]
    """Stages as a plot's key names them, where that is not their own name."""
    setup: tuple[str, ...]
    """What is made once and not counted, as `Curve.setup_seconds` names it."""
    uncounted: tuple[str, ...]
    """Stages of every rendering that are not counted and not among `stages`, but listed in the table of costs."""
    tick: tuple[float, str]
    """Factor from seconds to the unit in which the time of one photon or sample is given, and that unit."""
    asked_ratio: float
    """`srd` is to reach the error that `stochastic` ends with in at most one over this of its time."""
    compared_seconds: tuple[float, ...]
    """Times at which errors are read and compared, as far as a run reaches."""
    pictures: tuple[tuple[str, float], ...]
    """Endings of the names of the equal-time pictures, with the share of the time given that each is made after; the
    last picture first."""
    bias_cause: str
    noise_cause: str
    """What bias² and variance of `srd` come from, and what reduces them."""
    bare_method: str
    """A method whose bias² is that which all methods share."""
    bare_text: str
    """Why a part of `srd`'s bias² is found there too."""

    def amount(self, budget: int) -> str:
        """ "1 sample", "2,048 photons"."""
        return f"{budget:,} {self.each if budget == 1 else self.units}"


LIGHT = MeasuredPass(
    "light",
    "photons",
    "photons",
    "photon",
    "photon time",
    stages=("trace", "splat", "resolve"),
    counted=("trace", "splat"),  # putting the maps together is part of display, the same for every method
    stage_names={"trace": "emission and trace"},
    setup=("start", "buffers", "compile", "pilot", "first run"),
    uncounted=("plan",),
    tick=(1e6, "µs"),
    asked_ratio=30.0,  # 2 minutes against 60 in Elek et al. 2014
    compared_seconds=(0.1, 1.0),
    pictures=(("", 1.0), (" early", 0.1)),
    bias_cause="footprints, bands and texels blur it, which only finer lattices reduce",
    noise_cause="noise, which more photons reduce",
    bare_method="stochastic-point",
    bare_text="which has neither footprints nor bands: the texels of the maps, common to all methods",
)

CAMERA = MeasuredPass(
    "camera",
    "camera samples a pixel",
    "samples",
    "sample",
    "camera time",
    stages=("bands", "looks"),
    counted=("bands", "looks"),
    stage_names={"bands": "choosing the bands", "looks": "looking"},
    setup=("start", "light pass", "buffers", "compile"),
    uncounted=(),
    tick=(1e3, "ms"),
    asked_ratio=20.0,  # 1 second against 20 in the talk
    compared_seconds=(0.5, 1.0, 5.0),
    pictures=(("", 1.0), (" early", 0.05), (" first", 0.025)),
    bias_cause=(
        "straight columns within wide bands, few places within a pixel and the caustic maps, of which more samples "
        "cure the first two alone"
    ),
    noise_cause="noise, which more samples reduce",
    bare_method="stochastic",
    bare_text=(
        "which has neither columns nor bands: places within a pixel, caustic maps and the noise of the reference's "
        "caustic, common to all methods"
    ),
)

MEASURED_PASSES = {measured.key: measured for measured in (LIGHT, CAMERA)}
COUNTED_STAGES = frozenset(stage for each in MEASURED_PASSES.values() for stage in each.counted)
"""No name of a counted stage of one pass is that of an uncounted one of the other."""
