"""Stones, prisms and lamps that beams are tried on: texts of scene files without a floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def lamp(
    position: Sequence[float],
    direction: Sequence[float],
    size: Sequence[float],
    kind: str = "collimated",
    more: str = "",
) -> str:
    """A light; `size`: radius, or width and height, of a collimated or an area one. What is empty is not written."""
    told = [f'kind = "{kind}"', more]
    told += [f"position = {list(position)}"] if len(position) else []
    told += [f"direction = {list(direction)}"] if len(direction) else []
    told += [f"radius = {size[0]}"] if len(size) == 1 else []
    told += [f'shape = "rectangle"\nsize = {list(size)}'] if len(size) == 2 else []
    return "[[lights]]\n" + "\n".join(told) + "\n"


def solid(
    vertices: np.ndarray, faces: Sequence[Sequence[int]], more: str = 'glass = "N-BK7"', name: str = "solid"
) -> str:
    """A mesh from faces with their corners counter-clockwise from outside, cut into fans."""
    triangles = [[face[0], face[i], face[i + 1]] for face in faces for i in range(1, len(face) - 1)]
    points = [[float(c) for c in v] for v in vertices]
    triangles = [[int(c) for c in t] for t in triangles]
    return f'[[objects]]\nname = "{name}"\nshape = "inline"\nvertices = {points}\ntriangles = {triangles}\n{more}\n'


def lofted(rings: Sequence[np.ndarray], more: str = 'glass = "N-BK7"', name: str = "solid") -> str:
    """Rings of equally many corners, counter-clockwise from above and from below upwards, with lids."""
    count = len(rings[0])
    faces = [list(range(count))[::-1], [(len(rings) - 1) * count + k for k in range(count)]]
    for level in range(len(rings) - 1):
        for k in range(count):
            a, b = level * count + k, level * count + (k + 1) % count
            faces.append([a, b, b + count, a + count])
    return solid(np.concatenate(rings), faces, more, name)


def ring(outline: np.ndarray, z: float) -> np.ndarray:
    """An outline (n, 2) at a height."""
    return np.column_stack([outline, np.full(len(outline), z)])


def octagon(width: float, depth: float, corner: float) -> np.ndarray:
    """A rectangle with its corners cut."""
    w, d = 0.5 * width, 0.5 * depth
    return np.array(
        [
            (w, -d + corner),
            (w, d - corner),
            (w - corner, d),
            (-w + corner, d),
            (-w, d - corner),
            (-w, -d + corner),
            (-w + corner, -d),
            (w - corner, -d),
        ]
    )


def step_cut(glass: str = "N-SF11") -> str:
    """An emerald cut: 8 sides, three steps below, two above."""
    sizes = [
        (0.42, 0.1, 0.02, -0.55),
        (0.85, 0.45, 0.1, -0.30),
        (1.1, 0.75, 0.18, -0.04),
        (1.1, 0.75, 0.18, 0.02),
        (0.92, 0.6, 0.14, 0.14),
        (0.7, 0.42, 0.1, 0.22),
    ]
    rings = [ring(octagon(w, d, c), z) for w, d, c, z in sizes]
    more = f'glass = "{glass}"\nrotation_deg = [9.0, -7.0, 23.0]\nposition = [0.0, 0.0, 1.2]'
    return lofted(rings, more, "step cut")


PRISM = """
[[objects]]
name = "prism"
shape = "prism"
side = 1.0
length = 1.2
glass = "N-SF11"
rotation_deg = [-90.0, 7.0, 3.0]
rests_at_z = 0.5
"""
BRILLIANT = """
[[objects]]
name = "diamond"
shape = "brilliant"
diameter = 1.0
glass = "diamond"
rotation_deg = [168.0, 8.0, 11.0]
position = [0.0, 0.0, 1.0]
"""
L_OUTLINE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 0.4), (0.4, 0.4), (0.4, 1.0), (0.0, 1.0)])


def l_solid(more: str = 'glass = "N-BK7"\nrotation_deg = [20.0, 14.0, 0.0]\nposition = [-0.5, -0.5, 0.7]') -> str:
    """A concave solid, L-shaped, its two halves' lids apart."""
    low, high = ring(L_OUTLINE, 0.0), ring(L_OUTLINE, 0.5)
    faces = [[5, 4, 3, 0], [3, 2, 1, 0], [6, 9, 10, 11], [6, 7, 8, 9]]
    faces += [[k, (k + 1) % 6, 6 + (k + 1) % 6, 6 + k] for k in range(6)]
    return solid(np.concatenate([low, high]), faces, more, "L")


