"""Where a light must shine: the rectangle of its emission domain that holds the specular objects.

Photons that cannot meet glass or a mirror make no caustic, so each light's lattice covers only
the rectangle (on Lambert's azimuthal equal-area plane for light that diverges, on a plane across
the beam for light that does not) round the projected objects, with a bit mask of the cells that
some triangle touches. The restriction is exact: a lattice point's weight is the true measure of
its share of the rectangle, and what the mask leaves out meets no specular object.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu.gpu_space import GpuSpace
from ..gpu.records import MASK_SIZE
from ..model.scene import Light, Scene
from ..model.vectors import frame_about

_COARSE_ANGLE = 0.15
"""Triangles that look larger than this from the light (rad, or of the unit sphere) are subdivided before projection."""
_MAX_SUBDIVIDED = 400_000
_NEAR_ANTIPODE = 3.0 * _COARSE_ANGLE
"""Triangles this close (rad) to the point behind a light are bent too much on the plane to be held by their corners'
box."""
_FAR, _FACING = 100.0, 0.9999
"""Distance of an area light in radii of the glass, and cosine to its axis, from which on its points are directions."""
_SOFT_EDGE = 1.0 / 48.0
"""Room about an aperture, as a share of its size: emission spreads its edge over a lattice spacing on both sides
(`lib/edge.glsl`), and what does not fit is lost. Enough for lattices of 2304 points; of 576, 0.4 % is lost."""


@dataclass(frozen=True)
class EmissionDomain:
    """One light's domain; positions in GPU space."""

    kind: str
    """"point", "profile", "plane" or "area": which variant of emit.comp runs."""
    origin: np.ndarray
    axis: np.ndarray
    tangent: np.ndarray
    bitangent: np.ndarray
    rect: np.ndarray
    """Corner and size (4,): plane coordinates, or GPU units."""
    mask: np.ndarray
    """bool (MASK_SIZE, MASK_SIZE), rows along the second axis."""
    measure: float
    """Measure of the whole rectangle (times the light's area): sr, unit² or sr·unit²."""
    back: float
    light_u: np.ndarray
    light_v: np.ndarray
    aperture_centre: np.ndarray
    is_disc: bool
    cone: tuple[float, float]
    thinned: np.ndarray | None = None
    """bool, as `mask`: cells of it of which only some points are emitted, for all (`guided_emission`); None: none."""
    thinned_chance: float = 1.0
    """Probability of a point in such a cell to be emitted."""

    @property
    def active_share(self) -> float:
        """Share of a lattice over the rectangle that is emitted: what the mask keeps, less what is thinned."""
        if self.thinned is None:
            return float(self.mask.mean())
        return float(self.mask.mean() - (1.0 - self.thinned_chance) * self.thinned.mean())

    def spacing(self, count: int) -> np.ndarray:
        """Distances (2,) along the axes between neighbours of a lattice of `count` points over the rectangle.

        In proportion to the rectangle: what light outlines there (an aperture, a solid) is as long as
        the rectangle along each axis, so that the blur of all its edges is least. The golden lattice is as even under
        every such stretch.
        """
        return self.rect[2:] / np.sqrt(count)


def azimuthal_plane(directions: np.ndarray) -> np.ndarray:
    """Lambert azimuthal equal-area coordinates (..., 2) of unit directions in a frame with z the axis."""
    k = np.sqrt(np.maximum(0.5 * (1.0 + directions[..., 2]), 1e-12))
    return directions[..., :2] / k[..., None]


def emission_domain(
    light: Light, scene: Scene, space: GpuSpace, specular_triangles: np.ndarray
) -> EmissionDomain | None:
    """The domain of `light`, or None where it cannot reach a specular object.

    `specular_triangles`: float64 (T, 3, 3) in GPU space.
    """
    if len(specular_triangles) == 0:
        return None
    position = space.to_gpu(np.array(light.position))
    direction = light.axes()[:, 2]
    corners = specular_triangles.reshape(-1, 3)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    if light.is_parallel or _is_far(light, position, direction, corners - middle, middle):
        return _plane_domain(light, scene, space, specular_triangles, position, direction, middle)
    return _diverging_domain(light, space, specular_triangles, position, direction, middle)


