"""A slow, readable float64 ray, and the central differences of its paths that derivatives are judged by."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from reference.grating import diffract
from reference.surfaces import Facet, Surface
from reference.textbook_optics import fresnel_reflectance
from spectrasplat.reference import optics, polarised


@dataclass(frozen=True)
class Ray:
    """A ray."""

    position: np.ndarray
    direction: np.ndarray
    """Unit, propagation."""

    def at(self, distance: float) -> np.ndarray:
        return self.position + distance * self.direction


def make_ray(position: Sequence[float], direction: Sequence[float]) -> Ray:
    """A ray from plain sequences; the direction is normalised."""
    return Ray(np.array(position, np.float64), optics.unit(np.array(direction, np.float64)))


AIR = 1.0


def advance(ray: Ray, surface: Surface, distance: float) -> tuple[Ray, np.ndarray, np.ndarray]:
    """Move a ray to a surface: (ray there, outward geometric normal, shading normal turned against the ray)."""
    arrived = replace(ray, position=ray.at(distance))
    geometric, normal = surface.normals(arrived.position)
    return arrived, geometric, -normal if ray.direction @ normal > 0.0 else normal


def reflected(ray: Ray, normal: np.ndarray) -> Ray:
    """The ray after a mirror at its position."""
    return replace(ray, direction=optics.reflect(ray.direction, normal))


def refracted(ray: Ray, normal: np.ndarray, n_i: float, n_t: float) -> Ray | None:
    """The ray beyond a boundary, or None at total reflection."""
    eta = n_i / n_t
    if optics.transmitted_cosine2(ray.direction, normal, eta) <= 0.0:
        return None
    return replace(ray, direction=optics.refract(ray.direction, normal, eta))


def through(ray: Ray, surface: Surface, n_i: float, n_t: float, root: int = 0, mirror: bool = False) -> Ray:
    """Follow a ray to the given root of a surface and refract it there (reflect it, where `mirror`).

    Raises ValueError at total internal reflection.
    """
    arrived, _, normal = advance(ray, surface, surface.distances(ray.position, ray.direction)[root])
    left = reflected(arrived, normal) if mirror else refracted(arrived, normal, n_i, n_t)
    if left is None:
        raise ValueError("total internal reflection")
    return left


def onto(ray: Ray, surface: Surface, root: int = 0) -> Ray:
    """Move a ray to a surface without changing its direction."""
    return advance(ray, surface, surface.distances(ray.position, ray.direction)[root])[0]


# ---- triangle lists --------------------------------------------------------------------------

RECEIVER = -1
"""Material of a triangle; a glass is its position in the list of bodies."""

TOUCHING = 1e-9
"""Two surfaces closer than this are at one place: a ray enters what lies there before it leaves."""


@dataclass(frozen=True)
class Body:
    """What a ray meets, at one wavelength."""

    index: float = AIR
    absorption: float = 0.0
    """Per unit of length, inside."""
    reflectance: float = 1.0
    """Of a mirror."""
    priority: int = 0
    """Where glasses overlap, the highest decides; of equal ones the later."""
    kind: Literal["glass", "mirror", "receiver", "grating"] = "glass"
    lines: np.ndarray | None = None
    """(3,): along a grating's lines. `reflectance` is the efficiency of its one order."""
    step: float = 0.0
    """m λ / Λ of that order."""
    throws_back: bool = False


