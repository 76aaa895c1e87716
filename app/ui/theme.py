"""Fonts, colours and sizes of the interface, in dark and in light.

Everything here is Dear ImGui style; nothing knows the scene or OpenGL. `set_up` is called once
after the imgui context is made, `apply` whenever preferences or the screen's scale may have changed.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import imgui_bundle
from imgui_bundle import imgui, implot

from ..edit.state import Preferences

Colour = tuple[float, float, float, float]
"""sRGB and opacity, 0 to 1."""


@dataclass(frozen=True)
class Palette:
    """The colours of one theme; panels take theirs from here."""

    is_dark: bool
    canvas: Colour
    """Behind the docked windows and around the picture."""
    window: Colour
    frame: Colour
    """Ground of fields, sliders and buttons."""
    raised: Colour
    """Title and menu bars, headers of tables."""
    border: Colour
    text: Colour
    muted: Colour
    accent: Colour
    warning: Colour
    """What is not physical, not saved or only approximate."""
    error: Colour
    good: Colour


DARK = Palette(
    is_dark=True,
    canvas=(0.055, 0.055, 0.055, 1.0),
    window=(0.115, 0.115, 0.115, 1.0),
    frame=(0.190, 0.190, 0.190, 1.0),
    raised=(0.150, 0.150, 0.150, 1.0),
    border=(0.260, 0.260, 0.260, 1.0),
    text=(0.880, 0.880, 0.880, 1.0),
    muted=(0.580, 0.580, 0.580, 1.0),
    accent=(0.400, 0.620, 0.920, 1.0),
    warning=(0.960, 0.720, 0.280, 1.0),
    error=(0.960, 0.420, 0.380, 1.0),
    good=(0.470, 0.780, 0.480, 1.0),
)
LIGHT = Palette(
    is_dark=False,
    canvas=(0.560, 0.560, 0.560, 1.0),
    window=(0.925, 0.925, 0.925, 1.0),
    frame=(0.835, 0.835, 0.835, 1.0),
    raised=(0.870, 0.870, 0.870, 1.0),
    border=(0.720, 0.720, 0.720, 1.0),
    text=(0.100, 0.100, 0.100, 1.0),
    muted=(0.380, 0.380, 0.380, 1.0),
    accent=(0.130, 0.400, 0.760, 1.0),
    warning=(0.580, 0.330, 0.000, 1.0),
    error=(0.740, 0.140, 0.100, 1.0),
    good=(0.130, 0.450, 0.160, 1.0),
)


FONT_SIZE = 15.0
"""Height of the text in logical pixels, before `Preferences.ui_scale` and the screen's scale."""

_REGULAR, _BOLD = "Roboto-Regular", "Roboto-Bold"


def palette(preferences: Preferences | None = None) -> Palette:
    """The theme chosen in `preferences`; without them, the one in effect."""
    if preferences is not None:
        return DARK if preferences.theme == "dark" else LIGHT
    ground = imgui.get_style().color_(imgui.Col_.window_bg)
    return LIGHT if ground.x > 0.5 else DARK


def ground() -> Colour:
    """What a frame is cleared to: docked windows have no ground of their own."""
    return palette().window


def set_up() -> None:
    """Give the imgui context its fonts, once; later calls cost nothing. Best before the first frame."""
    if bold() is None:
        _load_fonts(imgui.get_io())


def apply(preferences: Preferences, scale: float | None = None) -> None:
    """Make the theme and the size of `preferences` those in effect.

    `scale` is interface pixels per logical pixel: the content scale of the screen where imgui's
    coordinates are device pixels (X11, Windows), 1 where the system scales by itself (macOS); None
    keeps what was said last. Cheap when nothing changed.
    """
    chosen, style = palette(preferences), imgui.get_style()
    scale = style.font_scale_dpi if scale is None else scale
    total = preferences.ui_scale * scale
    is_coloured = abs(style.color_(imgui.Col_.window_bg).x - chosen.window[0]) < 1e-6
    if is_coloured and abs(style.font_scale_main * style.font_scale_dpi - total) < 1e-6:
        return
    _set_sizes(style, total)
    style.font_scale_main, style.font_scale_dpi = preferences.ui_scale, scale
    for name, colour in _colours(chosen).items():
        style.set_color_(imgui.Col_[name], imgui.ImVec4(*colour))
    if implot.get_current_context() is not None:
        _set_plot_style(chosen, total)


