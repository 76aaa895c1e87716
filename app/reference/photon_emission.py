"""Where the reference's photons start: exact densities over what can meet glass or a mirror.

Every light is one or more domains, each a unit square with a density of GRID² cells (piecewise
constant, drawn by marginal and conditional distribution) and a map from the square to rays:

- directional and collimated light: a rectangle on the plane across the beam;
- points and spots: a rectangle on a plane at distance one (straight edges stay straight there, so
  the box round a projected triangle is exact); six of them, a cube's faces, round a light amid its objects;
- area lights: a cone of directions, uniform, from a uniform point of the light to a sphere round all objects.

Cells that no specular triangle's box touches have density 0; a pilot raises it where light lands in the
picture (`refined`). The weight is always the measure over the density, so neither changes the mean.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.scene import Light, Scene
from ..model.vectors import frame_about
from .photon_emit import AREA, DIRECTIONS, GRID, PLANE
from .photon_intersect import compiled
from .photon_scene import Colours, PhotonScene, colours, reflectance_classes
from .scene_surfaces import specular_corners

_WIDEST_COSINE = 0.35
"""One plane holds directions up to this from its axis; more is left to a cube's faces."""
_FLOOR = 0.2
"""Share of a refined density that stays even over the reachable cells: bounds every weight."""


class Domain(NamedTuple):
    """A part of a light. Positions about the arrays' origin (`photon_scene`)."""

    kind: int
    frame: np.ndarray
    """float64 (3, 3): tangent, bitangent, axis."""
    origin: np.ndarray
    """Middle of the plane (PLANE) or the light's position."""
    rect: np.ndarray
    """float64 (4,): corner and size on the plane (PLANE, DIRECTIONS)."""
    rows: np.ndarray
    """float64 (GRID + 1,): distribution over rows."""
    columns: np.ndarray
    """float64 (GRID, GRID + 1): distribution within each row."""
    measure: float
    """Measure of the whole square: unit² (PLANE), plane units (DIRECTIONS), the light's area (AREA)."""
    axis: np.ndarray
    """The light's own axis."""
    cone: np.ndarray = np.array([4.0, 4.0])
    """float64 (2,): a spot's half angles, rad; beyond π for none."""
    profile: np.ndarray = np.zeros(0)
    """float64: a lamp's intensities over directions, as `ies_file.Profile.packed` has them; empty without."""
    back: float = 0.0
    """How far before the plane rays start (PLANE)."""
    tilt: float = 0.0
    """Tangent of a sun's angular radius."""
    aperture: np.ndarray = np.zeros(4)
    """float64 (4,): a beam's middle and half size on the plane."""
    has_aperture: bool = False
    is_disc: bool = False
    extended: bool = False
    """Two more random numbers place a photon on the light."""
    half_u: np.ndarray = np.zeros(3)
    half_v: np.ndarray = np.zeros(3)
    """An area light's middle to its rim; where a profile's horizontal angle is 0 and 90°."""
    target: np.ndarray = np.zeros(3)
    """Middle of the sphere round all specular objects (AREA)."""
    radius: float = 0.0


def scene_domains(scene: Scene, photons: PhotonScene, centre: np.ndarray) -> tuple[list[Domain], list[Colours]]:
    """Domains of all lights that shine, and the spectrum of each; `photons`, `centre`: of `photon_scene`."""
    specular = specular_corners(scene, centre)
    corners = photons.corners
    reach = float(
        np.linalg.norm(corners[:, :3], axis=1).max() + np.linalg.norm(corners[:, 3:].reshape(-1, 3), axis=1).max()
    )
    classes, _ = reflectance_classes(scene)
    found: list[Domain] = []
    spectra: list[Colours] = []
    for light in scene.lights:
        if light.spectral_power.power_w() > 0.0:
            own = domains(light, specular, centre, reach)
            found += own
            spectra += [colours(light.spectral_power, classes)] * len(own)
    return found, spectra


def domains(light: Light, triangles: np.ndarray, centre: np.ndarray, reach: float) -> list[Domain]:
    """The light's domains; none where it cannot meet a specular triangle.

    `triangles` float64 (S, 3, 3) and `reach` (farthest point of any object) about the world position `centre`.
    """
    if not len(triangles):
        return []
    direction = np.asarray(light.direction, float)
    direction = direction / np.linalg.norm(direction)
    position = np.asarray(light.position, float) - centre
    if light.is_parallel:
        return _plane(light, triangles, position, direction, reach)
    if light.has_outline:
        return _area(light, triangles, position, direction)
    return _directions(light, triangles, position, direction)


