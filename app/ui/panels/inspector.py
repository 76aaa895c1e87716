"""Placement and material of the selection in numbers; the scene's own settings when nothing is selected."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from ...edit import edits, environments
from ...edit.matrices import decompose
from ...edit.objects import rename, set_diffuse_colour, set_material, set_position, set_rotation, set_scale
from ...edit.state import Selection, State
from ...model.materials import MATERIAL_KINDS
from ...model.materials.coating import TITLES, preset
from ...model.materials.diffuse import USUAL_COAT_INDEX, USUAL_ROUGHNESS
from ...model.materials.grating import PROFILES
from ...model.optics.metals import metals
from ...model.scene import (
    Diffuse,
    Grating,
    Material,
    SceneObject,
    Vec3,
)
from ...model.scene_render import MAX_ANISOTROPY, MAX_BOUNCES
from .. import theme
from ..view_model import ViewModel
from . import outliner, picture_choice, widgets
from .camera_rows import draw_camera_rows
from .crystal_rows import draw_axis, draw_crystal
from .declared_rows import draw_flags, draw_numbers
from .environment_rows import draw_environment
from .glass_values import abbe_text, own_numbers
from .light_panel import draw_light

_KINDS = {cls.title: cls for cls in MATERIAL_KINDS.values()}
_UNITS = "units"
_SHOWN_NM = 550.0
"""Wavelength for which the shares of a grating's orders are shown."""
_MOST_HAZE = 1.0
"""On the slider: thicker haze is not thin."""
_OWN_LAYERS = "own"
_WRAPS = {"repeat": "Repeats", "clamp": "Its border continues"}

_keeps_proportions = {"on": True}
"""Whether the three scales move together: memory of the interface."""


