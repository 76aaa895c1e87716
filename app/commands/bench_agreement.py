"""The bench-agreement command: checks what was typed, compares scene after scene, keeps what is found."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..base.atomic import atomic_output, make_output_folder
from ..base.errors import UserError
from ..base.interrupts import exit_code_of
from ..base.memory import check_picture_memory
from ..bench.results import RANDOM_KINDS
from ..bench.results import AgreementSettings as Settings
from . import options
from .bench import MAX_SEEDS, load_scenes, met_by

MAX_RANDOM = 1000


@dataclass(frozen=True)
class AgreementRequest:
    """The options as typed."""

    scenes: tuple[str, ...] = ()
    output: Path = Path("bench_agreement")
    photons: str | None = None
    seeds: str | None = None
    size: str | None = None
    reference_seconds: str | None = None
    method: str | None = None
    reference: str | None = None
    random: str | None = None
    random_seed: str | None = None
    random_kinds: str | None = None


def bench_agreement_command(request: AgreementRequest) -> int:
    """Measure and print; returns the exit code. Raises `UserError`."""
    import msgspec

    from ..base.progress import ProgressReporter
    from ..bench import agreement
    from ..bench.random_scenes import random_scenes
    from ..bench.rendering import NothingToMeasure
    from ..gpu.context import create_context

    settings = _settings(request)
    count, seed, kinds = _chance(request)
    named = load_scenes(request.scenes) if count is None else {}
    make_output_folder(request.output, "agreement.json")
    scenes = met_by(settings.reference, named if count is None else random_scenes(count, seed, request.output, kinds))
    found: list[agreement.SceneAgreement] = []
    print(agreement.HEAD, flush=True)
    try:
        with create_context() as context:
            for name, scene in scenes.items():
                try:
                    with ProgressReporter(f"bench-agreement {name}") as progress:
                        found.append(agreement.measure(context, name, scene, settings, progress))
                except NothingToMeasure as reason:
                    if len(scenes) == 1:
                        raise
                    print(f"note: {reason}", file=sys.stderr)
                    continue
                print(agreement.line(found[-1]), flush=True)
                with atomic_output(request.output / "agreement.json") as temporary:
                    temporary.write_bytes(msgspec.json.format(msgspec.json.encode(found)))
    except KeyboardInterrupt as interrupt:
        print(f"spectrasplat: stopped; {len(found)} scenes kept", file=sys.stderr)
        return exit_code_of(interrupt)
    print(f"wrote {request.output / 'agreement.json'}")
    return 0


def _chance(request: AgreementRequest) -> tuple[int | None, int, str]:
    """How many scenes are drawn by chance, None where scenes are named, their seed, and of what they are."""
    if request.random is None:
        for option, value in (("--random-seed", request.random_seed), ("--random-kinds", request.random_kinds)):
            if value is not None:
                raise UserError(f"{option} says which random scenes are compared: say with --random N how many")
        return None, 1, RANDOM_KINDS[0]
    if request.scenes:
        raise UserError(
            f"--random draws its own scenes: leave out {', '.join(request.scenes)}, or compare these apart without it"
        )
    count = options.parse_integer("--random", request.random, 1, MAX_RANDOM)
    seed = (
        1
        if request.random_seed is None
        else options.parse_integer("--random-seed", request.random_seed, 0, options.MAX_SEED)
    )
    kinds = RANDOM_KINDS[0] if request.random_kinds is None else request.random_kinds
    if kinds not in RANDOM_KINDS:
        raise UserError(f"--random-kinds '{kinds}' is neither {' nor '.join(RANDOM_KINDS)}")
    return count, seed, kinds


def _settings(request: AgreementRequest) -> Settings:
    asked: dict[str, Any] = {}
    if request.size is not None:
        asked["width"], asked["height"] = options.parse_size(request.size)
        check_picture_memory(asked["width"], asked["height"], None)
    if request.photons is not None:
        asked["photons"] = options.parse_photons(request.photons)
    if request.seeds is not None:
        asked["seeds"] = options.parse_integer("--seeds", request.seeds, 2, MAX_SEEDS)
    if request.reference_seconds is not None:
        asked["reference_seconds"] = options.parse_seconds(request.reference_seconds)
    if request.method is not None:
        asked["method"] = options.parse_method(request.method)
    if request.reference is not None:
        asked["reference"] = options.parse_reference(request.reference)
    return Settings(**asked)
