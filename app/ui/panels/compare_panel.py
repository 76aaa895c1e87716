"""The picture compared with a reference or another method: what is shown, and what it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from ...base.colour_maps import ERROR, sample
from ...base.image_io import READ_SUFFIXES
from ...base.tone_map import LUMINANCE_709
from ...edit.requests import ComputeReference
from ...edit.state import Compare, CompareMode, State
from .. import theme
from ..view_model import ViewModel
from . import file_browser, rows, spectrum_strip, widgets
from .methods import MENU_METHODS, METHOD_TIPS

MODES: dict[CompareMode, str] = {
    "off": "Picture alone",
    "hold": "Hold C to see it",
    "wipe": "Wipe",
    "error": "Error map",
}
MODE_TIPS = {
    "off": "Show the picture alone. Hold C at any time to see what it is compared with.",
    "hold": "Compute the other picture and show it as long as C is held.",
    "wipe": "The picture left of the line, the other right of it. Drag the line in the picture.",
    "error": "Relative error of the picture: blue is too dark, red too bright.",
}
REFERENCE = "reference"
_TIPS = {
    REFERENCE: "An independent rendering in float64 that shares no code with this one, refined in the background.",
    "glass": "The same scene with one solid of another glass, traced in its own engine.",
    "file": "A picture from a file, such as another program's of the same view.",
}
_GLASSES = ("N-BK7", "F2", "N-SF11", "N-SF66", "water", "diamond")
_OF_SOLID = "Of the selected solid, or else of the first."
ERROR_RANGE = 0.5
"""Relative error at the ends of the map's scale (`passes.display.ERROR_RANGE`)."""
_LEGEND_STEPS = 40


def draw_compare(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    if not widgets.begin_columns("##compare"):
        return state
    imgui.table_next_column()
    state = _controls(state, view_model)
    imgui.table_next_column()
    _values(state, view_model)
    state = _progress(state, view_model)
    imgui.end_table()
    return state


def _controls(state: State, view_model: ViewModel) -> State:
    compare = state.compare
    mode = widgets.combo("Show", MODES, compare.mode, tip=MODE_TIPS[compare.mode])
    others = {REFERENCE: "Reference", "glass": "Another glass", "file": "A picture file"} | {
        method: name for method, name in MENU_METHODS.items() if method != state.method
    }
    tip = METHOD_TIPS.get(compare.method) or _TIPS[compare.method]
    method = widgets.combo("With", others, compare.method, tip=tip)
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
        _file(compare, view_model)
    if mode == "wipe":
        tip, before = "Place of the line, share of the picture's width.", 100.0 * compare.wipe
        wipe = widgets.slider("Line at", before, 0.0, 100.0, unit="%", format="%.0f", reset=50.0, tip=tip)
        compare = replace(compare, wipe=wipe / 100.0)
    elif mode == "error":
        _legend()
    return replace(state, compare=compare)


def _glass(compare: Compare) -> Compare:
    glasses = dict.fromkeys((*_GLASSES, compare.glass))
    glass = widgets.combo("Glass", tuple(glasses), compare.glass, tip=_OF_SOLID)
    # One that does not exist is reported below, with what was perhaps meant.
    typed = widgets.text_field("Other glass", glass, tip="Any name of the catalogue, such as N-LAK33B.")
    return replace(compare, glass=typed if typed == glass else typed.strip())


def _file(compare: Compare, view_model: ViewModel) -> None:
    name = "none" if compare.file is None else compare.file.name
    tip = "A picture to compare with: .exr and .npy are linear, .png is read as displayed."
    if widgets.file_field("File", name, tip=tip):
        folder = view_model.path.parent if view_model.path is not None else Path.home()
        start = compare.file or folder
        file_browser.ask(file_browser.Question("Compare with", READ_SUFFIXES, start, _with_file))


def _with_file(state: State, _view_model: ViewModel, path: Path) -> State:
    return replace(state, compare=replace(state.compare, file=path))


def _values(state: State, view_model: ViewModel) -> None:
    """Both pictures under the cursor, in numbers."""
    if not state.compare.is_active:
        return
    own = None if view_model.cursor is None else view_model.cursor.rgb
    for label, rgb in (("Here", own), ("There", view_model.compared_rgb)):
        text = "–" if rgb is None else "  ".join(f"{value:.4g}" for value in rgb)
        widgets.read_out(label, text, tip="Linear red, green and blue under the cursor, lm/(sr unit²).")
    if own is not None and view_model.compared_rgb is not None:
        a, b = (float(LUMINANCE_709 @ np.asarray(rgb)) for rgb in (own, view_model.compared_rgb))
        text = f"{100.0 * (a - b) / b:+.2f} %" if b > 0.0 else "–"
        widgets.read_out("Difference", text, tip="Of the luminances, relative to the other picture.")


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
    rows.explain("Progress", "How far the picture it is compared with has come. It continues while the window is open.")
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
    spectrum_strip.draw_gradient(drawing, start, imgui.ImVec2(start.x + width, start.y + height), colours)
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
