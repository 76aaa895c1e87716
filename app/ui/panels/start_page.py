"""The first thing seen: scenes as cards, recent files, the work of a session that crashed, and where to drop a file."""

from __future__ import annotations

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from ...edit.autosave import Recovery
from ...edit.requests import Recover
from ...edit.state import State
from .. import item_rects, layout, theme
from ..view_model import SceneEntry, ViewModel
from . import dialogs, lesson_panel, messages, widgets

_CARD_EM, _GAP_EM = 17.0, 1.1
_ASPECT = 9 / 16


def draw_start_page(state: State, view_model: ViewModel) -> State:
    """Draw the page over the whole window below the menu bar; it closes itself when something is opened."""
    viewport = imgui.get_main_viewport()
    padding = imgui.ImVec2(theme.em(2.2), theme.em(1.6))
    layout.begin_area("##start page", viewport.work_pos, viewport.work_size, padding)
    _title(view_model)
    if view_model.recovery is not None:
        state = _recovery(state, view_model.recovery)
    imgui.dummy(imgui.ImVec2(0, max(theme.em(0.4), messages.end_on_start_page["y"] - imgui.get_cursor_screen_pos().y)))
    imgui.begin_child("##side", imgui.ImVec2(theme.em(15), 0))
    state = _side(state, view_model)
    imgui.end_child()
    imgui.same_line(0, theme.em(2))
    imgui.begin_child("##cards", imgui.ImVec2(0, 0))
    state = _cards(state, view_model)
    imgui.end_child()
    imgui.end()
    return state


def _title(view_model: ViewModel) -> None:
    with theme.heading(1.9):
        imgui.text_unformatted("SpectraSplat")
    widgets.hint(
        "See the coloured light that glass makes, and change the glass while you look. Click a scene or a lesson to "
        "begin; drop a scene, a GLB or a mesh of your own on the window."
    )
    if view_model.stats.renderer:
        widgets.hint(f"Draws with {view_model.stats.renderer}")


def _recovery(state: State, recovery: Recovery) -> State:
    chosen = theme.palette()
    imgui.dummy(imgui.ImVec2(0, theme.em(0.3)))
    imgui.push_style_color(imgui.Col_.child_bg, chosen.raised)
    imgui.push_style_color(imgui.Col_.border, chosen.warning)
    flags = imgui.ChildFlags_.borders | imgui.ChildFlags_.auto_resize_y | imgui.ChildFlags_.always_use_window_padding
    imgui.begin_child("##recovery", imgui.ImVec2(min(theme.em(44), imgui.get_content_region_avail().x), 0), flags)
    with theme.coloured(chosen.warning), theme.heading():
        imgui.text_unformatted(f"{icons.ICON_FA_TRIANGLE_EXCLAMATION}  Unsaved work was found")
    whose = f"{recovery.note.title}, as of {recovery.written}."
    widgets.hint(f"{whose} That session ended without saving. Recover it, or discard it for good.")
    if widgets.button(
        "Recover", tip="Open the work as it was last written, at most 30 s before the end.", width=theme.em(7)
    ):
        state = state.asking(Recover()).with_panels(start_page=False)
    imgui.same_line()
    if widgets.button("Discard##recovery", tip="Delete the recovered work.", width=theme.em(7)):
        state = state.asking(Recover(discard=True))
    imgui.end_child()
    imgui.pop_style_color(2)
    return state


def _side(state: State, view_model: ViewModel) -> State:
    if widgets.button(f"{icons.ICON_FA_FOLDER_OPEN}  Open…", tip="Scenes, glTF and meshes (Ctrl+O).", width=-1):
        state = dialogs.open_file(state, view_model)
    if widgets.button(f"{icons.ICON_FA_FILE}  New scene", tip="Start from the default scene (Ctrl+N).", width=-1):
        state = dialogs.new_scene(state, view_model)
    if widgets.button(f"{icons.ICON_FA_ARROW_RIGHT}  Continue", tip=f"On with {view_model.title}.", width=-1):
        state = state.with_panels(start_page=False)
    imgui.dummy(imgui.ImVec2(0, theme.em(0.5)))
    with theme.heading():
        imgui.text_unformatted("Lessons")
    state = lesson_panel.draw_lesson_items(state, view_model)
    imgui.dummy(imgui.ImVec2(0, theme.em(0.5)))
    with theme.heading():
        imgui.text_unformatted("Recent")
    if not view_model.recent:
        widgets.hint("Files that you open or save appear here.")
    for index, path in enumerate(view_model.recent):
        pressed, _ = imgui.selectable(f"{view_model.called(path)}##recent {index}", False)
        item_rects.note(f"Recent: {path.name}")
        widgets.tooltip(str(path))
        if pressed:
            state = dialogs.open_path(state, view_model, path)
    return state