def refined(domain: Domain, importance: np.ndarray) -> Domain:
    """The same domain with density ∝ √importance over its reachable cells, besides an even share.

    `importance`: mean square of what a photon of each cell adds to the picture, (GRID, GRID), any scale.
    """
    reachable = density(domain) > 0.0
    padded = np.pad(importance, 1)
    smooth = sum(padded[i : i + GRID, j : j + GRID] for i in range(3) for j in range(3))
    wish = np.sqrt(smooth) * reachable
    if wish.sum() <= 0.0:
        return domain
    rows, columns = _distribution((1.0 - _FLOOR) * wish / wish.sum() + _FLOOR * reachable / reachable.sum())
    return domain._replace(rows=rows, columns=columns)


def density(domain: Domain) -> np.ndarray:
    """Probability of each cell, float64 (GRID, GRID)."""
    return np.diff(domain.rows)[:, None] * np.diff(domain.columns, axis=1)


def _distribution(probability: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    total = probability.sum(axis=1)
    rows = np.concatenate([[0.0], np.cumsum(total)])
    within = np.divide(probability, total[:, None], out=np.zeros_like(probability), where=total[:, None] > 0.0)
    columns = np.concatenate([np.zeros((GRID, 1)), np.cumsum(within, axis=1)], axis=1)
    # The last lit cell ends at 1 exactly, and no number can fall into a dark one behind it.
    columns[columns >= 1.0 - 1e-12] = 1.0
    rows[rows >= 1.0 - 1e-12] = 1.0
    return rows, columns


def _plane(
    light: Light, triangles: np.ndarray, position: np.ndarray, direction: np.ndarray, reach: float
) -> list[Domain]:
    frame = frame_about(direction, light.tangent)
    flat, depth = triangles @ frame[:2].T, triangles @ direction
    tilt = math.tan(light.angular_radius)
    grow = tilt * np.abs(depth)[..., None]
    low, high = (flat - grow).min(axis=1), (flat + grow).max(axis=1)
    box_low, box_high = low.min(axis=0), high.max(axis=0)
    half = np.array(light.half_extent)
    at = frame[:2] @ position
    if light.has_place:
        box_low, box_high = np.maximum(box_low, at - half), np.minimum(box_high, at + half)
    if np.any(box_high <= box_low):
        return []
    rect = np.concatenate([box_low, box_high - box_low])
    mask = _touched(low, high, rect)
    if not mask.any():
        return []
    even = _distribution(mask / mask.sum())
    domain = Domain(PLANE, frame, np.zeros(3), rect, *even, float(rect[2] * rect[3]), direction)
    if light.has_place:
        aperture = np.concatenate([at, half])
        return [
            domain._replace(
                back=-float(position @ direction), aperture=aperture, has_aperture=True, is_disc=light.is_disc
            )
        ]
    # Beyond the sphere that holds everything, also for the most slanted ray to the rectangle's corner.
    corner = float(np.hypot(*np.maximum(np.abs(box_low), np.abs(box_high))))
    return [domain._replace(back=1.01 * (reach + corner), tilt=tilt, extended=tilt > 0.0)]


def _directions(light: Light, triangles: np.ndarray, position: np.ndarray, direction: np.ndarray) -> list[Domain]:
    relative = triangles - position
    corners = relative.reshape(-1, 3)
    axis = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    size = np.linalg.norm(axis)
    lengths = np.linalg.norm(corners, axis=1)
    narrow = size > 0.0 and lengths.min() > 0.0 and ((corners @ axis) / (lengths * size)).min() > _WIDEST_COSINE
    charts = (
        [frame_about(axis / size, None)]
        if narrow
        else [frame_about(side * e, None) for e in np.eye(3) for side in (1.0, -1.0)]
    )
    cone = np.array(light.cone)
    found = []
    for frame in charts:
        limit = np.array([[-np.inf] * 2, [np.inf] * 2]) if narrow else np.array([[-1.0] * 2, [1.0] * 2])
        domain = _chart(frame, relative @ frame.T, limit, position, direction, cone)
        if domain is not None and light.profile is not None:
            u, v = light.across
            domain = domain._replace(profile=light.profile.packed(), half_u=u, half_v=v)
        if domain is not None:
            found.append(domain)
    return found


def _chart(
    frame: np.ndarray,
    local: np.ndarray,
    limit: np.ndarray,
    position: np.ndarray,
    direction: np.ndarray,
    cone: np.ndarray,
) -> Domain | None:
    """One plane's domain from triangles (S, 3, 3) in its frame."""
    height = local[..., 2]
    local = local[(height > 0.0).any(axis=1)]
    if not len(local):
        return None
    height = local[..., 2]
    before = (height > 1e-3 * np.linalg.norm(local, axis=-1)).all(axis=1)
    flat = local[..., :2] / np.where(before[:, None], height, 1.0)[..., None]
    # A triangle that reaches behind the plane may appear anywhere on it.
    low = np.where(before[:, None], flat.min(axis=1), limit[0])
    high = np.where(before[:, None], flat.max(axis=1), limit[1])
    box_low, box_high = np.maximum(low.min(axis=0), limit[0]), np.minimum(high.max(axis=0), limit[1])
    axis_local = frame @ direction
    if math.acos(float(np.clip(axis_local[2], -1.0, 1.0))) + cone[1] < 1.3:
        cone_low, cone_high = _cone_box(axis_local, float(cone[1]))
        box_low, box_high = np.maximum(box_low, cone_low), np.minimum(box_high, cone_high)
    if np.any(box_high <= box_low):
        return None
    rect = np.concatenate([box_low, box_high - box_low])
    mask = _touched(low, high, rect)
    if cone[1] < math.pi:
        mask &= _within_cone(rect, axis_local, float(cone[1]))
    if not mask.any():
        return None
    even = _distribution(mask / mask.sum())
    return Domain(DIRECTIONS, frame, position, rect, *even, float(rect[2] * rect[3]), direction, cone)


def _cone_box(axis: np.ndarray, half_angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (with a margin) of a cone's cut with the plane at distance one; the whole cone lies before it."""
    frame = frame_about(axis, None)
    turn = np.linspace(0.0, 2.0 * np.pi, 513)[:, None]
    rim = math.cos(half_angle) * axis + math.sin(half_angle) * (np.cos(turn) * frame[0] + np.sin(turn) * frame[1])
    flat = rim[:, :2] / rim[:, 2:]
    margin = 1e-3 * np.ptp(flat, axis=0)
    return flat.min(axis=0) - margin, flat.max(axis=0) + margin


def _within_cone(rect: np.ndarray, axis: np.ndarray, half_angle: float) -> np.ndarray:
    """Cells that directions of the cone may fall into."""
    middle = (np.arange(GRID) + 0.5) / GRID
    x, y = np.meshgrid(rect[0] + middle * rect[2], rect[1] + middle * rect[3])
    direction = np.stack([x, y, np.ones_like(x)], axis=-1)
    cosine = direction @ axis / np.linalg.norm(direction, axis=-1)
    # Angles on the plane are at most its distances.
    return np.arccos(np.clip(cosine, -1.0, 1.0)) <= half_angle + 0.5 * math.hypot(rect[2], rect[3]) / GRID + 1e-7


def _area(light: Light, triangles: np.ndarray, position: np.ndarray, direction: np.ndarray) -> list[Domain]:
    corners = triangles.reshape(-1, 3)
    target = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    radius = 1.0001 * float(np.linalg.norm(corners - target, axis=1).max())
    frame = frame_about(direction, light.tangent)
    half = light.half_extent
    u, v = half[0] * frame[0], half[1] * frame[1]
    rim = position + np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) @ np.stack([u, v])
    if ((target - rim) @ direction).max() <= -radius:
        return []  # everything lies behind the light
    way = target - position
    length = np.linalg.norm(way)
    aim = frame_about(way / length if length > 0.0 else direction, None)
    even = _distribution(np.full((GRID, GRID), 1.0 / GRID**2))
    domain = Domain(AREA, aim, position, np.zeros(4), *even, light.area, direction)
    return [domain._replace(is_disc=light.is_disc, extended=True, half_u=u, half_v=v, target=target, radius=radius)]


def _touched(low: np.ndarray, high: np.ndarray, rect: np.ndarray) -> np.ndarray:
    """Cells of the rectangle that a box [low, high] (S, 2) touches, grown by one against rounding."""
    with np.errstate(over="ignore"):
        first = np.clip(np.floor((low - rect[:2]) / rect[2:] * GRID) - 1, -1, GRID).astype(np.int64)
        last = np.clip(np.floor((high - rect[:2]) / rect[2:] * GRID) + 1, -1, GRID).astype(np.int64)
    mask = np.zeros((GRID, GRID), np.bool_)
    _mark(mask, np.maximum(first, 0), np.minimum(last, GRID - 1))
    return mask


@compiled
def _mark(mask, first, last):
    for i in range(first.shape[0]):
        for y in range(first[i, 1], last[i, 1] + 1):
            for x in range(first[i, 0], last[i, 0] + 1):
                mask[y, x] = True
