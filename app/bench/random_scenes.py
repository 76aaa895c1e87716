"""Random scenes: glass solids on and over a table under random lights, for `bench-agreement --random`.

Shipped scenes show what their authors thought of. Random ones hold what nobody thought of: grazing light, glass in
another solid's shadow, solids that float at any angle. Each is a function of its seed and its number alone, and is
written as a scene file that anybody can open.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..base.atomic import atomic_output
from ..model.io.scene_file import load_scene
from ..model.io.toml_text import toml_text
from ..model.scene import Scene
from .random_solids import (
    GLASSES,
    PLAIN,
    WIDER,
    Piece,
    Values,
    between,
    chance,
    rounded,
    vector,
    wider_material,
)

SPECTRA = ("D65", "A", "E", {"blackbody": 3200}, {"lines": [[450.0, 1.0], [546.1, 2.0], [611.0, 1.5]]})
TABLE_SIDE = 8.0
_GAP = 1e-3
"""Between a solid and the table below it: shipped scenes keep it too."""


def random_scene(seed: int, number: int, kind: str = "plain") -> Values:
    """The tables of scene `number` of a seed: plain values, with as many digits as its file has."""
    rng = np.random.default_rng([seed, number])
    wide = kind == "all"
    solids, places = _solids(rng, wide)
    objects = [*solids, *_extras(rng, places, wide), *_receivers(rng)]
    return {
        "name": scene_name(seed, number, kind),
        "camera": _camera(rng),
        "lights": [_light(rng, f"light {i + 1}", wide) for i in range(rng.integers(1, 3))],
        "objects": objects,
    }


def scene_name(seed: int, number: int, kind: str = "plain") -> str:
    """What a scene and its file are called."""
    return f"random_{seed}_{number}" if kind == "plain" else f"random_{kind}_{seed}_{number}"


def random_scenes(count: int, seed: int, folder: Path, kind: str = "plain") -> dict[str, Scene]:
    """By name, the first `count` scenes of a seed, each as its file in `folder` says, which is written first. Raises
    `UserError` where that cannot be."""
    scenes = {}
    for number in range(count):
        values = random_scene(seed, number, kind)
        path = folder / f"{values['name']}.toml"
        with atomic_output(path) as temporary:
            temporary.write_text(toml_text(values), encoding="utf-8")
        scenes[values["name"]] = load_scene(path)
    return scenes


# -- what light meets ---------------------------------------------------------------------


_APART = 2.0
"""Between two solids' middles: none is longer."""


def _solids(rng: np.random.Generator, wide: bool) -> tuple[list[Values], list[np.ndarray]]:
    """One to three pieces of glass about the table's middle, standing or floating, and where."""
    count = int(rng.choice([1, 2, 3], p=[0.5, 0.35, 0.15]))
    start = rng.uniform(0.0, 2.0 * np.pi)
    away = 0.0 if count == 1 else 0.5 * _APART / np.sin(np.pi / count) * rng.uniform(1.0, 1.3)
    made = {**WIDER, **PLAIN} if wide else PLAIN
    objects, places = [], []
    for i in range(count):
        name = str(rng.choice(list(made)))
        angle = start + 2.0 * np.pi * i / count
        place = away * np.array([np.cos(angle), np.sin(angle)]) + rng.uniform(-0.05, 0.05, 2)
        turned = [0.0, 0.0, between(rng, 0.0, 360.0)] if chance(rng, 0.4) else vector(rng.uniform(0.0, 360.0, 3))
        piece = made[name](rng)
        material = wider_material(rng) if wide else {"glass": str(rng.choice(GLASSES))}
        height = _GAP if chance(rng, 0.5) else between(rng, 0.1, 1.2)
        objects.extend(_placed(f"{name} {i + 1}", piece, material, turned, place, height))
        places.append(place)
    return objects, places


def _placed(
    name: str, piece: Piece, material: Values, turned: list[float], place: np.ndarray, height: float
) -> list[Values]:
    """Objects of a piece whose lowest point is `height` above the table; solids without a material of their own get
    `material`."""
    if len(piece.solids) == 1 and not piece.upright:
        where = {"rotation_deg": turned, "position": [*vector(place), 0.0], "rests_at_z": height}
        return [{"name": name, **piece.solids[0], **material, **where}]
    objects = []
    for number, solid in enumerate(piece.solids):
        own = {} if solid.keys() & {"glass", "material"} else material
        position = np.array([*place, height + piece.below]) + solid.get("position", (0.0, 0.0, 0.0))
        where = {"rotation_deg": [0.0, 0.0, turned[2]] if piece.upright else turned, "position": vector(position)}
        objects.append({"name": f"{name}{' inside' * number}", **solid, **own, **where})
    return objects


