"""Solids and receivers that a scene file can name: flat-faced ones here, round ones, gems and water in other files.

Every solid is closed, faces outward and is centred on the origin unless its docstring says
otherwise; lengths are in scene units. Impossible dimensions raise UserError with one
sentence that begins with the shape's name. Those in `SPECIAL` are other shapes by an everyday name: their functions
give the other shape's keys, and they are met, saved and drawn as those.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .mesh import Mesh, make_mesh
from .primitives_gem import brilliant, step_cut
from .primitives_lens import lens
from .primitives_parts import band, count, in_range, positive, with_box_uv
from .primitives_round import ellipsoid, solid_of_revolution, sphere, torus
from .primitives_water import height_field, rippled_water

__all__ = [
    "box",
    "brilliant",
    "disc",
    "ellipsoid",
    "height_field",
    "lens",
    "plane",
    "polygon_prism",
    "prism",
    "rippled_water",
    "slab",
    "solid_of_revolution",
    "sphere",
    "step_cut",
    "torus",
]


def box(size: tuple[float, float, float] = (1.0, 1.0, 1.0), name: str = "box") -> Mesh:
    """A box of edge lengths `size` along x, y, z; every face shows the whole of a picture (`primitives_parts`)."""
    x, y, z = (positive("box", f"size along {axis}", s) for axis, s in zip("xyz", size, strict=True))
    return with_box_uv(extruded(name, _rectangle(x, y), z))


def slab(width: float = 1.0, height: float = 1.0, thickness: float = 0.1, name: str = "slab") -> Mesh:
    """A plane-parallel plate: `width` along x, `height` along y, `thickness` along z; pictures as on a `box`."""
    outline = _rectangle(positive("slab", "width", width), positive("slab", "height", height))
    return with_box_uv(extruded(name, outline, positive("slab", "thickness", thickness)))


def prism(apex_angle_deg: float = 60.0, side: float = 1.0, length: float = 1.0, name: str = "prism") -> Mesh:
    """An isosceles triangular prism, its refracting edge up (+z) and along y.

    `side` is the length of the two faces that meet at the apex, measured across the edge;
    `length` runs along y. The cross-section's centroid is the origin.
    """
    half = 0.5 * math.radians(in_range("prism", "apex_angle_deg", apex_angle_deg, 0.0, 180.0))
    side = positive("prism", "side", side)
    x, z = side * math.sin(half), side * math.cos(half)
    # Extruded along its own z, then turned about x so that z becomes -y and y becomes z.
    outline = np.array([(-x, -z / 3.0), (x, -z / 3.0), (0.0, 2.0 * z / 3.0)])
    return extruded(name, outline, positive("prism", "length", length), upright=False)


def polygon_prism(sides: int = 6, radius: float = 0.5, length: float = 1.0, name: str = "polygon prism") -> Mesh:
    """A right prism over a regular polygon of circumradius `radius`, its axis along z."""
    sides = count("polygon prism", "sides", sides, 3, 4096)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    outline = positive("polygon prism", "radius", radius) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return extruded(name, outline, positive("polygon prism", "length", length))


def plane(width: float = 1.0, height: float = 1.0, name: str = "plane") -> Mesh:
    """An open rectangle in z = 0 facing +z, `width` along x and `height` along y; uv runs over [0, 1]²."""
    outline = _rectangle(positive("plane", "width", width), positive("plane", "height", height))
    triangles = np.array([(0, 1, 2), (0, 2, 3)])
    unit = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    return make_mesh(name, np.pad(outline, ((0, 0), (0, 1))), triangles, uv=unit[triangles])


def disc(radius: float = 0.5, segments: int = 96, name: str = "disc") -> Mesh:
    """An open flat disc in z = 0 facing +z: the regular polygon of `segments` corners inscribed in the circle.

    A picture's square is the one round the circle.
    """
    segments = count("disc", "segments", segments, 3, 1 << 16)
    angle = 2.0 * np.pi * np.arange(segments) / segments
    radius = positive("disc", "radius", radius)
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(segments)], axis=1)
    triangles = _fan(np.arange(segments))
    return make_mesh(
        name, vertices, triangles, uv=(0.5 + vertices[:, :2] / (2.0 * radius))[triangles], uv_unwraps=False
    )


def _rectangle(width: float, height: float) -> np.ndarray:
    """Corners of a centred rectangle, counter-clockwise, float64 (4, 2)."""
    return 0.5 * np.array([(-width, -height), (width, -height), (width, height), (-width, height)])


def _fan(ring: np.ndarray) -> np.ndarray:
    """Triangles of a convex polygon given its vertex numbers in order, int (len - 2, 3)."""
    return np.stack([np.full(len(ring) - 2, ring[0]), ring[1:-1], ring[2:]], axis=1)


def extruded(name: str, outline: np.ndarray, length: float, upright: bool = True) -> Mesh:
    """A right prism over a convex counter-clockwise `outline` (N, 2).

    Upright: the outline lies in (x, y) and the axis along z. Otherwise the outline lies in
    (x, z) and the axis along y.
    """
    corners = len(outline)
    low, high = np.arange(corners), corners + np.arange(corners)
    along = np.repeat([-0.5 * length, 0.5 * length], corners)[:, None]
    across = np.tile(outline, (2, 1))
    # (x, y, z) -> (x, -z, y) is a quarter turn about x, so the winding holds.
    vertices = np.hstack([across, along]) if upright else np.hstack([across[:, :1], -along, across[:, 1:]])
    return make_mesh(name, vertices, np.concatenate([_fan(low[::-1]), _fan(high), band(low, high)]))


SPECIAL = ("cylinder", "cone", "dome", "doublet")


def cylinder(radius: float = 0.5, length: float = 1.0) -> dict[str, Any]:
    """A round rod with flat ends."""
    radius, half = positive("cylinder", "radius", radius), 0.5 * positive("cylinder", "length", length)
    return {"shape": "revolution", "profile": [[0.0, -half], [radius, -half], [radius, half], [0.0, half]]}


def cone(radius: float = 0.5, length: float = 1.0) -> dict[str, Any]:
    """A round cone with a flat base, its tip up."""
    radius, half = positive("cone", "radius", radius), 0.5 * positive("cone", "length", length)
    return {"shape": "revolution", "profile": [[0.0, -half], [radius, -half], [0.0, half]]}


def dome(radius: float = 0.5) -> dict[str, Any]:
    """Half a ball, its flat side down."""
    radius = positive("dome", "radius", radius)
    return {"shape": "lens", "radius1": math.inf, "radius2": -radius, "thickness": radius, "diameter": 2.0 * radius}


def doublet(
    part: str,
    radius1: float,
    radius2: float,
    radius3: float,
    thickness1: float,
    thickness2: float,
    diameter: float,
    triangles: int = 40_000,
) -> dict[str, Any]:
    """One of two cemented lenses, the vertex that they share at the origin; `triangles`: of both."""
    front = -positive("doublet", "thickness1", thickness1)
    first, second, thickness, place = (
        (radius1, radius2, thickness1, front) if part == "front" else (radius2, radius3, thickness2, 0.0)
    )
    sizes = {"thickness": thickness, "diameter": diameter, "triangles": triangles // 2, "front": place}
    return {"shape": "lens", "radius1": first, "radius2": second, **sizes}