@dataclass(frozen=True, eq=False)
class TriangleList:
    """Triangles (T, 3, 3) with a material each (T,) and, for smooth ones, corner normals (T, 3, 3)."""

    corners: np.ndarray
    material: np.ndarray
    corner_normals: np.ndarray | None = None
    """A row of zeros is a flat triangle."""

    def facet(self, triangle: int) -> Facet:
        normals = None if self.corner_normals is None else self.corner_normals[triangle]
        return Facet(self.corners[triangle], normals if normals is not None and normals.any() else None)

    def nearest(self, ray: Ray, leaving: int | None, inside: frozenset[int] = frozenset()) -> tuple[int, float] | None:
        """(triangle, distance) of the closest hit that is not the triangle just left.

        Glass is entered from outside and left from `inside` only: so surfaces that touch cannot be met twice.
        """
        crossed, distance, leaves = self._crossings(ray)
        glass, within = self.material >= 0, np.isin(self.material, list(inside))
        crossed &= np.where(glass, (distance > -TOUCHING) & (within == leaves), distance > 0.0)
        if leaving is not None:
            crossed[leaving] = False
        if not crossed.any():
            return None
        best = int(np.where(crossed, distance + TOUCHING * (glass & within), np.inf).argmin())
        return best, float(distance[best])

    def holding(self, ray: Ray) -> frozenset[int]:
        """The glasses round a ray's start: those that it leaves once more than it enters them."""
        crossed, distance, leaves = self._crossings(ray)
        ahead = crossed & (distance > 0.0) & (self.material >= 0)
        balance = {
            int(solid): np.sum(np.where(leaves, 1, -1)[ahead & (self.material == solid)])
            for solid in np.unique(self.material[ahead])
        }
        return frozenset(solid for solid, exits in balance.items() if exits > 0)

    @cached_property
    def _planes(self) -> tuple[np.ndarray, np.ndarray]:
        """Normals (T, 3) and, in each plane, the vectors (T, 3, 3) across the edges that point inwards."""
        edges = np.roll(self.corners, -1, axis=1) - self.corners
        normal = optics.cross(edges[:, 0], -edges[:, 2])
        return normal, optics.cross(normal[:, None], edges)

    def _crossings(self, ray: Ray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Over all triangles (T,): whether the ray's line meets it, at which distance, and from behind."""
        normal, inward = self._planes
        facing = normal @ ray.direction
        crossed = facing != 0.0
        distance = np.full(len(facing), np.inf)
        distance[crossed] = optics.dot(self.corners[:, 0] - ray.position, normal)[crossed] / facing[crossed]
        point = ray.position + np.where(crossed, distance, 0.0)[:, None] * ray.direction
        crossed &= (optics.dot(point[:, None] - self.corners, inward) >= 0.0).all(axis=1)
        return crossed, distance, facing > 0.0


@dataclass(frozen=True)
class Path:
    """Where a ray went. `triangles[-1]` is the receiver's, unless the ray escaped or ran too deep."""

    ray: Ray
    """At the last hit (at the last departure, where it escaped)."""
    triangles: tuple[int, ...]
    reflections: tuple[bool, ...]
    """For each specular event: whether it was reflected."""
    landed: bool
    transmittance: float = 1.0
    """Product of Fresnel factors of the branches taken, absorption and mirrors."""
    margin: float = 1.0
    """Smallest cosine on the way, incident on a facet or (imaginary ones too) transmitted: how far from the hazards."""


def follow(
    ray: Ray,
    scene: TriangleList,
    bodies: Sequence[Body],
    reflects: Callable[[int], bool] = lambda event: False,
    max_depth: int = 64,
    along: Sequence[int] | None = None,
    inside: frozenset[int] | None = None,
    polarisation: bool = False,
) -> Path:
    """Follow one path among glasses that may nest or touch, mirrors and receivers.

    A triangle's material is an index into `bodies`, and glass has one that is not negative: mirrors and
    receivers stand at the end and are counted from there. `reflects(event)` chooses reflection at a specular event
    (total reflection happens anyway). `along` forces a sequence of triangles: each is met on its whole plane, inside
    its edges or not, as a difference quotient over one and the same path needs.
    `inside`: glasses that the ray starts in, found by counting boundaries where it is not given.
    """
    inside = scene.holding(ray) if inside is None else inside
    field = np.zeros((2, 3), complex)
    polarised.begin_unpolarised(field, tuple(ray.direction))
    triangles: list[int] = []
    reflections: list[bool] = []
    factor, margin = 1.0, 1.0
    while len(reflections) <= max_depth:
        if along is not None:
            hit = (
                None
                if len(triangles) >= len(along)
                else (along[len(triangles)], _distance(ray, scene.facet(along[len(triangles)])))
            )
        else:
            hit = scene.nearest(ray, triangles[-1] if triangles else None, inside)
        if hit is None:
            return Path(ray, tuple(triangles), tuple(reflections), False, factor, margin)
        triangle, distance = hit
        factor *= float(np.exp(-_medium(inside, bodies).absorption * distance))
        triangles.append(triangle)
        arrived, geometric, normal = advance(ray, scene.facet(triangle), distance)
        margin = min(margin, abs(float(ray.direction @ geometric)))
        material = int(scene.material[triangle])
        body = bodies[material]
        if body.kind == "receiver":
            return Path(arrived, tuple(triangles), tuple(reflections), True, factor, margin)
        if body.kind == "mirror":
            ray = reflected(arrived, normal)
            _turned(field, arrived, ray, normal, -1.0, 1.0)
            factor *= body.reflectance
            reflections.append(True)
            continue
        if body.kind == "grating":
            sent = _diffracted(arrived, geometric, body, _medium(inside, bodies).index)
            if sent is None:
                return Path(arrived, tuple(triangles), tuple(reflections), False, factor, margin)
            ray = sent
            factor *= body.reflectance
            reflections.append(body.throws_back)
            continue
        before = inside - {material} if ray.direction @ geometric < 0.0 else inside | {material}
        after = before ^ {material}
        n_i, n_t = _medium(before, bodies), _medium(after, bodies)
        if n_i is n_t:
            # Another glass decides here: the boundary is not seen.
            ray, inside = arrived, after
            continue
        eta_it = n_i.index / n_t.index
        reflectance = float(fresnel_reflectance(arrived.direction, normal, eta_it))
        margin = min(margin, float(np.sqrt(abs(optics.transmitted_cosine2(arrived.direction, normal, eta_it)))))
        beyond = None if reflects(len(reflections)) else refracted(arrived, normal, n_i.index, n_t.index)
        sent = reflected(arrived, normal) if beyond is None else beyond
        if polarisation:
            r_s, r_p, t_s, t_p = polarised.amplitudes(-float(arrived.direction @ normal), eta_it)
            factor *= _turned(field, arrived, sent, normal, *((r_s, r_p) if beyond is None else (t_s, t_p)))
        else:
            factor *= reflectance if beyond is None else 1.0 - reflectance
        reflections.append(beyond is None)
        ray, inside = sent, before if beyond is None else after
    return Path(ray, tuple(triangles), tuple(reflections), False, factor, margin)


def _turned(field: np.ndarray, before: Ray, after: Ray, normal: np.ndarray, a_s: complex, a_p: complex) -> float:
    """Turn electric fields with the ray by amplitudes for s and p; returns the share of their power that goes on."""
    s = polarised.senkrecht(tuple(before.direction), tuple(normal))
    share = polarised.share_of(field, tuple(before.direction), s, complex(a_s), complex(a_p))
    polarised.turn_fields(field, tuple(before.direction), tuple(after.direction), s, complex(a_s), complex(a_p))
    return float(share)


def _diffracted(ray: Ray, normal_out: np.ndarray, body: Body, index: float) -> Ray | None:
    """The ray behind a flat grating in a medium of this index; None where its order is evanescent."""
    assert body.lines is not None
    step = np.array([body.step / index])
    (direction,) = diffract(ray.direction[None], normal_out, body.lines, step, body.throws_back)
    return replace(ray, direction=direction) if np.isfinite(direction).all() else None


_OUTSIDE = Body()


def _medium(inside: frozenset[int], bodies: Sequence[Body]) -> Body:
    """The glass that decides among those a ray is inside of."""
    return bodies[max(inside, key=lambda i: (bodies[i].priority, i))] if inside else _OUTSIDE


def _distance(ray: Ray, facet: Facet) -> float:
    return float(facet.distances(ray.position, ray.direction)[0])


def central_difference(path_of: Callable[[float], Path], step: float) -> np.ndarray:
    """∂position at the end of `path_of(x)` at x = 0, to fourth order in the step.

    Raises ValueError when the four neighbours do not run over the same triangles and choices.
    """
    paths = {k: path_of(k * step) for k in (-2, -1, 1, 2)}
    if len({(p.triangles, p.reflections) for p in paths.values()}) != 1:
        raise ValueError("the neighbouring paths differ; use a smaller step or force one sequence")
    far, near, ahead, farther = (p.ray.position for p in paths.values())
    return (8.0 * (ahead - near) - (farther - far)) / (12.0 * step)
