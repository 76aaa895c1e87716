"""The whole interface of one frame: `draw_interface(state, view_model) -> state`, the one function a host calls.

Every panel draws its own contents; the windows around them, with their close buttons, are opened here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from imgui_bundle import imgui

from ..edit.state import Panels, State
from . import help_list, item_rects, layout, menu, shortcuts, theme
from .layout import Place
from .panels import (
    dialogs,
    gem_panel,
    history_panel,
    inspector,
    lens_panel,
    lesson_panel,
    messages,
    numbers,
    opened_card,
    outliner,
    rays_panel,
    rows,
    solve_panel,
    spectrum,
    start_page,
    status_bar,
    timing,
    view_panel,
)
from .panels.abbe import draw_abbe
from .panels.brush_panel import draw_brush
from .panels.compare_panel import draw_compare
from .panels.dispersion import draw_dispersion
from .panels.export_panel import draw_export
from .view_model import ViewModel
from .viewport import draw_viewport

Draw = Callable[[State, ViewModel], State]


@dataclass(frozen=True)
class PanelWindow:
    """A panel's window."""

    field: str
    """Its field of `Panels`."""
    title: str
    place: Place
    draw: Draw
    size_em: tuple[float, float] = (26.0, 22.0)
    """Width and height when it floats, text heights."""


WINDOWS = (
    PanelWindow("outliner", "Outliner", "left top", outliner.draw_outliner),
    PanelWindow("lesson", "Lesson", "left bottom", lesson_panel.draw_lesson),
    PanelWindow("history", "History", "left bottom", history_panel.draw_history),
    PanelWindow("dispersion", "Dispersion", "right bottom", draw_dispersion),
    PanelWindow("inspector", "Inspector", "right top", inspector.draw_inspector),
    PanelWindow("view", "View", "right top", view_panel.draw_view),
    PanelWindow("brush", "Brush", "right bottom", draw_brush),
    PanelWindow("export", "Export", "right bottom if tall", draw_export, (26.0, 30.0)),
    PanelWindow("rays", "Rays", "bottom", rays_panel.draw_rays_panel),
    PanelWindow("lens", "Lens", "bottom", lens_panel.draw_lens_panel),
    PanelWindow("gem", "Gem", "bottom", gem_panel.draw_gem_panel),
    PanelWindow("solve", "Solve", "bottom", solve_panel.draw_solve),
    PanelWindow("timing", "Timing", "bottom", timing.draw_timing),
    PanelWindow("spectrum", "Spectrum", "bottom", spectrum.draw_spectrum),
    PanelWindow("compare", "Compare", "bottom", draw_compare),
    # Next to the caustic, which it is there to change.
    PanelWindow("abbe", "Abbe", "right bottom", draw_abbe, (44.0, 34.0)),
    PanelWindow("shortcuts", "Shortcuts", "floating", help_list.draw_shortcuts, (62.0, 38.0)),
    PanelWindow("about", "About SpectraSplat", "floating", help_list.draw_about, (32.0, 20.0)),
)
_OVER_START_PAGE = ("shortcuts", "about")
_CALLED_UP = frozenset(window.field for window in WINDOWS if not getattr(Panels(), window.field))
"""Panels that somebody opened: Esc closes them, docked or floating, while they have the keyboard and no tool is to be
left first."""


def draw_interface(state: State, view_model: ViewModel) -> State:
    """Draw everything and return the state as the user left it, with requests for the host appended.

    The host applies the theme (`theme.apply`) between frames: sizes must not change within one.
    """
    numbers.use_units(state.scene.units)
    state = shortcuts.handle(state, view_model)
    shortcuts.focused_panel["field"] = ""
    layout.floating.clear()
    state = menu.draw_menu(state, view_model)
    if state.preferences.panels.start_page:
        state = start_page.draw_start_page(state, view_model)
        for window in WINDOWS:
            if window.field in _OVER_START_PAGE and getattr(state.preferences.panels, window.field):
                state = _draw_panel(window, state, view_model)
    else:
        state = _draw_windows(state, view_model)
    state = dialogs.draw_dialogs(state, view_model)
    if rows.take_held():
        state = replace(state, interacting=True)
    return messages.draw_messages(state, view_model)


def _draw_windows(state: State, view_model: ViewModel) -> State:
    layout.dockspace(WINDOWS, status_bar.height())
    state = status_bar.draw_status_bar(state, view_model)
    state = _draw_picture(state, view_model)
    for window in WINDOWS:
        if getattr(state.preferences.panels, window.field):
            state = _draw_panel(window, state, view_model)
    return state


def _draw_picture(state: State, view_model: ViewModel) -> State:
    flags = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse | imgui.WindowFlags_.no_collapse
    if view_model.picture is not None:
        # The picture covers all of it: a software renderer need not fill it twice.
        flags |= imgui.WindowFlags_.no_background
    imgui.push_style_var(imgui.StyleVar_.window_padding, imgui.ImVec2(0, 0))
    shown, _ = imgui.begin(layout.VIEWPORT, None, flags)
    imgui.pop_style_var()
    corner, size = imgui.get_window_pos(), imgui.get_window_size()
    if shown:
        state = draw_viewport(state, view_model)
    imgui.end()
    if shown:
        state = opened_card.draw_opened_card(state, view_model, corner.x + 0.5 * size.x, corner.y + size.y)
    return state


def _draw_panel(window: PanelWindow, state: State, view_model: ViewModel) -> State:
    viewport = imgui.get_main_viewport()
    width = min(theme.em(window.size_em[0]), viewport.work_size.x * 0.9)
    height = min(theme.em(window.size_em[1]), viewport.work_size.y * 0.85)
    imgui.set_next_window_size((width, height), imgui.Cond_.first_use_ever)
    imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.first_use_ever, imgui.ImVec2(0.5, 0.5))
    if layout.is_raised(window.field):
        imgui.set_next_window_focus()
    # A software renderer takes as long to fill panels as to draw the picture.
    flags = imgui.WindowFlags_.no_background if layout.is_in_dock_space(window.title) else imgui.WindowFlags_.none
    shown, stays = imgui.begin(window.title, True, flags)
    item_rects.note(f"Window: {window.title}")
    is_floating = not imgui.is_window_docked()
    (layout.behind.discard if shown or is_floating else layout.behind.add)(window.field)
    if is_floating:
        layout.floating[window.field] = window.title
    is_leavable = is_floating or (window.field in _CALLED_UP and state.tool == "select")
    if is_leavable and imgui.is_window_focused(imgui.FocusedFlags_.child_windows):
        shortcuts.focused_panel["field"] = window.field
    if shown:
        state = window.draw(state, view_model)
    imgui.end()
    return state if stays else state.opened(window.field, False)
