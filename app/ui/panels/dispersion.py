"""The dispersion of the selected object: its glass, n_d and Abbe number, the gain, n(λ) and its colour."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from imgui_bundle import ImVec2, imgui

from ...edit import edits, presets
from ...edit.glass import set_absorption, set_dispersion, set_priority, set_tint
from ...edit.objects import set_material
from ...edit.state import State
from ...model.materials.dielectric import MAX_PRIORITY
from ...model.optics import glass
from ...model.optics.glass import Dispersion
from ...model.optics.tints import Tint, half_distance, tint, tint_of, tints
from ...model.scene import Absorption, SceneObject, Vec3
from ...model.staging import tinted
from .. import theme
from ..view_model import ViewModel
from . import widgets
from .glass_picker import POPUP, draw_glass_picker
from .glass_values import (
    abbe_text,
    as_sold,
    attempted,
    base_name,
    is_as_sold,
    lines_of,
    notes_of,
    own_numbers,
    selected_glass,
    shown_name,
    with_abbe,
)
from .index_curve import draw_index_curve

_FIRST_COLOUR, _FIRST_DISTANCE = (0.55, 0.85, 0.75), 1.0
"""What a glass starts with when it is tinted: bottle green."""
_OWN = "own"


def draw_absorption(state: State, index: int) -> State:
    """Rows for the absorption of object `index`, which is of glass; a thin sheet has none."""
    item = state.scene.objects[index]
    material = item.material
    if not material.is_solid:
        return state
    tip = "Let the glass absorb light on the way through it (Beer–Lambert). Off: perfectly clear."
    is_tinted = widgets.toggle("Tinted", material.absorption is not None, tip=tip)
    if is_tinted != (material.absorption is not None):
        return _tinted(state, index, _FIRST_COLOUR if is_tinted else None, _FIRST_DISTANCE)
    if material.absorption is None:
        return state
    known = tint_of(material.absorption.coefficient)
    present = _OWN if known is None else known[0].name
    choices = {_OWN: "A colour of its own"} | {each.name: each.name.capitalize() for each in tints()}
    tip = "What colours the glass. " + (
        "Tints are approximated by the bands of their colourants." if known is None else f"{known[0].colourant}."
    )
    chosen = widgets.combo("Tint", choices, present, tip=tip)
    if chosen != present:
        return _chosen(state, index, chosen, known)
    if known is not None:
        return _draw_depth(state, index, *known)
    return _draw_colour(state, index, material.absorption)


def _chosen(state: State, index: int, name: str, known: tuple[Tint, float] | None) -> State:
    """Another tint as deep as the last, or the colour of one's own."""
    found = tint(name)
    if found is None:
        return _tinted(state, index, _FIRST_COLOUR, _FIRST_DISTANCE)
    item = state.scene.objects[index]
    absorption = tinted(item, found).absorption
    assert absorption is not None
    distance = half_distance(absorption.coefficient) if known is None else known[1]
    return edits.attempt(state, f"Tint of {item.name}", set_tint, index, found, distance)


def _depth_drag(label: str, distance: float, tip: str) -> float:
    """A row for a depth of glass, in the scene's units."""
    return widgets.drag(
        label, distance, 1e-4, 1e6, unit="units", tip=tip, reset=_FIRST_DISTANCE, format="%.3f", logarithmic=True
    )


def _draw_depth(state: State, index: int, present: Tint, distance: float) -> State:
    tip = "How far daylight travels inside until it is half as bright. Shorter is deeper."
    wanted, label = _depth_drag("Half at a depth of", distance, tip), f"Tint of {state.scene.objects[index].name}"
    return state if wanted == distance else edits.attempt(state, label, set_tint, index, present, wanted)


def _draw_colour(state: State, index: int, absorption: Absorption) -> State:
    if absorption.colour is None:
        widgets.hint("The absorption is a measured curve, which no colour describes.")
        return state
    rgb = widgets.colour(
        "Colour", absorption.colour[0], tip="Colour of white light after the distance below.", highest=1.0
    )
    tip = "How far white light travels inside the glass until it has this colour. Shorter is deeper."
    distance = _depth_drag("At a depth of", absorption.colour[1], tip)
    return state if (rgb, distance) == absorption.colour else _tinted(state, index, rgb, distance)


def _tinted(state: State, index: int, rgb: Vec3 | None, distance: float) -> State:
    """Object `index` with that absorption; `rgb` None: clear."""
    label = f"Tint of {state.scene.objects[index].name}"
    return edits.attempt(state, label, set_absorption, index, rgb, distance)


