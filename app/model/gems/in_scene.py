"""The stone that is in a scene, for its figures; and a stone under a lamp, for the fire that it throws on a table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...base.errors import UserError
from ..geometry.mesh import Mesh
from ..lights.light import DEFAULT_ILLUMINANCE
from ..lights.outlined import CollimatedLight
from ..naming import place_of
from ..optics.glass import Dispersion
from ..optics.spectrum import illuminant
from ..scene import Camera, Dielectric, Diffuse, Scene, SceneObject
from ..scene_objects import make_shape
from .figures import Stone, stone_of

TABLE = "table"
AXES = ("z", "-z", "x", "-x", "y", "-y")
_HEIGHT, _WIDTH = 2.0, 10.0
"""How high the stone is above the table and how wide that is, diameters of the stone."""
_LEAN_DEG = 12.0
"""By which the stone hangs askew, so that its two halves throw different light."""


def stone_in(scene: Scene, name: str | None = None, glass: Dispersion | None = None, up: str = "z") -> Stone:
    """The object `name` of `scene`, or its first solid of glass, as a stone of its own or another `glass`.

    `up`: where its table faces, an axis of its own coordinates. Raises `UserError`.
    """
    if up not in AXES:
        raise UserError(f"'{up}' is no axis for the table to face; give one of {', '.join(AXES)}")
    item = chosen_stone(scene, name, glass)
    notes: list[str] = []
    material = item.material
    if glass is None:
        assert isinstance(material, Dielectric)
        glass = material.dispersion
        if material.is_crystal:
            notes.append(f"{item.name} is a crystal; its double refraction is left out: the figures are of its n_o")
        if material.absorption is not None:
            notes.append(f"{item.name} absorbs light; the figures are of the same stone without colour")
    return stone_of(_face_up(item, up), glass, tuple(notes))


def chosen_stone(scene: Scene, name: str | None = None, glass: Dispersion | None = None) -> SceneObject:
    """The object that `stone_in` takes. Raises `UserError`."""
    solids = [item for item in scene.objects if item.material.is_solid and item.material.transmits]
    if name is not None:
        item = scene.objects[
            place_of(name, [each.name for each in scene.objects], f"scene '{scene.name}' has no object")
        ]
    elif solids:
        item = solids[0]
    else:
        raise UserError(
            f"scene '{scene.name}' has no solid of glass; name one of its objects with a glass to be cut of"
        )
    if glass is not None:
        return item
    if item not in solids or not isinstance(item.material, Dielectric):
        raise UserError(
            f"'{item.name}' is {item.material.title.lower()}, not a solid of glass; name the glass it is cut of"
        )
    why = None if item.material.is_crystal else item.material.why_no_beams
    if why is not None:
        raise UserError(f"'{item.name}' has no figures of a gem: {why}; make it clear, polished and solid")
    return item


def _face_up(item: SceneObject, up: str) -> Mesh:
    """Its mesh as stretched in the scene but not turned there, `up` to +z."""
    matrix, axis = np.eye(4), "xyz".index(up[-1])
    # The axis goes to z, the next ones to x and y; downward ones turn about x.
    turned = np.roll(np.eye(3), -(axis + 1), axis=0)
    matrix[:3, :3] = (np.diag([1.0, -1.0, -1.0]) if up[0] == "-" else np.eye(3)) @ turned @ item.stretch
    return replace(item.mesh.transformed(matrix), name=item.name)


def under_lamp(stone: Stone) -> Scene:
    """`stone`, table down and 1 wide, two diameters above a white table, in a vertical beam as wide as it is."""
    scale, lean = 0.5 / stone.radius, math.radians(_LEAN_DEG)
    matrix = np.eye(4)
    turn = np.array([(1.0, 0.0, 0.0), (0.0, -math.cos(lean), math.sin(lean)), (0.0, -math.sin(lean), -math.cos(lean))])
    matrix[:3, :3] = scale * turn
    matrix[2, 3] = _HEIGHT
    white = make_shape("plane", width=_WIDTH, height=_WIDTH)
    return Scene(
        f"{stone.name} under a lamp",
        Camera((0.0, -6.0, 5.0), (0.0, 0.0, 0.5)),
        (
            CollimatedLight(
                "lamp",
                illuminant("D65").scaled_to_luminous(DEFAULT_ILLUMINANCE),
                (0.0, 0.0, _HEIGHT + 2.0),
                (0.0, 0.0, -1.0),
                radius=0.55,
            ),
        ),
        (
            SceneObject("stone", stone.mesh, Dielectric(stone.glass), matrix),
            SceneObject(TABLE, white, Diffuse((0.8, 0.8, 0.8))),
        ),
    )
