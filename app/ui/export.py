"""Screenshots, which are only written; finished pictures, spectral ones, baked maps and animations as one job that
works beside the window."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.atomic import check_writable
from ..base.errors import UserError
from ..base.glare import with_glare
from ..base.image_io import SPECTRAL_SUFFIXES, check_suffix, write_image
from ..base.memory import MAX_SIDE_PX, check_picture_memory
from ..edit import requests
from ..edit.parameters import Stage
from ..edit.state import Display as DisplaySettings
from ..edit.state import State
from ..gpu.context_thread import no_thread
from ..model.scene import RenderDefaults
from ..model.settings import RenderSettings
from ..passes.display import Display
from ..render.notices import FrameNotices, frame_notices
from .export_job import ExportJob, Words
from .file_writer import FileWriter
from .render_job import Course
from .screenshot import Shown, screenshot, texture_codes, write_codes
from .view_model import JobInfo

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..gpu.context_thread import ContextThread

SPECTRAL_BINS = 20
MIN_PHOTONS = 1_000_000
MAX_PHOTONS = 64_000_000


class Exports:
    """Writes screenshots, as many as are asked for, and runs one longer job at a time. Both work beside the window;
    what became of them `step` returns."""

    def __init__(self, context: Context, thread: Callable[[], ContextThread | None] = no_thread) -> None:
        """`thread`: where jobs work, asked when the first begins; None for the caller's own, with `context`."""
        self._context, self._find_thread = context, thread
        self._writer = FileWriter()
        self._job: ExportJob | None = None

    @property
    def is_rendering(self) -> bool:
        """The running job is a finished picture."""
        return self._job is not None and self._job.is_picture

    @property
    def is_stopped(self) -> bool:
        """The running job ends with what is done."""
        return self._job is not None and self._job.is_stopped

    @property
    def is_busy(self) -> bool:
        """Something has yet to be written."""
        return self._job is not None or self._writer.is_busy

    @property
    def job(self) -> JobInfo | None:
        """The running job, for panels."""
        return None if self._job is None else self._job.view_model

    @property
    def writing(self) -> str:
        """Which screenshot takes long to be written, in words; empty without one."""
        return self._writer.words

    def begin(self, request: requests.Export, state: State, shown: Shown) -> None:
        """Begin what `request` asks for. Raises `UserError`; a running job is not disturbed."""
        if isinstance(request, requests.Screenshot) and not request.spectral:
            check_suffix(request.path)
            check_writable(request.path)
            self.write(request.path, screenshot(request.path, shown))
            return
        if self._job is not None:
            raise UserError("an export is running already: wait for it, or cancel it first")
        self._job = self._made(request, state, shown)

    def write(self, path: Path, work: Callable[[], None]) -> None:
        """Let `work`, which needs no OpenGL, write `path` beside the window."""
        self._writer.write(path, work, f"Saved {path.name} in {path.parent}.")

    def step(self, budget_s: float) -> str | None:
        """Work on the job for about `budget_s`; a sentence when something is finished. Raises `UserError` when it
        fails; it is over then."""
        written = self._writer.finished()
        if written is not None or self._job is None:
            return written
        try:
            note = self._job.step(budget_s)
        except BaseException:
            self._job = None
            raise
        if note is not None:
            self._job = None
        return note

    def cancel(self) -> str | None:
        """End the job; what is finished stays. None where that takes a moment: `step` tells then."""
        note = None if self._job is None else self._job.cancel()
        if note is not None:
            self._job = None
        return note

    def stop(self) -> str | None:
        """End the job as soon as it can keep what is done: a picture is written with the light that it has by then.
        Asked again, or of what has no such middle, `cancel`."""
        if self._job is not None and self._job.stop():
            return None
        return self.cancel()

    def release(self) -> list[str]:
        """End the job, and wait for what is being written; sentences about what could not be."""
        if self._job is not None:
            self._job.release()
            self._job = None
        return self._writer.release()

    def _made(self, request: requests.Export, state: State, shown: Shown) -> ExportJob:
        is_map = isinstance(request, requests.Bake)
        size = (not is_map and getattr(request, "size", None)) or state.viewport_size
        stage = Stage(state.scene, state.camera_for(size), shown.exposure_ev, state.solo_nm)
        name, notices = request.path.name, FrameNotices()
        thread = self._find_thread()
        context = self._context if thread is None else thread.context
        nothing = "Nothing was written: {} is whole or not at all.".format
        if isinstance(request, requests.Screenshot):
            work = _spectral(context, request.path, stage, state, shown.photons, notices)
            words = Words(f"Spectral picture: {name}", f"Saved {name}.", nothing("a picture"))
            return ExportJob(words, work, notices, thread)
        if isinstance(request, requests.Bake):
            work = _bake(context, request, stage, state, notices)
            place = request.path.with_suffix(".json").name
            words = Words(f"Caustic map: {name}", f"Baked {name}; its place is in {place}.", nothing("a map"))
            return ExportJob(words, work, notices, thread)
        if isinstance(request, requests.RenderPicture):
            course = Course()
            work = _render(context, request, stage, state, notices, course)
            words = Words(
                f"Rendering {name}",
                f"Rendered {name}.",
                nothing("a picture"),
                "it is written with the light that it has by then",
            )
            return ExportJob(words, work, notices, thread, seconds=request.seconds, course=course)
        work, frames = _animate(context, request, stage, state, notices)
        title = "Turntable" if request.kind == "turntable" else "Animation"
        words = Words(
            f"{title}: {name}",
            f"Saved {name}, {frames} frames.",
            f"Stopped {name}; the frames that are done stay.",
            "the frames that are done stay",
        )
        return ExportJob(words, work, notices, thread, frames)


