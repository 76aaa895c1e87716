"""What a wavelength looks like on the screen, for axes and curves: as saturated as sRGB allows, dimmer at the ends."""

from __future__ import annotations

from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...model.optics.colorimetry import VISIBLE_NM, cmf_xyz, xyz_to_rgb709

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
    encoded = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * np.maximum(rgb, 1e-12) ** (1 / 2.4) - 0.055)
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


@lru_cache(maxsize=16)
def _strip(steps: int, opacity: float) -> list[int]:
    return [colour_of_nm(380.0 + 400.0 * i / steps, opacity) for i in range(steps + 1)]


def draw_strip(drawing: imgui.ImDrawList, low: ImVec2, high: ImVec2, opacity: float = 1.0, steps: int = 64) -> None:
    """A band of 380 to 780 nm, from left to right, between two corners in pixels."""
    width = (high.x - low.x) / steps
    for i, (left, right) in enumerate(pairwise(_strip(steps, opacity))):
        x = low.x + i * width
        drawing.add_rect_filled_multi_color(ImVec2(x, low.y), ImVec2(x + width, high.y), left, right, right, left)
