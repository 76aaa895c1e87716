"""A lens as a scene, its glass between surfaces as solids; and the lens that is in a scene, for its figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.errors import UserError
from .geometry.primitives_lens import vertices_of
from .lights.light import DEFAULT_ILLUMINANCE
from .lights.outlined import CollimatedLight
from .naming import Names, place_of
from .optics.lens_design import Lens, Surface, lens_table
from .optics.spectrum import illuminant
from .scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from .scene_defaults import environment_of, studio_environment, studio_lights
from .scene_objects import make_shape
from .vectors import vec3

TRIANGLES = 20_000
_STEPS = np.linspace(0.0, 1.0, 1025)
_ALONG_X = np.array([(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)])
"""Turns the lens's axis z to x, and its x up."""
_TOLERANCE = 1e-7
"""How far places that are one may be apart, as a share of a lens's size."""


def scene_of_lens(lens: Lens) -> Scene:
    """`lens` with its axis along x and its first vertex at the origin, in a beam of light, and a screen at its back
    focus. What had to be assumed is in the scene's notes."""
    notes, names = list(lens.notes), Names()
    matrix = np.eye(4)
    matrix[:3, :3] = _ALONG_X
    objects = []
    for front, first, second, radius in _elements(lens, notes):
        keys: dict[str, Any] = {
            "radius1": first.radius,
            "radius2": second.radius,
            "thickness": first.thickness,
            "diameter": 2.0 * radius,
            "triangles": TRIANGLES,
            "front": front,
        }
        keys |= {f"conic{i}": face.conic for i, face in enumerate((first, second), start=1) if face.conic}
        mesh = make_shape("lens", **keys)
        assert first.glass is not None
        objects.append(SceneObject(names.unique(first.glass.name), mesh, Dielectric(first.glass), matrix))
    table = lens_table(lens)
    length = sum(surface.thickness for surface in lens.surfaces)
    widest = max(surface.semi_diameter for surface in lens.surfaces)
    distance = table.back_focus
    if not 0.0 < distance < 1e3 * widest:
        distance = 4.0 * widest
        notes.append(f"The light of {lens.name} comes to no focus behind it; the screen stands {distance:.4g} off.")
    else:
        notes.append(
            f"A beam and, {distance:.6g} behind the last vertex, a screen at the back focus of "
            f"{lens.reference_nm:g} nm were added."
        )
    light = CollimatedLight(
        "beam",
        illuminant("D65").scaled_to_luminous(DEFAULT_ILLUMINANCE),
        (-2.0 * widest, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        radius=table.beam_radius,
    )
    around = environment_of(objects)
    middle, reach = 0.5 * (length + distance), 0.5 * (length + distance) + widest
    target = np.array([middle, 0.0, 0.0])
    camera = Camera(vec3(target + reach * np.array([-1.8, -3.1, 1.6])), vec3(target), vertical_fov_deg=25.0)
    screen = _screen(length + distance, 3.0 * widest)
    return Scene(
        lens.name,
        camera,
        (light, studio_lights(around)[1]),
        (*objects, screen),
        environment=studio_environment(),
        notes=tuple(notes),
        units=lens.units,
    )


def _screen(at: float, side: float) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, :3] = _ALONG_X @ np.diag([1.0, -1.0, -1.0])  # facing the lens
    matrix[0, 3] = at
    return SceneObject("screen", make_shape("plane", width=side, height=side), Diffuse((0.5, 0.5, 0.5)), matrix)


def _elements(lens: Lens, notes: list[str]) -> list[tuple[float, Surface, Surface, float]]:
    """Place of the first vertex, both surfaces, and radius of every solid; cemented ones have one radius, so that their
    common surface has the same vertices in both."""
    faces: list[tuple[float, Surface]] = []
    place, is_behind_glass = 0.0, False
    for surface in lens.surfaces:
        if is_behind_glass or surface.glass is not None:  # else a stop in the air
            faces.append((place, surface))
        place += surface.thickness
        is_behind_glass = surface.glass is not None
    radii = [face.semi_diameter for _, face in faces]
    pairs = list(enumerate(pairwise(faces)))
    for i, ((_, first), _) in pairs * len(faces):
        if first.glass is not None:
            radii[i] = radii[i + 1] = max(radii[i : i + 2])
    meetings = [_meeting(a, b, radii[i : i + 2]) for i, (a, b) in pairs]
    for i, ((_, first), _) in pairs * len(faces):
        radius = min(meetings[i], *(radii[i : i + 2] if first.glass is not None else ()), math.inf)
        radii[i], radii[i + 1] = min(radii[i], radius), min(radii[i + 1], radius)
    for (_, face), radius in zip(faces, radii, strict=True):
        if radius < face.semi_diameter * (1.0 - 1e-9):
            notes.append(
                f"{lens.name}: a glass was made {2.0 * radius:.4g} wide, not {2.0 * face.semi_diameter:.4g}, for its "
                "faces, or those of its neighbour, meet there."
            )
    return [(at, first, second, radii[i]) for i, ((at, first), (_, second)) in pairs if first.glass is not None]


