"""The merge command: parts of one rendering, traced by `render --passes`, become its picture."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.interrupts import interrupt_flag
from .printing import note
from .render import write_result
from .scenes import find_scene
from .table import Merge

if TYPE_CHECKING:
    from ..render.parts import PartHeader


def merge(options: Merge) -> int:
    """Merge to a picture file; returns the exit code. Raises `UserError`."""
    from ..base.atomic import check_writable
    from ..base.image_io import check_suffix
    from ..base.progress import ProgressReporter

    if options.output.suffix.lower() == ".ssp":
        return _merge_to_part(options)
    check_suffix(options.output)
    check_writable(options.output)

    from ..model.io.scene_file import load_scene
    from ..render.part_file import merged_sums
    from ..render.parts import check_maps, merged_light, rendering_key, settings_of
    from ..render.still import render

    headers = _headers(options)
    chosen = _chosen(headers, options.partial)
    first = headers[chosen[0]]
    settings = settings_of(first)
    scene = load_scene(find_scene(options.scene or first.scene))
    if rendering_key(scene, settings) != first.key:
        raise UserError(
            f"{options.scene or first.scene} is not as it was when {chosen[0]} was traced (or this is another version "
            "of the program): give the scene that was rendered with --scene, or trace all parts again"
        )

    started = time.perf_counter()
    fill = merged_light(
        [headers[path] for path in chosen],
        merged_sums(chosen, first),
        lambda light: check_maps(light, first, str(chosen[0])),
    )
    with interrupt_flag() as interrupted, ProgressReporter(scene.name) as progress:
        result = render(scene, settings, progress, interrupted, fill=fill)
        stopped = interrupted()
    exposure_ev = scene.render.exposure_ev if options.exposure is None else options.exposure
    write_result(options.output, scene, replace(settings, exposure_ev=exposure_ev, glare=scene.render.glare), result)
    print(
        f"{options.output.resolve()}: {settings.width}×{settings.height}, "
        f"{sum(len(headers[path].indices) for path in chosen)} of {first.share.count} parts, "
        f"{result.stats.photons:,} photons in {time.perf_counter() - started:.1f} s"
        + (", stopped early" if stopped else "")
    )
    if options.stats:
        print("\n".join(result.stats.lines()))
    return interrupted.exit_code if stopped else 0


def _merge_to_part(options: Merge) -> int:
    """Merge to one part that holds them all: what many machines trace is then merged in a tree."""
    from ..base.atomic import check_writable
    from ..render.part_file import merged_sums, write_part
    from ..render.parts import Part, merged_header

    for option, value in (("--exposure", options.exposure), ("--scene", options.scene)):
        if value is not None:
            note(f"{option} does not change a part; give it when the picture is made")
    check_writable(options.output)
    started, headers = time.perf_counter(), _headers(options)
    chosen = _chosen(headers, partial=None)
    header = merged_header([headers[path] for path in chosen])
    write_part(options.output, Part(header, list(merged_sums(chosen, header))))
    print(
        f"{options.output.resolve()}: {len(header.indices)} of {header.share.count} parts in one, in "
        f"{time.perf_counter() - started:.1f} s, {options.output.stat().st_size / 1e6:.1f} MB"
    )
    return 0


def _headers(options: Merge) -> dict[Path, PartHeader]:
    """Headers of all files that are given, each once. Raises `UserError`."""
    from ..render.part_file import SUFFIX, read_header

    paths: list[Path] = []
    for path in options.parts:
        inside = sorted(path.glob(f"*{SUFFIX}")) if path.is_dir() else [path]
        if not inside:
            raise UserError(
                f"folder {path} holds no part: give one that 'render --passes' has written {SUFFIX} files in"
            )
        paths += inside
    for path, times in Counter(paths).items():
        if times > 1:
            note(f"{path} is given {times} times: counted once")
    return {path: read_header(path) for path in paths}


def _chosen(headers: dict[Path, PartHeader], partial: bool | None) -> list[Path]:
    """Files that hold each part once, in their order. Raises `UserError` where they are not of one rendering, or some
    are missing and `partial` is false; None: some may be missing."""
    # What holds many parts first: others may only repeat it.
    paths = sorted(headers, key=lambda path: -len(headers[path].indices))
    first = headers[paths[0]]
    found: dict[int, Path] = {}
    for path in paths:
        header = headers[path]
        if header.key != first.key:
            what = "scenes or settings" if header.name == first.name else f"scenes, '{first.name}' and '{header.name}'"
            raise UserError(f"{paths[0]} and {path} are parts of different {what}: merge parts of one rendering")
        if (header.share.count, header.rounds) != (first.share.count, first.rounds):
            raise UserError(
                f"{paths[0]} is one of {first.share.count} parts of {first.rounds} rounds, {path} one of "
                f"{header.share.count} of {header.rounds}: trace all with the same --passes and --batch"
            )
        if (header.layout, header.size, header.targets) != (first.layout, first.size, first.targets):
            raise UserError(
                f"{paths[0]} ('{first.renderer}') and {path} ('{header.renderer}') have other maps: trace "
                "all parts on the same kind of device"
            )
        again = [index for index in header.indices if index in found]
        if not again:
            found |= dict.fromkeys(header.indices, path)
        elif len(again) == len(header.indices):
            note(f"{path} is part {_listed(again)} again, as {found[again[0]]}: counted once")
        else:
            raise UserError(
                f"{path} holds part {_listed(again)}, as {found[again[0]]} does, and other parts: it cannot be "
                "taken apart, so merge from parts of which each is in one file only"
            )
    missing = [index for index in range(1, first.share.count + 1) if index not in found]
    if missing and partial is not None:
        words = f"of {first.share.count} parts {len(missing)} are missing: {_listed(missing)}"
        if not partial:
            raise UserError(f"{words}; trace them, or merge what there is with --partial, which is noisier")
        note(words)
    return list(dict.fromkeys(found[index] for index in sorted(found)))


def _listed(indices: list[int]) -> str:
    """The first twenty by their numbers."""
    return ", ".join(map(str, indices[:20])) + (f" and {len(indices) - 20} more" if len(indices) > 20 else "")