def bold() -> imgui.ImFont | None:
    """The heavier face, for headings; None before `set_up`."""
    for font in imgui.get_io().fonts.fonts:
        if font.get_debug_name().startswith(_BOLD):
            return font
    return None


@contextmanager
def heading(size: float = 1.0) -> Iterator[None]:
    """Draw text in the heavier face, `size` times as tall as normal text."""
    imgui.push_font(bold(), FONT_SIZE * size)
    yield
    imgui.pop_font()


@contextmanager
def coloured(colour: Colour) -> Iterator[None]:
    """Draw text in `colour`."""
    imgui.push_style_color(imgui.Col_.text, colour)
    yield
    imgui.pop_style_color()


@contextmanager
def chosen_rows() -> Iterator[None]:
    """Draw chosen rows of lists in the accent colour."""
    accent = palette().accent
    imgui.push_style_color(imgui.Col_.header, (*accent[:3], 0.30))
    imgui.push_style_color(imgui.Col_.header_hovered, (*accent[:3], 0.22))
    yield
    imgui.pop_style_color(2)


def packed(colour: Colour, opacity: float = 1.0) -> int:
    """`colour` as a draw list takes it."""
    return imgui.color_convert_float4_to_u32((*colour[:3], colour[3] * opacity))


def em(lengths: float) -> float:
    """That many text heights in interface pixels: the unit for every width that must follow the text."""
    return imgui.get_font_size() * lengths


def _load_fonts(io: imgui.IO) -> None:
    """Roboto, regular and bold, each with icons and with the subscripts and arrows that Roboto lacks."""
    folder, fonts = Path(imgui_bundle.__file__).parent / "assets" / "fonts", io.fonts
    for face in (f"{_REGULAR}.ttf", f"{_BOLD}.ttf"):
        font = _add(fonts, folder / "Roboto" / face)
        if face.startswith(_REGULAR):
            io.font_default = font
        _add(fonts, folder / "Font_Awesome_6_Free-Solid-900.otf", merged=True, icons=True)
        fallback = _dejavu()
        if fallback is not None:
            _add(fonts, fallback, merged=True)
    imgui.get_style().font_size_base = FONT_SIZE


def _add(fonts: imgui.ImFontAtlas, path: Path, *, merged: bool = False, icons: bool = False) -> imgui.ImFont:
    config = imgui.ImFontConfig()
    config.merge_mode = merged
    if icons:
        # Icons are drawn wider than tall; a little smaller they sit on the line like capitals.
        size = FONT_SIZE * 0.86
        config.glyph_min_advance_x = FONT_SIZE * 1.2
        config.glyph_offset = imgui.ImVec2(0.0, -0.5)
        return fonts.add_font_from_file_ttf(str(path), size, config)
    return fonts.add_font_from_file_ttf(str(path), FONT_SIZE, config)


