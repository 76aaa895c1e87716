"""Texture coordinates of primitives: how a picture lies on a box's faces and round a globe.

Seen from outside u runs to the right and v up. These are made for pictures; faces share the picture and globes
stretch it at the poles, so no caustic map is laid out by them (`Mesh.uv_unwraps`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .mesh import Mesh


def with_box_uv(mesh: Mesh) -> Mesh:
    """A box along the axes, centred on the origin, each of whose faces shows the whole picture.

    Up is +z on the sides, +y on the upper face, and -y on the lower one, where the right is +x as on the upper.
    """
    normals = mesh.face_normals()
    level = np.abs(normals[:, 2]) > 0.5
    up = np.where(level[:, None], np.sign(normals[:, 2:]) * (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    right = np.cross(up, normals)
    low, high = mesh.bounds()
    # In units of the box every face is a unit square about 0.
    corners = mesh.corners() / (high - low)
    uv = 0.5 + np.stack([np.einsum("tcj,tj->tc", corners, axis) for axis in (right, up)], axis=2)
    uv.setflags(write=False)
    return replace(mesh, uv=uv, uv_unwraps=False)


def globe_uv(directions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Longitude and latitude of a globe's corners, float64 (T, 3, 2), from unit `directions` (V, 3).

    u = ½ + azimuth/2π and v = 1 − polar angle/π. Triangles across the date line run on past u = 0 or 1, as a
    repeating picture wants it; a pole takes the longitude of its triangle's middle.
    """
    corners = directions[triangles]
    middle = corners.mean(axis=1)
    around = np.arctan2(middle[:, 1], middle[:, 0])[:, None]
    azimuth = np.arctan2(corners[..., 1], corners[..., 0])
    azimuth = around + np.mod(azimuth - around + np.pi, 2.0 * np.pi) - np.pi
    at_pole = np.hypot(corners[..., 0], corners[..., 1]) < 1e-12
    azimuth = np.where(at_pole, around, azimuth)
    polar = np.arccos(np.clip(corners[..., 2], -1.0, 1.0))
    return np.stack([0.5 + azimuth / (2.0 * np.pi), 1.0 - polar / np.pi], axis=2)
