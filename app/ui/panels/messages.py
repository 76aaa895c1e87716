"""Sentences from the host in the corner: notices fade, errors stay until they are closed; shader errors in a window."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from ...edit.requests import DismissMessage, ReloadShaders
from ...edit.state import State
from .. import item_rects, theme
from ..line_breaks import broken
from ..view_model import Message, ViewModel
from . import status_bar, widgets

_FADE_FROM_S, _FADE_S = 4.5, 1.5
_BARE = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
    | imgui.WindowFlags_.no_docking
    | imgui.WindowFlags_.no_move
)
_SHADER_WINDOW = "Shader error"

_closed_shader_error = {"text": ""}
"""The shader error whose window was closed: it comes back with the next, different one."""


def draw_messages(state: State, view_model: ViewModel) -> State:
    """Draw what there is to say, newest at the bottom of the right corner."""
    state = _shader_error(state, view_model)
    viewport = imgui.get_main_viewport()
    bottom = viewport.work_pos.y + viewport.work_size.y - status_bar.height() - theme.em(0.6)
    right = viewport.work_pos.x + viewport.work_size.x - theme.em(0.8)
    for index in reversed(range(len(view_model.messages))):
        message = view_model.messages[index]
        imgui.set_next_window_pos((right, bottom), imgui.Cond_.always, imgui.ImVec2(1.0, 1.0))
        state, height = _toast(state, message, index)
        bottom -= height + theme.em(0.4)
    return state


def _toast(state: State, message: Message, index: int) -> tuple[State, float]:
    opacity = 1.0 if message.is_error else min(max(1.0 - (message.age_s - _FADE_FROM_S) / _FADE_S, 0.15), 1.0)
    chosen = theme.palette()
    accent = chosen.error if message.is_error else chosen.accent
    imgui.push_style_var(imgui.StyleVar_.alpha, opacity)
    imgui.push_style_color(imgui.Col_.border, accent)
    imgui.push_style_color(imgui.Col_.window_bg, (*chosen.raised[:3], 0.97))
    imgui.begin(f"##message {index}", None, _BARE)
    imgui.internal.bring_window_to_display_front(imgui.internal.get_current_window())
    with theme.coloured(accent):
        imgui.text_unformatted(icons.ICON_FA_TRIANGLE_EXCLAMATION if message.is_error else icons.ICON_FA_CIRCLE_INFO)
    imgui.same_line()
    width = theme.em(28)
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width)  # for names that are wider than that
    imgui.text_unformatted(broken(message.text, width, lambda text: imgui.calc_text_size(text).x))
    imgui.pop_text_wrap_pos()
    if message.is_error:
        imgui.same_line(0, theme.em(0.8))
        if imgui.small_button(f"{icons.ICON_FA_XMARK}##close"):
            state = state.asking(DismissMessage(message.text))
        item_rects.note(f"Close message {index}")
        widgets.tooltip("Close this message.")
    height = imgui.get_window_height()
    imgui.end()
    imgui.pop_style_color(2)
    imgui.pop_style_var()
    return state, height


def _shader_error(state: State, view_model: ViewModel) -> State:
    text = view_model.shader_error
    if text is None:
        _closed_shader_error["text"] = ""
        return state
    if text == _closed_shader_error["text"]:
        return state
    imgui.set_next_window_size((theme.em(46), theme.em(16)), imgui.Cond_.appearing)
    centre = imgui.get_main_viewport().get_center()
    imgui.set_next_window_pos(centre, imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
    flags = imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_collapse
    shown, stays = imgui.begin(_SHADER_WINDOW, True, flags)
    if shown:
        widgets.hint("A shader does not compile. The last good one draws on; saving the file compiles it again.")
        footer = imgui.get_frame_height_with_spacing()
        imgui.begin_child("##log", imgui.ImVec2(0, -footer), imgui.ChildFlags_.borders)
        imgui.push_text_wrap_pos(0.0)
        with theme.coloured(theme.palette().error):
            imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_child()
        if widgets.button("Compile again", tip="Compile the shaders from disk again (F5)."):
            state = state.asking(ReloadShaders())
        imgui.same_line()
        if widgets.button("Copy text", tip="Put file, line and message on the clipboard."):
            imgui.set_clipboard_text(text)
    imgui.end()
    if not stays:
        _closed_shader_error["text"] = text
    return state
