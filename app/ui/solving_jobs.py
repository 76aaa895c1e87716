"""Jobs of the window that solve (which glass or number, a derivative, whether a plate draws its picture), and the
pictures that they found, by the functions that the command line and Python use."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from threading import Event
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..base.colour_maps import signed_codes
from ..edit import requests
from ..edit.parameters import Stage
from ..model.io.scene_pictures import nearest_levels
from ..render.notices import FrameNotices
from .export_job import ExportJob, Words, settings_of
from .view_model import Found

if TYPE_CHECKING:
    import moderngl

    from ..edit.solved import Fit, Match
    from ..edit.state import State
    from ..gpu.context import Context
    from ..gpu.context_thread import ContextThread
    from ..render.solving import Solver

T = TypeVar("T")
_LARGEST_PX = 480
"""Longer side of a derivative."""
_PAUSE_S = 0.02
_GLASSES = 5
"""That are listed."""


class FoundPictures:
    """What jobs found, by name: kept on any thread, shown on that of the context."""

    def __init__(self, context: Context) -> None:
        self._ctx = context.ctx
        self._found: dict[str, Found] = {}
        self._textures: dict[str, tuple[Found, moderngl.Texture]] = {}

    def keep(self, name: str, found: Found) -> None:
        """In place of what was found before."""
        self._found[name] = found

    def entries(self) -> dict[str, Found]:
        """All, with their textures."""
        return {name: self._shown(name, found) for name, found in self._found.items()}

    def _shown(self, name: str, found: Found) -> Found:
        if found.codes is None:
            return found
        kept = self._textures.get(name)
        if kept is None or kept[0] is not found:
            if kept is not None:
                kept[1].release()
            height, width = found.codes.shape[:2]
            rgba = np.concatenate([found.codes, np.full((height, width, 1), 255, np.uint8)], axis=2)
            kept = self._textures[name] = found, self._ctx.texture((width, height), 4, rgba.tobytes())
        return replace(found, texture=kept[1].glo)

    def release(self) -> None:
        """Forget all."""
        for _, texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self._found.clear()


def solving_job(
    context: Context, request: requests.Solving, state: State, thread: ContextThread | None, found: FoundPictures
) -> ExportJob:
    """The job of `request`. Raises `UserError` for what cannot be begun."""
    notices = FrameNotices()
    match request:
        case requests.MatchGlass():
            words, work = _match(context, request, state, found, notices)
        case requests.Derive():
            words, work = _derive(context, request, state, found)
        case requests.CheckPlate():
            words, work = _check(request, state, found, notices)
        case requests.JudgeStone():
            words, work = _judge(request, state, found)
    return ExportJob(words, work, notices, thread)


def _match(
    context: Context, request: requests.MatchGlass, state: State, found: FoundPictures, notices: FrameNotices
) -> tuple[Words, Iterator[float]]:
    from ..render.gradient import check_path
    from ..render.light_target import flat_receiver, read_target
    from ..render.solving import solution

    scene = state.scene
    stage, receiver = Stage(scene, scene.camera), flat_receiver(scene, request.between)
    settings = settings_of(state, state.viewport_size, photons=request.photons)
    values = None if request.file is None else read_target(request.file)
    wish = receiver, values, request.between or None, request.width

    for path in request.of:
        check_path(stage, path)
    target = (
        f"a width of {request.width:g}" if request.width else request.file.name if request.file else "its light now"
    )
    title = "Fit of " + ", ".join(request.of) if request.of else f"Glass of {scene.objects[request.index].name}"

    def solve(its: Solver) -> Generator[float, None, Fit | Match]:
        return (yield from its.fit(request.of) if request.of else its.match(request.index, _GLASSES))

    def work() -> Iterator[float]:
        its = yield from solution(context, stage, settings, *wish, solve)
        rows = (("Asked", title), ("By", f"{target}, on '{receiver}'"), *its.rows())
        found.keep("answer", Found((scene,), rows))
        (label, text), *_ = its.rows()
        notices.take([f"{label}: {text}"])

    return Words(title, "What was found is in the Solve panel.", "Nothing was found."), work()


def _derive(
    context: Context, request: requests.Derive, state: State, found: FoundPictures
) -> tuple[Words, Iterator[float]]:
    from ..render.gradient import check_path, gradient

    width, height = state.viewport_size
    scale = min(1.0, _LARGEST_PX / max(width, height))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    stage = Stage(state.scene, state.camera_for(size), 0.0, state.solo_nm)
    check_path(stage, request.path)
    settings = settings_of(state, size, photons=request.photons)
    of = state.scene, state.camera, request.path

    def work() -> Iterator[float]:
        its = (yield from gradient(context, stage, settings, [request.path], noise=True)).derivatives[0]
        rows = (
            ("By", its.path),
            ("Step", f"{its.step:.3g} to either side"),
            ("Noise", f"{100.0 * its.noise:.2g} % of it"),
        )
        found.keep("derivative", Found(of, rows, signed_codes(its.picture.rgb)))

    words = f"Derivative by {request.path}", "The derivative is in the Solve panel.", "No derivative was found."
    return Words(*words), work()


def _check(
    request: requests.CheckPlate, state: State, found: FoundPictures, notices: FrameNotices
) -> tuple[Words, Iterator[float]]:
    from ..model.io.picture_files import read_picture
    from ..model.optics.caustic_plate import plate_of
    from ..model.plate_check import check_plate

    item = state.scene.objects[request.index]
    glass, mesh = item.material.dispersion, item.mesh.transformed(item.object_to_world)
    rgb, notes = read_picture(request.target)
    notices.take(notes)
    plate_of(mesh, glass, 1)  # what is no plate is said at once
    of = item.mesh, item.object_to_world, glass, request.target, request.distance

    def work() -> Iterator[float]:
        report = yield from _on_thread(
            lambda progress, stopped: check_plate(mesh, glass, rgb, request.distance, progress, stopped)
        )
        found.keep("plate", Found(of, report.rows(), nearest_levels(report.pictures())))

    name = f"{item.name} against {request.target.name}"
    return Words(f"Plate {name}", f"Checked {name}: see the Lens panel.", "The plate was not checked."), work()


def _judge(request: requests.JudgeStone, state: State, found: FoundPictures) -> tuple[Words, Iterator[float]]:
    from ..model.gems.in_scene import chosen_stone, stone_in
    from ..model.gems.report import gem_report

    item, stone = chosen_stone(state.scene, request.name), stone_in(state.scene, request.name)

    def work() -> Iterator[float]:
        report = yield from _on_thread(lambda progress, stopped: gem_report(stone, report=progress, cancelled=stopped))
        if report is not None:
            rows = tuple((name, f"{value}  {meaning}") for name, value, meaning in report.rows())
            aset, ideal_scope, brightness, fire = report.pictures.values()
            shown = np.vstack([np.hstack([aset, ideal_scope]), np.hstack([brightness, fire])])
            found.keep("gem", Found((item,), rows, nearest_levels(shown)))

    words = f"Figures of {item.name}", "Figures and pictures are in the Gem panel.", "The stone was not judged."
    return Words(*words), work()


def _on_thread(work: Callable[[Callable[[float, str], None], Callable[[], bool]], T]) -> Generator[float, None, T]:
    """What `work` returns, done on a thread of its own so that the window goes on; closed, it is told to stop."""
    shares, stop = [0.0], Event()
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(work, lambda share, _: shares.append(share), stop.is_set)
        try:
            while not future.done():
                wait([future], _PAUSE_S)
                yield shares[-1]
        finally:
            stop.set()
    return future.result()
