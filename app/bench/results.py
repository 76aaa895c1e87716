"""What a bench run has measured, as plain values: written to results.json, read back to resume, shown by the report."""

from __future__ import annotations

import msgspec

from .measured_passes import COUNTED_STAGES

DEFAULT_METHODS = (
    "stochastic",
    "stochastic-even",
    "stochastic-point",
    "progressive-stochastic",
    "hero",
    "regular-7",
    "regular-16",
    "srd-lambda",
    "progressive",
    "srd-photons",
    "srd",
)

OWN_METHODS = ("srd", "srd-photons", "progressive")
"""The program's own, measured as they ship; all others are baselines, each at its best (`tuning`)."""
TARGETS = (0.3, 0.1, 0.03, 0.01, 0.003, 0.001)
"""relMSE at which methods are compared."""
CLOCKS = ("photon", "whole")
"""By which speed-ups are given: the time of the measured pass, and that of a whole process."""
ERROR_SOUGHT = 0.01
"""A method that is worse than this after `BenchSettings.seconds` is followed to the horizon."""

RANDOM_KINDS = ("plain", "all")
"""What scenes drawn by chance hold (`random_scenes`)."""
REFERENCES = ("exact", "mesh")
"""What a reference meets where a shape has an equation: that surface, or the triangles that the renderer has."""


class BenchSettings(msgspec.Struct, frozen=True):
    """The settings of a run; results of other settings are never mixed."""

    seconds: float = 3.0
    """Photon time of the largest rendering of each method and seed."""
    seeds: int = 5
    methods: tuple[str, ...] = DEFAULT_METHODS
    size: tuple[int, int] | None = None
    """Width and height in pixels; None: 480 wide, in each scene's own aspect."""
    reference_seconds: float = 60.0
    """Most time that one run spends on a scene's reference; what earlier runs made is used as well."""
    reference: str = "exact"
    """One of `REFERENCES`."""
    measured_pass: str = "light"
    """Which pass of the renderer is measured, a key of `measured_passes.MEASURED_PASSES`. Below, what is said of
    photons and photon time holds for camera samples a pixel and camera time where it is the camera's."""
    horizon: float | None = None
    """Most photon time of a method's largest rendering; None: ten times `seconds`. The light pass's alone."""

    @property
    def horizon_seconds(self) -> float:
        return 10.0 * self.seconds if self.horizon is None else self.horizon


class AgreementSettings(msgspec.Struct, frozen=True):
    """What `agreement` compares."""

    width: int = 240
    height: int = 135
    photons: int = 250_000
    """Of each seed's picture."""
    seeds: int = 6
    reference_seconds: float = 60.0
    """Most time spent on each scene's reference; what earlier runs made is used as well."""
    method: str = "srd"
    reference: str = "exact"
    """One of `REFERENCES`."""


class Sample(msgspec.Struct, frozen=True):
    """One rendering: a method, a photon budget and a seed."""

    photons: int
    """Asked for; the abscissa of the error-against-photons plot."""
    seed: int
    emitted: int
    splats: int
    seconds: dict[str, float]
    """By stage: `MeasuredPass.stages`; and, not counted, the light pass's "plan" (bands and spectral tables, once
    before a rendering) and "camera" (display, the same for every method)."""
    metrics: dict[str, float]
    """relmse, relmse_raw (the reference's own variance left in), relmse_trimmed, relmse_whole (ε from the whole
    picture's mean), smape, chroma, nrmse, energy_ratio (Σ picture / Σ reference); "flip" for the equal-time pictures
    alone. See `metrics`."""

    kernel: float = 0.0
    """Standard deviation of the footprints in lattice spacings; 0: as the method has it."""

    @property
    def photon_seconds(self) -> float:
        return sum(seconds for stage, seconds in self.seconds.items() if stage in COUNTED_STAGES)

    @property
    def all_seconds(self) -> float:
        """Of every stage; the set-up, once a process, is the curve's."""
        return sum(self.seconds.values())


class Point(msgspec.Struct, frozen=True):
    """All seeds of one photon budget."""

    photons: int
    seconds: float
    """Median photon time: a moment's disturbance of the machine is no property of the method."""
    relmse: float
    relmse_low: float
    relmse_high: float
    """Over seeds: mean, least and largest; freed of the reference's own variance."""
    bias2: float
    variance: float
    """relMSE split in two: bias² of the mean picture (less what its own variance leaves) and mean variance. With one
    seed it cannot be split: both are 0."""
    whole_seconds: float = 0.0
    """Median time of a whole process that makes this one picture: `Curve.setup_seconds` and every stage."""


