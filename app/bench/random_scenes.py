"""Scenes that nobody chose: glass solids on and over a table, lit by what comes, for `bench-agreement --random`.

Shipped scenes show what their authors thought of. These are drawn by chance within what a table can hold, so that they
find what nobody thought of: light that grazes, glass in another one's shadow, solids that lean on nothing. Each is a
function of its seed and its number alone, and is written as a scene file that anybody can open.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..base.atomic import atomic_output
from ..model.io.scene_file import load_scene
from ..model.io.toml_text import toml_text
from ..model.scene import Scene

Values = dict[str, Any]
"""Tables of a scene file."""

GLASSES = ("N-BK7", "N-SF11", "N-SF66", "F2", "N-LAK33B", "water", "PMMA", "sapphire", "diamond")
SPECTRA = ("D65", "A", "E", {"blackbody": 3200}, {"lines": [[450.0, 1.0], [546.1, 2.0], [611.0, 1.5]]})
TABLE_SIDE = 8.0
_GAP = 1e-3
"""Between what stands and the table: shipped scenes keep it too."""
_DIGITS = 4


def random_scene(seed: int, number: int) -> Values:
    """The tables of scene `number` of a seed: plain values, with as many digits as its file has."""
    rng = np.random.default_rng([seed, number])
    solids, places = _solids(rng)
    objects = [*solids, *_extras(rng, places), *_receivers(rng)]
    return {
        "name": scene_name(seed, number),
        "camera": _camera(rng),
        "lights": [_light(rng, f"light {i + 1}") for i in range(rng.integers(1, 3))],
        "objects": objects,
    }


def scene_name(seed: int, number: int) -> str:
    """What a scene and its file are called."""
    return f"random_{seed}_{number}"


def random_scenes(count: int, seed: int, folder: Path) -> dict[str, Scene]:
    """By name, the first `count` scenes of a seed, each as its file in `folder` says, which is written first. Raises
    `UserError` where that cannot be."""
    scenes = {}
    for number in range(count):
        values = random_scene(seed, number)
        path = folder / f"{values['name']}.toml"
        with atomic_output(path) as temporary:
            temporary.write_text(toml_text(values), encoding="utf-8")
        scenes[values["name"]] = load_scene(path)
    return scenes


def _rounded(value: float) -> float:
    return round(float(value), _DIGITS)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return _rounded(rng.uniform(low, high))


def _vector(values: np.ndarray) -> list[float]:
    return [_rounded(v) for v in values]


def _is(rng: np.random.Generator, chance: float) -> bool:
    return bool(rng.random() < chance)


# -- what light meets ---------------------------------------------------------------------


def _prism(rng: np.random.Generator) -> Values:
    side = _between(rng, 0.6, 1.2)
    return {"apex_angle_deg": _between(rng, 30.0, 90.0), "side": side, "length": _between(rng, 0.6, 1.6)}


def _box(rng: np.random.Generator) -> Values:
    return {"size": [_between(rng, 0.3, 1.2) for _ in range(3)]}


def _ball(rng: np.random.Generator) -> Values:
    return {"radius": _between(rng, 0.25, 0.6)}


def _ellipsoid(rng: np.random.Generator) -> Values:
    return {"semi_axes": [_between(rng, 0.25, 0.7) for _ in range(3)]}


def _lens(rng: np.random.Generator) -> Values:
    """Biconvex or plano-convex: never so thick or thin that its surfaces cross."""
    second = -_between(rng, 0.9, 2.5) if _is(rng, 0.7) else float("inf")
    return {
        "radius1": _between(rng, 0.9, 2.5),
        "radius2": second,
        "thickness": 0.45,
        "diameter": _between(rng, 0.6, 0.9),
    }


def _cylinder(rng: np.random.Generator) -> Values:
    radius, half = _between(rng, 0.2, 0.5), _between(rng, 0.3, 0.6)
    return {"profile": [[0.0, -half], [radius, -half], [radius, half], [0.0, half]]}


SOLIDS: Mapping[str, tuple[str, Callable[[np.random.Generator], Values]]] = {
    "prism": ("prism", _prism),
    "box": ("box", _box),
    "ball": ("sphere", _ball),
    "ellipsoid": ("ellipsoid", _ellipsoid),
    "lens": ("lens", _lens),
    "cylinder": ("revolution", _cylinder),
}
"""By name: the shape of the scene file, and its sizes."""
_APART = 2.0
"""Between two solids' middles: none is longer."""


