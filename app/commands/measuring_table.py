"""The commands that measure, with their options: see `table`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..bench.results import RANDOM_KINDS, REFERENCES
from ..model.settings import METHODS
from . import completion, options
from .options import MAX_SEED, Option, argument, option, setting, shared, switch, target
from .table import ReadsScenes

MAX_SEEDS = 1000
MAX_BENCH_SECONDS = 3600.0
MAX_RANDOM = 1000
PROOF_PARTS = ("programs", "answers", "pictures", "stress")
MEASURED_PARTS = ("frames", "trace", "camera", "viewer", "start")
"""What `prove-gpu` does after the doctor: the keys of `proof_steps.PARTS`."""
_bench_seconds = options.seconds(MAX_BENCH_SECONDS)
_REFERENCE = Option(
    "KIND",
    "What the reference meets: true spheres, lenses, tori and solids of revolution (exact), so that "
    "tessellation counts as an error, or the renderer's triangles (mesh); default: exact.",
    options.one_of(*REFERENCES),
    sets="settings",
)
_REFERENCE_SECONDS = Option(
    "S", "Time added to each scene's cached reference; default: 60.", _bench_seconds, sets="settings"
)


def _scenes(help: str) -> Any:
    return argument("[SCENE]...", help, complete=completion.scenes, repeated=True, default=())


@dataclass(frozen=True, kw_only=True)
class Bench(ReadsScenes):
    """Measure every method's error against its run time, and write a report."""

    scenes: tuple[str, ...] = _scenes("Scenes to measure; default: every shipped one that holds glass.")
    output: Path | None = target("DIR", "Folder for results.json, tables.md, plots and report.html.", default=None)
    seconds: float | None = setting(
        "S", "Photon time of each method's and seed's largest rendering; default: 3, with --camera 20.", _bench_seconds
    )
    horizon: float | None = setting(
        "S",
        "Photon time up to which a method is followed that has not come to a relMSE of 1 % by --seconds; default: "
        "ten times --seconds.",
        _bench_seconds,
    )
    seeds: int | None = setting("N", "Independent repeats; default: 5.", options.integer(1, MAX_SEEDS))
    methods: tuple[str, ...] | None = option(
        "A,B", "Methods to compare; default: all.", options.names, complete=completion.method_lists
    )
    size: tuple[int, int] | None = setting("WxH", "Pixels; default: 480 wide, in the scene's aspect.", options.size)
    reference_seconds: float | None = shared(_REFERENCE_SECONDS)
    reference: str | None = shared(_REFERENCE)
    fresh: bool = switch("Begin anew instead of going on from what DIR holds.")
    camera_pass: bool = switch(
        "Measure the camera pass, by samples a pixel, instead of the light pass by photons.",
        flags=("--camera", "--eye"),
    )


@dataclass(frozen=True, kw_only=True)
class Stress(ReadsScenes):
    """Measure stiff and extreme cases against their promises; exits with 1 where one is broken."""

    scenes: tuple[str, ...] = _scenes("Sweep these scenes; default: all stiff cases, and a sweep over shipped scenes.")
    output: Path | None = target("DIR", "Folder for stress.json and stress.html.", default=None)
    cases: str | None = option("A,B", "Only these cases; 'prism/' is all of that scene's.")
    list_cases: bool = switch("List the cases with their number of severities, and measure nothing.", flags=("--list",))


@dataclass(frozen=True, kw_only=True)
class BenchAgreement(ReadsScenes):
    """Compare a method's caustics with the float64 reference by standard scores, by pixels and in 8x8 blocks."""

    scenes: tuple[str, ...] = _scenes("Scenes to compare; default: every shipped one that holds glass.")
    output: Path = target(
        "DIR", "Folder for agreement.json and scenes drawn by chance.", default=Path("bench_agreement")
    )
    photons: int | None = setting("N", "Of each picture; default: 250k.", options.photons)
    seeds: int | None = setting("N", "Pictures, at least 2; default: 6.", options.integer(2, MAX_SEEDS))
    size: tuple[int, int] | None = setting("WxH", "Pixels; default: 240x135.", options.size, fields=("width", "height"))
    reference_seconds: float | None = shared(_REFERENCE_SECONDS)
    reference: str | None = shared(_REFERENCE)
    method: str | None = setting("NAME", "Default: srd.", options.one_of(*METHODS), complete=METHODS)
    random: int | None = option(
        "N",
        "Compare N scenes drawn by chance instead: glass solids on and over a table; their files are written to DIR.",
        options.integer(1, MAX_RANDOM),
    )
    random_seed: int | None = option(
        "S", "Which scenes these are; the same S, the same scenes; default: 1.", options.integer(0, MAX_SEED)
    )
    random_kinds: str | None = option(
        "plain|all",
        "What they hold: simple solids of clear glass, or cut stones, vessels, bubbles, tints, ground glass, "
        "gratings, spots and beams as well; default: plain.",
        options.one_of(*RANDOM_KINDS),
    )


@dataclass(frozen=True, kw_only=True)
class BenchView(ReadsScenes):
    """Measure the viewer's frame times: accumulating, orbiting, dragging the dispersion."""

    scene: str = argument("[SCENE]", "Default: the default scene.", complete=completion.scenes, default="default")
    size: tuple[int, int] | None = option("WxH", "Of the viewport; default: 960x540, on a GPU 1920x1080.", options.size)
    seconds: float = option("S", "For each phase; default: 6.", options.seconds(), default=6.0)


@dataclass(frozen=True, kw_only=True)
class ProveGpu:
    """Prove that this machine's GPU draws what it should, and measure how fast; exits with 10 and up where not."""

    output: Path = target(
        "DIR", "Folder for proof.json, proof.html and figures.jsonl; default: proof.", default=Path("proof")
    )
    quick: bool = switch("Only measure, within nine minutes: every figure is a line of JSON, the most important first.")
    short: bool = switch("Smaller pictures and fewer scenes, as on a software renderer in any case.")
    parts: tuple[str, ...] | None = option(
        "A,B", f"Only these parts beside doctor: {', '.join(PROOF_PARTS + MEASURED_PARTS)}.", options.names
    )
