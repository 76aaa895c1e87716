"""A session as a window or the headless interface shows it: draw function, pace, and nothing else."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from ..edit.state import Preferences
from .frame import Draw, run_frame
from .headless import HeadlessInterface
from .pace import Pace
from .session import Session
from .shell import draw_interface


class Viewer:
    """What a `Window` asks of its guest, answered by a `Session` (see `window.Guest`)."""

    def __init__(self, session: Session, draw: Draw = draw_interface, refresh_s: float = 1 / 60) -> None:
        self.session = session
        self.pace = Pace(session.context.is_software, refresh_s)
        self._draw = draw
        self._drawn_at = 0.0

    def prepare(self, interface_scale: float = 1.0, framebuffer_scale: float = 1.0) -> None:
        """Before a frame."""
        self.session.interface_scale, self.session.framebuffer_scale = interface_scale, framebuffer_scale
        self._drawn_at = time.perf_counter()
        self.session.prepare()

    def draw(self) -> None:
        """One frame."""
        if _is_touched() or self.session.was_interacting:
            run_frame(self.session, self._draw, self.pace.budget_s)
        else:
            run_frame(self.session, self._draw, self.pace.patient_budget_s, self.pace.frame_s)

    def rendered(self) -> None:
        """imgui has drawn; the screen has not been waited for."""
        self.pace.note(time.perf_counter() - self._drawn_at - self.session.engine_s - self.session.jobs_s)

    def finished(self, take_picture: Callable[[], np.ndarray]) -> None:
        """The frame is on the screen; `take_picture` gives it as uint8 (h, w, 3), top row first."""
        self.session.finished()
        if self.session.window_picture is not None:
            path, self.session.window_picture = self.session.window_picture, None
            self.session.write_window_picture(path, take_picture())

    def wait_s(self) -> float:
        """Seconds the window may sleep."""
        return self.session.wait_s()

    def drop(self, paths: list[Path]) -> None:
        """Files were dropped."""
        self.session.drop(paths)

    def ask_to_close(self) -> None:
        """The close button."""
        self.session.ask_to_close()

    @property
    def preferences(self) -> Preferences:
        """Theme and scale."""
        return self.session.state.preferences

    @property
    def title(self) -> str:
        """ "prism.toml* – SpectraSplat"."""
        document = self.session.document
        return f"{document.title}{'*' if document.unsaved else ''} – SpectraSplat"

    @property
    def is_full_screen(self) -> bool:
        """Whether the window should cover the screen."""
        return self.session.is_full_screen

    @property
    def wants_to_close(self) -> bool:
        """The window may close."""
        return self.session.wants_to_close


def _is_touched() -> bool:
    """Whether the mouse moves, or holds something, in this frame."""
    io = imgui.get_io()
    return (
        io.mouse_delta.x != 0.0
        or io.mouse_delta.y != 0.0
        or io.mouse_wheel != 0.0
        or any(io.mouse_down)
        or imgui.is_any_item_active()
    )


def headless_viewer(viewer: Viewer, size: tuple[int, int] = (1280, 720)) -> HeadlessInterface:
    """`viewer` in a windowless interface of `size` pixels. Its session stays the caller's to release."""
    return HeadlessInterface(
        viewer.session.context,
        viewer.draw,
        size,
        prepare=viewer.prepare,
        rendered=viewer.rendered,
        finished=viewer.finished,
        preferences=lambda: viewer.preferences,
    )
