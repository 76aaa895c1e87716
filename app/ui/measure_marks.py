"""The ruler and the protractor on the picture, and what a click takes hold of."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from imgui_bundle import ImVec2, imgui

from ..edit import measuring
from ..edit.picking import pick_in
from ..edit.state import State
from ..model.scene import Vec3
from . import item_rects, theme
from .overlay import Canvas, box_corners, draw_label, draw_outlined
from .panels.numbers import named
from .view_model import ViewModel

SNAP_PX = 9.0
"""From a ray's bend, a focus or the middle of a glass within which a click means that point, logical pixels."""
_COLOUR = (1.0, 0.86, 0.35, 1.0)
_ALONG = 200
"""Points of a ray's segment that can be clicked."""
_ARC_STEPS = 24
_ARC_SHARE = 0.35
"""Radius of the angle's arc, share of its shorter side."""


def point_at(state: State, view_model: ViewModel, canvas: Canvas, x: float, y: float) -> Vec3 | None:
    """The point at a place of the picture, 0..1: a ray's bend, a focus or a glass's middle that is near on the screen,
    else a point of a ray, else the surface under the cursor."""
    at = np.array([canvas.left + x * canvas.width, canvas.top + y * canvas.height])
    for points in (_special_points(state, view_model), _points_along(view_model)):
        if not len(points):
            continue
        away = np.linalg.norm(canvas.pixels(points) - at, axis=1)
        away = np.where(np.isfinite(away), away, np.inf)
        best = int(away.argmin())
        if away[best] < SNAP_PX * canvas.scale:
            return float(points[best, 0]), float(points[best, 1]), float(points[best, 2])
    hit = pick_in(state, x, y)
    return None if hit is None else hit.position


def draw_measure(canvas: Canvas, state: State, view_model: ViewModel, mouse: tuple[float, float] | None) -> None:
    """Lines, arc and numbers of what is measured; a ring at the point that a click at `mouse` (0..1) would take."""
    points = np.asarray(state.measured, float).reshape(-1, 3)
    if len(points) > 1:
        draw_outlined(canvas, points, _COLOUR, 1.8, closed=False)
    for place in canvas.pixels(points):
        _dot(canvas, place, 3.5, filled=True)
    for (a, b), length in zip(pairwise(points), measuring.lengths(state.measured), strict=True):
        x, y = canvas.pixels(0.5 * (a + b))
        _label(canvas, x, y, f"{length:.4g}")
    angle = measuring.angle_deg(state.measured)
    if angle is not None:
        arc = _arc(points)
        draw_outlined(canvas, arc, _COLOUR, 1.4, closed=False)
        x, y = canvas.pixels(arc[len(arc) // 2])
        _label(canvas, x, y, f"{angle:.2f}°")
    if mouse is not None:
        taken = point_at(state, view_model, canvas, *mouse)
        if taken is not None:
            _dot(canvas, canvas.pixels(np.asarray(taken)), 5.5, filled=False)
    text = named(measuring.words(state.measured))
    size = imgui.calc_text_size(text)
    draw_label(canvas, canvas.left + 0.5 * (canvas.width - size.x), canvas.top + theme.em(0.8), text)
    item_rects.note("Measured")


def _special_points(state: State, view_model: ViewModel) -> np.ndarray:
    glasses = (item for item in state.scene.objects if item.material.transmits)
    places = [box_corners(item.mesh.vertices, item.object_to_world).mean(axis=0, keepdims=True) for item in glasses]
    places += [ray.points for ray in view_model.rays]
    places += [np.asarray([reading.focus]) for reading in view_model.readings if reading.focus is not None]
    return np.concatenate(places) if places else np.zeros((0, 3))


def _points_along(view_model: ViewModel) -> np.ndarray:
    """Points of the rays themselves, close enough together to be clicked."""
    pairs = [np.stack([ray.points[:-1], ray.points[1:]], axis=1) for ray in view_model.rays]
    if not pairs:
        return np.zeros((0, 3))
    ends = np.concatenate(pairs)[:, :, None]
    share = np.linspace(0.0, 1.0, _ALONG)[:, None]
    return ((1.0 - share) * ends[:, 0] + share * ends[:, 1]).reshape(-1, 3)


def _arc(points: np.ndarray) -> np.ndarray:
    """From one side of the angle to the other, world (n, 3), in its plane."""
    first, second = points[0] - points[1], points[2] - points[1]
    radius = _ARC_SHARE * min(np.linalg.norm(first), np.linalg.norm(second))
    a = first / np.linalg.norm(first)
    across = second - (second @ a) * a
    size = np.linalg.norm(across)
    if size < 1e-9:
        return points[1] + radius * a[None]
    turn = np.linspace(0.0, np.arctan2(size, second @ a), _ARC_STEPS)[:, None]
    return np.asarray(points[1] + radius * (np.cos(turn) * a + np.sin(turn) * across / size))


def _dot(canvas: Canvas, place: np.ndarray, radius: float, filled: bool) -> None:
    if not np.isfinite(place).all():
        return
    at, size = ImVec2(float(place[0]), float(place[1])), radius * canvas.scale
    canvas.drawing.add_circle(at, size + 1.0, theme.packed((0.0, 0.0, 0.0, 0.7)), 20, 3.0)
    if filled:
        canvas.drawing.add_circle_filled(at, size, theme.packed(_COLOUR), 20)
    else:
        canvas.drawing.add_circle(at, size, theme.packed(_COLOUR), 20, 1.6)


def _label(canvas: Canvas, x: float, y: float, text: str) -> None:
    if np.isfinite([x, y]).all():
        size = imgui.calc_text_size(text)
        draw_label(canvas, x - 0.5 * size.x, y - 0.5 * size.y, text)
