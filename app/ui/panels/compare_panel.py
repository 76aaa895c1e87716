"""The picture compared with a reference or another method: what is shown, and what it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import imgui, implot

from ...base.colour_maps import ERROR, sample
from ...base.image_io import READ_SUFFIXES
from ...edit.requests import ComputeReference
from ...edit.state import Compare, CompareMode, State
from .. import item_rects, theme
from ..compared_with import LUMINANCE
from ..view_model import ViewModel
from . import file_browser, rows, widgets
from .methods import MENU_METHODS, METHOD_TIPS

MODES: dict[CompareMode, str] = {
    "off": "Picture alone",
    "hold": "Hold C to see it",
    "wipe": "Wipe",
    "beside": "Side by side",
    "error": "Error map",
}
MODE_TIPS = {
    "off": "Show the picture alone. Hold C at any time to see what it is compared with.",
    "hold": "Compute the other picture and show it as long as C is held.",
    "wipe": "The picture left of the line, the other right of it. Drag the line in the picture.",
    "beside": "This picture, the other and the error map beside each other, of the same view at half the size.",
    "error": "Relative error of the picture: blue is too dark, red too bright.",
}
REFERENCE = "reference"
_TIPS = {
    REFERENCE: "An independent rendering in float64 that shares no code with this one, refined in the background.",
    "glass": "The same scene with one solid of another glass, traced beside this one.",
    "file": "A picture from a file, such as another program's of the same view.",
}
_GLASSES = ("N-BK7", "F2", "N-SF11", "N-SF66", "water", "diamond")
_QUESTION = "compare with"
ERROR_RANGE = 0.5
"""Relative error at the ends of the map's scale (`passes.display.ERROR_RANGE`)."""
_WIDE_EM, _WIDEST_EM = 40.0, 50.0
"""Of the panel, from which on it has two and three columns."""
_LOWEST_PLOT_EM = 9.0
_LEGEND_STEPS = 40


