"""Where the spectral caustic is counted: the planes of flat receivers, and windows of texels on them.

Each side of a receiver that is both lit by glass or mirrors and seen gets two windows: a coarse one over all that the
camera sees of it, and a fine one over nearly all the light where it views most. Where they overlap only the fine one
counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..model.scene import Scene
from ..model.vectors import frame_about
from .camera_kernel import CausticTables
from .photon_scene import PhotonScene

TEXELS_A_PIXEL = 2.0
"""Side of a pixel in texels of a fine window, where the plan says nothing else: more would blur less, and leave fewer
photons a texel."""
_FLAT = 1e-6
"""Share of a receiver's size that its corners may leave a plane."""
_SPREAD = 0.005
"""Share of the places seen, and of the power where these end, beyond each side of a fine window: a lens shows a floor
to its end."""
_MARGIN_SEEN, _MARGIN_LIT = 0.1, 0.05
"""Shares of their sizes by which windows are larger than what the pilots found."""
_COARSE = 0.05
"""Texels of the coarse window, against the fine one's …"""
_MIN_COARSE = 1 << 14
"""… and at least."""


class Planes(NamedTuple):
    """S sides of all diffuse objects."""

    side: np.ndarray
    """int32 (O, 2): number of an object's front and back, −1 where it is not diffuse."""
    owner: np.ndarray
    """int64 (S,): object."""
    frame: np.ndarray
    """float64 (S, 3, 3): origin, two unit axes of the plane."""
    extent: np.ndarray
    """float64 (S, 2, 2): low and high corner of the object on it."""
    is_flat: np.ndarray
    """bool (S,)."""

    def flat(self, side: int, points: np.ndarray) -> np.ndarray:
        """Coordinates (N, 2) of points (N, 3) on a side's plane."""
        return (points - self.frame[side, 0]) @ self.frame[side, 1:].T


class VisiblePoints(NamedTuple):
    """Where N camera paths ended on receivers."""

    points: np.ndarray
    """float64 (N, 3)."""
    distance: np.ndarray
    """float64 (N,): length of the way there."""
    side: np.ndarray
    """int32 (N,)."""


class Landed(NamedTuple):
    """N photons on receivers."""

    points: np.ndarray
    """float64 (N, 3)."""
    watts: np.ndarray
    """float64 (N,)."""
    ends: np.ndarray
    """int32 (N, 4): side, bin, row and column of their light's domain."""


def receiver_planes(scene: Scene, photons: PhotonScene) -> Planes:
    """The sides of every diffuse object, flat or not."""
    side = np.full((len(scene.objects), 2), -1, np.int32)
    owner: list[int] = []
    frames, extents, flat = [], [], []
    for index, item in enumerate(scene.objects):
        if not item.material.receives:
            continue
        chosen = photons.owner == index
        corners = photons.corners[chosen].reshape(-1, 3, 3).copy()
        corners[:, 1:] += corners[:, :1]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
        points = corners.reshape(-1, 3)
        length = float(np.linalg.norm(normal))
        normal = normal / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        height = float(np.ptp((points - points[0]) @ normal))
        # Facets that face either way would make front and back one.
        is_flat = (
            length > 0.0
            and height <= _FLAT * float(np.ptp(points, axis=0).max())
            and bool((photons.normals[chosen] @ normal > 0.5).all())
        )
        frame = frame_about(normal, None)
        plane = (points - points[0]) @ frame[:2].T
        for back in range(2):
            side[index, back] = len(owner)
            owner.append(index)
            frames.append(np.stack([points[0], frame[0], frame[1]]))
            extents.append(np.array([plane.min(axis=0), plane.max(axis=0)]))
            flat.append(is_flat)
    count = len(owner)
    return Planes(
        side,
        np.array(owner, np.int64),
        np.array(frames).reshape(count, 3, 3),
        np.array(extents).reshape(count, 2, 2),
        np.array(flat, bool),
    )


def no_caustic(scene: Scene) -> CausticTables:
    """Tables that hold no light."""
    return _tables(
        np.full((len(scene.objects), 2), -1, np.int32),
        np.zeros((1, 3, 3)),
        np.zeros((1, 2, 2)),
        np.ones((1, 2, 2)),
        np.zeros((1, 2, 2), np.int64),
        1,
    )


