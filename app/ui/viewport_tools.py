"""What is drawn over the picture and clicked: the tools, play and pause, the physical switch, badges that say what one
sees."""

from __future__ import annotations

from dataclasses import dataclass, replace

from imgui_bundle import ImVec2, imgui
from imgui_bundle import icons_fontawesome_6 as icons

from ..edit.state import State, Tool
from . import item_rects, theme
from .commands import command
from .gizmo import Gizmo
from .panels.brush_panel import NOT_PHYSICAL
from .panels.rows import tooltip
from .panels.status_bar import preparing_words
from .view_model import ViewModel

MARGIN_EM = 0.6
_BUTTON_EM = 1.9
_GAP_EM = 0.55
_TOOLS: tuple[tuple[Tool, str, str], ...] = (
    ("select", "Select", icons.ICON_FA_ARROW_POINTER),
    ("move", "Move", icons.ICON_FA_UP_DOWN_LEFT_RIGHT),
    ("rotate", "Rotate", icons.ICON_FA_ROTATE),
    ("scale", "Scale", icons.ICON_FA_UP_RIGHT_AND_DOWN_LEFT_FROM_CENTER),
    ("brush", "Dispersion brush", icons.ICON_FA_PAINTBRUSH),
    ("pull", "Pull a colour", icons.ICON_FA_EYE_DROPPER),
    ("measure", "Measure", icons.ICON_FA_RULER_COMBINED),
)


@dataclass(frozen=True)
class Badge:
    """A few words on how the picture differs from the scene."""

    text: str
    tip: str
    is_warning: bool = True


def draw_toolbar(state: State, gizmo: Gizmo, left: float, top: float) -> State:
    """The column of tools with its upper left corner at (left, top), pixels."""
    size, gap = theme.em(_BUTTON_EM), theme.em(_GAP_EM)
    y = top + theme.em(MARGIN_EM)
    x = left + theme.em(MARGIN_EM)
    _ground(x, y, size, len(_TOOLS))
    for tool, name, icon in _TOOLS:
        what = command(name)
        if _button(name, icon, x, y, state.tool == tool, what.tip, what.keys):
            state = replace(state, tool=tool)
        y += size
    y += gap
    if state.tool in ("move", "rotate"):
        _ground(x, y, size, 1)
        shown, other = ("object", "world") if gizmo.is_local else ("world", "object")
        icon, tip = icons.ICON_FA_CUBE if gizmo.is_local else icons.ICON_FA_GLOBE, f"The gizmo shows the {shown}'s axes"
        tip = f"{tip}; click for the {other}'s."
        if _button("Gizmo axes", icon, x, y, gizmo.is_local, tip, ()):
            gizmo.is_local = not gizmo.is_local
        y += size + gap
    if state.tool in ("move", "rotate", "scale"):
        _ground(x, y, size, 1)
        tip = "Handles move in steps; Ctrl moves freely." if gizmo.is_snapping else "Move in steps, as Ctrl does."
        if _button("Snapping", icons.ICON_FA_MAGNET, x, y, gizmo.is_snapping, tip, ()):
            gizmo.is_snapping = not gizmo.is_snapping
        y += size + gap
    _ground(x, y, size, 2)
    what = command("Accumulate photons")
    name, icon, tip = ("Play", icons.ICON_FA_PLAY, "Continue accumulating photons.")
    if state.playing:
        name, icon, tip = ("Pause", icons.ICON_FA_PAUSE, "Pause: keep the picture as it is.")
    if _button(name, icon, x, y, not state.playing, tip, what.keys):
        state = replace(state, playing=not state.playing)
    what = command("Physical picture")
    if _button("Physical picture", icons.ICON_FA_FLASK, x, y + size, state.physical, what.tip, what.keys):
        state = replace(state, physical=not state.physical)
    return state


def _ground(x: float, y: float, size: float, count: int) -> None:
    palette, rounding = theme.palette(), imgui.get_style().frame_rounding + 1.0
    low, high = ImVec2(x - 1, y - 1), ImVec2(x + size + 1, y + count * size + 1)
    imgui.get_window_draw_list().add_rect_filled(low, high, theme.packed(palette.window, 0.82), rounding)
    imgui.get_window_draw_list().add_rect(low, high, theme.packed(palette.border, 0.6), rounding)