def _meeting(before: tuple[float, Surface], behind: tuple[float, Surface], radii: Sequence[float]) -> float:
    """The distance from the axis, up to the smaller of `radii` or in glass to both, at which neighbouring surfaces
    meet; infinite: they do not."""
    (low, first), (high, second) = before, behind
    r = _STEPS * (min(radii) if first.glass is None else max(radii))
    gap = high - low + second.sag(r) - first.sag(r)
    least = (-1e-9 if first.glass is None else 1e-9) * r[-1]
    outside = ~(gap > least) & (r > 0.0)
    return float(r[outside.argmax() - 1]) if outside.any() else math.inf


# ---- the other way ----------------------------------------------------------------------------


def lens_in(scene: Scene, name: str | None = None) -> Lens:
    """The lens that the objects of shape `lens` on one axis make: on that of the object `name`, or of the first.

    Where lenses are stretched across their axis, it is the section in which they are curved most. Raises `UserError`
    where there is none, or where its glasses overlap.
    """
    lenses, without = [item for item in scene.objects if _sizes(item)], f"scene '{scene.name}' has no glass of shape"
    if not lenses:
        raise UserError(f'{without} "lens"; add one')
    chosen = lenses[place_of(name, [item.name for item in lenses], f'{without} "lens" called') if name else 0]
    frame = chosen.object_to_world[:3, :3] / np.linalg.norm(chosen.object_to_world[:3, :3], axis=0)
    axis, origin = frame[:, 2], chosen.object_to_world[:3, 3]
    near = _TOLERANCE * float(_sizes(chosen)["diameter"] * np.linalg.norm(chosen.object_to_world[:3, :3]))
    directions = [light.direction for light in scene.lights if hasattr(light, "direction")]
    along = next((float(axis @ each) for each in directions if abs(axis @ each) > 0.5), 1.0)
    axis = -axis if along < 0.0 else axis
    found = []
    narrow: set[int] = set()
    for item in lenses:
        own = item.object_to_world[:3, :3] / np.linalg.norm(item.object_to_world[:3, :3], axis=0)
        off = item.object_to_world[:3, 3] - origin
        if np.linalg.norm(np.cross(own[:, 2], axis)) < _TOLERANCE and np.linalg.norm(off - axis * (off @ axis)) < near:
            found.append(_between(item, axis, float(off @ axis)))
            widths = np.linalg.norm(item.object_to_world[:3, :2], axis=0)
            if not math.isclose(*widths, rel_tol=_TOLERANCE):
                narrow.add(int(widths.argmin()) if np.abs(np.abs(frame.T @ own) - np.eye(3)).max() < _TOLERANCE else -1)
    if len(narrow) > 1 or -1 in narrow:
        raise UserError(f"lenses on the axis of '{chosen.name}' are stretched in different directions; make them alike")
    surfaces: list[Surface] = []
    end = 0.0
    for front, back, first, second, item in sorted(found, key=lambda each: each[0]):
        gap = front - end
        if surfaces and gap < -near:
            raise UserError(f"'{item.name}' begins within the lens before it: light does not meet them one by one")
        if surfaces and gap < near and math.isclose(surfaces[-1].curvature, first.curvature, rel_tol=_TOLERANCE):
            surfaces.pop()
        elif surfaces:
            surfaces[-1] = replace(surfaces[-1], thickness=max(gap, 0.0))
        surfaces += [first, second]
        end = back
    title = " and ".join(item.name for *_, item in found)
    return Lens(title, tuple(surfaces), units=scene.units, is_round=not narrow)


def _sizes(item: SceneObject) -> dict[str, float]:
    """The sizes of a lens; empty for anything else."""
    recipe, material = item.mesh.recipe or {}, item.material
    is_lens = recipe.get("shape") == "lens" and material.is_solid and material.transmits
    return {"radius1": 1.0, "radius2": -1.0, "thickness": 0.3, "diameter": 1.0, **recipe} if is_lens else {}


def _between(item: SceneObject, axis: np.ndarray, origin: float) -> tuple[float, float, Surface, Surface, SceneObject]:
    """Places of its vertices on `axis`, its surfaces in the order of light, and the object itself."""
    given = _sizes(item)
    scale = np.linalg.norm(item.object_to_world[:3, :3], axis=0)
    along, across = float(scale[2]), float(scale[:2].min())
    turns = item.object_to_world[:3, 2] @ axis < 0.0
    low, high = (origin + (-along if turns else along) * z for z in vertices_of(given["thickness"], given.get("front")))

    def surface(number: int, glass: bool, thickness: float) -> Surface:
        # r² = 2 R z − (1 + k) z², stretched: R s²/a and (1 + k) s²/a².
        ratio = across / along
        radius = (-1.0 if turns else 1.0) * given[f"radius{number}"] * across * ratio
        conic = (1.0 + given.get(f"conic{number}", 0.0)) * ratio**2 - 1.0
        semi = 0.5 * given["diameter"] * across
        return Surface(radius, thickness, item.material.dispersion if glass else None, semi, conic)

    order = (2, 1) if turns else (1, 2)
    front, back = min(low, high), max(low, high)
    return front, back, surface(order[0], True, back - front), surface(order[1], False, 0.0), item
