"""n(λ) of the selected glass as a curve whose points can be dragged, over the colours it bends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui, implot

from ...edit import edits
from ...edit.glass import set_dispersion
from ...edit.state import State
from ...model.optics import glass
from ...model.optics.glass import LINE_C_NM, LINE_D_NM, LINE_F_NM, Dispersion
from .. import item_rects, theme
from ..view_model import ViewModel
from . import widgets
from .glass_values import CONTROL_NM, as_sold, attempted, selected_glass, with_point
from .rows import begin_row
from .spectrum_strip import colour_of_nm, draw_strip

_CURVE_NM = np.linspace(380.0, 780.0, 161)
_LINES = {LINE_F_NM: "F", LINE_D_NM: "d", LINE_C_NM: "C"}
_MIN_SPAN = 0.004
"""Smallest height of the plot in n: a constant index is shown as a level line, not as noise."""


@dataclass
class _Memory:
    """How the curve is shown; not part of the document."""

    keep_n_d: bool = True
    slope: bool = False
    limits: tuple[float, float] = (1.0, 2.0)
    """Ends of the n axis; they stay while a point is dragged."""
    of: Dispersion | None = None
    held: bool = False
    refused: str = ""


@dataclass(frozen=True)
class _Area:
    """Where the plot was drawn."""

    points: tuple[ImVec2, ...]
    """Pixels of the points of `CONTROL_NM`."""
    n_per_pixel: float


_memory = _Memory()


@lru_cache(maxsize=16)
def _curves(dispersion: Dispersion) -> tuple[np.ndarray, np.ndarray]:
    """n and dn/dλ on `_CURVE_NM`, remembered from frame to frame."""
    return dispersion.index(_CURVE_NM), dispersion.derivative(_CURVE_NM)


def draw_index_curve(state: State, view_model: ViewModel) -> State:
    """The plot, its switches and the reset; the state with the curve as it was dragged."""
    selected = selected_glass(state)
    if selected is None:
        return state
    index, _, material = selected
    dispersion = material.dispersion
    _fit(dispersion)
    area = _draw_plot(dispersion)
    if area is not None:
        state = _draw_points(state, index, dispersion, area)
    tip = (
        "Hold the point of the d line, so that only the colours move: light that is stored is splatted again and "
        "nothing is traced."
    )
    _memory.keep_n_d = widgets.toggle("Keep n_d", _memory.keep_n_d, tip=tip)
    tip = "Draw the slope dn/dλ, 1/µm, on the right-hand axis: the steeper, the wider colours spread."
    _memory.slope = widgets.toggle("Show dn/dλ", _memory.slope, tip=tip)
    if _memory.refused:
        widgets.error(_memory.refused)
    return _draw_reset(state, index, dispersion)


def _draw_reset(state: State, index: int, dispersion: Dispersion) -> State:
    sold = as_sold(dispersion)
    can_reset = sold is not None and dispersion.natural != sold
    tip = (
        f"Back to the curve of {sold.name}; the dispersion gain stays."
        if sold
        else "This glass is not from the catalogue."
    )
    begin_row("")
    if widgets.button("Reset curve", tip=tip, enabled=can_reset) and sold is not None:
        _memory.refused = ""
        name = state.scene.objects[index].name
        natural_curve = glass.with_gain(sold, dispersion.gain)
        return edits.attempt(state, f"Reset n(λ) of {name}", set_dispersion, index, natural_curve)
    return state


def _fit(dispersion: Dispersion) -> None:
    """Ends of the axis about the curve (and the catalogue's, where it is another)."""
    if _memory.held or dispersion == _memory.of:
        return
    sold = as_sold(dispersion)
    values = [_curves(each)[0] for each in (dispersion, sold) if each is not None]
    low, high = float(np.min(values)), float(np.max(values))
    middle, span = (low + high) / 2, max(high - low, _MIN_SPAN)
    _memory.of, _memory.limits = dispersion, (middle - 0.72 * span, middle + 0.62 * span)


def _draw_plot(dispersion: Dispersion) -> _Area | None:
    size = ImVec2(-1.0, theme.em(14.0))
    flags = implot.Flags_.canvas_only.value | implot.Flags_.no_inputs.value
    if not implot.begin_plot("##index", size, flags):
        return None
    plain = implot.AxisFlags_.no_menus.value | implot.AxisFlags_.no_highlight.value
    implot.setup_axis(implot.ImAxis_.x1.value, "λ, nm", plain)
    implot.setup_axis(implot.ImAxis_.y1.value, "n", plain)
    implot.setup_axis_format(implot.ImAxis_.y1.value, "%.4g")
    implot.setup_axis_limits(implot.ImAxis_.x1.value, 380.0, 780.0, implot.Cond_.always.value)
    implot.setup_axis_limits(implot.ImAxis_.y1.value, *_memory.limits, implot.Cond_.always.value)
    n, slope = _curves(dispersion)
    if _memory.slope:
        _setup_slope_axis(plain, slope)
    implot.setup_finish()
    _draw_ground()
    colours = theme.palette()
    sold = as_sold(dispersion)
    if sold is not None and sold != dispersion:
        _line("catalogue", _curves(sold)[0], (*colours.muted[:3], 0.8), 1.5)
    _line("n", n, colours.text, 2.0)
    if _memory.slope:
        implot.set_axes(implot.ImAxis_.x1.value, implot.ImAxis_.y2.value)
        _line("slope", slope, colours.accent, 1.5)
        implot.set_axes(implot.ImAxis_.x1.value, implot.ImAxis_.y1.value)
    values = dispersion.index(np.array(CONTROL_NM))
    points = tuple(implot.plot_to_pixels(nm, float(n)) for nm, n in zip(CONTROL_NM, values, strict=True))
    per_pixel = (_memory.limits[1] - _memory.limits[0]) / max(implot.get_plot_size().y, 1.0)
    implot.end_plot()
    item_rects.note("Index plot")
    return _Area(points, per_pixel)


def _setup_slope_axis(plain: int, slope: np.ndarray) -> None:
    opposite = implot.AxisFlags_.opposite.value | implot.AxisFlags_.no_grid_lines.value
    implot.setup_axis(implot.ImAxis_.y2.value, "dn/dλ, 1/µm", plain | opposite)
    implot.setup_axis_format(implot.ImAxis_.y2.value, "%.3g")
    low, high = float(slope.min()), float(slope.max())
    span = max(high - low, 1e-4)
    implot.setup_axis_limits(implot.ImAxis_.y2.value, low - 0.2 * span, high + 0.1 * span, implot.Cond_.always.value)


def _line(name: str, values: np.ndarray, colour: theme.Colour, weight: float) -> None:
    spec = implot.Spec()
    spec.line_color, spec.line_weight = ImVec4(*colour), weight
    implot.plot_line(f"##{name}", _CURVE_NM, np.ascontiguousarray(values), spec)


def _draw_ground() -> None:
    """The spectrum along the bottom, and the Fraunhofer lines."""
    drawing, corner, size = implot.get_plot_draw_list(), implot.get_plot_pos(), implot.get_plot_size()
    bottom = corner.y + size.y
    draw_strip(drawing, ImVec2(corner.x, bottom - theme.em(0.5)), ImVec2(corner.x + size.x, bottom))
    tint = theme.packed(theme.palette().muted)
    for nm, name in _LINES.items():
        x = corner.x + size.x * (nm - 380.0) / 400.0
        drawing.add_line(ImVec2(x, corner.y + theme.em(1.3)), ImVec2(x, bottom), colour_of_nm(nm, 0.6), 1.0)
        width = imgui.calc_text_size(name).x
        drawing.add_text(ImVec2(x - width / 2, corner.y + theme.em(0.15)), tint, name)


def _draw_points(state: State, index: int, dispersion: Dispersion, area: _Area) -> State:
    """Handles over the plot; the one that is dragged bends the curve."""
    after, radius = imgui.get_cursor_screen_pos(), theme.em(0.32)
    _memory.held = False
    for at, (nm, pixel) in enumerate(zip(CONTROL_NM, area.points, strict=True)):
        is_fixed = _memory.keep_n_d and nm == LINE_D_NM
        imgui.set_cursor_screen_pos(ImVec2(pixel.x - 1.6 * radius, pixel.y - 1.6 * radius))
        imgui.invisible_button(f"point {at}", ImVec2(3.2 * radius, 3.2 * radius))
        is_held, is_hovered = imgui.is_item_active(), imgui.is_item_hovered()
        item_rects.note(f"n at {nm:.0f} nm")
        _draw_handle(pixel, nm, radius, is_fixed, is_held or is_hovered)
        if is_held or is_hovered:
            _explain(nm, float(dispersion.index(nm)), is_fixed)
        if is_held and not is_fixed:
            _memory.held = True
            widgets.hold()
            state = _moved(state, index, dispersion, at, area)
    imgui.set_cursor_screen_pos(after)
    imgui.dummy(ImVec2(0.0, 0.0))
    return state


def _moved(state: State, index: int, dispersion: Dispersion, at: int, area: _Area) -> State:
    """The curve after the mouse's movement in this frame; a tenth of it with Shift."""
    io = imgui.get_io()
    step = -io.mouse_delta.y * area.n_per_pixel * (0.1 if io.key_shift else 1.0)
    if step == 0.0:
        return state
    n = float(dispersion.index(CONTROL_NM[at])) + step
    label = f"Shape n(λ) of {state.scene.objects[index].name}"
    return attempted(state, index, label, lambda: with_point(dispersion, at, n, _memory.keep_n_d), _memory)


def _draw_handle(pixel: ImVec2, nm: float, radius: float, is_fixed: bool, is_lit: bool) -> None:
    drawing, colours = imgui.get_window_draw_list(), theme.palette()
    ring = theme.packed(colours.accent if is_lit else colours.text)
    if is_fixed:
        corner, far = (
            ImVec2(pixel.x - 0.8 * radius, pixel.y - 0.8 * radius),
            ImVec2(pixel.x + 0.8 * radius, pixel.y + 0.8 * radius),
        )
        drawing.add_rect_filled(corner, far, theme.packed(colours.muted))
        return
    drawing.add_circle_filled(pixel, radius, colour_of_nm(nm))
    drawing.add_circle(pixel, radius, ring, 0, 1.5)


def _explain(nm: float, n: float, is_fixed: bool) -> None:
    line = f" ({_LINES[nm]} line)" if nm in _LINES else ""
    way = "Held by “Keep n_d”." if is_fixed else "Drag up or down; Shift drags finely."
    imgui.set_tooltip(f"{nm:.2f} nm{line}: n = {n:.5f}\n{way}")