def amici() -> str:
    """Crown, flint, crown, cemented."""
    outlines = {
        "crown in": ([(-1.65505853, -0.5), (-0.015, -0.5), (-1.015, 0.5), (-1.04494147, 0.5)], "N-BK7"),
        "flint": ([(-0.015, -0.5), (0.015, -0.5), (1.015, 0.5), (-1.015, 0.5)], "N-SF11"),
        "crown out": ([(0.015, -0.5), (1.65505853, -0.5), (1.04494147, 0.5), (1.015, 0.5)], "N-BK7"),
    }
    return "".join(
        lofted([ring(np.array(o), 0.2), ring(np.array(o), 1.4)], f'glass = "{g}"', n) for n, (o, g) in outlines.items()
    )


def box(
    size: Sequence[float], at: Sequence[float], more: str, name: str = "box", turn: Sequence[float] = (0, 0, 0)
) -> str:
    """A box, its middle at `at`."""
    return (
        f'[[objects]]\nname = "{name}"\nshape = "box"\nsize = {list(size)}\nposition = {list(at)}\n'
        f"rotation_deg = {list(turn)}\n{more}\n"
    )


SUN = lamp((), (0.2, 0.1, -1.0), (), "directional")
DOWN = lamp((-0.2, 0.1, 4.0), (0.05, 0.03, -1.0), (0.46,))
AMICI_LIGHT = lamp((-6.3, 0.0, 1.5), (0.992546, 0.0, -0.121869), (0.10, 1.1), more="tangent = [0.0, 1.0, 0.0]")
PRISM_LIGHT = lamp((-2.0, 0.4, 1.9), (0.85, -0.1, -0.4), (0.3, 0.8), more="tangent = [0.0, 1.0, 0.0]")
TINTED = """
[[objects]]
name = "tinted"
shape = "prism"
side = 1.0
length = 1.2
material = { kind = "glass", glass = "N-SF11", absorption = { colour = [0.6, 0.3, 0.1], distance = 0.7 } }
rotation_deg = [-90.0, 7.0, 3.0]
rests_at_z = 0.5
"""
CASES = {
    "prism": PRISM_LIGHT + PRISM,
    "step cut": DOWN + step_cut(),
    "brilliant": lamp((-1.2, 0.8, 5.0), (0.28, -0.19, -0.94), (0.46,)) + BRILLIANT,
    "amici": AMICI_LIGHT + amici(),
    "L": DOWN + l_solid(),
    "two stones": lamp((-3.0, 0.0, 2.4), (0.9, 0.05, -0.35), (0.7,))
    + box((0.6, 0.7, 0.8), (-0.6, 0.1, 1.3), 'glass = "N-SF11"', "near", (10, 20, 30))
    + box((0.5, 0.6, 0.7), (0.5, -0.1, 1.05), 'glass = "N-BK7"', "far", (-20, 15, 50)),
    "slit": PRISM_LIGHT
    + PRISM
    + box((0.02, 0.5, 3.0), (-0.9, 0.44, 1.6), 'material = "black"', "left")
    + box((0.02, 0.5, 3.0), (-0.9, -0.26, 1.6), 'material = "black"', "right"),
    "tinted": PRISM_LIGHT + TINTED,
    "crossing": DOWN
    + box((0.8, 0.7, 0.6), (0.0, 0.0, 1.0), 'glass = "N-BK7"', "one", (10, 20, 30))
    + box((0.8, 0.7, 0.6), (0.3, 0.1, 0.9), 'glass = "N-SF11"', "other", (-20, 15, 50)),
    "sunk": DOWN + box((0.8, 0.7, 0.6), (0.0, 0.0, 0.1), 'glass = "N-BK7"', "sunk", (10, 20, 30)),
    "mirror": PRISM_LIGHT
    + PRISM
    + box(
        (0.02, 2.0, 2.0),
        (1.6, 0.0, 1.0),
        'material = { kind = "mirror", reflectance = [0.8, 0.6, 0.4] }',
        "mirror",
        (0, 12, 8),
    ),
}
"""What light does in them: refraction; steps; sixty facets; cement; a solid that hides parts of itself; one solid that
shades another; black before glass; absorption; solids that overlap; one sunk into the floor; a mirror."""

SPOT = "half_angle_deg = 14.0\nsoftness = 0.5"
NEAR = {
    "point far": lamp((-2.0, 0.4, 2.6), (), (), "point") + PRISM,
    "point near": lamp((-0.5, 0.1, 1.7), (), (), "point") + box((1.0, 1.0, 0.4), (0.0, 0.0, 0.9), 'glass = "N-SF11"'),
    "spot": lamp((-2.0, 0.4, 2.6), (0.75, -0.1, -0.65), (), "spot", SPOT) + PRISM,
    "between": lamp((0.0, 0.0, 2.0), (), (), "point")
    + box((0.5, 1.0, 1.0), (-1.2, 0.0, 0.9), 'glass = "N-BK7"', "left")
    + box((0.5, 1.0, 1.0), (1.2, 0.1, 0.9), 'glass = "N-BK7"', "right"),
    "point brilliant": lamp((-0.8, 0.5, 3.0), (), (), "point") + BRILLIANT,
}
"""Points of light: far from a prism, close above a block, a soft spot, between two blocks, before a brilliant."""


