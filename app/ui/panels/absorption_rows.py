"""How deep the colour of a glass is: a colour that white light has taken on after a distance inside."""

from __future__ import annotations

from ...edit import edits
from ...edit.glass import set_tint
from ...edit.state import State
from ...model.optics.tints import Tint, half_distance, tint, tint_of, tints
from ...model.scene import Absorption, Vec3
from ...model.staging import tinted
from . import widgets

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
    changed, tinted = widgets.toggle("Tinted", material.absorption is not None, tip=tip)
    if changed:
        return _tinted(state, index, _FIRST_COLOUR if tinted else None, _FIRST_DISTANCE)
    if material.absorption is None:
        return state
    known = tint_of(material.absorption.coefficient)
    present = _OWN if known is None else known[0].name
    choices = {_OWN: "A colour of its own"} | {each.name: each.name.capitalize() for each in tints()}
    tip = "What colours the glass. " + (
        "Tints are approximated by the bands of their colourants." if known is None else f"{known[0].colourant}."
    )
    _, chosen = widgets.combo("Tint", choices, present, tip=tip)
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


def _draw_depth(state: State, index: int, present: Tint, distance: float) -> State:
    tip = "How far daylight travels inside until it is half as bright. Shorter is deeper."
    changed, distance, active = widgets.drag(
        "Half at a depth of",
        distance,
        1e-4,
        1e6,
        unit="units",
        tip=tip,
        reset=_FIRST_DISTANCE,
        format="%.3f",
        logarithmic=True,
    )
    state = widgets.holding(state, active)
    label = f"Tint of {state.scene.objects[index].name}"
    return edits.attempt(state, label, set_tint, index, present, distance) if changed else state


def _draw_colour(state: State, index: int, absorption: Absorption) -> State:
    if absorption.colour is None:
        widgets.hint("The absorption is a measured curve, which no colour describes.")
        return state
    rgb, distance = absorption.colour
    tip = "Colour of white light after the distance below."
    colour_changed, rgb, colour_active = widgets.colour("Colour", rgb, tip=tip)
    tip = "How far white light travels inside the glass until it has this colour. Shorter is deeper."
    depth_changed, distance, depth_active = widgets.drag(
        "At a depth of",
        distance,
        1e-4,
        1e6,
        unit="units",
        tip=tip,
        reset=_FIRST_DISTANCE,
        format="%.3f",
        logarithmic=True,
    )
    state = widgets.holding(state, colour_active or depth_active)
    return _tinted(state, index, rgb, distance) if colour_changed or depth_changed else state


def _tinted(state: State, index: int, rgb: Vec3 | None, distance: float) -> State:
    """Object `index` with that absorption; `rgb` None: clear."""
    label = f"Tint of {state.scene.objects[index].name}"
    colour = rgb and (min(max(rgb[0], 0.0), 1.0), min(max(rgb[1], 0.0), 1.0), min(max(rgb[2], 0.0), 1.0))
    return edits.attempt(state, label, edits.set_absorption, index, colour, distance)
