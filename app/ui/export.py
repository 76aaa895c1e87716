"""Screenshots, which are only written; finished pictures, baked maps and animations as one job that works while the
window is drawn."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ..base.atomic import check_writable
from ..base.errors import UserError
from ..base.glare import with_glare
from ..base.image_io import SHOWN_SUFFIXES, SPECTRAL_SUFFIXES, check_finite, check_suffix, write_image
from ..base.memory import check_picture_memory
from ..edit import requests
from ..edit.parameters import Stage
from ..edit.state import Display as DisplaySettings
from ..edit.state import State
from ..gpu.context import Context
from ..gpu.context_thread import ContextThread, no_thread
from ..model.scene import RenderDefaults
from ..model.settings import RenderSettings
from ..passes.display import Display
from ..render.export_caustic import PAGE_SUFFIXES
from ..render.notices import FrameNotices, frame_notices
from .export_job import Course, ExportJob, Words, settings_of
from .file_writer import FileWriter
from .screenshot import Shown, screenshot, texture_codes, write_codes
from .solving_jobs import FoundPictures, solving_job
from .view_model import JobInfo

_CAUSTIC_SHARE = 0.2
"""Share of the time for the layer of the caustics alone: light is traced once, and their camera samples are cheap."""
_NOTHING = "Nothing was written: {} is whole or not at all."


class Exports:
    """Writes screenshots, as many as are asked for, and runs one longer job at a time, both on other threads; `step`
    returns what became of them."""

    def __init__(self, context: Context, thread: Callable[[], ContextThread | None] = no_thread) -> None:
        """`thread`: where jobs work, called when the first begins; None for the caller's own, with `context`."""
        self._context, self._find_thread = context, thread
        self._writer = FileWriter()
        self.found = FoundPictures(context)
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
        if isinstance(request, requests.Screenshot):
            check_suffix(request.path)
            check_writable(request.path)
            self.write(request.path, screenshot(request.path, shown))
            return
        if self._job is not None:
            raise UserError("an export is running already: wait for it, or cancel it first")
        self._job = self._made(request, state, shown.exposure_ev)

    def write(self, path: Path, work: Callable[[], None]) -> None:
        """Let `work`, which needs no OpenGL, write `path` on a thread."""
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
        """End the job; what is finished stays. None where that takes a moment: `step` returns the sentence then."""
        note = None if self._job is None else self._job.cancel()
        if note is not None:
            self._job = None
        return note

    def stop(self) -> str | None:
        """End the job as soon as it can keep what is done: a picture is written with the light that it has by then.
        Called again, or of what has no such middle, `cancel`."""
        return None if self._job is not None and self._job.stop() else self.cancel()

    def release(self) -> list[str]:
        """End the job, and wait for what is being written; sentences about what could not be."""
        if self._job is not None:
            self._job.release()
            self._job = None
        self.found.release()
        return self._writer.release()

    def _made(self, request: requests.LongExport, state: State, exposure_ev: float) -> ExportJob:
        thread = self._find_thread()
        context = self._context if thread is None else thread.context
        if isinstance(request, requests.Solving):
            return solving_job(context, request, state, thread, self.found)
        size, name, notices = request.size, request.path.name, FrameNotices()
        shown_size = state.viewport_size if isinstance(request, requests.Bake) else size
        stage = Stage(state.scene, state.camera_for(shown_size), exposure_ev, state.solo_nm)
        match request:
            case requests.Bake() if request.path.suffix.lower() in PAGE_SUFFIXES:
                work = _page(context, request, state, exposure_ev)
                saved = f"Saved {name}: any browser opens it."
                return ExportJob(Words(f"Page: {name}", saved, _NOTHING.format("a page")), work, notices, thread)
            case requests.Bake():
                settings = settings_of(state, size, photons=request.photons)
                work = _bake(context, request, stage, settings, notices)
                saved = f"Baked {name}; its place is in {request.path.with_suffix('.json').name}."
                words = Words(f"Caustic map: {name}", saved, _NOTHING.format("a map"))
                return ExportJob(words, work, notices, thread)
            case requests.RenderPicture():
                course = Course()
                settings = settings_of(
                    state,
                    size,
                    photons=None if request.seconds is not None else request.photons,
                    seconds=request.seconds,
                    spp=request.samples,
                    bins=request.bins,
                )
                work = _render(context, request, stage, settings, state.display, notices, course)
                kept = "it is written with the light that it has by then"
                words = Words(f"Rendering {name}", f"Rendered {name}.", _NOTHING.format("a picture"), kept)
                return ExportJob(words, work, notices, thread, seconds=request.seconds, course=course)
        settings = settings_of(state, size, photons=request.photons, spp=request.samples)
        work, frames = _animate(context, request, stage, settings, state, notices)
        title = "Turntable" if request.kind == "turntable" else "Animation"
        saved, kept = f"Saved {name}, {frames} frames.", "the frames that are done stay"
        words = Words(f"{title}: {name}", saved, f"Stopped {name}; {kept}.", kept)
        return ExportJob(words, work, notices, thread, frames)


