"""The dispersion brush and pulling a colour: settings, what was painted where, and the physical picture to compare
with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...edit import edits
from ...edit.brush import USUAL_RADIUS
from ...edit.objects import clear_dabs
from ...edit.state import Brush, State, Tool
from ...model.local_dispersion import dab_weight
from ...model.scene import Dab
from .. import theme
from ..view_model import ViewModel
from . import widgets
from .rows import begin_row

NOT_PHYSICAL = "Not physical: local gain"
"""What every picture with brushed dispersion is labelled."""

_MODES = {"widen": "Widen colours", "narrow": "Narrow colours", "erase": "Erase"}
_DEFAULT = Brush()


def draw_brush(state: State, view_model: ViewModel) -> State:
    """The panel's contents; the window is the shell's."""
    state = _draw_tools(state)
    if widgets.section("Brush settings"):
        state = _draw_settings(state)
    if widgets.section("Painted"):
        state = _draw_painted(state)
    if widgets.section("Pulling", is_open=False):
        _draw_pull_words(state)
    return state


def _draw_tools(state: State) -> State:
    width = 0.5 * (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x)
    tools: tuple[tuple[Tool, str, str], ...] = (
        ("brush", "Brush", "Paint on a receiver where its colours spread more or less than in nature. B"),
        ("pull", "Pull a colour", "Take a colour of the caustic and drag it; the glass's dispersion follows. P"),
    )
    for tool, label, tip in tools:
        is_on = state.tool == tool
        if is_on:
            imgui.push_style_color(imgui.Col_.button, imgui.get_style_color_vec4(imgui.Col_.button_active))
        if widgets.button(label, tip=tip, width=width):
            state = replace(state, tool="select" if is_on else tool)
        if is_on:
            imgui.pop_style_color()
        if tool == "brush":
            imgui.same_line()
    return state


def _draw_settings(state: State) -> State:
    brush = state.brush
    tip = "What a stroke does. While painting, Shift erases and Ctrl does the opposite of widening or narrowing."
    mode = widgets.combo("Mode", _MODES, brush.mode, tip=tip)
    tip = "Radius on the receiver. Shift+wheel over the picture, or [ and ], change it too."
    usual = USUAL_RADIUS * state.view.height_at(state.view.target_distance)
    radius = widgets.drag(
        "Radius", brush.radius, 1e-4, 1e4, unit="units", tip=tip, reset=usual, format="%.4g", logarithmic=True
    )
    if mode == "erase":
        tip = "Share of what was painted that is erased in a quarter of a second under a still cursor."
        top, unit = 1.0, ""
    else:
        tip = "How fast paint builds up under a still cursor: 1 doubles (or halves) the spread of colours every second."
        top, unit = 8.0, "doublings/s"
    before, usual = min(brush.strength, top), _DEFAULT.strength
    strength = widgets.slider(
        "Strength", before, 0.01, top, unit=unit, tip=tip, reset=usual, format="%.2f", logarithmic=True
    )
    tip = "Share of the radius over which the brush fades out: 0 is a hard edge, 1 fades from the centre on."
    usual = _DEFAULT.falloff
    falloff = widgets.slider("Falloff", brush.falloff, 0.0, 1.0, unit="", tip=tip, reset=usual, format="%.2f")
    _draw_profile(falloff)
    strength = strength if strength != before else brush.strength  # what the eraser cannot show is kept for the others
    return replace(state, brush=Brush(mode, radius, strength, falloff))  # type: ignore[arg-type]


def _draw_profile(falloff: float) -> None:
    """The brush across its width, as tall as it is strong."""
    begin_row("Profile")
    size = ImVec2(imgui.get_content_region_avail().x, theme.em(2.2))
    corner = imgui.get_cursor_screen_pos()
    imgui.dummy(size)
    widgets.tooltip("The brush across its diameter: how strongly each place is painted.")
    drawing, colours = imgui.get_window_draw_list(), theme.palette()
    drawing.add_rect_filled(corner, ImVec2(corner.x + size.x, corner.y + size.y), theme.packed(colours.frame), 3.0)
    across = np.linspace(-1.0, 1.0, 81)
    weight = dab_weight(Dab((0.0, 0.0, 0.0), 1.0, 1.0, falloff), np.abs(across))
    base, height = corner.y + size.y - 3.0, size.y - 6.0
    points: list[Any] = [
        ImVec2(corner.x + size.x * (0.5 + 0.48 * float(x)), base - height * float(w))
        for x, w in zip(across, weight, strict=True)
    ]
    drawing.add_polyline(points, theme.packed(colours.accent), 1.5, 0)


def _draw_painted(state: State) -> State:
    painted = [(i, o) for i, o in enumerate(state.scene.objects) if o.local_dispersion]
    if not painted:
        widgets.hint("Nothing is painted: this is the physical picture.")
        if not any(o.material.receives for o in state.scene.objects):
            widgets.hint("No object receives light; make one diffuse to paint on it.")
        return state
    if state.physical:
        widgets.hint("The physical picture is shown; what is painted is left out.")
    else:
        widgets.note(f"{NOT_PHYSICAL}. Colours spread as painted, not as light does.")
    tip = "Leave the painted gain out, to compare with what nature would show. Nothing painted is lost."
    state = replace(state, physical=widgets.toggle("Physical picture", state.physical, tip=tip))
    for index, item in painted:
        count = len(item.local_dispersion)
        begin_row(item.name)
        tip = f"Take every dab off {item.name}. Undo brings them back."
        words = f"Clear {count} dab{'s' if count > 1 else ''}"
        if widgets.button(f"{words}##{item.name}", tip=tip, width=-1.0):
            state = edits.attempt(state, f"Clear dabs of {item.name}", clear_dabs, index)
    return state


def _draw_pull_words(state: State) -> None:
    if state.pull is None:
        widgets.hint(
            "Choose the tool (P), press on a colour of the caustic and drag it along the spectrum. The dispersion of "
            "the "
            "glass that made it is solved so that the colour stays under the cursor; white light stays where it is. "
            "With Shift only the place is changed: a local gain, which is not physical."
        )
        return
    held, item = state.pull, state.scene.objects[state.pull.object_index]
    widgets.read_out(
        "Colour held", f"{held.wavelength_nm:.0f} nm", tip="Wavelength of the light under the cursor when it was taken."
    )
    widgets.read_out("Glass", item.name, tip="The object whose dispersion is solved for.")
    what = "Local gain, not physical" if held.local else "Dispersion gain of the glass"
    widgets.read_out("Changes", what, tip="What follows the cursor. Shift changes the place only.")
