"""Screenshots at once; spectral pictures, baked maps and animations as one background job that works a little in every
frame."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.atomic import atomic_output, check_writable
from ..base.errors import UserError
from ..base.glare import with_glare
from ..base.image_io import SHOWN_SUFFIXES, check_finite, check_suffix, save_codes, write_image
from ..base.memory import MAX_SIDE_PX, check_picture_memory
from ..edit import requests
from ..edit.parameters import Stage
from ..edit.state import Display as DisplaySettings
from ..edit.state import State
from ..model.scene import RenderDefaults
from ..model.settings import RenderSettings
from ..passes.display import Display
from ..render.notices import FrameNotices, frame_notices
from .render_job import Course
from .view_model import JobInfo

if TYPE_CHECKING:
    import moderngl

    from ..gpu.context import Context

SPECTRAL_BINS = 20
MIN_PHOTONS = 1_000_000
MAX_PHOTONS = 64_000_000


@dataclass(frozen=True)
class Shown:
    """What is on the screen."""

    codes: moderngl.Texture
    """RGBA8, sRGB, row 0 on top."""
    radiance: moderngl.Texture
    """RGBA32F, linear Rec.709, row 0 on top."""
    exposure_ev: float
    """Absolute, the one in use."""
    photons: int = 0
    """In the picture."""


class Exports:
    """Runs one job at a time. `begin` and `step` return a sentence when something is finished."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._job: _Job | None = None

    @property
    def is_rendering(self) -> bool:
        """The running job is a finished picture."""
        return self._job is not None and self._job.is_picture

    @property
    def job(self) -> JobInfo | None:
        """The running job, for panels."""
        return None if self._job is None else self._job.view_model

    def begin(self, request: requests.Export, state: State, shown: Shown) -> str | None:
        """Carry out `request`, or start it. Raises `UserError`; a running job is not disturbed."""
        if isinstance(request, requests.Screenshot) and not request.spectral:
            return save_screenshot(request.path, shown)
        if self._job is not None:
            raise UserError("an export is running already: wait for it, or cancel it first")
        self._job = self._made(request, state, shown)
        return None

    def step(self, budget_s: float) -> str | None:
        """Work on the job for about `budget_s`. Raises `UserError` when it fails; it is over then."""
        if self._job is None:
            return None
        try:
            note = self._job.step(budget_s)
        except BaseException:
            self._job = None
            raise
        if note is not None:
            self._job = None
        return note

    def cancel(self) -> str | None:
        """End the job; what is finished stays."""
        if self._job is None:
            return None
        job, self._job = self._job, None
        return job.cancel()

    def stop(self) -> str | None:
        """End the job as soon as it can keep what is done: a picture is written with the light that it has by then.
        Asked again, or of what has no such middle, `cancel`."""
        if self._job is not None and self._job.stop():
            return None
        return self.cancel()

    def release(self) -> None:
        """End the job."""
        self.cancel()

    def _made(self, request: requests.Export, state: State, shown: Shown) -> _Job:
        stage = Stage(state.scene, state.camera, shown.exposure_ev, state.solo_nm)
        name, notices = request.path.name, FrameNotices()
        if isinstance(request, requests.Screenshot):
            work = _spectral(self._context, request.path, stage, state, shown.photons, notices)
            return _Job(
                f"Spectral picture: {name}",
                work,
                f"Saved {name}.",
                "Nothing was written: a picture is whole or not at all.",
                notices,
            )
        if isinstance(request, requests.Bake):
            work = _bake(self._context, request, stage, state, notices)
            return _Job(
                f"Caustic map: {name}",
                work,
                f"Baked {name}; its place is in {request.path.with_suffix('.json').name}.",
                "Nothing was written: a map is whole or not at all.",
                notices,
            )
        if isinstance(request, requests.RenderPicture):
            course = Course()
            return _Job(
                f"Rendering {name}",
                _render(self._context, request, stage, state, notices, course),
                f"Rendered {name}.",
                "Nothing was written: a picture is whole or not at all.",
                notices,
                seconds=request.seconds,
                course=course,
            )
        work, frames = _animate(self._context, request, stage, state, notices)
        title = "Turntable" if request.kind == "turntable" else "Animation"
        return _Job(
            f"{title}: {name}",
            work,
            f"Saved {name}, {frames} frames.",
            f"Stopped {name}; the frames that are done stay.",
            notices,
            frames,
        )


