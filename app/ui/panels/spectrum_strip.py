"""Colours of single wavelengths, as strips and curves show them, and a strip with a handle to pick a wavelength on."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...base.tone_map import srgb_oetf
from ...model.optics.colorimetry import VISIBLE_NM, cmf_xyz, xyz_to_rgb709
from .. import theme
from . import rows

_DIMMEST = 0.25
"""Share of the brightness left at 380 and 780 nm, where the eye sees next to nothing."""


@cache
def spectral_srgb() -> np.ndarray:
    """sRGB-encoded colours of 380, 381, … 780 nm: float64 (401, 3), read-only."""
    rgb = xyz_to_rgb709(cmf_xyz())
    rgb = np.maximum(rgb, 0.0)
    rgb = rgb / rgb.max(axis=1, keepdims=True)
    rise = np.clip((VISIBLE_NM - 380.0) / 40.0, 0.0, 1.0)
    fall = np.clip((780.0 - VISIBLE_NM) / 90.0, 0.0, 1.0)
    rgb = rgb * (_DIMMEST + (1.0 - _DIMMEST) * np.minimum(rise, fall))[:, None]
    encoded = srgb_oetf(rgb)
    encoded.flags.writeable = False
    return encoded


def colour_of_nm(wavelength_nm: float, opacity: float = 1.0) -> int:
    """The colour as a draw list takes it."""
    return _packed(min(max(round(wavelength_nm) - 380, 0), 400), opacity)


@lru_cache(maxsize=4096)
def _packed(row: int, opacity: float) -> int:
    # Strips ask for more than a hundred in every frame: worked out each time they took a third of all panels' time.
    red, green, blue = spectral_srgb()[row]
    return imgui.color_convert_float4_to_u32((red, green, blue, opacity))


def draw_strip(drawing: imgui.ImDrawList, low: ImVec2, high: ImVec2) -> None:
    """A band of 380 to 780 nm, from left to right, between two corners in pixels."""
    draw_gradient(drawing, low, high, [colour_of_nm(380.0 + 400.0 * i / 64) for i in range(65)])


def draw_gradient(drawing: imgui.ImDrawList, low: ImVec2, high: ImVec2, colours: Sequence[int]) -> None:
    """Packed colours at even distances from left to right between two corners in pixels, blended from each to the
    next."""
    width = (high.x - low.x) / (len(colours) - 1)
    for i, (left, right) in enumerate(pairwise(colours)):
        x = low.x + i * width
        drawing.add_rect_filled_multi_color(ImVec2(x, low.y), ImVec2(x + width, high.y), left, right, right, left)


LOW_NM, HIGH_NM = 380.0, 780.0
"""Ends of the strip."""


def strip(label: str, wavelength_nm: float | None, *, tip: str) -> float | None:
    """A strip as wide as the window, its handle at `wavelength_nm` (none when None); the wavelength chosen on it."""
    width, height = imgui.get_content_region_avail().x, imgui.get_frame_height()
    start = imgui.get_cursor_screen_pos()
    imgui.invisible_button(f"##{label}", imgui.ImVec2(width, height))
    rows.explain(label, tip, "nm")
    drawing = imgui.get_window_draw_list()
    draw_strip(drawing, start, imgui.ImVec2(start.x + width, start.y + height))
    if imgui.is_item_active():
        rows.hold()
        share = min(max((imgui.get_mouse_pos().x - start.x) / max(width, 1.0), 0.0), 1.0)
        wavelength_nm = round(LOW_NM + share * (HIGH_NM - LOW_NM), 1)
    if wavelength_nm is not None:
        share = min(max((wavelength_nm - LOW_NM) / (HIGH_NM - LOW_NM), 0.0), 1.0)
        x, half = start.x + share * width, theme.em(0.16)
        low, high = imgui.ImVec2(x - half, start.y - half), imgui.ImVec2(x + half, start.y + height + half)
        drawing.add_rect_filled(low, high, theme.packed((1.0, 1.0, 1.0, 1.0)), half)
        drawing.add_rect(low, high, theme.packed((0.0, 0.0, 0.0, 0.8)), half)
    return wavelength_nm
