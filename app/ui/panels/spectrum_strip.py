"""A strip of spectral colours with a handle, to pick a wavelength on."""

from __future__ import annotations

from imgui_bundle import imgui

from .. import theme
from . import rows, spectral_colour

LOW_NM, HIGH_NM = 380.0, 780.0
"""Ends of the strip."""


def strip(label: str, wavelength_nm: float | None, *, tip: str) -> tuple[bool, float, bool]:
    """A strip as wide as the window, its handle at `wavelength_nm` (none when None).

    Returns (changed, wavelength in nm, whether it is being dragged).
    """
    width, height = imgui.get_content_region_avail().x, imgui.get_frame_height()
    start = imgui.get_cursor_screen_pos()
    imgui.invisible_button(f"##{label}", imgui.ImVec2(width, height))
    rows.explain(label, tip, "nm")
    active = imgui.is_item_active()
    drawing = imgui.get_window_draw_list()
    spectral_colour.draw_strip(drawing, start, imgui.ImVec2(start.x + width, start.y + height))
    chosen = wavelength_nm
    if active:
        share = min(max((imgui.get_mouse_pos().x - start.x) / max(width, 1.0), 0.0), 1.0)
        chosen = round(LOW_NM + share * (HIGH_NM - LOW_NM), 1)
    if chosen is None:
        return False, LOW_NM, active
    _draw_handle(drawing, start, width, height, chosen)
    return chosen != wavelength_nm, chosen, active


def _draw_handle(
    drawing: imgui.ImDrawList, start: imgui.ImVec2, width: float, height: float, wavelength_nm: float
) -> None:
    share = min(max((wavelength_nm - LOW_NM) / (HIGH_NM - LOW_NM), 0.0), 1.0)
    x, half = start.x + share * width, theme.em(0.16)
    low, high = imgui.ImVec2(x - half, start.y - half), imgui.ImVec2(x + half, start.y + height + half)
    drawing.add_rect_filled(low, high, theme.packed((1.0, 1.0, 1.0, 1.0)), half)
    drawing.add_rect(low, high, theme.packed((0.0, 0.0, 0.0, 0.8)), half)
