"""Light that goes on from one diffuse surface to another: where there is any to follow."""

from __future__ import annotations

import numpy as np

from .environment_light import lighting_environment
from .scene import Scene

_FLAT = 1e-5
"""Height over a plane, of a scene's size, up to which a surface lies in it."""


def why_no_bounces(scene: Scene) -> str | None:
    """Why no light that one diffuse surface sends back reaches another, or the same again; None: some may."""
    if scene.render.bounces == 0:
        return "[render] bounces is 0"
    receivers = [o for o in scene.objects if o.material.receives]
    if not receivers:
        return "no surface is diffuse"
    if not scene.lights and lighting_environment(scene) is None:
        return "nothing shines"
    if any(o.material.is_specular for o in scene.objects):
        return None  # a floor sees itself in glass that stands on it
    points = np.concatenate(
        [o.mesh.vertices @ o.object_to_world[:3, :3].T + o.object_to_world[:3, 3] for o in receivers]
    )
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if singular[-1] <= _FLAT * max(singular[0], np.finfo(float).tiny):
        return "all diffuse surfaces lie in one plane: none sees another"
    return None