def fit_windows(
    planes: Planes,
    seen: VisiblePoints,
    lit: Landed,
    bins: int,
    texel_at: Callable[[float], float],
    max_texels: int,
) -> tuple[CausticTables, np.ndarray]:
    """Tables of zeros over what both pilots found, and which sides have any, bool (S,) (at least one).

    `texel_at`: size of a fine texel at a distance along the camera's way; where all fine windows together had more than
    `max_texels`, each has the share that it has of the places seen.
    """
    count = len(planes.owner)
    low, high, texel, views = np.zeros((count, 2, 2)), np.ones((count, 2, 2)), np.ones(count), np.zeros(count)
    wanted = np.zeros(count, bool)
    for side in range(count):
        from_camera = seen.side == side
        here = lit.ends[:, 0] == side
        if not from_camera.any() or not here.any():
            continue
        places = planes.flat(side, seen.points[from_camera])
        low[side, 0], high[side, 0] = _grown(places.min(axis=0), places.max(axis=0), _MARGIN_SEEN, planes.extent[side])
        landed, watts = planes.flat(side, lit.points[here]), lit.watts[here]
        inside = np.all((landed >= low[side, 0]) & (landed <= high[side, 0]), axis=1)
        if not inside.any():
            continue
        wanted[side] = True
        often = np.array([_quantiles(places[:, axis], np.ones(len(places))) for axis in range(2)])
        often_low, often_high = _grown(often[:, 0], often[:, 1], _MARGIN_SEEN, planes.extent[side])
        looked_at = inside & np.all((landed >= often_low) & (landed <= often_high), axis=1)
        inside = looked_at if looked_at.any() else inside
        box = np.array([_quantiles(landed[inside, axis], watts[inside]) for axis in range(2)])
        low[side, 1], high[side, 1] = _grown(box[:, 0], box[:, 1], _MARGIN_LIT, np.array([low[side, 0], high[side, 0]]))
        near = np.all((places >= low[side, 1]) & (places <= high[side, 1]), axis=1)
        distance = seen.distance[from_camera]
        texel[side] = texel_at(float(np.median(distance[near] if near.any() else distance)))
        views[side] = max(int(near.sum()), 1)
    span = np.maximum(high - low, 1e-300)
    wants = np.where(wanted, np.prod(span[:, 1], axis=1) / texel**2, 0.0)
    texel *= np.sqrt(np.divide(wants, _shared(wants, views, max_texels), out=np.ones(count), where=wanted))
    size = np.zeros((count, 2, 2), np.int64)
    for side in np.flatnonzero(wanted).tolist():
        size[side, 1] = np.maximum(np.ceil(span[side, 1] / texel[side] - 1e-9), 1)
        texels = max(_COARSE * float(np.prod(size[side, 1])), _MIN_COARSE)
        size[side, 0] = np.maximum(np.ceil(span[side, 0] * math.sqrt(texels / np.prod(span[side, 0]))), 1)
    number = np.where((planes.side >= 0) & wanted[np.maximum(planes.side, 0)], planes.side, -1).astype(np.int32)
    return _tables(number, planes.frame, low, np.maximum(size, 1) / span, size, bins), wanted


def within(tables: CausticTables, side: int, places: np.ndarray) -> np.ndarray:
    """Which points (N, 2) of a side's plane lie in its coarse window, bool (N,)."""
    high = tables.low[side, 0] + tables.size[side, 0] / tables.texels_per_unit[side, 0]
    return np.all((places >= tables.low[side, 0]) & (places <= high), axis=1)


def free_areas(tables: CausticTables, side: int, window: int) -> np.ndarray:
    """Unit² of each texel, row by row, that no finer window covers: what its light falls on."""
    step = 1.0 / tables.texels_per_unit[side, window]
    whole, covered = [], []
    for axis in range(2):
        count = tables.size[side, window, axis]
        edges = tables.low[side, window, axis] + step[axis] * np.arange(count + 1)
        low = tables.low[side, 1, axis]
        high = low + tables.size[side, 1, axis] / tables.texels_per_unit[side, 1, axis]
        whole.append(np.full(count, step[axis]))
        covered.append(np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0.0, step[axis]))
    area = np.outer(whole[1], whole[0]).ravel()
    if window == 1:
        return area
    left = area - np.outer(covered[1], covered[0]).ravel()
    return np.where(left > 1e-9 * area, left, 0.0)


def _tables(
    side: np.ndarray, frame: np.ndarray, low: np.ndarray, texels_per_unit: np.ndarray, size: np.ndarray, bins: int
) -> CausticTables:
    first = np.concatenate([[0], np.cumsum(np.prod(size, axis=2).ravel() * bins)]).astype(np.int64)
    return CausticTables(
        side,
        np.ascontiguousarray(frame),
        low,
        texels_per_unit,
        size,
        first[:-1].reshape(len(size), 2).copy(),
        np.zeros(int(first[-1]), np.float32),
        bins,
    )


def _shared(wants: np.ndarray, weight: np.ndarray, most: float) -> np.ndarray:
    """What each gets of `most` in all: as much as `wants` says, or a share by `weight` of what is left by those that
    want less than their share."""
    if wants.sum() <= most:
        return wants
    content = wants <= 0.0
    while True:
        fair = (most - wants[content].sum()) * weight / weight[~content].sum()
        less = ~content & (wants <= fair)
        if not less.any():
            return np.where(content, wants, fair)
        content |= less


def _grown(low: np.ndarray, high: np.ndarray, share: float, limit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A box with a margin on all sides, within `limit` (2, 2)."""
    margin = share * (high - low) + 1e-9 * (limit[1] - limit[0])
    return np.maximum(low - margin, limit[0]), np.minimum(high + margin, limit[1])


def _quantiles(values: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    last = len(order) - 1
    low, high = np.minimum(np.searchsorted(share, (_SPREAD, 1.0 - _SPREAD)), last)
    return float(values[order[low]]), float(values[order[high]])