def _is_far(light: Light, position: np.ndarray, axis: np.ndarray, around: np.ndarray, middle: np.ndarray) -> bool:
    """Whether an area light that faces the glass is so far away that its points are directions: all of them see all of
    the glass alike, and a domain of directions would hardly hit it."""
    distance, radius = float(np.linalg.norm(middle - position)), float(np.linalg.norm(around, axis=1).max())
    return light.has_outline and distance > _FAR * radius and float((middle - position) @ axis) > _FACING * distance


def _plane_domain(
    light: Light,
    scene: Scene,
    space: GpuSpace,
    triangles: np.ndarray,
    position: np.ndarray,
    direction: np.ndarray,
    middle: np.ndarray,
) -> EmissionDomain | None:
    tangent, bitangent, _ = light.axes().T
    is_far, measure, tilt = not light.is_parallel, 1.0, np.full(2, np.tan(light.angular_radius))
    cone = float(tilt[0]), 0.0
    if is_far:
        distance = float(np.linalg.norm(middle - position))
        direction = (middle - position) / distance
        bitangent = np.cross(direction, tangent) / np.linalg.norm(np.cross(direction, tangent))
        tangent = np.cross(bitangent, direction)
        tilt = np.array(light.half_extent) * space.scale / distance
        cone = float(tilt[0]), 0.0 if light.is_disc else float(tilt[1])
        # Of a rectangle each direction is weighted by itself.
        measure = float(np.pi * tilt[0] ** 2 / (1.0 + tilt[0] ** 2) if light.is_disc else 4.0 * tilt.prod())
    frame = np.stack([tangent, bitangent])
    if light.has_place and not is_far:
        # About the beam's own axis, where float32 resolves the thinnest beam.
        middle = middle + ((position - middle) @ frame.T) @ frame
    relative = triangles - middle
    low, high = _bounds(_in_frame(relative, frame))
    if tilt.any():
        near, far = _bounds(_in_frame(relative, direction[None, :]))
        grow = tilt * np.maximum(-near, far)
        low, high = low - grow, high + grow
    box_low, box_high = low.min(axis=0), high.max(axis=0)
    centre, light_u, light_v, is_disc, rim = middle, np.zeros(3), np.zeros(3), False, np.zeros(2)
    if light.has_place and not is_far:
        half = np.array(light.half_extent) * space.scale
        light_u, light_v, is_disc = tangent / half[0], bitangent / half[1], light.is_disc
        rim = _SOFT_EDGE * 2.0 * half
        box_low, box_high = np.maximum(box_low, -half - rim), np.minimum(box_high, half + rim)
        back = float((middle - position) @ direction)
    else:
        ends = np.concatenate([space.to_gpu(item.world_vertices) for item in scene.objects])
        back = float(np.max((middle - ends) @ direction)) + 1.0
    if np.any(box_high <= box_low):
        return None
    rect, mask = _rect_and_mask(low, high, box_low, box_high)
    if is_disc:
        mask &= _disc_mask(rect, np.zeros(2), half[0] + rim[0])
    if not mask.any():  # the beam misses
        return None
    area = measure * rect[2] * rect[3] / space.scale**2
    return EmissionDomain(
        "plane",
        centre,
        direction,
        tangent,
        bitangent,
        rect,
        mask,
        area,
        back,
        light_u,
        light_v,
        middle,
        is_disc,
        cone,
    )


