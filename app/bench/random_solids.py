"""The pieces of glass of random scenes, and their materials.

`PLAIN` and `GLASSES` are those of every scene, `WIDER` and `wider_material` are added by `--random-kinds all`: cut
stones, vessels with something in them, bubbles, doublets; tinted, ground and invented glass, mirrors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Values = dict[str, Any]
"""Tables of a scene file."""
GLASSES = ("N-BK7", "N-SF11", "N-SF66", "F2", "N-LAK33B", "water", "PMMA", "sapphire", "diamond")


def rounded(value: float) -> float:
    """With as many digits as a scene's file has."""
    return round(float(value), 4)


def between(rng: np.random.Generator, low: float, high: float) -> float:
    return rounded(rng.uniform(low, high))


def vector(values: np.ndarray) -> list[float]:
    return [rounded(v) for v in values]


def chance(rng: np.random.Generator, share: float) -> bool:
    return bool(rng.random() < share)


@dataclass(frozen=True)
class Piece:
    """Solids that belong together, the outermost first, in coordinates of their own. None is longer than 2."""

    solids: tuple[Values, ...]
    """Shape and sizes of each; a `position` is that in the piece."""
    below: float = 0.0
    """From its origin down to its lowest point, scene units: of a piece of several solids."""
    upright: bool = False
    """It stays upright, as a vessel with liquid must."""


def _prism(rng: np.random.Generator) -> Piece:
    side = between(rng, 0.6, 1.2)
    return _one("prism", apex_angle_deg=between(rng, 30.0, 90.0), side=side, length=between(rng, 0.6, 1.6))


def _box(rng: np.random.Generator) -> Piece:
    return _one("box", size=[between(rng, 0.3, 1.2) for _ in range(3)])


def _ball(rng: np.random.Generator) -> Piece:
    return _one("sphere", radius=between(rng, 0.25, 0.6))


def _ellipsoid(rng: np.random.Generator) -> Piece:
    return _one("ellipsoid", semi_axes=[between(rng, 0.25, 0.7) for _ in range(3)])


def _lens(rng: np.random.Generator) -> Piece:
    """Biconvex or plano-convex: never so thick or thin that its surfaces cross."""
    second = -between(rng, 0.9, 2.5) if chance(rng, 0.7) else float("inf")
    return _one("lens", radius1=between(rng, 0.9, 2.5), radius2=second, thickness=0.45, diameter=between(rng, 0.6, 0.9))


def _cylinder(rng: np.random.Generator) -> Piece:
    radius, half = between(rng, 0.2, 0.5), between(rng, 0.3, 0.6)
    return _one("revolution", profile=[[0.0, -half], [radius, -half], [radius, half], [0.0, half]])


PLAIN: Mapping[str, Callable[[np.random.Generator], Piece]] = {
    "prism": _prism,
    "box": _box,
    "ball": _ball,
    "ellipsoid": _ellipsoid,
    "lens": _lens,
    "cylinder": _cylinder,
}
"""By name."""


def _one(shape: str, **sizes: object) -> Piece:
    return Piece(({"shape": shape, **sizes},))


# -- wider --------------------------------------------------------------------------------


def _brilliant(rng: np.random.Generator) -> Piece:
    angles = {"crown_angle_deg": between(rng, 30.0, 38.0), "pavilion_angle_deg": between(rng, 39.0, 43.0)}
    return _one("brilliant", diameter=between(rng, 0.7, 1.4), **angles)


def _step_cut(rng: np.random.Generator) -> Piece:
    return _one("step_cut", width=between(rng, 0.6, 1.0), length=between(rng, 1.0, 1.4))


def _column(rng: np.random.Generator) -> Piece:
    return _one(
        "polygon_prism", sides=int(rng.integers(3, 9)), radius=between(rng, 0.3, 0.6), length=between(rng, 0.2, 1.2)
    )


def _torus(rng: np.random.Generator) -> Piece:
    major = between(rng, 0.35, 0.6)
    return _one("torus", major_radius=major, minor_radius=rounded(major * rng.uniform(0.2, 0.6)), triangles=_TRIANGLES)


