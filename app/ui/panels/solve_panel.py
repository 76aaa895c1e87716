"""What solves by derivatives: the picture's derivative by a number of the scene, and which glass or number casts a
light."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from imgui_bundle import imgui

from ...base.image_io import READ_SUFFIXES
from ...edit.parameters import paths
from ...edit.requests import Derive, MatchGlass
from ...edit.state import State
from ..compared_with import glass_object
from ..view_model import Found, ViewModel
from . import file_browser, widgets

_WANTED: dict[Literal["light", "picture", "width"], str] = {
    "light": "The light as it is",
    "picture": "A picture at the ruler",
    "width": "A width at the ruler",
}
_WANTED_TIPS = {
    "light": "What the scene casts on its first flat receiver now, after a colour was pulled for example.",
    "picture": "Press K and click three corners on the receiver: upper left, upper right, lower left; or, for spectra "
    "in a .csv, both ends of a line.",
    "width": "Press K and click both ends of a line across the fringe, on the receiver.",
}


def draw_solve(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    if not widgets.begin_columns("##solve"):
        return state
    imgui.table_next_column()
    state = _derivative(state, view_model)
    imgui.table_next_column()
    state = _glass(state, view_model)
    imgui.end_table()
    return state


def _derivative(state: State, view_model: ViewModel) -> State:
    kind, index = state.selection.kind, state.selection.index
    names = [each.name for each in (state.scene.objects if kind == "object" else state.scene.lights)]
    if kind not in ("object", "light"):
        widgets.hint("Select an object or a light: by which of its numbers is the picture to be derived?")
        return state
    head = f"{kind}s.{names[index]}."
    known = {path: path.removeprefix(head) for path in paths(state.scene, state.camera) if path.startswith(head)}
    present = state.solve.parameter if state.solve.parameter in known else next(iter(known))
    tip = "Of what is selected. Red becomes brighter as it grows, blue darker."
    chosen = widgets.combo("Derivative by", known, present, tip=tip)
    state = replace(state, solve=replace(state.solve, parameter=chosen))
    tip = "Render the picture at either side of a small step, by the same random numbers, and take the difference."
    if widgets.button("Derive", tip=tip, enabled=view_model.job is None, width=-1):
        state = state.asking(Derive(chosen))
    draw_found(view_model.found.get("derivative"), state.scene, state.camera, chosen)
    return state


def _glass(state: State, view_model: ViewModel) -> State:
    index = glass_object(state.scene, state.selection)
    if index is None:
        widgets.hint("Nothing in this scene is glass.")
        return state
    solve = state.solve
    wanted = widgets.combo("Wanted", _WANTED, solve.wanted, tip=_WANTED_TIPS[solve.wanted])
    solve = replace(solve, wanted=wanted)
    if wanted == "picture":
        tip = "A picture, or a .csv of spectra, a line a place."
        target_row(state, view_model, "file", (*READ_SUFFIXES, ".csv"), tip=tip)
    elif wanted == "width":
        tip = "Full width at half maximum of the light along the ruler's line."
        solve = replace(solve, width=widgets.drag("Width", solve.width, 0.0, unit="units", tip=tip))
    state = replace(state, solve=solve)
    item = state.scene.objects[index]
    file = solve.file if wanted == "picture" else None
    missing = (wanted == "picture" and file is None) or (wanted == "width" and solve.width <= 0.0)
    missing = missing or (wanted != "light" and len(state.measured) < 2)
    if missing:
        widgets.hint(_WANTED_TIPS[wanted])
    ready = not missing and view_model.job is None and not item.material.is_crystal
    between = () if wanted == "light" else state.measured[: 2 if wanted == "width" else 3]
    ask = MatchGlass(index, file, solve.width if wanted == "width" else None, between)
    if widgets.button(f"Find the glass of {item.name}###find", tip="Rank the catalogue.", enabled=ready, width=-1):
        state = state.asking(ask)
    if wanted != "light":
        state = _numbers(state, view_model, ask, ready=not missing)
    draw_found(view_model.found.get("answer"), state.scene)
    return state


def _numbers(state: State, view_model: ViewModel, ask: MatchGlass, *, ready: bool) -> State:
    """The row that fits the number that is chosen for the derivative, of a picture with n_d and V_d."""
    solve, name = state.solve, state.scene.objects[ask.index].name
    of: tuple[str, ...] = (solve.parameter,)
    if ask.width is None:
        tip = "Of this glass, all at once. A picture tells them apart, a width does not."
        solve = replace(solve, with_glass=widgets.toggle("n_d, V_d too", solve.with_glass, tip=tip))
    if ask.width is None and solve.with_glass:
        of = tuple(dict.fromkeys((*of, f"objects.{name}.n_d", f"objects.{name}.V_d")))
    tip = "From its present value on, by derivatives. The number is that chosen under 'Derivative by'."
    ready = ready and bool(of[0]) and view_model.job is None
    state = replace(state, solve=solve)
    if widgets.button(f"Fit {of[0] or 'a number'}###fit", tip=tip, enabled=ready, width=-1):
        state = state.asking(replace(ask, of=of))
    return state


def target_row(state: State, view_model: ViewModel, field: str, suffixes: tuple[str, ...], *, tip: str) -> None:
    """A row for the file that `field` of what the panels are set to holds."""
    present = getattr(state.solve, field)
    if widgets.file_field("Target", "none" if present is None else present.name, tip=tip):
        folder = view_model.path.parent if view_model.path is not None else Path.home()

        def chosen(state: State, _view_model: ViewModel, path: Path) -> State:
            return replace(state, solve=replace(state.solve, **{field: path}))  # type: ignore[arg-type]

        file_browser.ask(file_browser.Question("Light that is wanted", suffixes, present or folder, chosen))


def draw_found(found: Found | None, *of: object) -> None:
    """What a job found, `of` what is there now or of what was before, and a picture of it where there is one."""
    if found is None:
        return
    if not found.is_of(*of):
        widgets.note("Something has changed since: this was found before.")
    for label, text in found.rows:
        widgets.read_out(label if "." in label else label[:1].upper() + label[1:], text, tip=text)
    if found.codes is None:
        return
    height, width = found.codes.shape[:2]
    across = min(imgui.get_content_region_avail().x, float(2 * width))
    imgui.image(imgui.ImTextureRef(found.texture), imgui.ImVec2(across, across * height / width))
