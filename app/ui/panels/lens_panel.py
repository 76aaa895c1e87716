"""The selected lens in numbers (focal lengths, chromatic shift and spots by wavelength), or what a selected caustic
plate draws, compared with its target."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import imgui

from ...base.errors import UserError
from ...edit.requests import CheckPlate
from ...edit.state import State
from ...model.io.picture_files import PICTURE_SUFFIXES
from ...model.lens_scene import lens_in
from ...model.optics.lens_design import HEADINGS, lens_table
from ..view_model import ViewModel
from . import widgets
from .solve_panel import draw_found, target_row
from .wavelength_table import draw_wavelength_table


def draw_lens_panel(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    index = state.selection.index if state.selection.kind == "object" else None
    chosen = None if index is None else state.scene.objects[index]
    try:
        lens = lens_in(state.scene, None if chosen is None or chosen.material.receives else chosen.name)
        found = lens_table(lens)
    except UserError as error:
        if chosen is not None and index is not None and chosen.material.is_solid and not chosen.material.is_crystal:
            return _plate(state, view_model, index)
        widgets.hint(f"{str(error)[:1].upper()}{str(error)[1:]}.")
        return state
    imgui.text_wrapped(f"{lens.name}: {found.summary()}.")
    draw_wavelength_table("Lens", HEADINGS, [(row.wavelength_nm, row.texts()[1:]) for row in found.rows])
    return state


def _plate(state: State, view_model: ViewModel, index: int) -> State:
    """Check object `index`, which is no lens, as a caustic plate."""
    item = state.scene.objects[index]
    solve = state.solve
    widgets.hint(f"{item.name} is no lens. Is it a plate that draws a picture with parallel light?")
    target, tip = solve.plate_target, "The picture that the plate was made for."
    target_row(state, view_model, "plate_target", PICTURE_SUFFIXES, tip=tip)
    tip = "From the plate's far side to the screen; 0: where the picture is most like the target."
    distance = widgets.drag("Distance", solve.plate_distance, 0.0, unit="units", tip=tip)
    state = replace(state, solve=replace(solve, plate_distance=distance))
    tip = "Compare what it draws in parallel light with the target, and find focus, colours and tolerances."
    if widgets.button("Check plate", tip=tip, enabled=target is not None and view_model.job is None, width=-1):
        assert target is not None
        state = state.asking(CheckPlate(index, target, distance or None))
    of = item.mesh, item.object_to_world, item.material.dispersion, target, distance or None
    draw_found(view_model.found.get("plate"), *of)
    return state
