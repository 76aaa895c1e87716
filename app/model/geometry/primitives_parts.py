"""What primitives share: range checks of their dimensions, each failure one sentence, and coordinates for pictures.

Seen from outside u runs to the right and v up. These are made for pictures; faces share the picture and globes
stretch it at the poles, so no caustic map is laid out by them (`Mesh.uv_unwraps`)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...base.errors import UserError
from ..vectors import frozen
from .mesh import Mesh

MAX_TRIANGLES = 4_000_000
"""Most triangles of one shape: making twice as many takes more than 2 GiB."""


def positive(shape: str, key: str, value: float) -> float:
    """`value` as a float, finite and greater than zero."""
    value = float(value)
    if not (math.isfinite(value) and value > 0.0):
        raise UserError(f"{shape}: {key} must be a number greater than 0, not {value:g}")
    return value


def in_range(shape: str, key: str, value: float, low: float, high: float) -> float:
    """`value` as a float, strictly between `low` and `high`."""
    value = float(value)
    if not low < value < high:
        raise UserError(f"{shape}: {key} must lie between {low:g} and {high:g}, not {value:g}")
    return value


def count(shape: str, key: str, value: int, low: int, high: int = MAX_TRIANGLES) -> int:
    """`value` as an int, from `low` to `high` inclusive."""
    if int(value) != value or not low <= value <= high:
        raise UserError(f"{shape}: {key} must be a whole number from {low} to {high}, not {value:g}")
    return int(value)


def band(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Two triangles for each step of two closed rings of vertices, outward for rings counter-clockwise from above."""
    low_next, high_next = np.roll(low, -1), np.roll(high, -1)
    return np.concatenate([np.stack([low, low_next, high_next], axis=1), np.stack([low, high_next, high], axis=1)])


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
    return replace(mesh, uv=frozen(uv), uv_unwraps=False)


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