def _extras(rng: np.random.Generator, places: list[np.ndarray], wide: bool) -> list[Values]:
    """Sometimes a mirror or something black, next to all glass; a grating, a white ball, a white board."""
    if not chance(rng, 0.35):
        return []
    kind = str(rng.choice(["black", "mirror", *_MORE_EXTRAS] if wide else ["black", "mirror"]))
    angle = rng.uniform(0.0, 2.0 * np.pi)
    away = max(float(np.linalg.norm(place)) for place in places) + rng.uniform(1.5, 2.2)
    if kind in _MORE_EXTRAS:
        return [_wider_extra(rng, kind, away * np.array([np.cos(angle), np.sin(angle)]))]
    return [
        {
            "name": "mirror" if kind == "mirror" else "blocker",
            "shape": "box",
            "size": [0.05, between(rng, 0.6, 1.4), between(rng, 0.5, 1.4)],
            "material": kind,
            "rotation_deg": [0.0, 0.0, rounded(np.degrees(angle) + rng.uniform(-30.0, 30.0))],
            "position": [*vector(away * np.array([np.cos(angle), np.sin(angle)])), 0.0],
            "rests_at_z": _GAP,
        }
    ]


_MORE_EXTRAS = ("grating", "white ball", "board")


def _wider_extra(rng: np.random.Generator, kind: str, place: np.ndarray) -> Values:
    where: Values = {"name": kind, "position": [*vector(place), 0.0]}
    white = {"kind": "diffuse", "colour": between(rng, 0.3, 0.9)}
    slant = vector(rng.uniform(-40.0, 40.0, 3))
    if kind == "grating":
        lines = {"kind": "grating", "lines_per_mm": between(rng, 100.0, 900.0)}
        height = {"position": [*vector(place), between(rng, 0.5, 1.5)], "rotation_deg": slant}
        return where | height | {"shape": "disc", "radius": between(rng, 0.2, 0.5), "material": lines}
    if kind == "board":
        board = {"shape": "box", "size": [between(rng, 0.6, 1.4), between(rng, 0.6, 1.4), 0.05]}
        return where | board | {"material": white, "rotation_deg": slant, "rests_at_z": _GAP}
    return where | {"shape": "sphere", "radius": between(rng, 0.3, 0.6), "material": white, "rests_at_z": _GAP}


def _receivers(rng: np.random.Generator) -> list[Values]:
    """The table; sometimes a wall at its end."""
    diffuse = {"kind": "diffuse", "colour": between(rng, 0.3, 0.9)}
    table = {"name": "table", "shape": "plane", "width": TABLE_SIDE, "height": TABLE_SIDE, "material": diffuse}
    if not chance(rng, 0.3):
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
    """Unit vector up to something so high above the horizon."""
    height, azimuth = np.radians(rng.uniform(low_deg, high_deg)), np.radians(rng.uniform(*azimuths))
    return np.array([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)])


_FROM_THE_FRONT = (180.0, 360.0)
"""Azimuths, degrees: from the side of the camera, so that a wall blocks no light."""


def _light(rng: np.random.Generator, name: str, wide: bool) -> Values:
    towards = _from_above(rng, 20.0, 85.0, _FROM_THE_FRONT)
    spectrum = SPECTRA[rng.integers(len(SPECTRA))]
    kinds = ["sun", "point", "disc", "rectangle"]
    kind = str(rng.choice([*kinds, "spot", "beam"] if wide else kinds))
    values: Values = {"name": name, "spectrum": spectrum}
    if kind == "sun":
        breadth = 0.53 if chance(rng, 0.6) else 0.0
        lux = {"illuminance_lx": between(rng, 200.0, 2000.0)}
        return values | {"kind": "directional", "direction": vector(-towards), "angular_diameter_deg": breadth} | lux
    at = {"position": vector(rng.uniform(3.5, 7.0) * towards + [0.0, 0.0, 0.3])}
    if kind == "point":
        return values | {"kind": "point"} | at | {"intensity_cd": between(rng, 2e3, 2e4)}
    at["target"] = [*vector(rng.uniform(-0.3, 0.3, 2)), 0.3]
    if kind == "spot":
        cone = {"half_angle_deg": between(rng, 4.0, 25.0), "softness": between(rng, 0.0, 1.0)}
        return values | {"kind": "spot", **at, **cone, "intensity_cd": between(rng, 2e3, 2e4)}
    if kind == "beam":
        values |= {"kind": "collimated", **at, "illuminance_lx": between(rng, 1e3, 2e4)}
        return values | (
            {"shape": "disc", "radius": between(rng, 0.05, 0.6)}
            if chance(rng, 0.5)
            else {"shape": "rectangle", "size": [between(rng, 0.05, 1.0), between(rng, 0.05, 1.0)]}
        )
    values |= {"kind": "area", **at}
    if kind == "disc":
        values |= {"shape": "disc", "radius": between(rng, 0.05, 0.4)}
    else:
        values |= {"shape": "rectangle", "size": [between(rng, 0.1, 0.8), between(rng, 0.1, 0.8)]}
    return values | {"flux_lm": between(rng, 2e4, 1e5)}


def _camera(rng: np.random.Generator) -> Values:
    towards = _from_above(rng, 25.0, 75.0, (225.0, 315.0))
    values: Values = {
        "position": vector(rng.uniform(6.5, 10.0) * towards),
        "target": [*vector(rng.uniform(-0.5, 0.5, 2)), 0.0],
    }
    if chance(rng, 0.2):
        return values | {"kind": "orthographic", "vertical_extent": between(rng, 3.5, 6.0)}
    return values | {"vertical_fov_deg": between(rng, 25.0, 45.0)}
