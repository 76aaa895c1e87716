"""The n_d–V_d diagram that glass makers print, to click in: every glass of the catalogue, and those of the scene.

A click gives the selected object the glass under the cursor; Ctrl and drag makes it a model
glass of any n_d and Abbe number, live. Wheel zooms, dragging moves the view.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui, implot

from ...edit.state import State
from ...model.optics import catalogue
from ...model.optics.catalogue import MAKER_ORDER, Entry
from .. import item_rects, theme
from ..view_model import ViewModel
from . import widgets
from .glass_picker import apply_glass, remark
from .glass_values import abbe_text, attempted, glasses_of, own_numbers, selected_glass, with_abbe

V_D_RANGE, N_D_RANGE = (15.0, 100.0), (1.4, 2.1)
"""What is shown at first: nearly all glasses."""

_CROWN_FLINT = ((55.0, 0.0), (55.0, 1.6), (50.0, 1.6), (50.0, 9.0))
"""Crown is left of this line: V_d above 55, or above 50 where n_d exceeds 1.6."""

_NEAR_EM = 0.7

_COLOURS = (
    (0.62, 0.62, 0.62),
    (0.36, 0.61, 0.84),
    (0.90, 0.60, 0.00),
    (0.17, 0.68, 0.48),
    (0.84, 0.45, 0.68),
    (0.83, 0.37, 0.12),
    (0.60, 0.53, 0.86),
    (0.74, 0.70, 0.24),
    (0.45, 0.75, 0.75),
)
"""One for each maker, distinguishable to the colour-blind too (after Okabe and Ito)."""


@dataclass(frozen=True)
class _Points:
    """The catalogue as arrays."""

    entries: tuple[Entry, ...]
    v_d: np.ndarray
    n_d: np.ndarray
    maker: np.ndarray
    """Index in `MAKER_ORDER`."""


@dataclass
class _Memory:
    """What the diagram shows; not part of the document."""

    hidden: set[str] = field(default_factory=set)
    """Makers left out."""
    is_setting: bool = False
    """A Ctrl-drag is under way."""
    refused: str = ""
    corners: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))
    """Where the plot was drawn last, pixels: top left, bottom right."""


_memory = _Memory()


def draw_abbe(state: State, view_model: ViewModel) -> State:
    """The diagram with the makers to show; the state with the glass that was clicked or dragged to."""
    _draw_makers()
    selected = selected_glass(state)
    if selected is None:
        widgets.hint("Select an object of glass, then click a glass here.")
    else:
        widgets.hint(f"Click: {selected[1].name} gets that glass.  Ctrl+drag: any n_d and V_d.  Wheel: zoom.")
    if _memory.refused:
        widgets.error(_memory.refused)
    flags = implot.Flags_.no_legend.value | implot.Flags_.no_menus.value | implot.Flags_.no_box_select.value
    flags |= implot.Flags_.no_title.value | implot.Flags_.no_mouse_text.value
    if not implot.begin_plot("##abbe", ImVec2(-1.0, max(imgui.get_content_region_avail().y, theme.em(14.0))), flags):
        return state
    _setup_axes()
    _draw_regions()
    shown = _shown()
    _draw_glasses(shown)
    _draw_objects(state)
    state = _answer_mouse(state, shown)
    corner, size = implot.get_plot_pos(), implot.get_plot_size()
    _memory.corners = (corner.x, corner.y), (corner.x + size.x, corner.y + size.y)
    implot.end_plot()
    item_rects.note("Abbe plot")
    return state


@cache
def _points() -> _Points:
    kept = tuple(e for e in catalogue.entries() if np.isfinite(e.dispersion.V_d))
    makers = {maker: i for i, maker in enumerate(MAKER_ORDER)}
    return _Points(
        kept,
        np.array([e.dispersion.V_d for e in kept]),
        np.array([e.dispersion.n_d for e in kept]),
        np.array([makers[e.maker] for e in kept]),
    )


def _shown() -> np.ndarray:
    """Which points are shown, bool."""
    hidden = [i for i, maker in enumerate(MAKER_ORDER) if maker in _memory.hidden]
    return ~np.isin(_points().maker, hidden)


def _maker_colour(index: int) -> theme.Colour:
    r, g, b = _COLOURS[index]
    shade = 1.0 if theme.palette().is_dark else 0.82
    return (r * shade, g * shade, b * shade, 1.0)


def _draw_makers() -> None:
    """A box for each maker in its colour, as many in a row as there is room for."""
    gap, edge = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
    used = 0.0
    for index, maker in enumerate(MAKER_ORDER):
        width = imgui.calc_text_size(maker).x + imgui.get_frame_height() + imgui.get_style().item_inner_spacing.x
        if 0.0 < used and used + gap + width <= edge:
            imgui.same_line()
            used += gap + width
        else:
            used = width
        imgui.push_style_color(imgui.Col_.check_mark, ImVec4(*_maker_colour(index)))
        changed, is_shown = imgui.checkbox(maker, maker not in _memory.hidden)
        imgui.pop_style_color()
        item_rects.note(maker)
        widgets.tooltip(f"Show the glasses of {maker}." if index else "Show water, plastics, crystals and gems.")
        if changed:
            (_memory.hidden.discard if is_shown else _memory.hidden.add)(maker)


# ---- drawing ------------------------------------------------------------------------------


def _setup_axes() -> None:
    x, y = implot.ImAxis_.x1.value, implot.ImAxis_.y1.value
    implot.setup_axis(x, "Abbe number V_d", implot.AxisFlags_.invert.value)
    implot.setup_axis(y, "Index n_d")
    implot.setup_axis_limits(x, *V_D_RANGE)
    implot.setup_axis_limits(y, *N_D_RANGE)
    implot.setup_axis_limits_constraints(x, 5.0, 125.0)
    implot.setup_axis_limits_constraints(y, 1.0, 3.0)
    implot.setup_finish()


def _draw_regions() -> None:
    spec = implot.Spec()
    muted = theme.palette().muted
    spec.line_color, spec.line_weight = ImVec4(*muted[:3], 0.7), 1.0
    v_d, n_d = np.array(_CROWN_FLINT).T
    implot.plot_line("##crown and flint", np.ascontiguousarray(v_d), np.ascontiguousarray(n_d), spec)
    limits, drawing = implot.get_plot_limits(), implot.get_plot_draw_list()
    edge = implot.plot_to_pixels(50.0, limits.y.max)
    implot.push_plot_clip_rect()
    width = imgui.calc_text_size("Crown").x
    tint = theme.packed(muted)
    drawing.add_text(ImVec2(edge.x - width - theme.em(0.8), edge.y + theme.em(0.4)), tint, "Crown")
    drawing.add_text(ImVec2(edge.x + theme.em(0.8), edge.y + theme.em(0.4)), tint, "Flint")
    implot.pop_plot_clip_rect()


def _draw_glasses(shown: np.ndarray) -> None:
    points = _points()
    for index, maker in enumerate(MAKER_ORDER):
        mine = shown & (points.maker == index)
        if not mine.any():
            continue
        spec = implot.Spec()
        colour = ImVec4(*_maker_colour(index)[:3], 0.75)
        spec.marker, spec.marker_size = implot.Marker_.circle.value, theme.em(0.18)
        spec.marker_fill_color, spec.marker_line_color = colour, ImVec4(0.0, 0.0, 0.0, 0.0)
        implot.plot_scatter(f"##{maker}", points.v_d[mine], points.n_d[mine], spec)


def _draw_objects(state: State) -> None:
    """A ring and a name for each object of glass, the selected one in the accent's colour."""
    drawing, colours = implot.get_plot_draw_list(), theme.palette()
    implot.push_plot_clip_rect()
    taken: list[ImVec2] = []
    right = implot.get_plot_pos().x + implot.get_plot_size().x
    for index, item, material in glasses_of(state.scene):
        n_d, v_d = own_numbers(material.dispersion)
        if not np.isfinite(v_d):
            continue
        at = implot.plot_to_pixels(v_d, n_d)
        is_selected = state.selection.kind == "object" and state.selection.index == index
        tint = theme.packed(colours.accent if is_selected else colours.text)
        drawing.add_circle(at, theme.em(0.42), tint, 0, 2.0)
        # Names of objects of one glass are below each other.
        line = sum(abs(at.x - other.x) < theme.em(2.0) and abs(at.y - other.y) < theme.em(1.0) for other in taken)
        taken.append(at)
        x = place_of_name(at.x, imgui.calc_text_size(item.name).x, theme.em(0.65), right)
        _draw_name(drawing, ImVec2(x, at.y - theme.em(0.55) + line * theme.em(1.1)), item.name, tint)
    implot.pop_plot_clip_rect()


