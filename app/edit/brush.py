"""The dispersion brush: from the cursor's way over a receiver to dabs on it.

Paint flows by time: a stroke adds `strength` doublings a second, spread evenly along the way since the last frame, so
the result depends on how long a place was painted and not on the frame rate. Dabs are a quarter of
the radius apart; painting where a dab of the same stroke is already makes that one stronger, so
that a stroke of many seconds stays a few dozen dabs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..model.local_dispersion import plane_of
from ..model.scene import Dab, Scene, SceneObject, Vec3
from ..model.vectors import frame_about, unit
from .objects import with_dabs
from .projection import View
from .state import Brush

SPACING = 0.25
"""Between dabs, radii."""
FIRST_TOUCH_S = 0.1
"""What a mere click is worth, seconds of painting."""
MIN_RADIUS, MAX_RADIUS = 1e-3, 0.5
"""Radii of the brush, as shares of the picture's height at the cursor's distance."""
USUAL_RADIUS = 0.01
"""Likewise, to begin with."""
RADIUS_STEP = 1.15
LABEL = "Brush dispersion"
_RING_POINTS = 64
_ERASER_HASTE = 4.0
"""An eraser takes its share this many times a second: slower would feel like it does not work."""


@dataclass(frozen=True)
class Stroke:
    """A stroke on one receiver while the button is down."""

    object_index: int
    brush: Brush
    before: tuple[Dab, ...]
    """The receiver's dabs when it began."""
    dabs: tuple[Dab, ...] = ()
    """Its own."""
    last: Vec3 = (0.0, 0.0, 0.0)
    """World position of the cursor in the last frame."""


def mode_held(brush: Brush, shift: bool, ctrl: bool) -> Brush:
    """The brush with a modifier: Shift erases, Ctrl does the opposite of widening or narrowing."""
    if shift:
        return replace(brush, mode="erase")
    if ctrl:
        return replace(brush, mode="narrow" if brush.mode == "widen" else "widen")
    return brush


def resized(brush: Brush, steps: float, visible_height: float) -> Brush:
    """With a radius larger by `steps` notches, kept usable for a picture that shows `visible_height` scene units."""
    radius = float(np.clip(brush.radius * RADIUS_STEP**steps, MIN_RADIUS * visible_height, MAX_RADIUS * visible_height))
    return replace(brush, radius=radius)


def followed(brush: Brush, before: View, after: View) -> Brush:
    """As large in the picture as it was before the view changed."""
    was, now = (view.height_at(view.target_distance) for view in (before, after))
    return brush if was == now else replace(brush, radius=brush.radius * now / was)


def begin(scene: Scene, object_index: int, brush: Brush, position: Vec3) -> Stroke:
    """A stroke with its first touch at a world position."""
    item = scene.objects[object_index]
    stroke = Stroke(object_index, brush, item.local_dispersion, (), position)
    return _deposited(stroke, item, [np.asarray(position, float)], FIRST_TOUCH_S)


def extend(stroke: Stroke, scene: Scene, position: Vec3, dt: float) -> Stroke:
    """The stroke after the cursor moved to `position` in `dt` seconds (it may rest)."""
    item = scene.objects[stroke.object_index]
    start, end = np.asarray(stroke.last, float), np.asarray(position, float)
    steps = max(1, int(np.ceil(np.linalg.norm(end - start) / (SPACING * stroke.brush.radius))))
    places = [start + (end - start) * (i + 1) / steps for i in range(steps)]
    return replace(_deposited(stroke, item, places, dt), last=position)


def applied(scene: Scene, stroke: Stroke) -> Scene:
    """The scene with the stroke on its receiver."""
    return with_dabs(scene, stroke.object_index, stroke.before + stroke.dabs)


def object_radius(item: SceneObject, radius: float) -> float:
    """A world radius in a receiver's own units: by the stretch of its plane where it is flat, else of its space."""
    linear = item.object_to_world[:3, :3]
    volume = abs(float(np.linalg.det(linear)))
    plane = plane_of(item)
    if plane is None:
        return radius / volume ** (1.0 / 3.0)
    # How areas in a plane are stretched: the volume's stretch over that of the heights above it.
    return radius / float(np.sqrt(volume * np.linalg.norm(np.linalg.solve(linear.T, plane[:3]))))


def _deposited(stroke: Stroke, item: SceneObject, places: list[np.ndarray], seconds: float) -> Stroke:
    brush = stroke.brush
    own_radius = object_radius(item, brush.radius)
    to_object = np.linalg.inv(item.object_to_world)
    dabs = list(stroke.dabs)
    for place in places:
        own = (to_object @ np.append(place, 1.0))[:3]
        near = _near(dabs, own, SPACING * own_radius)
        fresh = _dab(brush, own, own_radius, seconds / len(places))
        if near is None:
            dabs.append(fresh)
        else:
            dab, erase = dabs[near], 1.0 - (1.0 - dabs[near].erase) * (1.0 - fresh.erase)
            dabs[near] = replace(dab, log2_gain=dab.log2_gain + fresh.log2_gain, erase=erase)
    return replace(stroke, dabs=tuple(dabs))


def _near(dabs: list[Dab], place: np.ndarray, spacing: float) -> int | None:
    """The dab nearest to a place, where it is within the spacing."""
    if not dabs:
        return None
    distance = np.linalg.norm(np.array([dab.position for dab in dabs]) - place, axis=1)
    best = int(distance.argmin())
    return best if distance[best] < 0.999 * spacing else None


def _dab(brush: Brush, place: np.ndarray, radius: float, seconds: float) -> Dab:
    position = (float(place[0]), float(place[1]), float(place[2]))
    if brush.mode == "erase":
        share = min(brush.strength, 0.999)
        return Dab(position, radius, 0.0, brush.falloff, erase=1.0 - float((1.0 - share) ** (seconds * _ERASER_HASTE)))
    sign = 1.0 if brush.mode == "widen" else -1.0
    return Dab(position, radius, sign * brush.strength * seconds, brush.falloff)


def ring(position: Vec3, normal: Vec3, radius: float) -> np.ndarray:
    """A circle of world `radius` round a position in the plane across `normal`: (64, 3)."""
    first, second, _ = frame_about(unit(normal))
    angle = np.linspace(0.0, 2.0 * np.pi, _RING_POINTS, endpoint=False)[:, None]
    return np.asarray(position, float) + radius * (np.cos(angle) * first + np.sin(angle) * second)