def _tetrahedron(rng: np.random.Generator) -> Piece:
    """No two of its faces alike."""
    corners = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    corners = 0.4 * corners + rng.uniform(-0.15, 0.15, (4, 3))
    faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
    return _one("inline", vertices=[vector(row) for row in corners], triangles=faces)


def _vessel(rng: np.random.Generator) -> Piece:
    """A tumbler, more often than not with something in it, which reaches into the wall."""
    radius, height, wall = between(rng, 0.35, 0.6), between(rng, 0.6, 1.3), between(rng, 0.06, 0.12)
    foot = rounded(radius * rng.uniform(0.7, 1.0))
    within, foot_within = rounded(radius - wall), rounded(foot - wall)
    turned = {"shape": "revolution", "segments": 256, "crease_deg": 30.0}
    outside = [[0.0, 0.0], [foot, 0.0], [radius, height]]
    glass = turned | {
        "priority": 2,
        "profile": [*outside, [within, height], [foot_within, wall], [0.0, wall]],
    }
    if not chance(rng, 0.6):
        return Piece((glass,), upright=True)
    level, low = rounded(height * rng.uniform(0.4, 0.85)), rounded(0.5 * wall)
    wet = [[rounded(foot + (radius - foot) * z / height - 0.5 * wall), z] for z in (low, level)]
    liquid = turned | {"profile": [[0.0, low], *wet, [0.0, level]], "glass": "water"}
    return Piece((glass, liquid), upright=True)


def _bubble(rng: np.random.Generator) -> Piece:
    """A ball with one of air in it, aside of its middle."""
    radius = between(rng, 0.35, 0.6)
    aside = vector(rng.uniform(-0.1, 0.1, 3) * radius)
    air = {"material": {"kind": "glass", "name": "air", "n_d": 1.0}, "priority": 1}
    bubble = {"shape": "sphere", "radius": rounded(radius * rng.uniform(0.3, 0.7)), "position": aside, **air}
    return Piece(({"shape": "sphere", "radius": radius}, bubble), below=radius)


def _doublet(rng: np.random.Generator) -> Piece:
    diameter = between(rng, 0.6, 0.9)
    sizes = {
        "radius1": between(rng, 0.8, 1.4),
        "radius2": -between(rng, 0.8, 1.4),
        "radius3": -between(rng, 2.0, 6.0),
        "thickness1": 0.4,
        "thickness2": 0.12,
        "diameter": diameter,
        "triangles": _TRIANGLES,
    }
    parts = [{"shape": "doublet", "part": part, **sizes} for part in ("front", "back")]
    return Piece((parts[0], parts[1] | {"glass": "F2"}), below=diameter)


_TRIANGLES = 40_000
WIDER: Mapping[str, Callable[[np.random.Generator], Piece]] = {
    "brilliant": _brilliant,
    "step cut": _step_cut,
    "column": _column,
    "torus": _torus,
    "tetrahedron": _tetrahedron,
    "vessel": _vessel,
    "bubble": _bubble,
    "doublet": _doublet,
}
"""By name."""


def wider_material(rng: np.random.Generator) -> Values:
    """The material of a piece: keys of an object."""
    kind = str(rng.choice(["glass", "numbers", "tinted", "ground", "widened", "mirror"], p=_SHARES))
    glass = str(rng.choice(GLASSES))
    if kind == "mirror":
        return {"material": {"kind": "mirror", "reflectance": between(rng, 0.5, 1.0)}}
    if kind == "numbers":
        return {"material": {"kind": "glass", "n_d": between(rng, 1.3, 2.4), "V_d": between(rng, 15.0, 80.0)}}
    if kind == "tinted":
        colour = vector(rng.uniform(0.1, 1.0, 3))
        tint = {"colour": colour, "distance": between(rng, 0.3, 1.5)}
        return {"material": {"kind": "glass", "glass": glass, "absorption": tint}}
    if kind == "ground":
        return {"glass": glass, "roughness": between(rng, 0.1, 0.6)}
    if kind == "widened":
        return {"glass": glass, "dispersion_gain": between(rng, 0.0, 4.0)}
    return {"glass": glass}


_SHARES = (0.35, 0.2, 0.15, 0.1, 0.1, 0.1)
