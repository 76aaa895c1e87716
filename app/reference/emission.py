"""CPU reference of emit.comp, for tests and stress cases: how rays leave a light, in float64 and world units.

It has no derivatives: the shader's ray differentials are checked against difference quotients of `Emitter.start`.
Lattice, equal-area map, disc and spot edge follow their mathematical definitions, independently of
shaders/lib/emission.glsl and spot.glsl. Points of the plane or of the unit square have shape (..., 2), directions
(..., 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import erf

import numpy as np

from ..gpu.gpu_space import GpuSpace
from ..model.scene import Light
from ..passes.emission_domain import EmissionDomain
from .optics import unit
from .random_numbers import kronecker, unit_float

Array = np.ndarray
GOLDEN = 2654435769  # 2³² divided by the golden ratio
PLASTIC = (3242174889, 2447445414)  # 2³² divided by the plastic number and by its square


def lattice_point(i: Array, count: int, shift: tuple[Array | int, Array | int]) -> Array:
    """Point i of the golden-ratio Kronecker lattice of `count` points in the unit square, shifted modulo 2³²."""
    along = (np.asarray(i, np.float64) + unit_float(shift[0])) / count
    return np.stack(np.broadcast_arrays(along, kronecker(i, GOLDEN, shift[1])), axis=-1)


def azimuthal_direction(q: Array) -> Array:
    """Lambert's azimuthal equal-area map: |q| <= 2 is the chord 2 sin(angle/2) from the z axis."""
    radius = np.linalg.norm(q, axis=-1)
    angle = 2.0 * np.arcsin(0.5 * radius)
    sine_over_radius = np.sqrt(np.maximum(1.0 - 0.25 * radius**2, 0.0))
    return np.concatenate([q * sine_over_radius[..., None], np.cos(angle)[..., None]], axis=-1)


def concentric_disc(unit: Array) -> Array:
    """Map the unit square to the unit disc: concentric squares become circles (Shirley and Chiu 1997)."""
    p = 2.0 * np.asarray(unit, np.float64) - 1.0
    x, y = p[..., 0], p[..., 1]
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    safe = np.where(radius == 0.0, 1.0, radius)
    turn = np.where(wide, 0.25 * np.pi * y / safe, 0.5 * np.pi - 0.25 * np.pi * x / safe)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1)


def angle_between(a: Array, b: Array) -> Array:
    """Angle between unit vectors, rad, from the lengths of difference and sum: accurate near 0 and pi as well."""
    return 2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))


def spot_falloff(direction: Array, axis: Array, inner: Array | float, outer: Array | float) -> Array:
    """1 within the angle `inner` (rad), 0 beyond `outer`, a smoothstep between; a hard edge where they are equal."""
    angle = angle_between(direction, axis)
    soft = outer - inner > 1e-7
    t = np.clip((outer - angle) / np.where(soft, outer - inner, 1.0), 0.0, 1.0)
    return np.where(soft, t * t * (3.0 - 2.0 * t), (angle <= outer).astype(np.float64))


EDGE_SPREAD = 0.42
"""Standard deviation, in lattice spacings, of what a lattice point represents near a hard edge (lib/edge.glsl)."""


@dataclass(frozen=True)
class Emitter:
    """One light's emission domain, with the one point of the light's extent that all rays are emitted from."""

    light: Light
    domain: EmissionDomain
    space: GpuSpace
    place: tuple[float, float]
    """That point, in the unit square: a position on an area light, a direction within a sun's disc; else unused."""

    @property
    def unit_length(self) -> float:
        """World units per unit of the domain's coordinates; 1 on the azimuthal plane, which has no length unit."""
        return 1.0 / self.space.scale if self.domain.kind == "plane" else 1.0

    def start(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(position, direction), each (..., 3), of the ray at the domain's point `q` (..., 2).

        `q` is in world units for directional and collimated light, on the azimuthal plane otherwise.
        """
        domain = self.domain
        frame = np.stack([domain.tangent, domain.bitangent])
        origin = self.space.to_world(domain.origin)
        q = np.asarray(q, np.float64)
        if domain.kind == "plane":
            direction = unit(domain.axis + domain.cone[0] * concentric_disc(np.array(self.place)) @ frame)
            position = origin + q @ frame - domain.back / self.space.scale * direction
            return position, np.broadcast_to(direction, position.shape)
        local = azimuthal_direction(q)
        if domain.kind == "area":
            square = 2.0 * np.array(self.place) - 1.0
            on_light = concentric_disc(np.array(self.place)) if domain.is_disc else square
            origin = origin + on_light @ np.stack([domain.light_u, domain.light_v]) / self.space.scale
        return np.broadcast_to(origin, local.shape), local @ np.vstack([frame, domain.axis])

    def weight(self, q: np.ndarray, count: int) -> np.ndarray:
        """Weight of the lattice point at `q` (..., 2), one of `count`: its flux per unit of the light's own quantity.

        Near a hard edge only the lit share of a normal distribution about the point counts.
        """
        light = self.light
        share: np.ndarray | float = self.domain.measure / count
        start, direction = self.start(q)
        axis = unit(np.asarray(light.direction, float))
        spacing = self.domain.spacing(count) * self.unit_length

        if light.profile is not None:
            u, v = light.across
            horizontal = np.arctan2(direction @ v, direction @ u)
            share = share * light.profile.at(angle_between(direction, axis), horizontal)
        inner, outer = light.cone
        if outer < np.pi:
            if inner != outer:
                return share * spot_falloff(direction, axis, inner, outer)

            def angle_at(q: np.ndarray) -> np.ndarray:
                return angle_between(self.start(q)[1], axis)

            steps = 1e-3 * np.diag(spacing)
            change = np.stack([angle_at(q + step) - angle_at(q - step) for step in steps], axis=-1) / 2e-3
            return share * _lit_share((outer - angle_at(q)) / np.linalg.norm(change, axis=-1))
        if self.domain.kind == "area":
            return share * np.maximum(direction @ axis, 0.0)
        if light.has_outline:
            offset = (start - np.array(light.position)) @ np.stack([self.domain.tangent, self.domain.bitangent]).T
            if light.is_disc:
                across = np.linalg.norm(offset * spacing, axis=-1)
                away = np.linalg.norm(offset, axis=-1)
                return share * _lit_share((light.half_extent[0] - away) * away / np.maximum(across, 1e-30))
            inside = (np.array(light.half_extent) - np.abs(offset)) / spacing
            return share * _lit_share(inside[..., 0]) * _lit_share(inside[..., 1])
        return np.full(direction.shape[:-1], share)

    def lattice(self, count: int, shift: tuple[int, int], sub_lattice: int = 0) -> np.ndarray:
        """All points (count, 2) of a sub-lattice of the domain, in the coordinates of `start`."""
        first, second = ((s + sub_lattice * g) % 2**32 for s, g in zip(shift, PLASTIC, strict=True))
        square = lattice_point(np.arange(count), count, (first, second))
        return self.unit_length * (self.domain.rect[:2] + square * self.domain.rect[2:])


def _lit_share(spacings: np.ndarray) -> np.ndarray:
    """Lit share of a lattice point that lies `spacings` inside a hard edge; 0 or 1 beyond one spacing."""
    share = 0.5 * (1.0 + np.vectorize(erf, otypes=[float])(spacings / (np.sqrt(2.0) * EDGE_SPREAD)))
    return np.where(np.abs(spacings) < 1.0, share, spacings > 0.0)
