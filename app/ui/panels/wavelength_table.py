"""A table with a row a wavelength, each marked with its colour."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from imgui_bundle import imgui

from .. import item_rects, theme
from . import widgets
from .spectrum_strip import colour_of_nm


def draw_wavelength_table(name: str, columns: Mapping[str, str], rows: Iterable[tuple[float, Sequence[str]]]) -> None:
    """Draw it; `columns`: headings and what they are, the first of the wavelength; `rows`: nm, and the other cells."""
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_stretch_prop | imgui.TableFlags_.scroll_y
    if not imgui.begin_table(f"##{name}", len(columns), flags):
        return
    imgui.table_setup_scroll_freeze(0, 1)
    for title in columns:
        imgui.table_setup_column(title)
    imgui.table_next_row(imgui.TableRowFlags_.headers)
    for title, tip in columns.items():
        imgui.table_next_column()
        imgui.table_header(title)
        item_rects.note(f"{name}: {title}")
        widgets.tooltip(tip)
    for nm, texts in rows:
        imgui.table_next_row()
        imgui.table_next_column()
        at, height = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
        colour = colour_of_nm(nm)
        imgui.get_window_draw_list().add_rect_filled(at, imgui.ImVec2(at.x + theme.em(0.25), at.y + height), colour)
        imgui.set_cursor_screen_pos(imgui.ImVec2(at.x + theme.em(0.5), at.y))
        imgui.text_unformatted(f"{nm:.1f}")
        for text in texts:
            imgui.table_next_column()
            imgui.text_unformatted(text)
    imgui.end_table()