class Trial(msgspec.Struct, frozen=True):
    """One rendering of the sweep that a baseline's kernel was chosen from."""

    photons: int
    smoothing: float
    """Standard deviation of the footprints in lattice spacings; 0: the method has none."""
    seconds: float
    """Photon time."""
    relmse: float


class SpeedUp(msgspec.Struct, frozen=True):
    """How much sooner `srd` reaches an error than the best of the baselines, by one clock."""

    target: float
    """relMSE."""
    clock: str
    """One of `CLOCKS`."""
    seconds: float | None
    """When `srd` gets there; None: it does not."""
    at_once: bool
    """Its smallest rendering is already as good: at most `seconds`."""
    baseline: str
    """The one that gets there first; "" where none does."""
    baseline_seconds: float
    """When it gets there; where none does, the time up to which all were followed."""
    baseline_at_once: bool

    @property
    def ratio(self) -> float | None:
        """Baseline's time over `srd`'s; None where `srd` does not get there."""
        return None if self.seconds is None else self.baseline_seconds / self.seconds

    @property
    def bound(self) -> str:
        """ "≥" or "≤" where the ratio is a bound only, "~" where both are there at once, "" where it is known."""
        above = not self.baseline or self.at_once
        below = bool(self.baseline) and self.baseline_at_once
        return "~" if above and below else "≥" if above else "≤" if below else ""


class Curve(msgspec.Struct):
    """One method in one scene."""

    method: str
    setup_seconds: dict[str, float]
    """Once per process and not in photon time: "start" (interpreter, imports, OpenGL context), "buffers" (tree and
    uploads), "compile", "pilot", "first run" (what the first rendering takes longer than the second one, as drivers
    finish compiling in it); "light pass" (the caustic maps that all methods look up)."""
    samples: list[Sample]
    budgets: list[int] = []
    """Photons of each point, from the rate that a first trial had; the same for every seed."""
    points: list[Point] = []
    slope: float = 0.0
    """Exponent of relMSE against photons over the curve's second half, and its 95 % confidence half-width."""
    slope_half_width: float = 0.0
    buffers_mib: float = 0.0
    kernels: list[float] = []
    """Of each budget, standard deviation in lattice spacings; empty: as the method has it."""
    sweep: list[Trial] = []
    """What `kernels`, and the horizon, were chosen from."""

    def largest_samples(self) -> list[Sample]:
        """All seeds of the largest budget that has a sample."""
        most = max((sample.photons for sample in self.samples), default=0)
        return [sample for sample in self.samples if sample.photons == most]


class ReferenceInfo(msgspec.Struct):
    """The picture that errors are measured against."""

    method: str
    photons: int
    seconds: float
    relmse: float
    """Its own error (variance of the mean, estimated from independent parts), as relMSE. It is subtracted from every
    relMSE reported."""
    key: str
    """Hash of scene content, camera and size: the cache's key."""
    caustic_photons: int = 0
    """Photons of the caustic that the camera's reference looks up; 0: there is none in it."""
    caustic_relmse: float = 0.0
    """What the caustic's noise adds to the picture's relMSE, about: a part of `relmse`."""


class SceneResult(msgspec.Struct):
    """One scene."""

    scene: str
    title: str
    size: tuple[int, int]
    seeds: int
    seconds: float
    """Photon time given to each method and seed's largest rendering."""
    reference: ReferenceInfo | None
    curves: list[Curve]
    speed_ups: list[SpeedUp] = []
    """`srd` against the best baseline at each of `TARGETS`, by both clocks."""
    strongest_glass: str = ""
    strongest_abbe: float = 0.0
    """Lowest V_d in the scene; 0 when nothing disperses."""
    pictures: dict[str, str] = {}
    """Files next to results.json, .npy of XYZ float32 (H, W, 3): "reference", "METHOD" (after
    `equal_time` of photon time) and "METHOD early" and the like (after a share of it, see `MeasuredPass.pictures`)."""
    equal_time: float = 0.0
    """Photon seconds for which the pictures named by a method alone were made."""
    picture_samples: dict[str, Sample] = {}
    """What each of `pictures` but the reference took and how far off it is, by the same name; "flip" among its
    metrics."""
    measured_pass: str = "light"
    """As in the settings."""
    complete: bool = False
    """Every method has had every seed, and the pictures are made."""


class BenchResult(msgspec.Struct):
    """One run of `spectrasplat bench`."""

    version: str
    date: str
    command: str
    machine: dict[str, str]
    """processor, cores, renderer, driver, opengl, system, python, program (hash of what renders and measures)."""
    scenes: list[SceneResult]
    settings: BenchSettings = BenchSettings()