def _diverging_domain(
    light: Light,
    space: GpuSpace,
    triangles: np.ndarray,
    position: np.ndarray,
    direction: np.ndarray,
    middle: np.ndarray,
) -> EmissionDomain | None:
    to_middle = middle - position
    distance = np.linalg.norm(to_middle)
    axis = to_middle / distance if distance > 1e-9 else direction
    tangent, bitangent, _ = frame_about(axis)
    frame = np.stack([tangent, bitangent, axis])
    triangles = _subdivided(triangles, position)
    relative = _in_frame(triangles - position, frame)
    lengths = np.linalg.norm(relative, axis=-1)
    flat = azimuthal_plane(relative / np.maximum(lengths, 1e-12)[..., None])
    light_u, light_v = light.across
    # Farthest from the axis, with what the extent of the light adds to it.
    farthest = np.arccos(np.clip((relative[..., 2] / np.maximum(lengths, 1e-12)).min(axis=1), -1.0, 1.0))
    shift = np.zeros(len(triangles))
    area = 1.0
    if light.has_outline:
        half = np.array(light.half_extent)
        edge_u, edge_v, _ = light.axes().T
        light_u, light_v = edge_u * half[0] * space.scale, edge_v * half[1] * space.scale
        area = light.area
        reach = (half[0] if light.is_disc else np.linalg.norm(half)) * space.scale
        # Seen from the light's rim the object shifts by at most this angle.
        shift = np.arcsin(np.clip(reach / np.maximum(lengths.min(axis=1), 1e-12), 0.0, 1.0))
        farthest = np.minimum(farthest + shift, np.pi)
    # The plane stretches angles by 1 / cos(angle / 2) on its way out.
    grow = (shift * np.maximum(1.5, 1.0 / np.maximum(np.cos(0.5 * farthest), 1e-3)))[:, None]
    low, high = _bounds(flat)
    low, high = np.maximum(low - grow, -2.0), np.minimum(high + grow, 2.0)
    box_low, box_high = low.min(axis=0), high.max(axis=0)
    # The point behind the light is the plane's whole rim: what is near it gets a ring instead of boxes.
    behind = np.pi - farthest < _NEAR_ANTIPODE
    ring = np.inf
    if behind.any():
        nearest = (
            np.arccos(np.clip(relative[behind, :, 2] / np.maximum(lengths[behind], 1e-12), -1.0, 1.0)).min(axis=1)
            - shift[behind]
        )
        ring = 2.0 * float(np.sin(0.5 * max(nearest.min(), 0.0)))
        box_low, box_high = np.full(2, -2.0), np.full(2, 2.0)
    inner, outer = light.cone
    cone_limit = None
    if outer < np.pi:
        cone_limit = (frame @ direction, outer)
        cone_low, cone_high = _cone_box(frame @ direction, outer)
        box_low, box_high = np.maximum(box_low, cone_low), np.minimum(box_high, cone_high)
        if np.any(box_high <= box_low):
            return None
    rect, mask = _rect_and_mask(low, high, box_low, box_high)
    mask |= ~_disc_mask(rect, np.zeros(2), ring - 2.0 * float(np.hypot(rect[2], rect[3])) / MASK_SIZE)
    if cone_limit is not None:
        mask &= _cone_mask(rect, *cone_limit)
    if not mask.any():
        return None
    measure = float(rect[2] * rect[3]) * area
    return EmissionDomain(
        light.emission,
        position,
        axis,
        tangent,
        bitangent,
        rect,
        mask,
        measure,
        0.0,
        light_u,
        light_v,
        position,
        light.is_disc,
        (float(inner), float(outer)),
    )


