"""The interface in a glfw window: events in, frames out, and nothing at all while nothing changes.

The window knows a `Viewer`, which draws one frame within imgui and says how long it can wait for the next; everything
else here is glfw.
"""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from imgui_bundle import imgui  # before glfw: it brings the GLFW that both then use

import glfw  # isort: skip

from ..base.errors import UserError
from ..base.paths import reserve_driver_cache
from ..edit.preferences import WindowPlace
from ..gpu.context import GL_VERSION, GL_VERSION_CODE, Context
from ..gpu.context_thread import ContextThread
from ..gpu.linker import adopting_context
from . import theme
from .imgui_host import ImguiHost

if TYPE_CHECKING:
    from ..render.viewer.engine import LiveEngine
    from ..render.viewer.threaded_engine import ThreadedEngine
    from .viewer import Viewer

SETTLE_FRAMES = 3
"""Frames drawn after an event before waiting again: imgui's layout and hovering need two."""
MIN_SIDE = 320
MODIFIER_KEYS = frozenset(range(glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SUPER + 1))
SHIFTS = (glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT)
LETTERS = frozenset((*range(glfw.KEY_SPACE, glfw.KEY_WORLD_2 + 1), *range(glfw.KEY_KP_0, glfw.KEY_KP_ENTER), *SHIFTS))
"""Keys whose presses come as characters too."""
COMMANDS = glfw.MOD_CONTROL | glfw.MOD_ALT | glfw.MOD_SUPER
ANSWER_FRAMES, DIALOGUE_FRAMES = 3, 5
"""From a command or a click until a dialogue that it opens is there, and until that one's field takes what is typed."""
NO_DISPLAY = "there is no display to open a window on: 'spectrasplat render SCENE -o OUT.png' needs none"


