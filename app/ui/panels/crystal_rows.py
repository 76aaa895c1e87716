"""Rows of what parts or chooses light by its polarisation: which crystal a glass is, and axes."""

from __future__ import annotations

from ...edit import edits
from ...edit.objects import set_material
from ...edit.state import State
from ...model.materials import Dielectric, Material
from ...model.optics.crystals import crystals, named
from ...model.optics.glass import Dispersion
from . import widgets

_OWN = "own"


def draw_crystal(state: State, index: int) -> State:
    """Which crystal an object of glass is, or none; both indices and the axis of one."""
    thing = state.scene.objects[index]
    material = thing.material
    assert isinstance(material, Dielectric)
    other = material.extraordinary
    present = "" if other is None else named(material.dispersion, other) or _OWN
    own = {_OWN: "Indices of its own"} if present == _OWN else {}
    names = {name: name.capitalize() for name, each in crystals().items() if name == each.substance}
    tip = "A crystal parts each ray in two, polarised across each other. Indices of one's own stand in the scene file."
    chosen = widgets.combo("Crystal", {"": "None"} | names | own, present, tip=tip)
    if chosen != present:
        return edits.attempt(state, f"Crystal of {thing.name}", set_material, index, _made_of(material, chosen))
    if other is None:
        return state
    tip = "Ordinary and extraordinary index at 587.56 nm. No unit."
    widgets.read_out("n_o, n_e", f"{material.dispersion.n_d:.5f}, {other.n_d:.5f}", tip=tip)
    return draw_axis(state, index, "Optic axis", "Light along it is not parted, in the object's own coordinates.")


def draw_axis(state: State, index: int, label: str, tip: str) -> State:
    """The axis of a crystal or a polariser."""
    thing = state.scene.objects[index]
    usual = thing.material.usual().axis
    wanted = widgets.vec3(label, thing.material.axis, unit="", tip=tip, speed=0.005, reset=usual)
    if wanted == thing.material.axis or not any(wanted):
        return state
    length = sum(part * part for part in wanted) ** 0.5
    turned = thing.material.changed(axis=tuple(part / length for part in wanted))
    return edits.attempt(state, f"Axis of {thing.name}", set_material, index, turned)


def _made_of(material: Dielectric, name: str) -> Material:
    """Another crystal, polished and bare as those are, or of the ordinary index alone."""
    crystal = crystals().get(name)
    if crystal is None:
        return material.changed(extraordinary=None)
    pair: dict[str, Dispersion] = {"dispersion": crystal.ordinary, "extraordinary": crystal.extraordinary}
    return material.changed(**pair, roughness=0.0, thin=False, coating=None, film_nm=0.0)
