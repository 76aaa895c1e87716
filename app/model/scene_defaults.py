"""What a scene gets where its file is silent: a camera, lights, a table, a quiet studio, fitted to the objects.

The world is z-up. The light is behind the object on the left, so that the caustic falls towards the viewer on the
right, and the camera frames both. A file that says nothing of light or camera gets the whole studio: a lamp whose pool
fades into the dark of the table, a wide weak light from above without which shadows would be holes, and a dark room
with bright windows, which is what glass mirrors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .environment import from_map
from .geometry.mesh import note_recipe
from .geometry.primitives import plane
from .lights.directional import SUN_DIAMETER_DEG, DirectionalLight
from .lights.light import DEFAULT_ILLUMINANCE
from .lights.point import SpotLight
from .optics.spectrum import illuminant
from .placement import Surroundings, default_direction
from .scene import Camera, Diffuse, Light, SceneObject
from .scene_environment import STUDIO_MAP
from .texture import Environment
from .vectors import Vec3, frozen, unit, vec3

KEY_DISTANCE = 9.0
"""Distance of the studio's lamp from the objects' middle, in their radii: rays are nearly parallel, caustics sharp."""
_KEY_ELEVATION_DEG = 46.0
"""The studio's lamp stands higher than the sun of `default_direction`."""
_POOL = 5.0
"""Radius of the lamp's pool of light, in radii of the objects: it fades within the picture."""
_POOL_INNER = 0.35
_FILL_SHARE = 0.2
"""Illuminance from above, as a share of the lamp's."""
_FILL_DIAMETER_DEG = 60.0
_STUDIO_INTENSITY = 0.15
"""Factor on the panorama: its soft boxes are then some five times as bright as the table."""
_TABLE_RGB = (0.46, 0.44, 0.42)
_VIEW = np.array([0.20, -0.80, 0.57])
"""From the objects to the camera: from the front, looking down."""
_FOV_DEG = 32.0
_ASPECT = 1.5
"""Aspect ratio of the frame that must hold everything: a little narrower than 16:9, as windows have panels."""
_FILLED = 0.86
"""Share of the frame that objects and caustic fill."""
_FRAMED_POINTS = 20_000
_FLAT = 0.1
"""Height over width of what may be a ground."""