def place_of_name(ring: float, width: float, gap: float, right: float) -> float:
    """Where a name of `width` begins: right of the ring, or left of it where it would pass the plot's `right` border;
    pixels."""
    beyond = ring + gap + width > right
    return ring - gap - width if beyond else ring + gap


def _draw_name(drawing: imgui.ImDrawList, at: ImVec2, name: str, tint: int) -> None:
    """Text on a plate of the plot's ground, so that points do not make it unreadable."""
    size = imgui.calc_text_size(name)
    ground = implot.get_style().color_(implot.Col_.plot_bg)
    plate = theme.packed((ground.x, ground.y, ground.z, 0.8))
    drawing.add_rect_filled(ImVec2(at.x - 2.0, at.y), ImVec2(at.x + size.x + 2.0, at.y + size.y), plate, 2.0)
    drawing.add_text(at, tint, name)


# ---- the mouse ----------------------------------------------------------------------------


def _answer_mouse(state: State, shown: np.ndarray) -> State:
    is_hovered, io = implot.is_plot_hovered(), imgui.get_io()
    if is_hovered and io.key_ctrl and imgui.is_mouse_clicked(0) and selected_glass(state) is not None:
        _memory.is_setting, _memory.refused = True, ""
    if _memory.is_setting and not imgui.is_mouse_down(0):
        _memory.is_setting = False
    if _memory.is_setting:
        widgets.hold()
        return _set_freely(state)
    near = nearest_entry(shown) if is_hovered else None
    if near is None:
        return state
    _mark(near)
    moved = imgui.get_mouse_drag_delta(0, 0.0)
    is_click = imgui.is_mouse_released(0) and abs(moved.x) + abs(moved.y) < 4.0
    if not (is_click and selected_glass(state) is not None):
        return state
    _memory.refused = ""
    return apply_glass(state, near)


