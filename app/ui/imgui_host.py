"""One imgui and one implot context with the OpenGL backend, and what every use of them must not forget.

Used by the window and by the headless interface. Nothing is ever written to the current folder.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import imgui, implot

from . import theme

GLSL_VERSION = "#version 430"


class ImguiHost:
    """Owns the contexts; they are current once this is made. An OpenGL context must be current."""

    def __init__(self) -> None:
        self._imgui = imgui.create_context()
        imgui.set_current_context(self._imgui)
        self._implot = implot.create_context()
        implot.set_current_context(self._implot)
        io = imgui.get_io()
        io.set_ini_filename("")
        io.set_log_filename("")
        io.config_flags |= imgui.ConfigFlags_.docking_enable.value
        io.config_windows_move_from_title_bar_only = True
        if not imgui.backends.opengl3_init(GLSL_VERSION):
            raise RuntimeError("imgui's OpenGL backend did not start")
        theme.set_up()
        self._is_released = False

    def make_current(self) -> None:
        """Make the contexts current, where several interfaces live side by side."""
        imgui.set_current_context(self._imgui)
        implot.set_current_context(self._implot)

    @contextmanager
    def frame(self) -> Iterator[None]:
        """imgui calls belong into this block.

        An exception in it ends the frame in good order (open windows are closed) and is raised again.
        """
        imgui.backends.opengl3_new_frame()
        imgui.new_frame()
        opened = imgui.internal.ErrorRecoveryState()
        imgui.internal.error_recovery_store_state(opened)
        try:
            yield
        except BaseException:
            io = imgui.get_io()
            io.config_error_recovery_enable_assert = False
            imgui.internal.error_recovery_try_to_recover_state(opened)
            io.config_error_recovery_enable_assert = True
            imgui.end_frame()
            raise
        imgui.render()

    def keep_for_next_frame(self) -> None:
        """Input from here on waits for the frame after the next.

        For frames that take longer than a keystroke. Before a modifier is released: Ctrl would else be up again in the
        very frame in which the letter is pressed, and Ctrl+R would be R. Before a mouse button is pressed where the
        mouse has just arrived: some controls must be hovered first. imgui handles a key's second change in a frame of
        its own, so a key that no keyboard has is pressed and released.
        """
        self.make_current()
        io = imgui.get_io()
        io.add_key_event(imgui.Key.f24, True)
        io.add_key_event(imgui.Key.f24, False)

    def render(self) -> None:
        """Draw the last frame into the framebuffer in use."""
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    def release(self) -> None:
        """Free everything (once)."""
        if self._is_released:
            return
        self._is_released = True
        self.make_current()
        imgui.backends.opengl3_shutdown()
        implot.destroy_context(self._implot)
        imgui.destroy_context(self._imgui)