def _render(
    context: Context,
    request: requests.RenderPicture,
    stage: Stage,
    settings: RenderSettings,
    display: DisplaySettings,
    notices: FrameNotices,
    course: Course,
) -> Iterator[float]:
    """Shares of the work from 0 to 1; files are written whole at its end. Raises `UserError` before the first share for
    what cannot be rendered or written."""
    path = request.path
    if check_suffix(path) not in SPECTRAL_SUFFIXES and request.bins is not None:
        names = " or ".join(SPECTRAL_SUFFIXES)
        raise UserError(f"cannot write spectral bins to {path.name}: choose a name that ends in {names}")
    if request.caustic and request.seconds is not None:
        raise UserError("a caustic layer needs a number of photons, not a time: its samples come on top")
    targets = [path, path.with_name(f"{path.stem}_caustic{path.suffix}")] if request.caustic else [path]
    for target in targets:
        check_writable(target)
    check_picture_memory(settings.width, settings.height, settings.bins)

    def work() -> Iterator[float]:
        from ..render.frames import FrameRenderer

        # From the first dispatch on: who asks for a minute waits for a minute.
        renderer = FrameRenderer(context, settings, [stage], time.perf_counter())
        try:
            own = 0.98 - (_CAUSTIC_SHARE if request.caustic else 0.0)
            for share in renderer.steps(stage, course.stops):
                course.phase = renderer.phase
                yield own * share
            pictures = [renderer.picture]
            notices.take(frame_notices(renderer.light, stage.camera, settings, pictures[0].rgb))
            if request.caustic:
                for share in renderer.steps_of_layer("caustic", stage, course.stops):
                    yield own + _CAUSTIC_SHARE * share
                pictures.append(renderer.picture)
        finally:
            renderer.release()
        course.phase = "writing the picture"
        yield 0.98
        develop = _Developer(context, display)
        try:
            for target, picture in zip(targets, pictures, strict=True):
                if target.suffix.lower() in SHOWN_SUFFIXES:
                    check_finite(target.name, picture.rgb)
                    write_codes(target, develop(picture.rgb, stage.exposure_ev, stage.scene.render))
                else:
                    write_image(target, picture.rgb, spectral=picture.spectral, bin_edges_nm=picture.bin_edges_nm)
        finally:
            develop.release()

    return work()


def _bake(
    context: Context, request: requests.Bake, stage: Stage, settings: RenderSettings, notices: FrameNotices
) -> Iterator[float]:
    from ..render import bake

    check_suffix(request.path)
    bake.check_receiver(stage.scene, request.receiver)
    for path in bake.written_with(request.path):
        check_writable(path)
    return bake.bake(context, stage, settings, request.receiver, request.path, notices)


def _page(context: Context, request: requests.Bake, state: State, exposure_ev: float) -> Iterator[float]:
    from ..render.page.page import check_page, check_page_path, page_size, page_steps, words_of

    scene, size = state.scene, page_size(state.scene)
    stage = Stage(scene, state.camera_for(size), exposure_ev)
    check_page_path(request.path)
    check_page(scene, request.receiver)
    look = {"exposure_ev": scene.render.exposure_ev, "glare": scene.render.glare}
    settings = settings_of(state, size, photons=request.photons, **look)

    def work() -> Iterator[float]:
        page = yield from page_steps(context, stage, settings, request.receiver, words_of(scene))
        page.to_html(request.path)

    return work()


def _animate(
    context: Context,
    request: requests.Animate,
    stage: Stage,
    settings: RenderSettings,
    state: State,
    notices: FrameNotices,
) -> tuple[Iterator[float], int]:
    """The work, and how many frames it has."""
    from ..base.movie import open_sink
    from ..edit import animation
    from ..render.animate import description, render_animation

    if request.kind == "turntable":
        made = animation.turntable(stage, request.frames or 1, request.fps)
    else:
        made = animation.keyed(stage, animation.tracks_of(state.animation), request.frames, request.fps)
    check_picture_memory(*request.size, None)
    shown = {"display": repr(state.display), "smoothing": state.smoothing}
    described = dict(description(made, settings, request.fps, request.photons)) | shown
    sink = open_sink(request.path, request.size, request.fps, described)
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