def _button(name: str, icon: str, x: float, y: float, is_on: bool, tip: str, keys: tuple[str, ...]) -> bool:
    palette, size = theme.palette(), theme.em(_BUTTON_EM)
    imgui.set_cursor_screen_pos(ImVec2(x, y))
    clear = imgui.ImVec4(0, 0, 0, 0)
    imgui.push_style_color(imgui.Col_.button, imgui.ImVec4(*palette.accent[:3], 0.85) if is_on else clear)
    imgui.push_style_color(imgui.Col_.button_hovered, imgui.ImVec4(*(palette.accent if is_on else palette.frame)))
    imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(1, 1, 1, 1) if is_on else imgui.ImVec4(*palette.text))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0, 0))
    pressed = imgui.button(f"{icon}##{name}", ImVec2(size, size))
    imgui.pop_style_var()
    imgui.pop_style_color(3)
    item_rects.note(name)
    tooltip(name, tip, f"Key: {keys[0]}" if keys else "")
    return pressed


def badges(state: State, view_model: ViewModel) -> list[Badge]:
    """What must be said of the present picture."""
    stats, compare, found = view_model.stats, state.compare, []

    def say(text: str, tip: str, is_warning: bool = True) -> None:
        found.append(Badge(text, tip, is_warning))

    if any(item.local_dispersion for item in state.scene.objects):
        if state.physical:
            tip = "What the dispersion brush painted is kept but not shown. V brings it back."
            say("Physical: local gain left out", tip, False)
        else:
            tip = "The dispersion brush has changed how far colours spread on a receiver. V shows the physical picture."
            say(NOT_PHYSICAL, tip)
    if stats.differs == "moved":
        tip = (
            "Light follows what is held by a few photons; let go, and it is traced properly. Soft light of an "
            "environment stays where it was until then."
        )
        say("A few photons while it moves", tip, False)
    elif stats.differs and view_model.picture is not None:  # its place says so, too
        tip = (
            "The picture shows what was there before the last change, until the first light of the new scene has been "
            "traced."
        )
        say(preparing_words(stats) if stats.differs == "scene" else "Light is being traced …", tip)
    if stats.first_order:
        tip = (
            "Photons were traced through a glass of another dispersion; the picture follows the edit to first order "
            "until they are traced again (Ctrl+R)."
        )
        say("First order", tip)
    if state.preview_s is not None:
        tip = "The animation at that time; the Export panel ends the preview. Edits change the scene itself."
        say(f"Preview at {state.preview_s:.2f} s", tip)
    if state.solo_nm is not None:
        tip = "The light of a single wavelength is shown. L shows all of it again."
        say(f"Only {state.solo_nm:.0f} nm", tip, False)
    if (compare.mode in ("wipe", "error") or compare.holding) and not view_model.compare_ready:
        tip = "The other picture is being computed; the compare panel shows how far it is."
        say("Nothing to compare with yet", tip)
    elif compare.holding:
        say(view_model.compare_label or "The other picture", "Shown while C is held down.", False)
    if not state.playing:
        say("Paused", "No photons are added. Space continues.", False)
    return found


def draw_badges(shown: list[Badge], left: float, bottom: float) -> None:
    """A row of badges with its lower left corner at (left, bottom), pixels."""
    palette, pad_x, pad_y = theme.palette(), theme.em(0.55), theme.em(0.28)
    x = left + theme.em(MARGIN_EM)
    for badge in shown:
        text = imgui.calc_text_size(badge.text)
        size = ImVec2(text.x + 2 * pad_x, text.y + 2 * pad_y)
        low = ImVec2(x, bottom - theme.em(MARGIN_EM) - size.y)
        high = ImVec2(low.x + size.x, low.y + size.y)
        drawing, colour = imgui.get_window_draw_list(), palette.warning if badge.is_warning else palette.text
        drawing.add_rect_filled(low, high, theme.packed(palette.window, 0.86), 0.5 * size.y)
        drawing.add_rect(low, high, theme.packed(colour, 0.55), 0.5 * size.y)
        drawing.add_text(ImVec2(low.x + pad_x, low.y + pad_y), theme.packed(colour), badge.text)
        imgui.set_cursor_screen_pos(low)
        imgui.invisible_button(f"##badge {badge.text}", size)
        item_rects.note(badge.text)
        tooltip(badge.tip)
        x = high.x + theme.em(0.4)
