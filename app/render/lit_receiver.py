"""A baked map put onto its receiver: what glows instead of being lit through glass.

A Lambertian surface of reflectance ρ under irradiance E sends out ρE/π, whatever the direction: so a texture of that
radiance is the caustic from everywhere, and adds to what other lights do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.errors import UserError
from ..base.tone_map import into_gamut
from ..model.io.lit_mesh import LitMesh
from ..model.scene import Scene
from ..model.staging import UpAxis
from .bake import check_receiver


def up_of(scene: Scene) -> UpAxis:
    """Which axis of a scene's coordinates is up, as its camera has it."""
    return "z" if abs(scene.camera.up[2]) >= abs(scene.camera.up[1]) else "y"


def lit_receiver(scene: Scene, receiver: str, rgb: np.ndarray, placement: Mapping[str, Any], plane: bool) -> LitMesh:
    """The receiver with its map; `plane`: only the rectangle on which its light lands, black and as bright as a white
    one.

    `rgb`: irradiance (h, w, 3), lm/unit². Raises `UserError` for a curved one's plane, and for a receiver that wears a
    picture, whose reflectance is not one colour.
    """
    check_receiver(scene, receiver)
    item = next(o for o in scene.objects if o.name == receiver and o.material.receives)
    is_flat = placement["kind"] == "rectangle"
    if plane and not is_flat:
        raise UserError(f"'{receiver}' is curved and has no plane that its light is in: leave --plane out")
    if not plane and item.material.texture is not None:
        raise UserError(
            f"'{receiver}' wears a picture, so its light is no single multiple of the map: with --plane you get the "
            "light of a white one, to be multiplied by the picture"
        )
    reflectance = (1.0, 1.0, 1.0) if plane else item.material.reflectance_rgb
    # One black texel all round, which clamping carries on: beyond the map there is no light.
    lit = np.pad(into_gamut(np.asarray(rgb, np.float32)), ((1, 1), (1, 1), (0, 0))) if is_flat else into_gamut(rgb)
    emission = (lit * np.asarray(reflectance, np.float32) / np.pi).astype(np.float32)
    mesh = item.mesh.transformed(item.object_to_world)
    height, width = rgb.shape[:2]
    if is_flat:
        corners = _rectangle(placement) if plane else mesh.corners()
        uv = (rectangle_uv(placement, corners) * (width, height) + 1.0) / (width + 2, height + 2)
    else:
        corners, uv = mesh.corners(), np.asarray(placement["triangle_uv"], float)
    normals = None if plane else mesh.corner_normals
    name = f"{receiver} caustic" if plane else receiver
    base = (0.0, 0.0, 0.0) if plane else item.material.reflectance_rgb
    return LitMesh(name, corners, normals, uv, emission, base, up_of(scene))


def rectangle_uv(placement: Mapping[str, Any], points: np.ndarray) -> np.ndarray:
    """Coordinates of world `points` (…, 3) in a map, (…, 2): (0, 0) its upper left corner, (1, 1) its lower right."""
    corner = {name: np.asarray(place, float) for name, place in placement["corners_world"].items()}
    across, down = corner["top_right"] - corner["top_left"], corner["bottom_left"] - corner["top_left"]
    sides = np.stack([across / (across @ across), down / (down @ down)], axis=1)
    return (np.asarray(points, float) - corner["top_left"]) @ sides


def _rectangle(placement: Mapping[str, Any]) -> np.ndarray:
    """Its two triangles, (2, 3, 3)."""
    corner = placement["corners_world"]
    quad = np.array([corner[name] for name in ("bottom_left", "bottom_right", "top_right", "top_left")], float)
    return quad[[[0, 1, 2], [0, 2, 3]]]
