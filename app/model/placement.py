"""Placement of an object: scale, rotation and position of a scene-file table as one matrix.

p_world = T · R · S · p_object with column vectors. Rotations are right-handed; `rotation_deg`
turns about the fixed world axes x, then y, then z (R = Rz Ry Rx).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .io.scene_table import SceneTable
from .vectors import Vec3, unit, vec3


@dataclass(frozen=True)
class Surroundings:
    """What a light without a target, a distance or a power is fitted to."""

    centre: np.ndarray
    """float64 (3,), middle of the objects that are not receivers."""
    radius: float
    """Half the diagonal of their bounds, scene units."""


def default_direction(elevation_deg: float = 38.0) -> Vec3:
    """A low afternoon sun from behind on the left: long caustics that run towards the viewer."""
    azimuth, elevation = math.radians(25.0), math.radians(elevation_deg)
    flat = math.cos(elevation)
    return flat * math.cos(azimuth), -flat * math.sin(azimuth), -math.sin(elevation)


PLACEMENT_KEYS = (
    "position",
    "scale",
    "rotation_deg",
    "axis",
    "angle_deg",
    "z_axis",
    "x_axis",
    "matrix",
)
_ROTATIONS = ("rotation_deg", "axis", "z_axis")


def read_placement(table: SceneTable) -> np.ndarray:
    """The object-to-world matrix of `table`, float64 (4, 4).

    Keys: `position`; `scale` (number or three); one rotation out of `rotation_deg`,
    `axis` + `angle_deg`, `z_axis` (+ `x_axis`): the directions the object's own axes
    point along; or `matrix`, 16 numbers row by row, which stands alone.
    """
    if table.has("matrix"):
        others = table.given([key for key in PLACEMENT_KEYS if key != "matrix"])
        if others:
            table.fail(others[0], "cannot stand beside 'matrix', which already holds it")
        return _read_matrix(table)
    matrix = np.eye(4)
    matrix[:3, :3] = _read_rotation(table) * _read_scale(table)
    matrix[:3, 3] = table.vector("position", (0.0, 0.0, 0.0))
    return matrix


def rotation_about(axis: Vec3, angle_rad: float) -> np.ndarray:
    """Right-handed rotation about the unit vector `axis`, float64 (3, 3) (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle_rad) * cross + (1.0 - math.cos(angle_rad)) * (cross @ cross)


def angles_deg(rotation: np.ndarray) -> Vec3:
    """Angles about the fixed axes x, then y, then z of a rotation matrix (3, 3); where x and z turn about one axis, all
    of it is given to z."""
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    y = math.atan2(-rotation[2, 0], level)
    if level < 1e-9:
        x, z = 0.0, math.atan2(-rotation[0, 1], rotation[1, 1])
    else:
        x, z = math.atan2(rotation[2, 1], rotation[2, 2]), math.atan2(rotation[1, 0], rotation[0, 0])
    return vec3(np.degrees([x, y, z]))


def frame_from_z(z_axis: Vec3, x_hint: Vec3 | None = None) -> np.ndarray | None:
    """Right-handed orthonormal frame, float64 (3, 3) of columns x, y, z, whose z is `z_axis` (unit).

    x lies as near to `x_hint` as it can; None when the hint is parallel to z. Without a hint
    x is horizontal where that is possible.
    """
    z = np.asarray(z_axis, dtype=np.float64)
    if x_hint is None:
        # Horizontal in a z-up world; straight up or down keeps the world's own x.
        x_hint = (1.0, 0.0, 0.0) if math.hypot(z[0], z[1]) < 1e-9 else (-z[1], z[0], 0.0)
    x = np.asarray(x_hint, dtype=np.float64)
    x = x - z * (x @ z)
    if np.linalg.norm(x) < 1e-9 * np.linalg.norm(x_hint):
        return None
    x = unit(x)
    return np.column_stack([x, np.cross(z, x), z])


def _read_matrix(table: SceneTable) -> np.ndarray:
    matrix = np.array(table.numbers("matrix", count=16)).reshape(4, 4)
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        table.fail("matrix", "must end in 0, 0, 0, 1: 16 numbers row by row, the translation in the last column")
    linear = matrix[:3, :3]
    if abs(np.linalg.det(linear)) <= 1e-12 * np.linalg.norm(linear) ** 3:
        table.fail("matrix", "flattens the object: its upper 3×3 part has no inverse")
    return matrix


def _read_scale(table: SceneTable) -> np.ndarray:
    """Scale per axis, float64 (3,); negative mirrors, zero is refused."""
    value = table.raw("scale", 1.0)
    scale = table.numbers("scale", count=3) if isinstance(value, list) else (table.number("scale", 1.0),) * 3
    if 0.0 in scale:
        table.fail("scale", "is zero on an axis, which would flatten the object")
    return np.array(scale)


def _read_rotation(table: SceneTable) -> np.ndarray:
    kind = table.one_of(_ROTATIONS, "the rotation")
    for key, partner in (("angle_deg", "axis"), ("x_axis", "z_axis")):
        if table.has(key) and kind != partner:
            table.fail(key, f"needs '{partner}' beside it")
    if kind == "rotation_deg":
        x, y, z = (math.radians(angle) for angle in table.vector("rotation_deg"))
        return (
            rotation_about((0.0, 0.0, 1.0), z) @ rotation_about((0.0, 1.0, 0.0), y) @ rotation_about((1.0, 0.0, 0.0), x)
        )
    if kind == "axis":
        return rotation_about(table.unit_vector("axis"), math.radians(table.number("angle_deg")))
    if kind == "z_axis":
        hint = table.unit_vector("x_axis") if table.has("x_axis") else None
        frame = frame_from_z(table.unit_vector("z_axis"), hint)
        if frame is None:
            table.fail("x_axis", "is parallel to 'z_axis'; give a direction across it")
        return frame
    return np.eye(3)
