"""The fingerprint command: hashes of programs and small pictures, written to a file or compared with one."""

from __future__ import annotations

from pathlib import Path

import msgspec

from ..base import files
from ..base.atomic import atomic_output, check_writable
from ..base.errors import UserError, suggestion
from ..base.version import __version__
from .measuring_table import Fingerprint
from .scenes import find_scene


class FingerprintFile(msgspec.Struct, forbid_unknown_fields=True):
    """What the command writes."""

    version: str
    """Of SpectraSplat."""
    driver: dict[str, str]
    scenes: dict[str, dict[str, dict[str, list[str]]]]
    """Scene → case → what was hashed → hashes."""


def fingerprint(options: Fingerprint) -> int:
    """Measure, write, compare; returns the exit code. Raises `UserError`."""
    from ..bench.fingerprint import CASES, differences, measure, scene_files
    from ..gpu.context import create_context

    if options.output is None and options.against is None:
        raise UserError("nothing to do with the hashes: give -o FILE, --against FILE, or both")
    shipped = scene_files()
    scenes = {name: shipped.get(name) or find_scene(name) for name in options.scenes or shipped}
    cases = options.cases or tuple(CASES)
    for name in cases:
        if name not in CASES:
            raise UserError(f"--cases '{name}' is unknown{suggestion(name, CASES) or ','} there are {', '.join(CASES)}")
    if options.output is not None:
        check_writable(options.output)
    before = None if options.against is None else _read(options.against)
    with create_context() as context:
        driver = {"renderer": context.renderer, "vendor": context.vendor, "version": context.version}
    if before is not None and before.driver != driver and not options.texts:
        there = " ".join(before.driver.values())
        print(f"note: {options.against} is of another driver ({there}), whose pictures differ in their last bits")

    found = FingerprintFile(__version__, driver, {})
    count = 0
    for scene, case, hashes in measure(scenes, cases, texts_only=options.texts):
        found.scenes.setdefault(scene, {})[case] = hashes
        if before is not None:
            known = before.scenes.get(scene, {}).get(case)
            lines = ["not in the file"] if known is None else differences(known, hashes, texts_only=options.texts)
            for what in lines:
                print(f"{scene}, {case}: {what}", flush=True)
                count += 1
        if options.output is not None:
            with atomic_output(options.output) as temporary:
                temporary.write_bytes(msgspec.json.format(msgspec.json.encode(found)))
    cases_found = sum(map(len, found.scenes.values()))
    told = "" if before is None else f", {count} differences" if count else ", no differences"
    print(f"{cases_found} cases of {len(found.scenes)} scenes on {driver['renderer']}{told}")
    return 1 if count else 0


def _read(path: Path) -> FingerprintFile:
    try:
        return msgspec.json.decode(files.read_bytes(path, files.TABLE_BYTES), type=FingerprintFile)
    except (OSError, msgspec.MsgspecError) as error:
        raise UserError(f"{path} is no file of fingerprints: {error}") from error