def _set_freely(state: State) -> State:
    """The selected object as a model glass of the numbers under the cursor."""
    selected = selected_glass(state)
    if selected is None:
        return state
    index, item, material = selected
    point = implot.get_plot_mouse_pos()
    v_d, n_d = float(f"{max(point.x, 5.0):.4g}"), float(f"{max(point.y, 1.0):.5g}")
    imgui.set_tooltip(f"n_d = {n_d:.4f}\nV_d = {v_d:.2f}")
    if own_numbers(material.dispersion) == (n_d, v_d):
        return state
    label = f"n_d and V_d of {item.name}"
    return attempted(state, index, label, lambda: with_abbe(material.dispersion, n_d, v_d), _memory)


def nearest_entry(shown: np.ndarray) -> Entry | None:
    """The shown glass nearest to the cursor, when one is near; to be called within the plot."""
    points = _points()
    origin, mouse = implot.plot_to_pixels(0.0, 0.0), imgui.get_mouse_pos()
    unit = implot.plot_to_pixels(1.0, 1.0)
    x = origin.x + (unit.x - origin.x) * points.v_d - mouse.x
    y = origin.y + (unit.y - origin.y) * points.n_d - mouse.y
    distance = np.where(shown, np.hypot(x, y), np.inf)
    best = int(distance.argmin())
    return points.entries[best] if distance[best] < theme.em(_NEAR_EM) else None


def _mark(entry: Entry) -> None:
    glass = entry.dispersion
    at = implot.plot_to_pixels(glass.V_d, glass.n_d)
    drawing = implot.get_plot_draw_list()
    drawing.add_circle_filled(at, theme.em(0.25), theme.packed(_maker_colour(MAKER_ORDER.index(entry.maker))))
    imgui.begin_tooltip()
    with theme.heading():
        imgui.text_unformatted(entry.qualified_name)
    imgui.text_unformatted(f"n_d = {glass.n_d:.5f}\nV_d = {abbe_text(glass.V_d)}")
    if remark(entry):
        widgets.hint(remark(entry))
    imgui.end_tooltip()