class GlfwLoader:
    """Finds OpenGL's functions through GLFW, however it made its context (GLX, EGL, WGL)."""

    def load(self, name: str) -> int:
        """Address of the OpenGL function `name`, 0 when unknown."""
        address: Any = glfw.get_proc_address(name)
        return address or 0

    def release(self) -> None:
        """The window owns the context."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        """Stays current."""


class Window:
    """One window with its OpenGL context, current from here on; a context manager.

    Raises `UserError` without a display or without OpenGL 4.3.
    """

    def __init__(self, place: WindowPlace | None = None, visible: bool = True) -> None:
        place = place or WindowPlace()
        self._handle = _create(place, visible)
        glfw.make_context_current(self._handle)
        self.context = Context(adopting_context(GlfwLoader(), GL_VERSION_CODE), "window")
        # A GPU waits for the screen; on the processor waiting would be time taken from the photons.
        glfw.swap_interval(0 if self.context.is_software else 1)
        self._screen = self.context.ctx.detect_framebuffer(0)
        self._threads: list[ContextThread] = []
        self._hidden: list[Any] = []
        """Windows of these threads."""
        self._free: list[Any] = []
        """Those whose thread has ended."""
        self._engine: ThreadedEngine | None = None
        self._settling = SETTLE_FRAMES
        self._dropped: list[Path] = []
        self._close_pressed = False
        self._has_moved = False
        """The mouse, since the last frame: controls with others on them (rows with an eye) take no press before they
        were hovered for a frame."""
        self._has_event = False
        """Since the last frame began."""
        self._typed: list[Callable[[], None]] = []
        """Keys and characters that wait for what the last command or click opens."""
        self._answer_frames = 0
        self._pointer = ctypes.cast(self._handle, ctypes.c_void_p).value or 0
        self._listen()
        self._host = ImguiHost()
        imgui.backends.glfw_init_for_opengl(self._pointer, False)
        self._title = ""
        self._before_full_screen: tuple[int, int, int, int] | None = None
        """Position and size to go back to; None while it is a window."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.release()

    def release(self) -> None:
        """Close the window; its context is gone with it."""
        self._host.make_current()
        imgui.backends.glfw_shutdown()
        self._host.release()
        if self._engine is not None:  # also where an error ended the session
            with suppress(Exception):
                self._engine.release()
        for thread in self._threads:
            with suppress(Exception):
                thread.close()
        for hidden in self._hidden:
            glfw.destroy_window(hidden)
        glfw.destroy_window(self._handle)
        glfw.terminate()

    def engine(self, context: Context) -> LiveEngine | ThreadedEngine:
        """One that works beside the window, which is drawn while the driver compiles; one at a time. Where the driver
        shares nothing, the window waits for it."""
        from ..render.viewer.engine import LiveEngine
        from ..render.viewer.threaded_engine import ThreadedEngine

        thread = self.open_thread("engine")
        if thread is None:
            return LiveEngine(context)
        self._engine = ThreadedEngine(context, thread)
        return self._engine

    def open_thread(self, name: str) -> ContextThread | None:
        """A thread with a context that shares the window's objects; None where the driver shares nothing."""
        hidden = self._free.pop() if self._free else _beside(self._handle)
        if hidden is None:
            return None
        if hidden not in self._hidden:
            self._hidden.append(hidden)
        thread = ContextThread(lambda: _entered(hidden), lambda: self._left(hidden), name)
        self._threads.append(thread)
        return thread

    def _left(self, hidden: Any) -> None:
        """On a thread, at its end."""
        no_window: Any = None
        glfw.make_context_current(no_window)
        self._free.append(hidden)

    def hide(self) -> None:
        """Out of sight at once: what is freed before the end may have to wait for the driver."""
        glfw.hide_window(self._handle)
        glfw.poll_events()

    @property
    def place(self) -> WindowPlace:
        """To be remembered; of a full screen, where it was before."""
        if self._before_full_screen is not None:
            x, y, width, height = self._before_full_screen
            return WindowPlace((x, y), (width, height), False)
        width, height = glfw.get_window_size(self._handle)
        maximised = bool(glfw.get_window_attrib(self._handle, glfw.MAXIMIZED))
        if glfw.get_platform() == glfw.PLATFORM_WAYLAND:  # windows there do not know where they are
            return WindowPlace(None, (width, height), maximised)
        x, y = glfw.get_window_pos(self._handle)
        return WindowPlace((x, y), (width, height), maximised)

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        """Device pixels."""
        width, height = glfw.get_framebuffer_size(self._handle)
        return width, height

    @property
    def interface_scale(self) -> float:
        """Interface pixels per logical pixel: 2 on a HiDPI screen where imgui counts device pixels, else 1."""
        content = glfw.get_window_content_scale(self._handle)[0]
        window, framebuffer = glfw.get_window_size(self._handle)[0], self.framebuffer_size[0]
        return content if not window or framebuffer == window else content * window / framebuffer

    @property
    def refresh_s(self) -> float:
        """Time between two pictures of the screen, seconds."""
        monitor = glfw.get_primary_monitor()
        mode = glfw.get_video_mode(monitor) if monitor else None
        return 1.0 / mode.refresh_rate if mode and mode.refresh_rate else 1 / 60

    def run(self, viewer: Viewer, until: Callable[[], bool] = lambda: False) -> None:
        """Show `viewer` until it wants to close, or until `until()`."""
        while not viewer.session.wants_to_close and not until():
            self._take_events(viewer)
            if glfw.get_window_attrib(self._handle, glfw.ICONIFIED):
                # Nothing to be seen: the picture waits, files and jobs go on.
                time.sleep(0.05)
            self.frame(viewer)

    def input_waits(self) -> bool:
        """Whether anything has happened that the frame which is being drawn does not know of: imgui keeps it for the
        next one."""
        glfw.poll_events()
        return self._has_event

    def frame(self, viewer: Viewer) -> None:
        """Draw one frame and show it."""
        self._host.make_current()
        self._has_moved = self._has_event = False
        self._answer_frames -= 1
        waiting, self._typed = self._typed, []
        for typed in waiting:
            self._type(typed)
        width = max(glfw.get_window_size(self._handle)[0], 1)
        viewer.prepare(self.interface_scale, self.framebuffer_size[0] / width)
        theme.apply(viewer.session.state.preferences, self.interface_scale)
        self._cover_screen(viewer.session.is_full_screen)
        if viewer.title != self._title:
            self._title = viewer.title
            glfw.set_window_title(self._handle, self._title)
        imgui.backends.glfw_new_frame()
        with self._host.frame():
            viewer.draw()
        self._screen.use()
        self._screen.viewport = (0, 0, *self.framebuffer_size)
        self._screen.clear(*theme.ground())
        self._host.render()
        if self.context.is_software:
            self.context.finish()
        viewer.rendered()
        glfw.swap_buffers(self._handle)
        viewer.finished(self.screenshot)

    def _cover_screen(self, wanted: bool) -> None:
        """Take the whole of the screen that the window is on, or go back to where it was."""
        if wanted == (self._before_full_screen is not None):
            return
        if self._before_full_screen is not None:
            x, y, width, height = self._before_full_screen
            self._before_full_screen = None
            no_monitor: Any = None
            glfw.set_window_monitor(self._handle, no_monitor, x, y, width, height, glfw.DONT_CARE)
        else:
            monitor = glfw.get_primary_monitor()
            mode = glfw.get_video_mode(monitor) if monitor else None
            if mode is None:
                return
            self._before_full_screen = (*glfw.get_window_pos(self._handle), *glfw.get_window_size(self._handle))
            glfw.set_window_monitor(self._handle, monitor, 0, 0, mode.size.width, mode.size.height, mode.refresh_rate)
        self.wake()

    def screenshot(self) -> np.ndarray:
        """The last frame, interface and all, uint8 (height, width, 3), top row first."""
        width, height = self.framebuffer_size
        # The window's own framebuffer need not keep what nobody sees, so the frame is drawn once more.
        texture = self.context.ctx.texture((width, height), 4)
        target = self.context.ctx.framebuffer([texture])
        target.use()
        target.clear(*theme.ground())
        self._host.render()
        data = target.read(components=3, alignment=1)
        self._screen.use()
        target.release()
        texture.release()
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1].copy()

    def wake(self) -> None:
        """Draw some frames even if no event comes."""
        self._settling = SETTLE_FRAMES

    def _take_events(self, viewer: Viewer) -> None:
        wait = 0.0 if self._settling > 0 else viewer.session.wait_s()
        self._settling = max(self._settling - 1, 0)
        if wait > 0:
            glfw.wait_events_timeout(wait)
        else:
            glfw.poll_events()
        if self._dropped:
            viewer.session.drop(self._dropped)
            self._dropped = []
        if self._close_pressed:
            self._close_pressed = False
            viewer.session.quit()

    def _listen(self) -> None:
        """Any event wakes the loop, and is passed on to imgui."""
        backend = imgui.backends

        def wake(*_event: object) -> None:
            self._has_event = True
            self.wake()

        def passed_on(to_imgui: Callable[..., None]) -> Callable[..., None]:
            def listen(_window: object, *event: float) -> None:
                wake()
                to_imgui(self._pointer, *event)

            return listen

        def key(_window: object, *event: int) -> None:
            wake()
            self._type(lambda: self._key(*event))

        def character(_window: object, code: int) -> None:
            wake()
            self._type(lambda: backend.glfw_char_callback(self._pointer, code))

        def button(_window: object, button: int, action: int, modifiers: int) -> None:
            wake()
            if action == glfw.PRESS and self._has_moved:
                self._host.keep_for_next_frame()
            if action == glfw.RELEASE:
                self._answer_frames = ANSWER_FRAMES
            backend.glfw_mouse_button_callback(self._pointer, button, action, modifiers)

        def moved(_window: object, x: float, y: float) -> None:
            wake()
            self._has_moved = True
            backend.glfw_cursor_pos_callback(self._pointer, x, y)

        glfw.set_key_callback(self._handle, key)
        glfw.set_char_callback(self._handle, character)
        glfw.set_mouse_button_callback(self._handle, button)
        glfw.set_cursor_pos_callback(self._handle, moved)
        glfw.set_cursor_enter_callback(self._handle, passed_on(backend.glfw_cursor_enter_callback))
        glfw.set_scroll_callback(self._handle, passed_on(backend.glfw_scroll_callback))
        glfw.set_window_focus_callback(self._handle, passed_on(backend.glfw_window_focus_callback))
        glfw.set_framebuffer_size_callback(self._handle, wake)
        glfw.set_window_refresh_callback(self._handle, wake)

        def dropped(_window: object, paths: list[str]) -> None:
            self._dropped += [Path(path) for path in paths]
            wake()

        def closing(_window: object) -> None:
            glfw.set_window_should_close(self._handle, False)
            self._close_pressed = True
            wake()

        glfw.set_drop_callback(self._handle, cast(Any, dropped))  # glfw passes a list, whatever its types say
        glfw.set_window_close_callback(self._handle, closing)

    def _type(self, typed: Callable[[], None]) -> None:
        """Do `typed` once a text field that is being opened can take it."""
        awaited = 0 if imgui.internal.get_top_most_popup_modal() is None else -DIALOGUE_FRAMES
        if self._typed or (self._answer_frames > awaited and not imgui.get_io().want_text_input):
            self._typed.append(typed)
        else:
            typed()

    def _key(self, key: int, scancode: int, action: int, modifiers: int) -> None:
        """Pass a key on to imgui. While a text is typed, letters are left to the characters that come with them: imgui
        takes a key's second change in a frame of its own, and a word would need as many frames as it has letters."""
        is_typing = imgui.get_io().want_text_input
        if is_typing and key in LETTERS and action != glfw.RELEASE and not modifiers & COMMANDS:
            return
        if action == glfw.RELEASE and key in MODIFIER_KEYS and not (is_typing and key in SHIFTS):
            self._host.keep_for_next_frame()
        if action == glfw.PRESS and modifiers & glfw.MOD_CONTROL and key not in MODIFIER_KEYS:
            self._answer_frames = ANSWER_FRAMES
        imgui.backends.glfw_key_callback(self._pointer, key, scancode, action, modifiers)