def draw_compare(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    width = imgui.get_content_region_avail().x
    if width < theme.em(_WIDE_EM):
        state = _controls(state, view_model)
        state = _progress(state, view_model)
        _values(state, view_model)
        _histogram(view_model, theme.em(11))
        return state
    # Below the picture it is low and wide: side by side nothing has to be scrolled to.
    is_widest = width >= theme.em(_WIDEST_EM) and state.compare.is_active
    if imgui.begin_table("##compare", 3 if is_widest else 2, imgui.TableFlags_.sizing_stretch_prop):
        stretch = imgui.TableColumnFlags_.width_stretch
        for name, share in (("controls", 1.0), *((("progress", 1.0),) if is_widest else ()), ("plot", 1.2)):
            imgui.table_setup_column(name, stretch, share)
        imgui.table_next_row()
        imgui.table_next_column()
        state = _controls(state, view_model)
        if is_widest:
            imgui.table_next_column()
            _values(state, view_model)
            state = _progress(state, view_model)
        else:
            state = _progress(state, view_model)
        imgui.table_next_column()
        if not is_widest:
            _values(state, view_model)
        room = max(imgui.get_content_region_avail().y, theme.em(_LOWEST_PLOT_EM))
        _histogram(view_model, room)
        imgui.end_table()
    return state


def _controls(state: State, view_model: ViewModel) -> State:
    compare = state.compare
    _, mode = widgets.combo("Show", MODES, compare.mode, tip=MODE_TIPS[compare.mode])
    others = {REFERENCE: "Reference", "glass": "Another glass", "file": "A picture file"} | {
        method: name for method, name in MENU_METHODS.items() if method != state.method
    }
    tip = METHOD_TIPS.get(compare.method) or _TIPS[compare.method]
    _, method = widgets.combo("With", others, compare.method, tip=tip)
    if method != compare.method and mode == "off":
        mode = "wipe"  # who chooses what to compare with wants to see it
    if method == "glass" and compare.method != "glass":
        present = {
            item.material.dispersion.name for item in state.scene.objects if item.material.dispersion is not None
        }
        others_of = [name for name in _GLASSES if not any(one.endswith(name) for one in present)]
        compare = replace(compare, glass=others_of[0] if others_of else compare.glass)
    compare = replace(compare, mode=mode, method=method)
    if method == "glass":
        compare = _glass(compare)
    elif method == "file":
        compare = _file(compare, view_model)
    if mode == "wipe":
        _, wipe, active = widgets.slider(
            "Line at",
            100.0 * compare.wipe,
            0.0,
            100.0,
            unit="%",
            format="%.0f",
            reset=50.0,
            tip="Place of the line, share of the picture's width.",
        )
        compare = replace(compare, wipe=wipe / 100.0)
        state = widgets.holding(state, active)
    state = replace(state, compare=compare)
    if mode in ("error", "beside"):
        _legend()
    return state


def _glass(compare: Compare) -> Compare:
    glasses = dict.fromkeys((*_GLASSES, compare.glass))
    _, glass = widgets.combo("Glass", tuple(glasses), compare.glass, tip="Of the selected solid, or else of the first.")
    changed, typed = widgets.text_field("Other glass", glass, tip="Any name of the catalogue, such as N-LAK33B.")
    # One that does not exist is told below, with what was perhaps meant.
    return replace(compare, glass=typed.strip() if changed else glass)


def _file(compare: Compare, view_model: ViewModel) -> Compare:
    name = "none" if compare.file is None else compare.file.name
    tip = "A picture to compare with: .exr and .npy are linear, .png is read as displayed."
    if widgets.file_field("File", name, tip=tip):
        folder = view_model.path.parent if view_model.path is not None else Path.home()
        file_browser.ask(file_browser.Question(_QUESTION, "Compare with", READ_SUFFIXES, compare.file or folder))
    path = file_browser.take(_QUESTION)
    return compare if path is None else replace(compare, file=path)


def _values(state: State, view_model: ViewModel) -> None:
    """Both pictures under the cursor, in numbers."""
    if not state.compare.is_active:
        return
    own = None if view_model.cursor is None else view_model.cursor.rgb
    for label, rgb in (("Here", own), ("There", view_model.compared_rgb)):
        text = "–" if rgb is None else "  ".join(f"{value:.4g}" for value in rgb)
        widgets.read_out(label, text, tip="Linear red, green and blue under the cursor, lm/(sr unit²).")
    if own is not None and view_model.compared_rgb is not None:
        a, b = (
            sum(w * v for w, v in zip(LUMINANCE.tolist(), rgb, strict=True)) for rgb in (own, view_model.compared_rgb)
        )
        text = f"{100.0 * (a - b) / b:+.2f} %" if b > 0.0 else "–"
        widgets.read_out("Difference", text, tip="Of the luminances, relative to the other picture.")


def _histogram(view_model: ViewModel, height: float) -> None:
    found = view_model.histogram
    if found is None:
        return
    flags = implot.Flags_.no_menus | implot.Flags_.no_mouse_text | implot.Flags_.no_inputs
    if implot.begin_plot("##histogram", imgui.ImVec2(-theme.em(0.6), height), flags):
        implot.setup_axes("luminance (stops about display white)", "√ share of pixels")
        implot.setup_axis_limits(implot.ImAxis_.x1, float(found.stops[0]), float(found.stops[-1]), implot.Cond_.always)
        top = max(float(found.own.max()), float(found.other.max()), 1e-6)
        # The root, so that a bright line on a grey table is seen beside the table.
        implot.setup_axis_limits(implot.ImAxis_.y1, 0.0, 1.15 * top**0.5, implot.Cond_.always)
        implot.setup_legend(implot.Location_.north_east)
        # Its error stands in the picture; here it would lie over the curves.
        other = view_model.compare_label.partition(",")[0] or "Other"
        for name, shares, tint in zip(("This picture", other), (found.own, found.other), _tints(), strict=True):
            spec = implot.Spec(line_color=tint, line_weight=1.8)
            implot.plot_line(name, found.stops, np.ascontiguousarray(np.sqrt(shares), float), spec)
        implot.end_plot()
    item_rects.note("Histogram")


def _progress(state: State, view_model: ViewModel) -> State:
    """How far the other picture is, and what it is."""
    if not state.compare.is_active:
        widgets.hint("Choose what to show to begin. The other picture is computed in the time that this one leaves.")
        return state
    if state.compare.method == "file":  # it is read at once, whole
        if view_model.compare_text:
            widgets.hint(view_model.compare_text)
        return state
    done = view_model.reference_progress
    rows.begin_row("Progress")
    imgui.progress_bar(done or 0.0, imgui.ImVec2(-1, 0), "waiting" if done is None else f"{100 * done:.0f} %")
    rows.explain("Progress", "How far the picture it is compared with has come. It goes on while the window is open.")
    if view_model.compare_stale:
        widgets.note("Scene or view has changed: this is the picture from before.")
    if view_model.compare_text:
        widgets.hint(view_model.compare_text)
    if widgets.button(
        "Start again", tip="Compute what it is compared with anew, for the present scene and view.", width=-1
    ):
        state = state.asking(ComputeReference())
    return state


def _legend() -> None:
    """The error map's scale."""
    rows.begin_row("Scale")
    width, height = imgui.get_content_region_avail().x, imgui.get_frame_height()
    start = imgui.get_cursor_screen_pos()
    imgui.invisible_button("##scale", imgui.ImVec2(width, height))
    share = min(max((imgui.get_mouse_pos().x - start.x) / max(width, 1.0), 0.0), 1.0)
    rows.explain(
        "Scale",
        f"{100 * ERROR_RANGE * (2 * share - 1):+.0f} % of the reference. What is nearly black on the screen counts "
        "less; magenta is no number.",
    )
    drawing = imgui.get_window_draw_list()
    scale = sample(ERROR, np.linspace(0.0, 1.0, _LEGEND_STEPS + 1)).astype(float)
    colours = [theme.packed((r, g, b, 1.0)) for r, g, b in scale.tolist()]
    for i in range(_LEGEND_STEPS):
        low, high = start.x + width * i / _LEGEND_STEPS, start.x + width * (i + 1) / _LEGEND_STEPS
        corners = imgui.ImVec2(low, start.y), imgui.ImVec2(high, start.y + height)
        drawing.add_rect_filled_multi_color(*corners, colours[i], colours[i + 1], colours[i + 1], colours[i])
    texts = (
        (f"-{100 * ERROR_RANGE:.0f} %", (0.08, 0.08, 0.1, 1.0), 0.0),
        ("0", (0.9, 0.9, 0.9, 1.0), 0.5),
        (f"+{100 * ERROR_RANGE:.0f} %", (0.12, 0.06, 0.06, 1.0), 1.0),
    )
    pad = theme.em(0.35)
    for text, tint, place in texts:
        size = imgui.calc_text_size(text)
        at = start.x + pad + place * (width - size.x - 2 * pad)
        drawing.add_text(imgui.ImVec2(at, start.y + 0.5 * (height - size.y)), theme.packed(tint), text)


def _tints() -> tuple[imgui.ImVec4, ...]:
    palette = theme.palette()
    return imgui.ImVec4(*palette.accent), imgui.ImVec4(*palette.warning)