def block(size: Sequence[float], at: Sequence[float], glass: str = "N-SF11") -> str:
    """A box of glass, named after it."""
    return box(size, at, f'glass = "{glass}"', glass)


def twin(text: str) -> str:
    """A box whose every triangle has corners of its own."""
    corners = np.array([(x, y, z) for x in (-0.4, 0.4) for y in (-0.3, 0.3) for z in (0.8, 1.3)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for s in sides for t in ((s[0], s[1], s[2]), (s[0], s[2], s[3]))]
    apart = np.concatenate([corners[list(t)] for t in triangles])
    return solid(apart, np.arange(len(apart)).reshape(-1, 3), text)


def needles(count: int) -> str:
    """A box whose lid is a fan of needles."""
    across = np.linspace(-0.4, 0.4, count)
    top = [(x, -0.3, 1.3) for x in across] + [(0.4, 0.3, 1.3), (-0.4, 0.3, 1.3)]
    low = [(-0.4, -0.3, 0.9), (0.4, -0.3, 0.9), (0.4, 0.3, 0.9), (-0.4, 0.3, 0.9)]
    n = len(top)
    faces = [[n - 1, k, k + 1] for k in range(n - 2)]
    faces += [[n + 3, n + 2, n + 1, n]]
    faces += [[n, n + 1, count - 1, *range(count - 2, -1, -1)], [n + 1, n + 2, n - 2, count - 1]]
    faces += [[n + 2, n + 3, n - 1, n - 2], [n + 3, n, 0, n - 1]]
    return solid(np.array(top + low), faces)


def pyramid(sides: int, height: float) -> str:
    """A round block, on it a pyramid whose tip lies on the z axis."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    rim = 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])
    corners = np.concatenate([ring(rim, 0.8), ring(rim, 1.0), [(0.0, 0.0, 1.0 + height)]])
    after = np.roll(np.arange(sides), -1)
    faces = [list(range(sides))[::-1]]
    faces += [[k, after[k], after[k] + sides, k + sides] for k in range(sides)]
    faces += [[k + sides, after[k] + sides, 2 * sides] for k in range(sides)]
    return solid(corners, faces)


_STRAIGHT = lamp((0.0, 0.0, 4.0), (0.0, 0.0, -1.0), (0.45,))
_SLANTED = lamp((-1.3, 0.0, 3.0), (0.45, 0.0, -0.89), (0.35,))
_SPLINTER = np.array([(-0.4, -0.3), (0.4, -0.3), (0.4, -0.299999), (-0.4, 0.3)])
EXTREMES = {
    "slab": _SLANTED + block((3.0, 3.0, 0.05), (0.0, 0.0, 1.0)),
    "edge-on": _STRAIGHT + block((0.6, 0.5, 0.5), (0.1, 0.0, 1.0)),
    "edge on edge": _STRAIGHT
    + block((0.4, 0.6, 0.4), (-0.2, 0.0, 1.2))
    + block((0.4, 0.6, 0.4), (0.2, 0.0, 0.7), "N-BK7"),
    "touching": _SLANTED
    + block((0.5, 0.6, 0.5), (-0.25, 0.0, 1.0))
    + block((0.5, 0.6, 0.5), (0.25, 0.0, 1.0), "N-BK7"),
    "same": _SLANTED + block((0.5, 0.6, 0.5), (0.0, 0.0, 1.0)) + block((0.5, 0.6, 0.5), (0.0, 0.0, 1.0), "N-BK7"),
    "doubled corners": _SLANTED + twin('glass = "N-SF11"'),
    "needles": _SLANTED + needles(60),
    "splinter": _SLANTED + lofted([ring(_SPLINTER, 0.9), ring(_SPLINTER, 1.3)]),
    "tip in the axis": _STRAIGHT + pyramid(8, 0.4),
    "tip, many sides": _STRAIGHT + pyramid(40, 0.3),
    "flat tip": _STRAIGHT + pyramid(12, 1e-6),
    "thin": _SLANTED + block((0.6, 0.6, 1e-5), (0.0, 0.0, 1.0)),
}
"""A slab with dozens of events between parallel faces; facets along the light; edges on edges; faces in contact; two
solids in one place; corners that are not shared; needles; a facet a millionth wide; a lamp's axis through a corner;
facets a millionth apart from one plane; a film."""
SWEPT = {name: CASES[name] for name in ("prism", "step cut", "amici", "L", "two stones", "tinted", "mirror")}
ONSET = lamp(
    (-2.0, -0.9, 1.85), (0.8296, 0.4790, -0.2873), (0.3, 0.5), more="tangent = [-0.5, 0.866, 0.0]"
) + PRISM.replace("[-90.0, 7.0, 3.0]", "[-90.0, 0.0, 0.0]")
"""A prism whose second face reflects everything below 470 nm and lets light through above."""