MAX_GAIN = 10.0


@dataclass
class _Memory:
    """The last edit that was refused, until one succeeds or something else is selected."""

    refused: str = ""
    of: str = ""


_memory = _Memory()


def draw_dispersion(state: State, view_model: ViewModel) -> State:
    """The panel's contents; the window is the shell's."""
    selected = selected_glass(state)
    if selected is None:
        widgets.hint(_why_empty(state))
        return state
    index, item, material = selected
    if _memory.of != item.name:
        _memory.of, _memory.refused = item.name, ""
    _draw_header(item, material.dispersion)
    state = _draw_buttons(state, view_model, index)
    if widgets.section("Dispersion"):
        state = _draw_numbers(state, view_model, index)
    if widgets.section("Index curve n(λ)"):
        state = draw_index_curve(state, view_model)
    if widgets.section("Colour and overlap", is_open=False):
        state = draw_absorption(state, index)
        state = _draw_priority(state, index)
    return state


def _why_empty(state: State) -> str:
    if state.selection.kind in (None, "camera"):
        return "Click an object of glass, or a caustic that it makes, to edit its dispersion."
    if state.selection.kind == "light":
        return "A light is selected. Its spectrum is in the inspector; click an object of glass to edit its dispersion."
    return "The selected object is not of glass. Give it a glass in the inspector, or click another object."


def _draw_header(item: SceneObject, dispersion: Dispersion) -> None:
    with theme.heading(1.15):
        imgui.text_unformatted(item.name)
    imgui.text_unformatted(shown_name(dispersion))
    sold = as_sold(dispersion)
    if sold is not None and dispersion.natural == sold:
        widgets.tooltip("As in the catalogue.")
    if dispersion.gain != 1.0:
        imgui.same_line()
        with theme.coloured(theme.palette().accent):
            imgui.text_unformatted(f"× {dispersion.gain:.3g}")
        widgets.tooltip("The dispersion is multiplied by this gain.")


# ---- buttons ------------------------------------------------------------------------------


def _draw_buttons(state: State, view_model: ViewModel, index: int) -> State:
    dispersion = selected_glass(state)[2].dispersion  # type: ignore[index]
    if widgets.button(
        "Choose glass…", tip="Search 1,700 glasses, plastics, liquids and gems by name, maker or number."
    ):
        imgui.open_popup(POPUP)
    widgets.beside("Abbe diagram")
    abbe_open = state.preferences.panels.abbe
    tip = "Every glass of the catalogue by n_d and Abbe number, to click in."
    if widgets.button("Abbe diagram", tip=tip):
        state = state.with_panels(abbe=not abbe_open)
    widgets.beside("As sold")
    sold = as_sold(dispersion)
    tip = (
        f"Back to {base_name(dispersion)} as the catalogue has it, without gain."
        if sold
        else "This glass is not from the catalogue."
    )
    if widgets.button("As sold", tip=tip, enabled=sold is not None and not is_as_sold(dispersion)) and sold:
        state = edits.attempt(state, f"{sold.name} as sold", set_dispersion, index, sold)
    state = _draw_clipboard(state, index)
    if imgui.begin_popup(POPUP):
        imgui.begin_child("picker", ImVec2(theme.em(46.0), theme.em(30.0)))
        state = draw_glass_picker(state, view_model)
        imgui.end_child()
        imgui.end_popup()
    return state


def _draw_clipboard(state: State, index: int) -> State:
    item = state.scene.objects[index]
    if widgets.button("Copy material", tip=f"Copy glass, gain and colour of {item.name}."):
        state = replace(state, clipboard=item.material)
    widgets.beside("Paste material")
    held = state.clipboard
    if held is not None and held.transmits:
        tip = f"Give {item.name} the copied material: {shown_name(held.dispersion)}."
    else:
        tip = "Copy the material of an object of glass first."
    if widgets.button("Paste material", tip=tip, enabled=held is not None and held.transmits) and held:
        state = edits.attempt(state, f"Paste material on {item.name}", set_material, index, held)
    widgets.beside("Presets…")
    ready = {p.name: p for p in presets.material_presets()}
    chosen = widgets.menu_button(
        "Presets…", {n: p.remark for n, p in ready.items()}, tip="Common glasses, liquids and gems by everyday names."
    )
    if chosen is None:
        return state
    return edits.attempt(state, f"{chosen} for {item.name}", presets.apply_material, index, ready[chosen])


