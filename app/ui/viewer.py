"""A session as a window or the headless interface shows it: draw function and pace, when to draw and when to wait."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from imgui_bundle import imgui

from .frame import Draw, run_frame
from .headless import HeadlessInterface
from .screenshot import write_codes
from .session import Session
from .shell import draw_interface

SOFTWARE_FRAME_S = 0.04
"""A frame on the software renderer: with the batch that runs over its end, within the 50 ms in which input must
have its effect."""
PATIENT_FRAME_S = 0.15
"""While nothing is touched: what the interface costs, on two cores more than half of a frame, is then spent less
often. Input and a new picture end it, or else half of the interface's frames would show what the last one did."""
LIGHT_SHARE = 3.0
"""Time of the engine over what the interface costs, at least, while nothing is touched …"""
LONGEST_PATIENT_S = 0.3
"""… but no longer: what is written in the window changes meanwhile."""
GPU_SHARE = 0.75
"""Share of the time between two pictures of the screen; the rest is the driver's and the window system's."""
MIN_SHARE = 0.25
"""Share of a frame that the engine always gets: a slow interface must not stop the light."""
_SMOOTHING = 0.2


class Pace:
    """`budget_s` for the next frame, from what the last ones cost without the engine."""

    def __init__(self, is_software: bool, refresh_s: float = 1 / 60) -> None:
        self._is_software = is_software
        self.frame_s = SOFTWARE_FRAME_S if is_software else GPU_SHARE * refresh_s
        self._besides_s = self._patient_besides_s = 0.0

    @property
    def budget_s(self) -> float:
        """Seconds for the engine."""
        return self._left_of(self.frame_s)

    @property
    def patient_budget_s(self) -> float:
        """The same while nothing is touched."""
        if not self._is_software:
            return self.budget_s
        least = min(LIGHT_SHARE * self._patient_besides_s, LONGEST_PATIENT_S)
        return max(self._left_of(max(self.frame_s, PATIENT_FRAME_S)), least)

    def _left_of(self, frame_s: float) -> float:
        return max(frame_s - self._besides_s, MIN_SHARE * frame_s)

    def note(self, besides_s: float) -> None:
        """A frame took `besides_s` seconds in addition to the engine's work (without waiting for the screen)."""
        # One long frame (a file was read) says nothing about the next.
        self._besides_s += _SMOOTHING * (min(besides_s, self.frame_s) - self._besides_s)
        self._patient_besides_s += _SMOOTHING * (min(besides_s, PATIENT_FRAME_S) - self._patient_besides_s)


class Viewer:
    """A session with the function that draws it and the pace of its frames."""

    def __init__(self, session: Session, draw: Draw = draw_interface, refresh_s: float = 1 / 60) -> None:
        self.session = session
        self.pace = Pace(session.context.is_software, refresh_s)
        session.wanted_hz = 1.0 / (SOFTWARE_FRAME_S if session.context.is_software else refresh_s)
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
            codes = take_picture()
            self.session.jobs.exports.write(path, lambda: write_codes(path, codes))

    @property
    def title(self) -> str:
        """ "prism.toml* – SpectraSplat"."""
        document = self.session.document
        return f"{document.title}{'*' if document.unsaved else ''} – SpectraSplat"


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
        preferences=lambda: viewer.session.state.preferences,
    )