def _create(place: WindowPlace, visible: bool) -> Any:
    """A glfw window with an OpenGL 4.3 core context, or a `UserError`."""
    problems: list[str] = []
    glfw.set_error_callback(
        lambda _code, text: problems.append(text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text))
    )
    if not glfw.init():
        has_display = os.name != "posix" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
        raise UserError(f"{NO_DISPLAY} ({_first(problems)})" if has_display else NO_DISPLAY)
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, GL_VERSION[0])
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, GL_VERSION[1])
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
    glfw.window_hint(glfw.VISIBLE, visible)
    glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
    glfw.window_hint(glfw.MAXIMIZED, place.maximised)
    glfw.window_hint(glfw.DEPTH_BITS, 0)
    glfw.window_hint(glfw.STENCIL_BITS, 0)
    reserve_driver_cache()
    handle = glfw.create_window(*place.size, "SpectraSplat", None, None)
    if not handle:
        glfw.terminate()
        wanted = f"{GL_VERSION[0]}.{GL_VERSION[1]}"
        raise UserError(
            f"no window with OpenGL {wanted} could be opened ({_first(problems)}): update the graphics driver, "
            "or set LIBGL_ALWAYS_SOFTWARE=1 for the software renderer"
        )
    if glfw.get_platform() != glfw.PLATFORM_NULL:  # which takes the smallest side for the height
        glfw.set_window_size_limits(handle, MIN_SIDE, MIN_SIDE, glfw.DONT_CARE, glfw.DONT_CARE)
    _shrink_to_screen(handle)
    if place.position is not None and _is_on_a_screen(place.position, place.size[0]):
        glfw.set_window_pos(handle, *place.position)
    return handle


