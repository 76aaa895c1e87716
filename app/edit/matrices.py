"""Position, rotation and scale of a placement: the only file that uses pyrr.

pyrr's quaternions and matrices rotate opposite ways, so quaternions are not used here at all.
Its 3×3 rotation matrices, applied to column vectors as everywhere in this program
(p_world = M @ p_object), turn right-handed; tests hold that. Angles are about the fixed axes
x, then y, then z, as `rotation_deg` of a scene file: R = Rz Ry Rx.
"""

from __future__ import annotations

import math

import numpy as np
import pyrr

from ..model.placement import angles_deg
from ..model.scene import Vec3
from ..model.vectors import vec3

Placement = tuple[Vec3, Vec3, Vec3]
"""Position (scene units), rotation (degrees about x, y, z), scale along the object's own axes."""


def rotation_matrix(rotation_deg: Vec3) -> np.ndarray:
    """Rz Ry Rx, float64 (3, 3), for column vectors."""
    x, y, z = (math.radians(angle) for angle in rotation_deg)
    matrix33 = pyrr.matrix33
    about = matrix33.create_from_z_rotation(z), matrix33.create_from_y_rotation(y), matrix33.create_from_x_rotation(x)
    return np.asarray(about[0] @ about[1] @ about[2], dtype=np.float64)


def decompose(matrix: np.ndarray) -> Placement:
    """Position, rotation and scale of an object-to-world matrix, as a scene file gives them.

    Angles are in (-180, 180], that about y in [-90, 90]; at ±90 the angle about x is given as 0. A mirrored
    matrix gets a negative scale on the axis that leaves the smallest rotation. What shears cannot be expressed
    in these terms: the rotation is then that of the nearest rotation matrix.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    scale = np.linalg.norm(linear, axis=0)
    axes = nearest_orthogonal(linear / np.where(scale > 0.0, scale, 1.0))
    if np.linalg.det(axes) < 0.0:
        mirrored = int(np.argmin(np.diagonal(axes)))
        axes[:, mirrored] *= -1.0
        scale[mirrored] *= -1.0
    # What is left of rounding would be shown as "-0.00".
    angles = vec3(0.0 if abs(angle) < 1e-10 else angle for angle in angles_deg(axes))
    return vec3(matrix[:3, 3]), angles, vec3(scale)


def with_position(matrix: np.ndarray, position: Vec3) -> np.ndarray:
    """`matrix` with another position; rotation, scale and shear stay."""
    moved = np.array(matrix, dtype=np.float64)
    moved[:3, 3] = position
    return moved


def with_rotation(matrix: np.ndarray, rotation_deg: Vec3) -> np.ndarray:
    """`matrix` turned so that `decompose` gives `rotation_deg`; a shear turns with it."""
    turned = np.array(matrix, dtype=np.float64)
    before = rotation_matrix(decompose(matrix)[1])
    turned[:3, :3] = rotation_matrix(rotation_deg) @ before.T @ turned[:3, :3]
    return turned


def with_scale(matrix: np.ndarray, scale: Vec3) -> np.ndarray:
    """`matrix` with another scale along the object's own axes; a shear stays."""
    scaled = np.array(matrix, dtype=np.float64)
    scaled[:3, :3] *= np.divide(scale, decompose(matrix)[2])
    return scaled


def nearest_orthogonal(axes: np.ndarray) -> np.ndarray:
    """The polar factor of `axes`: itself, to rounding, where its columns are orthonormal."""
    if np.abs(axes.T @ axes - np.eye(3)).max() < 1e-12:
        return axes.copy()
    u, _, v = np.linalg.svd(axes)
    return u @ v
