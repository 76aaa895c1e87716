"""The whole interface without a window: an own framebuffer, a synthetic mouse and keyboard, pictures of the result.

Tests, screenshots and `bench-view` drive the interface through this, as a user would: by places
on the screen, or by the labels that widgets note in `item_rects`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Self

import numpy as np
from imgui_bundle import imgui

from ..edit.state import Preferences
from ..gpu.context import Context
from . import theme
from .imgui_host import ImguiHost
from .item_rects import ItemRect, Recorder, recording

Point = tuple[float, float]
FRAME_S = 1 / 60
"""Time that passes on the interface's clock in a frame: fixed, so that runs repeat."""


class HeadlessInterface:
    """An interface of `size` pixels whose frame is `draw()`.

    `prepare()` runs before each frame, `rendered()` and `finished()` after it, outside of imgui's; `preferences()`
    holds the theme. A context manager; `release()` frees it. `items` says where controls are.
    """

    def __init__(
        self,
        context: Context,
        draw: Callable[[], None],
        size: tuple[int, int] = (1280, 720),
        prepare: Callable[[], None] = lambda: None,
        rendered: Callable[[], None] = lambda: None,
        finished: Callable[[Callable[[], np.ndarray]], None] = lambda _take_picture: None,
        preferences: Callable[[], Preferences] = Preferences,
    ) -> None:
        self.size = size
        self.items = Recorder()
        self._context = context
        self._draw = draw
        self._prepare = prepare
        self._rendered = rendered
        self._finished = finished
        self._preferences = preferences
        self._host = ImguiHost()
        self._texture = context.ctx.texture(size, 4)
        self._framebuffer = context.ctx.framebuffer([self._texture])
        # In use between frames: moderngl binds again what was bound last, even once that is released.
        self._no_framebuffer = context.ctx.detect_framebuffer(0)
        io = imgui.get_io()
        io.display_size = imgui.ImVec2(*size)
        # A press and a release in one batch of events must not cancel each other out.
        io.config_input_trickle_event_queue = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.release()

    def release(self) -> None:
        """Free the imgui context and the framebuffer."""
        self._host.release()
        self._framebuffer.release()
        self._texture.release()

    def frame(self, count: int = 1) -> None:
        """Draw `count` frames."""
        for _ in range(count):
            self._one_frame()

    def _one_frame(self) -> None:
        self._host.make_current()
        self._prepare()
        theme.apply(self._preferences())
        imgui.get_io().delta_time = FRAME_S
        self.items.clear()
        with recording(self.items), self._host.frame():
            self._draw()
        self._framebuffer.use()
        self._framebuffer.clear(*theme.ground())
        self._host.render()
        self._no_framebuffer.use()
        self._context.finish()
        self._rendered()
        self._finished(self.screenshot)

    def screenshot(self) -> np.ndarray:
        """The last frame, uint8 (height, width, 3), top row first."""
        data = self._framebuffer.read(components=3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(self.size[1], self.size[0], 3)[::-1].copy()

    # Where things are

    def find(self, label: str) -> ItemRect:
        """The control noted as `label` or "Window/label" in the last frame; LookupError names those that are there."""
        item = self.items.items.get(label)
        if item is None:
            raise LookupError(
                f"no control '{label}' is drawn; there are {', '.join(sorted(self.items.items)) or 'none'}"
            )
        return item

    def _point(self, where: str | Point) -> Point:
        return self.find(where).centre if isinstance(where, str) else where

    # The mouse

    def move(self, where: str | Point) -> None:
        """Put the cursor on a control or a place (pixels from the top left), and draw a frame."""
        self.put_mouse(self._point(where))
        self.frame()

    def put_mouse(self, place: Point) -> None:
        """Put the cursor on a place, seen by the next frame."""
        self._host.make_current()
        imgui.get_io().add_mouse_pos_event(*place)

    def press(self, button: int = 0) -> None:
        """Press a mouse button: 0 left, 1 right, 2 middle."""
        imgui.get_io().add_mouse_button_event(button, True)
        self.frame()

    def let_go(self, button: int = 0) -> None:
        """Let go of a mouse button."""
        imgui.get_io().add_mouse_button_event(button, False)
        self.frame()

    def click(self, where: str | Point, button: int = 0, keys: Sequence[imgui.Key] = (), count: int = 1) -> None:
        """Click a control or a place, `count` times; `keys` are held meanwhile. One frame more for the answer."""
        with self.held(keys):
            self.move(where)
            for _ in range(count):
                self.press(button)
                self.let_go(button)
        self.frame()

    def drag(
        self, start: str | Point, end: Point, steps: int = 6, button: int = 0, keys: Sequence[imgui.Key] = ()
    ) -> None:
        """Press at `start`, move to `end` in `steps` frames, let go."""
        first = self._point(start)
        with self.held(keys):
            self.move(first)
            self.press(button)
            for step in range(1, steps + 1):
                share = step / steps
                self.move((first[0] + share * (end[0] - first[0]), first[1] + share * (end[1] - first[1])))
            self.let_go(button)
        self.frame()

    def drag_slider(self, label: str, start: float, end: float, steps: int = 6) -> None:
        """Drag on a slider's own rectangle, from one share of its width (0..1) to another."""
        item = self.find(label)
        self.drag(item.at(start), item.at(end), steps)

    def wheel(self, where: str | Point, amount: float, keys: Sequence[imgui.Key] = ()) -> None:
        """Turn the wheel over a control or a place; positive is away from the user."""
        with self.held(keys):
            self.move(where)
            imgui.get_io().add_mouse_wheel_event(0.0, amount)
            self.frame()
        self.frame()

    # The keyboard

    @contextmanager
    def held(self, keys: Sequence[imgui.Key]) -> Iterator[None]:
        """Keys, modifiers included (`imgui.Key.mod_ctrl`), are down within the block."""
        if not keys:
            yield
            return
        io = imgui.get_io()
        for key in keys:
            io.add_key_event(key, True)
        self.frame()
        try:
            yield
        finally:
            for key in reversed(keys):
                io.add_key_event(key, False)
            self.frame()

    def key(self, key: imgui.Key, modifiers: Sequence[imgui.Key] = ()) -> None:
        """Press and let go of a key."""
        with self.held([*modifiers, key]):
            pass
        self.frame()

    def type(self, text: str) -> None:
        """Type into the field that has the focus."""
        imgui.get_io().add_input_characters_utf8(text)
        # imgui processes one character event a frame while keys change.
        self.frame(2)
