"""The selected lens in numbers: focal lengths, chromatic shift and spots by wavelength."""

from __future__ import annotations

from imgui_bundle import imgui

from ...base.errors import UserError
from ...edit.state import State
from ...model.lens_scene import lens_in
from ...model.optics.lens_design import HEADINGS, lens_table
from ..view_model import ViewModel
from . import widgets
from .wavelength_table import draw_wavelength_table


def draw_lens_panel(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    index = state.selection.index if state.selection.kind == "object" else None
    chosen = None if index is None else state.scene.objects[index]
    try:
        lens = lens_in(state.scene, None if chosen is None or chosen.material.receives else chosen.name)
        found = lens_table(lens)
    except UserError as error:
        widgets.hint(f"{str(error)[:1].upper()}{str(error)[1:]}.")
        return state
    imgui.text_wrapped(f"{lens.name}: {found.summary()}.")
    draw_wavelength_table("Lens", HEADINGS, [(row.wavelength_nm, row.texts()[1:]) for row in found.rows])
    return state