def _in_frame(triangles: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Corners (T, 3, n) along the n rows of `frame`: one product of matrices, not T small ones."""
    return (triangles.reshape(-1, 3) @ frame.T).reshape(len(triangles), 3, len(frame))


def _bounds(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest (T, n) of each triangle's corners (T, 3, n); numpy reduces so short an axis five times as
    slowly."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _rect_and_mask(
    low: np.ndarray, high: np.ndarray, box_low: np.ndarray, box_high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The rectangle with a small margin, and the cells that boxes [low, high] (T, 2) touch, grown by one."""
    margin = 1e-3 * (box_high - box_low)
    corner, size = box_low - margin, (box_high - box_low) + 2 * margin
    first = np.clip(np.floor((low - corner) / size * MASK_SIZE).astype(int) - 1, 0, MASK_SIZE)
    last = np.clip(np.floor((high - corner) / size * MASK_SIZE).astype(int) + 2, 0, MASK_SIZE)
    # Box counts by corner differences and running sums: one pass, however many triangles.
    steps = np.zeros((MASK_SIZE + 1, MASK_SIZE + 1), int)
    for y, x, sign in ((first, first, 1), (last, first, -1), (first, last, -1), (last, last, 1)):
        np.add.at(steps, (y[:, 1], x[:, 0]), sign)
    mask = steps.cumsum(axis=0).cumsum(axis=1)[:MASK_SIZE, :MASK_SIZE] > 0
    return np.concatenate([corner, size]), mask


def _subdivided(triangles: np.ndarray, viewpoint: np.ndarray) -> np.ndarray:
    """Triangles split until each looks small from `viewpoint`: straight edges bend on the azimuthal plane."""
    done = []
    while len(triangles):
        edges = triangles - np.roll(triangles, 1, axis=1)
        distance = np.linalg.norm(triangles.mean(axis=1) - viewpoint, axis=1)
        large = np.linalg.norm(edges, axis=-1).max(axis=1) > _COARSE_ANGLE * np.maximum(distance, 1e-3)
        done.append(triangles[~large])
        big = triangles[large]
        if sum(map(len, done)) + 4 * len(big) > _MAX_SUBDIVIDED:
            done.append(big)
            break
        a, b, c = big[:, 0], big[:, 1], big[:, 2]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        triangles = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return np.concatenate(done)


def _cone_box(axis_local: np.ndarray, outer: float) -> tuple[np.ndarray, np.ndarray]:
    """Bounding box of a cone of directions on the azimuthal plane."""
    if outer > np.pi / 2:
        return np.full(2, -2.0), np.full(2, 2.0)
    first, second, _ = frame_about(axis_local)
    turn = np.linspace(0.0, 2 * np.pi, 257)[:-1, None, None]
    angle = np.linspace(0.0, outer, 9)[None, :, None]
    directions = np.cos(angle) * axis_local + np.sin(angle) * (np.cos(turn) * first + np.sin(turn) * second)
    flat = azimuthal_plane(directions).reshape(-1, 2)
    slack = 0.01 * np.ptp(flat, axis=0)
    return flat.min(axis=0) - slack, flat.max(axis=0) + slack


def _disc_mask(rect: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """Cells of the rectangle that a disc may touch."""
    cells = (np.arange(MASK_SIZE) + 0.5) / MASK_SIZE
    x, y = np.meshgrid(rect[0] + cells * rect[2] - centre[0], rect[1] + cells * rect[3] - centre[1])
    return np.hypot(x, y) <= radius + np.hypot(rect[2], rect[3]) / MASK_SIZE


def _cone_mask(rect: np.ndarray, axis_local: np.ndarray, outer: float) -> np.ndarray:
    """Cells of the rectangle that a cone of directions may touch."""
    centres = (np.arange(MASK_SIZE) + 0.5) / MASK_SIZE
    qx, qy = np.meshgrid(rect[0] + centres * rect[2], rect[1] + centres * rect[3])
    r2 = np.minimum(qx**2 + qy**2, 4.0)
    k = np.sqrt(np.maximum(1.0 - 0.25 * r2, 0.0))
    directions = np.stack([qx * k, qy * k, 1.0 - 0.5 * r2], axis=-1)
    # The plane stretches angles by at most 1/k on its way out.
    diagonal = np.hypot(rect[2], rect[3]) / MASK_SIZE / np.maximum(k, 0.05)
    angle = np.arctan2(np.linalg.norm(np.cross(directions, axis_local), axis=-1), directions @ axis_local)
    return angle <= outer + diagonal
