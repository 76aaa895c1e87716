"""The ruler and the protractor: up to three points, the lengths between them and the angle at the second."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..model.scene import Vec3
from .state import State

MAX_POINTS = 3


def with_point(state: State, point: Vec3) -> State:
    """With one point more; the fourth begins a new measurement."""
    before = state.measured if len(state.measured) < MAX_POINTS else ()
    return replace(state, measured=(*before, point))


def lengths(points: tuple[Vec3, ...]) -> list[float]:
    """Between neighbours, scene units."""
    return [float(np.linalg.norm(np.subtract(b, a))) for a, b in pairwise(points)]


def angle_deg(points: tuple[Vec3, ...]) -> float | None:
    """At the second of three points, 0 to 180°; None of fewer points, or where two are the same."""
    if len(points) < MAX_POINTS:
        return None
    first, second = (np.subtract(points[i], points[1]) for i in (0, 2))
    if not first.any() or not second.any():
        return None
    # By the tangent: exact for small angles too, where a cosine is not.
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))


def words(points: tuple[Vec3, ...]) -> str:
    """The result in a line, or what to click next."""
    if not points:
        return "Click a point: a surface, a ray's bend, a focus."
    if len(points) == 1:
        return "Click the other end."
    text = " + ".join(f"{length:.4g}" for length in lengths(points)) + " units"
    angle = angle_deg(points)
    return f"{text}. A third point measures the angle." if angle is None else f"{text}, {angle:.2f}°"