def _settings(state: State, size: tuple[int, int], photons: int, **changes: Any) -> RenderSettings:
    """What is shown, in another size and with so many photons."""
    width, height = size
    if not (1 <= width <= MAX_SIDE_PX and 1 <= height <= MAX_SIDE_PX):
        raise UserError(f"a size of {width} × {height} pixels is out of range: no side may exceed {MAX_SIDE_PX}")
    return RenderSettings(
        width=width,
        height=height,
        photons=photons,
        method=state.method,
        smoothing=state.smoothing,
        max_depth=state.scene.render.max_depth,
        local_gain=not state.physical,
        **changes,
    )


def _spectral(
    context: Context, path: Path, stage: Stage, state: State, photons: int, notices: FrameNotices
) -> Iterator[float]:
    from ..render.frames import FrameRenderer

    if check_suffix(path) not in SPECTRAL_SUFFIXES:
        raise UserError(f"cannot write {path}: spectral channels need {' or '.join(SPECTRAL_SUFFIXES)}")
    check_writable(path)
    check_picture_memory(*state.viewport_size, SPECTRAL_BINS)
    settings = _settings(
        state, state.viewport_size, int(np.clip(photons, MIN_PHOTONS, MAX_PHOTONS)), bins=SPECTRAL_BINS
    )

    def work() -> Iterator[float]:
        renderer = FrameRenderer(context, settings, [stage])
        try:
            for share in renderer.steps(stage):
                yield 0.98 * share
            picture = renderer.picture
            notices.take(frame_notices(renderer.light, stage.camera, settings, picture.rgb))
            write_image(path, picture.rgb, spectral=picture.spectral, bin_edges_nm=picture.bin_edges_nm)
        finally:
            renderer.release()

    return work()


def _render(
    context: Context, request: requests.RenderPicture, stage: Stage, state: State, notices: FrameNotices, course: Course
) -> Iterator[float]:
    from .render_job import render_picture

    def write_shown(path: Path, rgb: np.ndarray) -> None:
        develop = _Developer(context, state.display)
        try:
            write_codes(path, develop(rgb, stage.exposure_ev, stage.scene.render))
        finally:
            develop.release()

    settings = _settings(state, request.size, request.photons or MIN_PHOTONS)
    return render_picture(context, request, stage, settings, write_shown, notices, course)


def _bake(
    context: Context, request: requests.Bake, stage: Stage, state: State, notices: FrameNotices
) -> Iterator[float]:
    from ..render import bake

    bake.check_output(request.path)
    bake.check_receiver(stage.scene, request.receiver)
    check_writable(request.path)
    check_writable(bake.placement_path(request.path))
    settings = _settings(state, request.size, request.photons)
    return bake.bake(context, stage, settings, request.receiver, request.path, notices)


def _animate(
    context: Context, request: requests.Animate, stage: Stage, state: State, notices: FrameNotices
) -> tuple[Iterator[float], int]:
    from ..base.movie import open_sink
    from ..edit import animation
    from ..render.animate import description, render_animation

    if request.kind == "turntable":
        made = animation.turntable(stage, request.frames or 1, request.fps)
    else:
        made = animation.keyed(stage, animation.tracks_of(state.animation), request.frames, request.fps)
    size = request.size or state.viewport_size
    settings = _settings(state, size, request.photons, spp=request.samples)
    check_picture_memory(*size, None)
    description_ = dict(description(made, settings, request.fps, request.photons)) | {
        "display": repr(state.display),
        "smoothing": state.smoothing,
    }
    sink = open_sink(request.path, size, request.fps, description_)
    develop = _Developer(context, state.display)

    def work() -> Iterator[float]:
        try:
            yield 0.0
            yield from render_animation(context, made, settings, sink, 0.0, develop, notices)
        finally:
            develop.release()
            sink.close()

    steps = work()
    next(steps)  # from here on closing it closes the sink, also when it is cancelled before its first frame
    return steps, len(made.times_s)


class _Developer:
    """Linear pictures to codes as the window shows them: tone curve with the lens's glare, or false colour, which is
    data and has none."""

    def __init__(self, context: Context, settings: DisplaySettings) -> None:
        self._context, self._settings = context, settings
        self._display: Display | None = None

    def __call__(self, rgb: np.ndarray, exposure_ev: float, look: RenderDefaults) -> np.ndarray:
        self._display = self._display or Display(self._context)
        is_data = self._settings.false_colour
        rgb = rgb if is_data else with_glare(rgb, look.glare)
        antialias = look.antialias_highlights and not is_data
        height, width = rgb.shape[:2]
        texels = np.concatenate([rgb, np.ones((height, width, 1), np.float32)], axis=-1)
        texture = self._context.ctx.texture(
            (width, height), 4, np.ascontiguousarray(texels, np.float32).tobytes(), dtype="f4"
        )
        try:
            shown = self._display.run(texture, self._settings, exposure_ev, (width, height), antialias=antialias)
            return texture_codes(shown)
        finally:
            texture.release()

    def release(self) -> None:
        if self._display is not None:
            self._display.release()
            self._display = None
