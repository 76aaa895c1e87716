"""What a scene gets where its file is silent: a camera, a sun, a table, fitted to the objects.

The world is z-up. The sun stands behind the object on the left, so that the caustic falls
towards the viewer on the right, and the camera looks at the middle between the two.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .geometry.mesh_recipes import note_recipe
from .geometry.primitives import plane
from .lights.directional import SUN_DIAMETER_DEG, DirectionalLight
from .lights.light import DEFAULT_ILLUMINANCE
from .optics.spectrum import illuminant
from .placement import Surroundings, default_direction
from .scene import Camera, Diffuse, Light, SceneObject
from .vectors import vec3


def bounds_of(objects: Sequence[SceneObject]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of all `objects` in the world, float64 (3,) each."""
    points = [o.mesh.vertices @ o.object_to_world[:3, :3].T + o.object_to_world[:3, 3] for o in objects]
    return np.min([p.min(axis=0) for p in points], axis=0), np.max([p.max(axis=0) for p in points], axis=0)


def environment_of(objects: Sequence[SceneObject]) -> Surroundings:
    """Middle and half diagonal of what is worth looking at: everything but the receivers, if there is more."""
    interesting = [o for o in objects if not o.material.receives] or list(objects)
    low, high = bounds_of(interesting)
    return Surroundings(0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 1e-12))


def default_camera(around: Surroundings) -> Camera:
    """Looks down from the front at the object and the place beside it where the caustic falls."""
    x, y, _ = default_direction()
    target = around.centre + around.radius * np.array([0.75 * x, 0.75 * y, -0.35])
    away = np.array([0.18, -0.80, 0.57])
    position = target + 7.5 * around.radius * away / np.linalg.norm(away)
    return Camera(vec3(position), vec3(target), vertical_fov_deg=32.0)


def default_light() -> Light:
    """A white sun."""
    power = illuminant("D65").scaled_to_luminous(DEFAULT_ILLUMINANCE)
    return DirectionalLight("sun", power, default_direction(), SUN_DIAMETER_DEG)


def default_table(objects: Sequence[SceneObject]) -> SceneObject:
    """A wide light-grey plane just below everything."""
    around = environment_of(objects)
    matrix = np.eye(4)
    matrix[:3, 3] = around.centre
    # A hair below, so that a flat underside and the table are not one surface.
    matrix[2, 3] = bounds_of(objects)[0][2] - 1e-3 * around.radius
    matrix.setflags(write=False)
    size = 40.0 * around.radius
    mesh = plane(size, size, name="table")
    note_recipe(mesh, {"shape": "plane", "width": size, "height": size})
    return SceneObject("table", mesh, Diffuse((0.8, 0.8, 0.8)), matrix)