def draw_inspector(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    selection = state.selection
    if selection.kind == "object" and selection.index < len(state.scene.objects):
        return _object(state, view_model, selection.index)
    if selection.kind == "light" and selection.index < len(state.scene.lights):
        return draw_light(state, view_model)
    if selection.kind == "camera":
        return _scene_camera(state)
    return _scene(state, view_model)


def _scene_camera(state: State) -> State:
    """The view that the scene is saved with, and rendered from elsewhere."""
    with theme.heading():
        imgui.text_unformatted("Camera")
    widgets.hint("The view that the scene is saved with.")
    camera = draw_camera_rows(state.scene.camera)
    if camera != state.scene.camera:
        looks_through = state.camera == state.scene.camera
        state = edits.attempt(state, "Camera", edits.set_camera, camera)
        if looks_through:  # a view through it follows
            state = replace(state, camera=state.scene.camera)
    if widgets.button("Look through it", tip="Take its view (0).", width=-1):
        state = replace(state, camera=state.scene.camera)
    if widgets.button("Put it here", tip="Save the present view with the scene (Ctrl+0).", width=-1):
        state = edits.attempt(state, "Camera", edits.set_camera, state.camera)
    return state


def _object(state: State, view_model: ViewModel, index: int) -> State:
    thing = state.scene.objects[index]
    with theme.heading():
        imgui.text_unformatted(f"{outliner.icon_of(thing)}  {thing.name}")
    name = widgets.text_field("Name", thing.name, tip="Name of the object; no two objects share one.")
    if name != thing.name:
        state = edits.attempt(state, f"Rename {thing.name}", rename, index, name)
    if widgets.section("Placement"):
        state = widgets.unless_locked(state, Selection("object", index), lambda state: _place(state, index))
    if widgets.section("Material"):
        state = _material(state, view_model, index)
    if widgets.section("Mesh", is_open=False):
        _mesh(thing)
    return state


def _place(state: State, index: int) -> State:
    thing = state.scene.objects[index]
    position, rotation, scale = decompose(thing.object_to_world)
    tip = "Where the object's origin is: x, y, z."
    wanted = widgets.vec3("Position", position, unit=_UNITS, tip=tip, speed=_speed(thing))
    if wanted != position:
        state = edits.attempt(state, f"Move {thing.name}", set_position, index, wanted)
    tip, still = "Angles about the world's x, then y, then z axis.", (0.0, 0.0, 0.0)
    wanted = widgets.vec3("Rotation", rotation, unit="°", format="%.2f", speed=0.25, reset=still, tip=tip)
    if wanted != rotation:
        state = edits.attempt(state, f"Rotate {thing.name}", set_rotation, index, wanted)
    tip, whole = "Factors along the object's own axes; a negative one mirrors.", (1.0, 1.0, 1.0)
    wanted = widgets.vec3("Scale", scale, unit="×", speed=0.005, reset=whole, tip=tip)
    if wanted != scale:
        factors = _in_proportion(scale, wanted) if _keeps_proportions["on"] else wanted
        state = edits.attempt(state, f"Scale {thing.name}", set_scale, index, factors)
    tip = "Changing one scale changes the other two by the same factor."
    _keeps_proportions["on"] = widgets.toggle("Keep proportions", _keeps_proportions["on"], tip=tip)
    return state


def _speed(thing: SceneObject) -> float:
    """Scene units a pixel: a drag across the field moves an object by about its own size."""
    low, high = thing.mesh.bounds()
    size = float(np.linalg.norm((high - low) * np.linalg.norm(thing.object_to_world[:3, :3], axis=0)))
    return max(size / 400.0, 1e-6)


def _in_proportion(before: Vec3, after: Vec3) -> Vec3:
    """All three scales by the factor of the one that changed."""
    changed = [i for i in range(3) if after[i] != before[i]]
    if len(changed) != 1 or before[changed[0]] == 0.0:
        return after
    factor = after[changed[0]] / before[changed[0]]
    return (before[0] * factor, before[1] * factor, before[2] * factor)


def _material(state: State, view_model: ViewModel, index: int) -> State:
    thing = state.scene.objects[index]
    material = thing.material
    tip = "Glass refracts, diffuse surfaces receive caustics, mirrors reflect, black absorbs."
    wanted = widgets.combo("Kind", tuple(_KINDS), material.title, tip=tip)
    if wanted != material.title:
        usual = _KINDS[wanted].usual()
        return edits.attempt(state, f"Make {thing.name} {wanted.lower()}", set_material, index, usual)
    if material.transmits:
        state = draw_crystal(_glass(_declared(state, index, material), material), index)
        return _surface_colour(_films(state, index), index)
    if material.is_black:
        widgets.hint("Absorbs all light that meets it.")
        return state
    if isinstance(material, Diffuse):
        state = _coat(state, index, material)
        material = state.scene.objects[index].material
    state = _declared(state, index, material)
    if material.is_mirror:
        state = _films(state, index)
        material = state.scene.objects[index].material
    if isinstance(material, Grating) and material.kind == Grating.kind:
        state = _profile(state, index, material)
    if material.is_polariser:
        return draw_axis(state, index, "Axis", "Light polarised along it passes, in the object's own coordinates.")
    if material.receives:
        state = _texture(state, view_model, index, material)
    return _colour(state, index, material) if material.receives or material.is_mirror else state


def _glass(state: State, material: Material) -> State:
    dispersion = material.dispersion
    tip = "Name of the glass. Its dispersion is edited in the Dispersion panel."
    widgets.read_out("Glass", dispersion.name or "unnamed", tip=tip)
    tip = "Index at 587.56 nm and Abbe number of the glass, before its gain. No unit."
    widgets.read_out("n_d, V_d", f"{dispersion.n_d:.5f}, {abbe_text(own_numbers(dispersion)[1])}", tip=tip)
    tip = "Open the Dispersion panel."
    if not state.preferences.panels.dispersion and widgets.button("Edit dispersion", tip=tip, width=-1):
        state = state.with_panels(dispersion=True)
    return state


def _declared(state: State, index: int, material: Material) -> State:
    """What the kind declares with a row."""
    parts = () if material.is_crystal else material.parts
    changed = draw_flags(draw_numbers(material, material.shown_numbers()), parts)
    if changed is material:
        return state
    label = f"{material.title} of {state.scene.objects[index].name}"
    return edits.attempt(state, label, set_material, index, changed)


def _coat(state: State, index: int, material: Diffuse) -> State:
    """Whether it is glossy."""
    tip = "A clear coat like varnish: the surface reflects what is round it, besides its colour."
    on = widgets.toggle("Coat", material.has_coat, tip=tip)
    if on == material.has_coat:
        return state
    coated = material.changed(roughness=USUAL_ROUGHNESS if on else None, coat_index=USUAL_COAT_INDEX)
    label = f"Coat of {state.scene.objects[index].name}"
    return edits.attempt(state, label, set_material, index, coated)


def _films(state: State, index: int) -> State:
    """Rows for a mirror's metal, and for what coats it or glass."""
    thing = state.scene.objects[index]
    changed = thing.material
    if changed.is_mirror:
        tip = "What it is made of: a metal reflects as measured, at every wavelength and angle."
        metal = widgets.combo("Metal", {"": "Ideal"} | {m: m.capitalize() for m in metals()}, changed.metal, tip=tip)
        if metal != changed.metal:
            changed = changed.changed(metal=metal, **({} if metal else {"coating": None, "film_nm": 0.0}))
    if (changed.transmits and not (changed.is_rough or changed.is_crystal)) or changed.metal:
        present = "" if changed.coating is None else changed.coating.preset or _OWN_LAYERS
        own = {_OWN_LAYERS: "Layers of its own"} if present == _OWN_LAYERS else {}
        tip = "Thin layers on its surface. Layers of one's own are written in the scene file."
        chosen = widgets.combo("Coating", {"": "None", **TITLES, **own}, present, tip=tip)
        if chosen != present:
            changed = changed.changed(coating=preset(chosen) if chosen else None)
    if changed is thing.material:
        return state
    return edits.attempt(state, f"Coating of {thing.name}", set_material, index, changed)


def _profile(state: State, index: int, material: Grating) -> State:
    """What shape its grooves have, and what that leaves to each order."""
    tip = "Shape of the grooves, which shares out light among the orders by wavelength and angle."
    titles = {"": "Given shares"} | {profile: profile.capitalize() for profile in PROFILES}
    chosen = widgets.combo("Profile", titles, material.profile, tip=tip)
    shares = material.shares(np.array(_SHOWN_NM), np.array([0.0, 0.0, -1.0]))
    orders = ", ".join(f"{m:+d}: {share:.0%}" for m, share in zip(material.orders, shares, strict=True))
    tip = f"Share of upright light of {_SHOWN_NM:g} nm that each order gets."
    widgets.read_out("Orders", orders, tip=tip)
    if chosen == material.profile:
        return state
    count = len(material.orders)
    whole = 1.0 if chosen else min(Grating.efficiency[0], 1.0 / count)
    changed = material.changed(profile=chosen, efficiency=(whole,) * count)
    return edits.attempt(state, f"Profile of {state.scene.objects[index].name}", set_material, index, changed)


def _texture(state: State, view_model: ViewModel, index: int, material: Material) -> State:
    """The picture that the surface wears."""
    thing = state.scene.objects[index]
    worn = material.texture
    can = thing.mesh.uv is not None
    name = "None" if worn is None else Path(worn.source).name if worn.source else "From the scene's file"
    tip = (
        "A picture on the surface (.png, .jpg, .exr). Click to choose one."
        if can
        else "This mesh has no texture coordinates for a picture."
    )
    pressed = widgets.file_field(
        "Picture", name, tip=tip, enabled=can, clear_tip="" if worn is None else "Back to the plain colour."
    )
    if pressed is None:
        return edits.attempt(state, f"Picture of {thing.name}", environments.clear_texture, index)
    if pressed:
        picture_choice.ask_texture(state, view_model, index)
    if worn is not None:
        wrap = widgets.combo("Beyond its edge", _WRAPS, worn.wrap, tip="What is shown where the picture ends.")
        if wrap != worn.wrap:
            state = edits.attempt(state, f"Picture of {thing.name}", environments.set_texture_wrap, index, wrap)
    return state


def _colour(state: State, index: int, material: Material) -> State:
    thing = state.scene.objects[index]
    tip = "Share of light reflected, linear Rec.709, 0 to 1."
    if material.texture is not None:
        tip += " The picture is multiplied by it."
    rgb = widgets.colour("Reflectance", material.reflectance_rgb, tip=tip, highest=1.0)
    if material.reflectance is not None:
        widgets.hint("A measured spectral reflectance is in use; choosing a colour replaces it.")
    if rgb != material.reflectance_rgb:
        state = edits.attempt(state, f"Colour of {thing.name}", set_diffuse_colour, index, rgb)
    if thing.local_dispersion:
        widgets.note(f"{len(thing.local_dispersion)} dabs of the dispersion brush are painted here. Not physical.")
    return state


def _surface_colour(state: State, index: int) -> State:
    """What glass lets through by its surface."""
    thing = state.scene.objects[index]
    tip = "What of light its surface lets through it, linear Rec.709, 0 to 1; white is clear. Once in a thin sheet."
    rgb = widgets.colour("Surface colour", thing.material.transmittance_rgb, tip=tip, highest=1.0)
    if rgb != thing.material.transmittance_rgb:
        coloured = thing.material.changed(transmittance_rgb=rgb)
        state = edits.attempt(state, f"Colour of {thing.name}", set_material, index, coloured)
    return state


def _mesh(thing: SceneObject) -> None:
    mesh = thing.mesh
    low, high = mesh.bounds()
    size = np.abs(high - low) * np.linalg.norm(thing.object_to_world[:3, :3], axis=0)
    widgets.read_out("Shape", mesh.name or "mesh", tip="Shape, or the name in the file it came from.")
    widgets.read_out("Triangles", f"{len(mesh.triangles):,}", tip="Number of triangles.")
    widgets.read_out("Vertices", f"{len(mesh.vertices):,}", tip="Number of vertices, welded.")
    extent = " × ".join(f"{s:.3g}" for s in size)
    widgets.read_out("Size", f"{extent} units", tip="Extent along its own axes, scene units.")
    tip = "Glass must be closed, or thin: light needs an inside."
    widgets.read_out("Closed", "yes" if mesh.is_closed else "no", tip=tip)


def _scene(state: State, view_model: ViewModel) -> State:
    scene = state.scene
    with theme.heading():
        imgui.text_unformatted(scene.name)
    widgets.hint("Select an object or a light to edit it: click it in the picture or in the outliner.")
    if widgets.section("Scene"):
        triangles = sum(len(thing.mesh.triangles) for thing in scene.objects)
        widgets.read_out("Objects", str(len(scene.objects)), tip="Number of objects.")
        widgets.read_out("Lights", str(len(scene.lights)), tip="Number of lights.")
        widgets.read_out("Triangles", f"{triangles:,}", tip="Triangles of all objects.")
        state = _light_path_rows(state)
    if widgets.section("Environment"):
        state = draw_environment(state, view_model)
    if scene.notes and widgets.section("Notes"):
        for note in scene.notes:
            widgets.hint(note)
    return state


def _light_path_rows(state: State) -> State:
    """What the scene asks of light on its way."""
    render, changed = state.scene.render, edits.render_changed
    tip = "Refractions and reflections after which a photon is given up."
    depth = widgets.whole("Longest path", render.max_depth, 1, 64, unit="events", reset=64, tip=tip)
    state = changed(state, "Longest path", max_depth=depth)
    tip = "Light keeps its polarisation from surface to surface; else every surface meets unpolarised light."
    state = changed(state, "Polarisation", polarisation=widgets.toggle("Polarisation", render.polarisation, tip=tip))
    tip = "How often light is passed on from one diffuse surface to another; 0: they do not light each other."
    state = changed(
        state, "Bounces", bounces=widgets.whole("Bounces", render.bounces, 0, MAX_BOUNCES, reset=0, tip=tip)
    )
    tip = "Share of light that thin haze scatters over a path of one scene unit; 0: light is not seen on its way."
    haze = widgets.slider(
        "Haze", render.haze, 0.0, _MOST_HAZE, unit="", format="%.4f", logarithmic=True, reset=0.0, clamp=False, tip=tip
    )
    state = changed(state, "Haze", haze=haze)
    if not render.haze:
        return state
    tip, most = "Mean cosine of the angle by which haze scatters; above 0: mostly onwards.", MAX_ANISOTROPY
    anisotropy = widgets.slider("Haze anisotropy", render.haze_anisotropy, -most, most, unit="", reset=0.0, tip=tip)
    return changed(state, "Haze anisotropy", haze_anisotropy=anisotropy)
