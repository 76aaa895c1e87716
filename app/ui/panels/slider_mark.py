"""The value of a slider, drawn along its lower edge so that nothing covers its digits.

Dear ImGui draws a block as tall as the field, and the number in the field's middle: wherever the block is behind
the number, a digit is hard to read. Here the block is left out and a line with a short handle is below the digits.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import ImVec2, imgui

from .. import theme

_INSET_PX = 2.0
"""Dear ImGui keeps this free at both ends of a slider."""
_LINE_SHARE, _HANDLE_SHARE = 0.09, 0.22
"""Heights, shares of the field's."""
_CLEAR = imgui.ImVec4(0.0, 0.0, 0.0, 0.0)


@contextmanager
def hidden_grab() -> Iterator[None]:
    """Sliders within draw no block of their own."""
    imgui.push_style_color(imgui.Col_.slider_grab, _CLEAR)
    imgui.push_style_color(imgui.Col_.slider_grab_active, _CLEAR)
    yield
    imgui.pop_style_color(2)


def share_of(value: float, low: float, high: float, smallest: float | None = None) -> float:
    """How far from `low` (0) to `high` (1) a value is, as Dear ImGui places it; ends may be in either order.

    `smallest`, of a logarithmic slider, whose ends are not negative: what counts as zero.
    """
    if smallest is not None:
        value, low, high = (math.log(max(number, smallest)) for number in (value, low, high))
    return min(max((value - low) / (high - low), 0.0), 1.0)


def smallest_shown(format: str) -> float:
    """The smallest number that printf's `format` distinguishes from zero: Dear ImGui's zero of a logarithmic slider."""
    decimals = re.search(r"%\.(\d+)", format)
    return 0.1 ** int(decimals[1]) if decimals else 1e-3


def draw(share: float) -> None:
    """The line from the left end to `share` of the last item, a slider, with its handle."""
    if imgui.internal.temp_input_is_active(imgui.get_item_id()):
        return
    style, held = imgui.get_style(), imgui.is_item_active()
    low, high, x = imgui.get_item_rect_min(), imgui.get_item_rect_max(), _place(share)
    height = high.y - low.y
    tint = style.color_(imgui.Col_.slider_grab_active if held or imgui.is_item_hovered() else imgui.Col_.slider_grab)
    packed, drawing = imgui.color_convert_float4_to_u32(tint), imgui.get_window_draw_list()
    half = style.grab_min_size / 2
    drawing.add_rect_filled(ImVec2(low.x + _INSET_PX, high.y - _LINE_SHARE * height), ImVec2(x, high.y), packed, 0.0)
    drawing.add_rect_filled(
        ImVec2(x - half, high.y - _HANDLE_SHARE * height), ImVec2(x + half, high.y), packed, half / 2
    )


def notch(share: float) -> None:
    """A short mark above the place of the last item's handle for a value."""
    low, high, x = imgui.get_item_rect_min(), imgui.get_item_rect_max(), _place(share)
    tint = theme.packed(theme.palette().text, 0.6)
    imgui.get_window_draw_list().add_line(ImVec2(x, low.y), ImVec2(x, low.y + 0.2 * (high.y - low.y)), tint, 1.5)


def _place(share: float) -> float:
    """The middle of the handle, in pixels of the screen."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    grab = imgui.get_style().grab_min_size
    return low.x + _INSET_PX + grab / 2 + share * (high.x - low.x - grab - 2.0 * _INSET_PX)