def _cards(state: State, view_model: ViewModel) -> State:
    if not view_model.scenes:
        widgets.hint("No scenes were found.")
        return state
    room, gap = imgui.get_content_region_avail().x, theme.em(_GAP_EM)
    columns = max(1, int((room + gap) / (theme.em(_CARD_EM) + gap)))
    width = (room - gap * (columns - 1)) / columns
    width = min(width, theme.em(_CARD_EM * 1.6))
    for index, entry in enumerate(view_model.scenes):
        if index % columns:
            imgui.same_line(0, gap)
        imgui.push_id(index)
        pressed = _card(entry, width)
        imgui.pop_id()
        if pressed:
            state = dialogs.open_path(state, view_model, entry.path)
        if index % columns == columns - 1:
            imgui.dummy(imgui.ImVec2(0, theme.em(0.3)))
    return state


def _card(entry: SceneEntry, width: float) -> bool:
    """A picture, a title and two lines of words; True when clicked."""
    padding, line = theme.em(0.6), imgui.get_text_line_height_with_spacing()
    picture_height = width * _ASPECT
    height = picture_height + 3 * line + 2 * padding
    start = imgui.get_cursor_screen_pos()
    pressed = imgui.invisible_button("##card", imgui.ImVec2(width, height))
    item_rects.note(entry.title)
    hovered = imgui.is_item_hovered()
    widgets.tooltip(entry.description or entry.title, str(entry.path.name))
    chosen, drawing = theme.palette(), imgui.get_window_draw_list()
    end = imgui.ImVec2(start.x + width, start.y + height)
    rounding = theme.em(0.4)
    drawing.add_rect_filled(start, end, theme.packed(chosen.frame if hovered else chosen.raised), rounding)
    _picture(drawing, entry, start, imgui.ImVec2(end.x, start.y + picture_height), rounding)
    drawing.add_rect(start, end, theme.packed(chosen.accent if hovered else chosen.border), rounding)
    left, top = start.x + padding, start.y + picture_height + padding
    drawing.add_text(
        theme.bold() or imgui.get_font(),
        imgui.get_font_size(),
        imgui.ImVec2(left, top),
        theme.packed(chosen.text),
        entry.title,
    )
    words = _first_lines(entry.description, width - 2 * padding, 2)
    for number, text in enumerate(words):
        drawing.add_text(imgui.ImVec2(left, top + (number + 1) * line), theme.packed(chosen.muted), text)
    return pressed


def _picture(
    drawing: imgui.ImDrawList, entry: SceneEntry, low: imgui.ImVec2, high: imgui.ImVec2, rounding: float
) -> None:
    if entry.thumbnail is None:
        drawing.add_rect_filled(low, high, theme.packed(theme.palette().canvas), rounding, imgui.ImDrawFlags_.round_top)
        return
    texture = imgui.ImTextureRef(entry.thumbnail)
    white = theme.packed((1.0, 1.0, 1.0, 1.0))
    drawing.add_image_rounded(texture, low, high, (0, 0), (1, 1), white, rounding, imgui.ImDrawFlags_.round_top)


def _first_lines(text: str, width: float, count: int) -> list[str]:
    """`text` broken at blanks into at most `count` lines of `width` pixels, the last one ending in … when more
    follows."""
    lines, words = [""], text.split()
    for position, word in enumerate(words):
        longer = f"{lines[-1]} {word}".strip()
        if imgui.calc_text_size(longer).x <= width or not lines[-1]:
            lines[-1] = longer
        elif len(lines) < count:
            lines.append(word)
        else:
            return [*lines[:-1], _shortened(" ".join([lines[-1], *words[position:]]), width)]
    return lines


def _shortened(text: str, width: float) -> str:
    """With … at the last blank that fits."""
    while " " in text and imgui.calc_text_size(f"{text}…").x > width:
        text = text.rpartition(" ")[0]
    return f"{text.rstrip(' ,.;:')}…"
