"""Rays for teachers: a flat fan from a light through an object, each ray at several wavelengths.

The fan spreads over the object's cross-section as the light sees it, in the plane in which the object bends light, so
that a prism or a lens shows its section. Rays carry no weights: they say where light goes, not how much of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model.optics.glass import LINE_D_NM
from ..model.scene import Light
from ..model.vectors import frame_about, unit
from .ray_line import RayLine
from .ray_paths import Path, RayPaths

_MIN_BEND = 1e-3
"""Sine of the least deviation that names a plane."""
_MAX_TANGENT = 20.0
"""Widest fan: objects that surround their light are cut there."""


@dataclass(frozen=True)
class _Beam:
    """A light as one object sees it: rays from a point, or along one direction."""

    origin: np.ndarray
    """The point, or a point of the plane across the direction that rays start on."""
    axis: np.ndarray
    """Unit, from the light to the object."""
    is_parallel: bool
    aperture: np.ndarray | None
    """Half extents of a beam's opening as vectors (2, 3), or None for an unbounded one."""
    is_disc: bool = True


class RayFan:
    """Fans of one scene, by its tracer of single rays."""

    def __init__(self, paths: RayPaths) -> None:
        self._scene, self._paths = paths.scene.scene, paths
        bounds = np.stack([item.world_bounds for item in self._scene.objects])
        self._points = [item.world_vertices for item in self._scene.objects]
        self._low, self._high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)

    def trace(
        self,
        light_index: int | None,
        object_index: int,
        rays: int,
        wavelengths_nm: Sequence[float],
        share: float = 1.0,
        reflections: int = 0,
    ) -> list[RayLine]:
        """`rays` rays from a light to an object, each at every wavelength: rays × wavelengths paths.

        A path ends on the first surface that is neither glass nor mirror, after 24 segments, or a scene's radius beyond
        the last surface. `light_index` None takes the light that shines on the object most. Empty where the light's
        beam passes the object by. `share`: of the object's extent that the fan spreads over, about its middle.
        `reflections`: within glass, before a path may leave it: 1 and 2 in a drop make the two rainbows.
        """
        light_index = self.brightest_light(object_index) if light_index is None else light_index
        if light_index is None or rays < 1 or not len(wavelengths_nm):
            return []
        beam = self._beam(self._scene.lights[light_index], object_index)
        starts = self._fan(self._scene.lights[light_index], beam, object_index, rays, share=share)
        if starts is None:
            return []
        nm = np.asarray(wavelengths_nm, float)
        origins, directions = (np.repeat(values, len(nm), axis=0) for values in starts)
        paths = self._follow(origins, directions, np.tile(nm, len(starts[0])), reflections)
        return [RayLine(float(w), path.points) for w, path in zip(np.tile(nm, len(starts[0])), paths, strict=True)]

    def brightest_light(self, object_index: int) -> int | None:
        """The light with the largest illuminance at an object among those whose beam meets it; None where there is
        none."""
        centre = self._points[object_index].mean(axis=0)
        best: tuple[float, int] | None = None
        for index, light in enumerate(self._scene.lights):
            if self._fan(light, self._beam(light, object_index), object_index, 1, np.zeros(3)) is None:
                continue
            power = float(light.spectral_power.xyz()[1])
            power /= light.reach(max(float(np.linalg.norm(centre - np.asarray(light.position))), 1e-6))
            if best is None or power > best[0]:
                best = power, index
        return None if best is None else best[1]

    def release(self) -> None:
        """Free the tracer."""
        self._paths.release()

    # ---- private ---------------------------------------------------------------------------

    @property
    def _radius(self) -> float:
        """Radius of the specular part of the scene, since floors may be endless."""
        return 1.0 / self._paths.scene.space.scale

    def _follow(self, origins: np.ndarray, directions: np.ndarray, nm: np.ndarray, reflections: int = 0) -> list[Path]:
        return self._paths.trace(origins, directions, nm, 2.0 * self._radius, reflections)

    def _beam(self, light: Light, object_index: int) -> _Beam:
        points = self._points[object_index]
        position, centre = np.asarray(light.position, float), 0.5 * (points.min(axis=0) + points.max(axis=0))
        if light.is_parallel:
            axis = np.asarray(light.direction, float) / np.linalg.norm(light.direction)
            if not light.has_place:
                # From outside of everything, so that whatever is in the way is met.
                return _Beam(centre - axis * float(np.linalg.norm(self._high - self._low)), axis, True, None)
            first, second, _ = light.axes().T
            half = light.half_extent
            return _Beam(position, axis, True, np.stack([first * half[0], second * half[1]]), light.is_disc)
        way = centre - position
        return _Beam(position, way / max(float(np.linalg.norm(way)), 1e-12), False, None)

    def _fan(
        self,
        light: Light,
        beam: _Beam,
        object_index: int,
        rays: int,
        across: np.ndarray | None = None,
        share: float = 1.0,
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Starts and directions (rays, 3); None where the beam misses the object. `across`: direction of the spread,
        found where None."""
        middle = self._middle(beam, self._points[object_index])
        if middle is None:
            return None
        if across is None:
            across = self._plane_of_bending(beam, middle)
        if not across.any():
            offsets = middle[None]
        else:
            offsets = self._spread(beam, self._points[object_index], middle, across, rays, share)
        if beam.is_parallel:
            return beam.origin + offsets, np.broadcast_to(beam.axis, offsets.shape).copy()
        directions = beam.axis + offsets
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        kept = light.emits_toward(directions)
        return (np.broadcast_to(beam.origin, directions[kept].shape).copy(), directions[kept]) if kept.any() else None

    def _seen(self, beam: _Beam, points: np.ndarray) -> np.ndarray:
        """Points as the light sees them: offsets across its axis (n, 3), lengths for parallel light, tangents for a
        point."""
        relative = points - beam.origin
        along = relative @ beam.axis
        across = relative - along[:, None] * beam.axis
        if beam.is_parallel:
            return across
        ahead = along > 0.05 * float(np.abs(along).max())
        if not ahead.any():
            return np.zeros((0, 3))
        seen = across[ahead] / along[ahead, None]
        return seen[np.linalg.norm(seen, axis=1) < _MAX_TANGENT]

    def _middle(self, beam: _Beam, points: np.ndarray) -> np.ndarray | None:
        """Middle of what the beam and the object share, as an offset; None where they share nothing."""
        seen = self._seen(beam, points)
        if not len(seen) or (
            beam.is_parallel and beam.aperture is not None and not ((points - beam.origin) @ beam.axis > 0.0).any()
        ):
            return None
        first, second = frame_about(beam.axis)[:2] if beam.aperture is None else (unit(v) for v in beam.aperture)
        middle = np.zeros(3)
        for side, half in zip(
            (first, second),
            (np.inf, np.inf) if beam.aperture is None else np.linalg.norm(beam.aperture, axis=1),
            strict=True,
        ):
            low, high = max(float((seen @ side).min()), -half), min(float((seen @ side).max()), half)
            if low >= high:
                return None
            middle = middle + 0.5 * (low + high) * side
        return middle

    def _plane_of_bending(self, beam: _Beam, middle: np.ndarray) -> np.ndarray:
        """Unit vector across the beam along which the object deviates its middle ray; the level one where the ray
        is not deviated."""
        origin, direction = (
            (beam.origin + middle, beam.axis) if beam.is_parallel else (beam.origin, unit(beam.axis + middle))
        )
        path = self._follow(origin[None], direction[None], np.array([LINE_D_NM]))[0]
        bend = np.zeros(3)
        if len(path.points) > 2:
            leaving = unit(path.points[-1] - path.points[-2])
            bend = leaving - (leaving @ beam.axis) * beam.axis
        if np.linalg.norm(bend) > _MIN_BEND:
            return unit(bend)
        level = np.cross(beam.axis, np.asarray(self._scene.camera.up, float))
        return unit(level) if np.linalg.norm(level) > 1e-6 else frame_about(beam.axis)[0]

    def _spread(
        self, beam: _Beam, points: np.ndarray, middle: np.ndarray, across: np.ndarray, rays: int, share: float
    ) -> np.ndarray:
        """Offsets (rays, 3) evenly over `share` of the object's extent along `across`, inside the beam's opening."""
        along = self._seen(beam, points) @ across
        low, high = float(along.min()) - middle @ across, float(along.max()) - middle @ across
        if beam.aperture is not None:
            room_low, room_high = _chord(beam.aperture, beam.is_disc, middle, across)
            low, high = max(low, room_low), min(high, room_high)
        places = 0.5 + share * ((np.arange(rays) + 0.5) / rays - 0.5)
        return middle + (low + places * (high - low))[:, None] * across


def _chord(aperture: np.ndarray, is_disc: bool, middle: np.ndarray, across: np.ndarray) -> tuple[float, float]:
    """How far from `middle` along `across` an opening reaches, both ways."""
    scale = np.sum(aperture**2, axis=1)
    start, step = aperture @ middle / scale, aperture @ across / scale  # in units of the half extents
    if is_disc:
        a, b, c = step @ step, start @ step, start @ start - 1.0
        root = np.sqrt(max(b * b - a * c, 0.0))
        return (-b - root) / a, (-b + root) / a
    limits = [((-1.0 - s) / d, (1.0 - s) / d) for s, d in zip(start, step, strict=True) if abs(d) > 1e-12]
    return max(min(pair) for pair in limits), min(max(pair) for pair in limits)
