"""The legend of false colour: a bar with stops about display white."""

from __future__ import annotations

from functools import cache

import numpy as np
from imgui_bundle import imgui

from ...base.colour_maps import FALSE_COLOUR, sample
from .. import theme
from . import rows, spectrum_strip

_STEPS = 48


def legend(stops: tuple[float, float], exposure_ev: float) -> None:
    """A bar as wide as the window, its ends labelled in stops; `exposure_ev` turns a stop into a luminance for the
    tooltip."""
    low, high = stops
    width, height = imgui.get_content_region_avail().x, theme.em(0.9)
    start = imgui.get_cursor_screen_pos()
    imgui.invisible_button("##false colour", imgui.ImVec2(width, height))
    share = (imgui.get_mouse_pos().x - start.x) / max(width, 1.0)
    stop = low + min(max(share, 0.0), 1.0) * (high - low)
    luminance = 2.0 ** float(np.clip(stop - exposure_ev, -60.0, 60.0))
    rows.explain("False colour bar", f"{stop:+.1f} stops about display white: {luminance:.4g} lm/(sr unit²).")
    corner = imgui.ImVec2(start.x + width, start.y + height)
    spectrum_strip.draw_gradient(imgui.get_window_draw_list(), start, corner, _packed())
    _labels(low, high, width)


def _labels(low: float, high: float, width: float) -> None:
    left = imgui.get_cursor_pos_x()
    imgui.text_disabled(f"{low:+.1f}")
    if low < 0.0 < high:
        _at(left, width, -low / (high - low), "display white" if width > theme.em(14) else "0")
    _at(left, width, 1.0, f"{high:+.1f}")


def _at(left: float, width: float, share: float, text: str) -> None:
    """A label centred at `share` of the bar, kept within it."""
    length = imgui.calc_text_size(text).x
    imgui.same_line(left + min(max(share * width - length / 2, 0.0), width - length))
    imgui.text_disabled(text)


@cache
def _packed() -> tuple[int, ...]:
    scale = sample(FALSE_COLOUR, np.linspace(0.0, 1.0, _STEPS + 1)).astype(float)
    return tuple(theme.packed((r, g, b, 1.0)) for r, g, b in scale.tolist())