def _solids(rng: np.random.Generator) -> tuple[list[Values], list[np.ndarray]]:
    """One to three pieces of glass about the table's middle, standing or floating, and where."""
    count = int(rng.choice([1, 2, 3], p=[0.5, 0.35, 0.15]))
    start = rng.uniform(0.0, 2.0 * np.pi)
    away = 0.0 if count == 1 else 0.5 * _APART / np.sin(np.pi / count) * rng.uniform(1.0, 1.3)
    objects, places = [], []
    for i in range(count):
        name = str(rng.choice(list(SOLIDS)))
        shape, sizes = SOLIDS[name]
        angle = start + 2.0 * np.pi * i / count
        place = away * np.array([np.cos(angle), np.sin(angle)]) + rng.uniform(-0.05, 0.05, 2)
        turned = [0.0, 0.0, _between(rng, 0.0, 360.0)] if _is(rng, 0.4) else _vector(rng.uniform(0.0, 360.0, 3))
        objects.append(
            {
                "name": f"{name} {i + 1}",
                "shape": shape,
                **sizes(rng),
                "glass": str(rng.choice(GLASSES)),
                "rotation_deg": turned,
                "position": [*_vector(place), 0.0],
                "rests_at_z": _GAP if _is(rng, 0.5) else _between(rng, 0.1, 1.2),
            }
        )
        places.append(place)
    return objects, places


def _extras(rng: np.random.Generator, places: list[np.ndarray]) -> list[Values]:
    """Sometimes a mirror or something black, beside all glass."""
    if not _is(rng, 0.35):
        return []
    kind = str(rng.choice(["black", "mirror"]))
    angle = rng.uniform(0.0, 2.0 * np.pi)
    away = max(float(np.linalg.norm(place)) for place in places) + rng.uniform(1.5, 2.2)
    return [
        {
            "name": "mirror" if kind == "mirror" else "blocker",
            "shape": "box",
            "size": [0.05, _between(rng, 0.6, 1.4), _between(rng, 0.5, 1.4)],
            "material": kind,
            "rotation_deg": [0.0, 0.0, _rounded(np.degrees(angle) + rng.uniform(-30.0, 30.0))],
            "position": [*_vector(away * np.array([np.cos(angle), np.sin(angle)])), 0.0],
            "rests_at_z": _GAP,
        }
    ]


def _receivers(rng: np.random.Generator) -> list[Values]:
    """The table; sometimes a wall at its end."""
    diffuse = {"kind": "diffuse", "colour": _between(rng, 0.3, 0.9)}
    table = {"name": "table", "shape": "plane", "width": TABLE_SIDE, "height": TABLE_SIDE, "material": diffuse}
    if not _is(rng, 0.3):
        return [table]
    wall = {
        "name": "wall",
        "shape": "plane",
        "width": TABLE_SIDE,
        "height": 4.0,
        "rotation_deg": [90.0, 0.0, 0.0],
        "position": [0.0, 0.5 * TABLE_SIDE, 2.0],
        "material": diffuse,
    }
    return [table, wall]


# -- lights and camera --------------------------------------------------------------------


def _from_above(rng: np.random.Generator, low_deg: float, high_deg: float, azimuths: tuple[float, float]) -> np.ndarray:
    """Unit vector up to something that stands so high above the horizon."""
    height, azimuth = np.radians(rng.uniform(low_deg, high_deg)), np.radians(rng.uniform(*azimuths))
    return np.array([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)])


_FROM_THE_FRONT = (180.0, 360.0)
"""Azimuths, degrees: from the side of the camera, so that a wall is in no light's way."""


def _light(rng: np.random.Generator, name: str) -> Values:
    towards = _from_above(rng, 20.0, 85.0, _FROM_THE_FRONT)
    spectrum = SPECTRA[rng.integers(len(SPECTRA))]
    kind = str(rng.choice(["sun", "point", "disc", "rectangle"]))
    values: Values = {"name": name, "spectrum": spectrum}
    if kind == "sun":
        breadth = 0.53 if _is(rng, 0.6) else 0.0
        lux = {"illuminance_lx": _between(rng, 200.0, 2000.0)}
        return values | {"kind": "directional", "direction": _vector(-towards), "angular_diameter_deg": breadth} | lux
    at = {"position": _vector(rng.uniform(3.5, 7.0) * towards + [0.0, 0.0, 0.3])}
    if kind == "point":
        return values | {"kind": "point"} | at | {"intensity_cd": _between(rng, 2e3, 2e4)}
    values |= {"kind": "area", **at, "target": [*_vector(rng.uniform(-0.3, 0.3, 2)), 0.3]}
    if kind == "disc":
        values |= {"shape": "disc", "radius": _between(rng, 0.05, 0.4)}
    else:
        values |= {"shape": "rectangle", "size": [_between(rng, 0.1, 0.8), _between(rng, 0.1, 0.8)]}
    return values | {"flux_lm": _between(rng, 2e4, 1e5)}


def _camera(rng: np.random.Generator) -> Values:
    towards = _from_above(rng, 25.0, 75.0, (225.0, 315.0))
    values: Values = {
        "position": _vector(rng.uniform(6.5, 10.0) * towards),
        "target": [*_vector(rng.uniform(-0.5, 0.5, 2)), 0.0],
    }
    if _is(rng, 0.2):
        return values | {"kind": "orthographic", "vertical_extent": _between(rng, 3.5, 6.0)}
    return values | {"vertical_fov_deg": _between(rng, 25.0, 45.0)}
