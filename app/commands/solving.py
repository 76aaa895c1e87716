"""The commands that solve: derivatives, which glass casts the light that is wanted, and which numbers of a scene."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from ..base.errors import UserError
from .opened import note_assumptions, open_scene, settings_for, worked_out
from .printing import note, show
from .solving_table import GRADIENT_SIZE, Fit, Gradient, Match

if TYPE_CHECKING:
    from ..edit import solved
    from ..model.scene import Scene
    from ..render.solving import Solver

Found = TypeVar("Found", bound="solved.Fit | solved.Match")
_NO_ANSWER = "stopped before there was an answer"


def gradient(options: Gradient) -> int:
    """Write a derivative as a picture; returns the exit code. Raises `UserError`."""
    from ..base.atomic import check_writable
    from ..base.colour_maps import signed_codes
    from ..base.image_io import SHOWN_SUFFIXES, SPECTRAL_SUFFIXES, check_suffix, save_codes, write_image
    from ..edit.parameters import Stage
    from ..render.bake import check_receiver
    from ..render.gradient import check_path
    from ..render.gradient import gradient as derived

    is_shown = check_suffix(options.output) in SHOWN_SUFFIXES
    if options.bins is not None and options.output.suffix.lower() not in SPECTRAL_SUFFIXES:
        note(f"--bins: a {options.output.suffix} file holds no spectral channels; write an .exr to keep them")
    check_writable(options.output)
    scene = open_scene(options)
    stage = Stage(scene, scene.camera)
    check_path(stage, options.of)
    if options.receiver is not None:
        check_receiver(scene, options.receiver)
    note_assumptions(scene)
    settings = settings_for(options, scene, width=GRADIENT_SIZE[0], height=GRADIENT_SIZE[1])
    if options.receiver is not None:
        settings = replace(settings, layer=f"map:{options.receiver}")
    steps = None if options.step is None else {options.of: options.step}
    started = time.perf_counter()
    found = worked_out(
        scene,
        "deriving",
        lambda context: derived(context, stage, settings, [options.of], steps, noise=True),
        _NO_ANSWER,
    )
    its = found.derivatives[0]
    if is_shown:
        save_codes(options.output, signed_codes(its.picture.rgb))
    else:
        write_image(
            options.output, its.picture.rgb, spectral=its.picture.spectral, bin_edges_nm=its.picture.bin_edges_nm
        )
    took = time.perf_counter() - started
    how = f"step {its.step:.3g} to either side, noise {100.0 * its.noise:.2g} % of it"
    show(f"{options.output.resolve()}: derivative by {its.path}, {how}, in {took:.1f} s")
    return 0


def match(options: Match) -> int:
    """Rank and list glasses; returns the exit code. Raises `UserError`."""
    from ..render.light_target import glass_called

    scene = open_scene(options)
    index, count = glass_called(scene, options.through), options.count or 10
    return _solved(options, scene, "comparing glasses", lambda its: its.match(index, count))


def fit(options: Fit) -> int:
    """Find and show numbers of a scene; returns the exit code. Raises `UserError`."""
    if options.target is None and options.width is None:
        raise UserError("there is nothing to fit to: give --target or --width")
    return _solved(options, open_scene(options), "fitting", lambda its: its.fit(options.of))


def _solved(
    options: Match | Fit, scene: Scene, what: str, work: Callable[[Solver], Generator[float, None, Found]]
) -> int:
    """Show what `work` finds for the target of `options`; returns the exit code. Raises `UserError`."""
    from ..edit.parameters import Stage
    from ..render import light_target
    from ..render.bake import check_receiver
    from ..render.solving import solution

    check_receiver(scene, options.receiver)
    between = [place for place in (options.begin, options.end, options.last) if place is not None]
    if between and (options.begin is None or options.end is None):
        raise UserError("--begin and --end go together: give both, where the target's first row begins and ends")
    values = None if options.target is None else light_target.read_target(options.target)
    note_assumptions(scene)
    wish = settings_for(options, scene), options.receiver, values, between or None, options.width
    started = time.perf_counter()
    stage = Stage(scene, scene.camera)
    found = worked_out(scene, what, lambda context: solution(context, stage, *wish, work), _NO_ANSWER)
    for label, text in found.rows():
        show(f"{label:<28} {text}")
    show(f"in {time.perf_counter() - started:.1f} s")
    return 0