class _Job:
    """A generator of shares, with a note about it."""

    def __init__(
        self,
        title: str,
        work: Iterator[float],
        finished: str,
        cancelled: str,
        notices: FrameNotices,
        frames: int = 0,
        seconds: float | None = None,
        course: Course | None = None,
    ) -> None:
        """`seconds`: that it takes, where that is known; `course`: of a finished picture."""
        self._course = course
        self._title, self._work, self._notices = title, work, notices
        self._finished, self._cancelled = finished, cancelled
        self._frames = frames
        self._fraction, self._seconds = 0.0, seconds
        self._started_s = time.monotonic()

    @property
    def is_picture(self) -> bool:
        """A finished picture, in which everything goes into one file."""
        return self._course is not None

    @property
    def is_stopped(self) -> bool:
        return self._course is not None and self._course.is_stopped

    @property
    def view_model(self) -> JobInfo:
        return JobInfo(self._title, self._fraction, self._text(), self.is_stopped)

    def stop(self) -> bool:
        """Whether it will end by itself with what is done."""
        if self._course is None or self._course.is_stopped:
            return False
        self._course.is_stopped = True
        return True

    def step(self, budget_s: float) -> str | None:
        started = time.perf_counter()
        try:
            while time.perf_counter() - started < budget_s:
                self._fraction = max(self._fraction, next(self._work))
        except StopIteration:
            early = " It was stopped early, and is what was done until then." if self.is_stopped else ""
            return self._told(self._finished + early)
        return None

    def cancel(self) -> str:
        close = getattr(self._work, "close", None)
        if close is not None:
            close()
        return self._told(self._cancelled)

    def _told(self, sentence: str) -> str:
        """With what the pictures say of themselves."""
        notices = self._notices.lines(of_frames=self._frames > 1)
        return " ".join([sentence, *(f"Note: {notice}." for notice in notices)])

    def _text(self) -> str:
        if self.is_stopped:
            return "Finishing with what is done so far"
        phase = "tracing photons and taking camera samples" if self._course is None else self._course.phase
        frame = (
            f"Frame {min(int(self._fraction * self._frames) + 1, self._frames)} of {self._frames}"
            if self._frames
            else phase[:1].upper() + phase[1:]
        )
        left = self._left_s()
        return frame if left is None else f"{frame}, {left_words(left, datetime.now().astimezone())}"

    def _left_s(self) -> float | None:
        """Seconds until it ends at the pace so far; None where that is not known yet."""
        worked = time.monotonic() - self._started_s
        if self._seconds is not None:
            return max(self._seconds - worked, 0.0)
        return None if self._fraction < 0.02 else worked * (1.0 - self._fraction) / self._fraction


def left_words(left_s: float, now: datetime) -> str:
    """ "about 40 s left, until 14:05"."""
    about = f"{left_s:.0f} s" if left_s < 90 else f"{left_s / 60:.0f} min"
    return f"about {about} left, until {now + timedelta(seconds=left_s):%H:%M}"


def save_screenshot(path: Path, shown: Shown) -> str:
    """Write what is shown: .png, .jpg and .webp as on the screen, .exr and .npy linear without tone curve. Returns the
    sentence to tell."""
    if check_suffix(path) in SHOWN_SUFFIXES:
        check_finite(path.name, _texels(shown.radiance))
        write_codes(path, texture_codes(shown.codes))
    else:
        write_image(path, _texels(shown.radiance))
    return f"Saved {path.name}."


def write_codes(path: Path, codes: np.ndarray) -> None:
    """Write uint8 (H, W, 3) sRGB codes, row 0 on top; for pictures of the whole window too."""
    with atomic_output(path) as temporary:
        save_codes(temporary, codes)


def texture_codes(texture: moderngl.Texture) -> np.ndarray:
    """uint8 (H, W, 3) of an RGBA8 texture whose row 0 is the top."""
    raw = np.frombuffer(texture.read(alignment=1), np.uint8)
    return np.ascontiguousarray(raw.reshape(texture.height, texture.width, 4)[..., :3])


def _texels(texture: moderngl.Texture) -> np.ndarray:
    texels = np.empty((texture.height, texture.width, 4), np.float32)
    texture.read_into(texels)
    return np.ascontiguousarray(texels[..., :3])


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

    if check_suffix(path) != ".exr":
        raise UserError(f"cannot write {path}: spectral channels need an .exr")
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