# ---- numbers ------------------------------------------------------------------------------


def _draw_numbers(state: State, view_model: ViewModel, index: int) -> State:
    item = state.scene.objects[index]
    dispersion = item.material.dispersion
    sold = as_sold(dispersion)
    tip = (
        "How many times stronger than in nature colours spread. 1 is the glass itself, 0 does not disperse; n_d stays."
    )
    gain = widgets.slider(
        "Dispersion gain", dispersion.gain, 0.0, MAX_GAIN, unit="×", tip=tip, reset=1.0, format="%.2f", mark=1.0
    )
    if gain != dispersion.gain:
        state = attempted(
            state, index, f"Dispersion gain of {item.name}", lambda: glass.with_gain(dispersion, gain), _memory
        )
    n_d, v_d = own_numbers(dispersion)
    tip = "Refractive index at the helium d line, 587.56 nm: how strongly light is bent. The Abbe number stays."
    new_n_d = widgets.slider(
        "Index n_d", n_d, 1.0, 2.8, unit="", tip=tip, reset=sold.n_d if sold else None, format="%.5f", clamp=False
    )
    if new_n_d != n_d:
        state = attempted(state, index, f"n_d of {item.name}", lambda: with_abbe(dispersion, new_n_d, v_d), _memory)
    tip = (
        "Abbe number (n_d − 1)/(n_F − n_C) of the glass before its gain: small is dispersive, 20 to 90 for glass. "
        "The slider is even in 1/V_d, so equal ways spread colours by equal amounts. Negative numbers (anomalous "
        "dispersion) can be typed."
    )
    reset = sold.V_d if sold else None
    new_v_d = widgets.reciprocal_slider("Abbe number V_d", v_d, 8.0, unit="", tip=tip, reset=reset)
    if new_v_d != v_d:
        state = attempted(
            state, index, f"Abbe number of {item.name}", lambda: with_abbe(dispersion, n_d, new_v_d), _memory
        )
    if _memory.refused:
        widgets.error(_memory.refused)
    _draw_lines(state.scene.objects[index].material.dispersion)
    if view_model.stats.first_order:
        widgets.hint("The caustic follows this edit to first order until it is traced again.")
    return state


def _draw_lines(dispersion: Dispersion) -> None:
    """What is rendered, in a catalogue's numbers."""
    lines = lines_of(dispersion)
    cells = (
        ("n_F", f"{lines.n_f:.5f}", "Index at the hydrogen F line, 486.13 nm (blue)."),
        ("n_d", f"{lines.n_d:.5f}", "Index at the helium d line, 587.56 nm (yellow)."),
        ("n_C", f"{lines.n_c:.5f}", "Index at the hydrogen C line, 656.27 nm (red)."),
        ("n_F − n_C", f"{lines.principal:.5f}", "Principal dispersion, gain included."),
        (
            "V_d" if dispersion.gain == 1.0 else "V_d / gain",
            abbe_text(lines.v_d),
            "Abbe number over the gain: that of what is rendered.",
        ),
        (
            "P_g,F",
            "–" if lines.partial_gf is None else f"{lines.partial_gf:.4f}",
            "Relative partial dispersion (n_g − n_F)/(n_F − n_C), g at 435.83 nm: how blue stretches against red.",
        ),
    )
    imgui.spacing()
    if imgui.begin_table("lines", 3, imgui.TableFlags_.sizing_stretch_same.value):
        for name, value, tip in cells:
            imgui.table_next_column()
            with theme.coloured(theme.palette().muted):
                imgui.text_unformatted(name)
            widgets.tooltip(tip)
            imgui.text_unformatted(value)
            widgets.tooltip(tip)
        imgui.end_table()
    for note in notes_of(dispersion):
        widgets.note(note[:1].upper() + note[1:])


def _draw_priority(state: State, index: int) -> State:
    item = state.scene.objects[index]
    material = item.material
    if not material.transmits:
        return state
    tip = (
        "Where solids overlap, the one of higher priority fills the place (a liquid in its vessel: lower than the "
        "glass)."
    )
    before, most = float(material.priority), MAX_PRIORITY
    priority = widgets.drag("Priority", before, -most, most, unit="", tip=tip, reset=0.0, format="%.0f", speed=0.05)
    rounded = math.floor(priority + 0.5)
    if rounded == material.priority:
        return state
    return edits.attempt(state, f"Priority of {item.name}", set_priority, index, rounded)