def _dejavu() -> Path | None:
    """DejaVu Sans from matplotlib's data, found without importing it (which takes a second)."""
    found = importlib.util.find_spec("matplotlib")
    if found is None or found.origin is None:
        return None
    path = Path(found.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
    return path if path.is_file() else None


def _set_sizes(style: imgui.Style, scale: float) -> None:
    pairs = {
        "window_padding": (10, 8),
        "frame_padding": (7, 4),
        "item_spacing": (8, 5),
        "item_inner_spacing": (6, 4),
        "cell_padding": (6, 3),
    }
    for name, (x, y) in pairs.items():
        setattr(style, name, imgui.ImVec2(x * scale, y * scale))
    lengths = {
        "frame_rounding": 3,
        "grab_rounding": 2,
        "window_rounding": 4,
        "popup_rounding": 4,
        "child_rounding": 4,
        "tab_rounding": 3,
        "scrollbar_rounding": 6,
        "scrollbar_size": 12,
        "grab_min_size": 7,
        "indent_spacing": 16,
        "docking_separator_size": 2,
        "tab_bar_overline_size": 2,
    }
    for name, length in lengths.items():
        setattr(style, name, length * scale)
    style.window_border_size = 1.0
    style.frame_border_size = 0.0
    style.tab_border_size = 0.0
    style.separator_text_border_size = 1.0
    style.separator_text_padding = imgui.ImVec2(0.0, 4.0 * scale)
    style.window_menu_button_position = imgui.Dir.none
    style.docking_node_has_close_button = False
    style.hover_stationary_delay = 0.12


def _colours(chosen: Palette) -> dict[str, Colour]:
    def mixed(ground: Colour, over: Colour, share: float) -> Colour:
        red, green, blue = (a + (b - a) * share for a, b in zip(ground[:3], over[:3], strict=True))
        return (red, green, blue, 1.0)

    frame, accent, text = chosen.frame, chosen.accent, chosen.text
    hovered, active = mixed(frame, text, 0.10), mixed(frame, text, 0.18)
    clear = (0.0, 0.0, 0.0, 0.0)
    return {
        "text": text,
        "text_disabled": chosen.muted,
        "text_link": accent,
        "text_selected_bg": (*accent[:3], 0.35),
        "input_text_cursor": text,
        "window_bg": chosen.window,
        "child_bg": clear,
        "popup_bg": mixed(chosen.window, (1, 1, 1, 1), 0.03 if chosen.is_dark else 0.5),
        "border": chosen.border,
        "border_shadow": clear,
        "frame_bg": frame,
        "frame_bg_hovered": hovered,
        "frame_bg_active": active,
        "title_bg": chosen.raised,
        "title_bg_active": chosen.raised,
        "title_bg_collapsed": chosen.raised,
        "menu_bar_bg": chosen.raised,
        "scrollbar_bg": clear,
        "scrollbar_grab": mixed(chosen.window, text, 0.22),
        "scrollbar_grab_hovered": mixed(chosen.window, text, 0.32),
        "scrollbar_grab_active": mixed(chosen.window, text, 0.42),
        "check_mark": accent,
        "checkbox_selected_bg": frame,
        # Digits are written over it: they must stay readable.
        "slider_grab": mixed(frame, accent, 0.62),
        "slider_grab_active": accent,
        "button": frame,
        "button_hovered": hovered,
        "button_active": mixed(frame, accent, 0.55),
        "header": mixed(chosen.window, text, 0.11),
        "header_hovered": mixed(chosen.window, text, 0.17),
        "header_active": mixed(chosen.window, accent, 0.42),
        "separator": chosen.border,
        "separator_hovered": accent,
        "separator_active": accent,
        "resize_grip": clear,
        "resize_grip_hovered": (*accent[:3], 0.5),
        "resize_grip_active": accent,
        "tab": chosen.raised,
        "tab_hovered": hovered,
        "tab_selected": chosen.window,
        "tab_selected_overline": accent,
        "tab_dimmed": chosen.raised,
        "tab_dimmed_selected": chosen.window,
        "tab_dimmed_selected_overline": mixed(chosen.window, text, 0.30),
        "docking_preview": (*accent[:3], 0.45),
        "docking_empty_bg": chosen.canvas,
        "plot_lines": accent,
        "plot_lines_hovered": text,
        "plot_histogram": accent,
        "plot_histogram_hovered": text,
        "table_header_bg": chosen.raised,
        "table_border_strong": chosen.border,
        "table_border_light": mixed(chosen.window, text, 0.10),
        "table_row_bg": clear,
        "table_row_bg_alt": (*text[:3], 0.025),
        "tree_lines": chosen.border,
        "drag_drop_target": accent,
        "nav_cursor": accent,
        "modal_window_dim_bg": (0.0, 0.0, 0.0, 0.55 if chosen.is_dark else 0.35),
        "unsaved_marker": chosen.warning,
    }


def _set_plot_style(chosen: Palette, scale: float) -> None:
    style = implot.get_style()
    style.plot_padding = imgui.ImVec2(8 * scale, 6 * scale)
    style.label_padding = imgui.ImVec2(4 * scale, 3 * scale)
    style.legend_padding = imgui.ImVec2(6 * scale, 6 * scale)
    style.plot_border_size = 0.0
    style.plot_min_size = imgui.ImVec2(60 * scale, 40 * scale)
    for name, colour in {
        "frame_bg": (0.0, 0.0, 0.0, 0.0),
        "plot_bg": chosen.canvas if chosen.is_dark else (1.0, 1.0, 1.0, 1.0),
        "plot_border": chosen.border,
        "legend_bg": (*chosen.window[:3], 0.85),
        "legend_border": chosen.border,
        "axis_text": chosen.muted,
        "axis_grid": (*chosen.text[:3], 0.14),
        "crosshairs": chosen.muted,
    }.items():
        style.set_color_(implot.Col_[name], imgui.ImVec4(*colour))