def _beside(window: Any) -> Any | None:
    """A hidden window whose context shares the objects of `window`'s, which stays current; None where there cannot be
    one. The hints are those of `window`."""
    glfw.window_hint(glfw.VISIBLE, False)
    glfw.window_hint(glfw.MAXIMIZED, False)
    no_monitor: Any = None
    return glfw.create_window(1, 1, "", no_monitor, window) or None


def _entered(hidden: Any) -> Context:
    """The context of a hidden window, made current on the thread that asks."""
    glfw.make_context_current(hidden)
    return Context(adopting_context(GlfwLoader(), GL_VERSION_CODE, unlocked=True), "window")


def _shrink_to_screen(handle: Any) -> None:
    """Make a window that is larger than any screen as large as the largest: where no window manager does it, panels at
    its right would be out of reach."""
    areas = [glfw.get_monitor_workarea(monitor)[2:] for monitor in glfw.get_monitors()]
    if not areas or glfw.get_window_attrib(handle, glfw.MAXIMIZED):
        return
    size = glfw.get_window_size(handle)
    fitting = tuple(min(side, max(sides)) for side, sides in zip(size, zip(*areas, strict=True), strict=True))
    if fitting != size and min(fitting) >= MIN_SIDE:
        glfw.set_window_size(handle, *fitting)


def _is_on_a_screen(position: tuple[int, int], window_width: int) -> bool:
    """Whether enough of the title bar can be reached: the screen of last time may be unplugged."""
    x, y = position
    for monitor in glfw.get_monitors():
        left, top, width, height = glfw.get_monitor_workarea(monitor)
        if left <= x + window_width - 80 and x + 80 <= left + width and top <= y <= top + height - 40:
            return True
    return False


def _first(problems: list[str]) -> str:
    return " ".join(problems[0].split()) if problems else "the driver gives no reason"
