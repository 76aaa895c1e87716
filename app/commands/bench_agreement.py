"""The bench-agreement command: compares scene after scene, keeps what is found."""

from __future__ import annotations

import sys

from ..base.atomic import atomic_output, make_output_folder
from ..base.errors import UserError
from ..base.interrupts import exit_code_of
from ..base.memory import check_picture_memory
from ..bench.results import RANDOM_KINDS, AgreementSettings
from .bench import met_by
from .measuring_table import BenchAgreement
from .options import given_for
from .printing import note
from .scenes import load_scenes


def bench_agreement(options: BenchAgreement) -> int:
    """Measure and print; returns the exit code. Raises `UserError`."""
    import msgspec

    from ..base.progress import ProgressReporter
    from ..bench import agreement
    from ..bench.random_scenes import random_scenes
    from ..bench.rendering import NothingToMeasure
    from ..gpu.context import create_context

    _check_chance(options)
    settings = AgreementSettings(**given_for("settings", options))
    check_picture_memory(settings.width, settings.height, None)
    named = load_scenes(options.scenes) if options.random is None else {}
    make_output_folder(options.output, "agreement.json")
    if options.random is not None:
        seed = 1 if options.random_seed is None else options.random_seed
        named = random_scenes(options.random, seed, options.output, options.random_kinds or RANDOM_KINDS[0])
    scenes = met_by(settings.reference, named)
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
                    note(str(reason))
                    continue
                print(agreement.line(found[-1]), flush=True)
                with atomic_output(options.output / "agreement.json") as temporary:
                    temporary.write_bytes(msgspec.json.format(msgspec.json.encode(found)))
    except KeyboardInterrupt as interrupt:
        print(f"spectrasplat: stopped; {len(found)} scenes kept", file=sys.stderr)
        return exit_code_of(interrupt)
    print(f"wrote {options.output / 'agreement.json'}")
    return 0


def _check_chance(options: BenchAgreement) -> None:
    """Raise `UserError` where options about scenes drawn by chance contradict the others."""
    if options.random is None:
        for option, value in (("--random-seed", options.random_seed), ("--random-kinds", options.random_kinds)):
            if value is not None:
                raise UserError(f"{option} says which random scenes are compared: say with --random N how many")
    elif options.scenes:
        raise UserError(
            f"--random draws its own scenes: leave out {', '.join(options.scenes)}, or compare these apart without it"
        )