def bounds_of(objects: Sequence[SceneObject]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of all `objects` in the world, float64 (3,) each."""
    bounds = np.stack([item.world_bounds for item in objects])
    return bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)


def environment_of(objects: Sequence[SceneObject]) -> Surroundings:
    """Middle and half diagonal of what is worth looking at: everything but the receivers, if there is more."""
    return surroundings_of([o for o in objects if not o.material.receives] or list(objects))


def surroundings_of(objects: Sequence[SceneObject]) -> Surroundings:
    """Middle and half diagonal of all of `objects`."""
    low, high = bounds_of(objects)
    return Surroundings(0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 1e-12))


def parts_of(objects: Sequence[SceneObject]) -> list[SceneObject]:
    """`objects` of a z-up world without the ground they stand on: receivers that are flat and reach beyond the rest.
    All, where nothing else is there."""

    if len(objects) < 2:
        return list(objects)
    low, high = np.stack([item.world_bounds for item in objects], axis=1)
    # Of all others, for each: the lowest, but the second lowest for the lowest itself. A file may have many thousands.
    lowest, highest = np.partition(low, 1, axis=0)[:2], -np.partition(-high, 1, axis=0)[:2]
    others_low = np.where(low == lowest[0], lowest[1], lowest[0])
    others_high = np.where(high == highest[0], highest[1], highest[0])
    size, rest = high - low, others_high - others_low
    is_ground = (size[:, 2] <= _FLAT * size[:, :2].max(axis=1)) & (size[:, :2] >= rest[:, :2]).all(axis=1)
    parts = [o for o, ground in zip(objects, is_ground, strict=True) if not (ground and o.material.receives)]
    return parts or list(objects)


def default_camera(around: Surroundings) -> Camera:
    """Looks down from the front at the object and the place beside it where the caustic falls."""
    x, y, _ = default_direction()
    target = around.centre + around.radius * np.array([0.75 * x, 0.75 * y, -0.35])
    position = target + 7.5 * around.radius * unit((0.18, -0.80, 0.57))
    return Camera(vec3(position), vec3(target), vertical_fov_deg=32.0)


def framing_camera(objects: Sequence[SceneObject]) -> Camera:
    """Sees all but the ground, and where the studio's lamp casts its shadow and caustic, as large as they fit."""
    points = np.concatenate([_some_points(o) for o in parts_of(objects)])
    floor = points[:, 2].min()
    x, y, z = default_direction(_KEY_ELEVATION_DEG)
    shadow = points - np.outer((points[:, 2] - floor) / z, (x, y, z))
    seen = np.concatenate([points, shadow])
    away = unit(_VIEW)
    right = unit(np.cross((0.0, 0.0, 1.0), away))
    across, up, ahead = seen @ right, seen @ np.cross(away, right), -(seen @ away)
    tangent = math.tan(math.radians(0.5 * _FOV_DEG)) * _FILLED
    distance, middle = 0.0, []
    for place, slope in ((across, tangent * _ASPECT), (up, tangent)):
        # |place − middle| <= slope (ahead + distance) for every point, with the least distance that any middle allows.
        above, below = (place - slope * ahead).max(), (-place - slope * ahead).max()
        distance = max(distance, (above + below) / (2.0 * slope))
        middle.append(0.5 * (above - below))
    at = middle[0] * right + middle[1] * np.cross(away, right)
    position = at + distance * away
    # The target is what orbiting turns about: the middle of the objects' depth.
    depth = distance + float(np.mean(ahead))
    return Camera(vec3(position), vec3(position - depth * away), vertical_fov_deg=_FOV_DEG)


def _some_points(item: SceneObject) -> np.ndarray:
    """Vertices in the world, float64 (n, 3), thinned out where they are very many."""
    vertices = item.mesh.vertices[:: max(1, len(item.mesh.vertices) // _FRAMED_POINTS)]
    return vertices @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3]


def default_light() -> Light:
    """A white sun."""
    power = illuminant("D65").scaled_to_luminous(DEFAULT_ILLUMINANCE)
    return DirectionalLight("sun", power, default_direction(), SUN_DIAMETER_DEG)


def studio_lights(around: Surroundings) -> tuple[Light, Light]:
    """A lamp whose pool of light fades on the table, and wide weak light from above."""
    white, distance = illuminant("D65"), KEY_DISTANCE * around.radius
    direction = default_direction(_KEY_ELEVATION_DEG)
    lamp = SpotLight(
        "lamp",
        white.scaled_to_luminous(DEFAULT_ILLUMINANCE * distance**2),
        vec3(around.centre - distance * np.array(direction)),
        direction,
        math.degrees(math.atan(_POOL_INNER * _POOL / KEY_DISTANCE)),
        math.degrees(math.atan(_POOL / KEY_DISTANCE)),
    )
    above = white.scaled_to_luminous(_FILL_SHARE * DEFAULT_ILLUMINANCE)
    return lamp, DirectionalLight("from above", above, (0.0, 0.3, -math.sqrt(0.91)), _FILL_DIAMETER_DEG)


def studio_environment(up: Vec3 = (0.0, 0.0, 1.0)) -> Environment:
    """The dark room that is seen round a scene with `studio_lights`."""
    return from_map(STUDIO_MAP, _STUDIO_INTENSITY, up=up)


def default_table(objects: Sequence[SceneObject]) -> SceneObject:
    """A wide grey plane just below everything."""
    around = environment_of(objects)
    matrix = np.eye(4)
    matrix[:3, 3] = around.centre
    # A hair below, so that a flat underside and the table are not one surface.
    matrix[2, 3] = bounds_of(objects)[0][2] - 1e-3 * around.radius
    size = 40.0 * around.radius
    mesh = plane(size, size, name="table")
    note_recipe(mesh, {"shape": "plane", "width": size, "height": size})
    return SceneObject("table", mesh, Diffuse(_TABLE_RGB), frozen(matrix))
