"""Makes the designs in this folder: proportions and angles of our own, distances from where facets meet.

python assets/gems/generate.py
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from spectrasplat.model.gems.facet_design import FacetDesign, Tier, write_asc
from spectrasplat.model.gems.from_mesh import design_in
from spectrasplat.model.io.scene_file import scene_of

HERE = Path(__file__).parent
QUARTZ, SPINEL = 1.54, 1.72
HALF_GIRDLE = 0.02
Point = tuple[float, float]
"""Distance from the axis, and height."""


def shaped(name: str, title: str, n_d: float, **sizes: object) -> None:
    """A design of one of the program's own shapes."""
    scene = scene_of({"objects": [{"name": title, "glass": "diamond", **sizes}]}, HERE / "scene.toml")
    design, _ = design_in(scene, title)
    write_asc(replace(design, n_d=n_d), HERE / name)


def through(point: Point, angle_deg: float) -> float:
    """Distance of a facet that goes through `point` in its own azimuth."""
    angle = math.radians(abs(angle_deg))
    return math.sin(angle) * point[0] + math.copysign(math.cos(angle), angle_deg) * point[1]


def rows(gear: int, fold: int, corner: Point, angles: list[float], part: str) -> list[Tier]:
    """Rows of `fold` facets, each half a step on from the one before: the first along a girdle with its corners at
    `corner`, the second through these, each further one through the tips of the row before last."""
    step = math.pi / fold
    tiers: list[Tier] = []
    point = (corner[0] * math.cos(step), corner[1])
    for number, angle in enumerate(angles):
        distance = through(corner if number == 1 else point, angle)
        first = gear // (2 * fold) * (1 - number % 2)
        indices = tuple(float(first + gear // fold * k or gear) for k in range(fold))
        tiers.append(Tier(angle, distance, indices, f"{part}{number + 1}"))
        if number:
            before, own = (math.radians(abs(a)) for a in angles[number - 1 : number + 1])
            sign = math.copysign(1.0, angle)
            lines = [
                [math.sin(before), sign * math.cos(before)],
                [math.sin(own) * math.cos(step), sign * math.cos(own)],
            ]
            r, z = np.linalg.solve(lines, [tiers[-2].distance, distance]).tolist()
            point = (r, z)
    return tiers


def portuguese() -> FacetDesign:
    """Sixteen-fold rows, four below and three above."""
    below = rows(64, 16, (1.0, -HALF_GIRDLE), [-58.0, -51.0, -45.5, -41.0], "P")
    girdle = Tier(90.0, math.cos(math.pi / 16), tuple(2.0 + 4.0 * k for k in range(16)), "G")
    above = rows(64, 16, (1.0, HALF_GIRDLE), [48.0, 38.0, 27.0], "C")
    table = Tier(0.0, 0.30, (64.0,), "T")
    return FacetDesign("Portuguese round for quartz", (*below, girdle, *above, table), 64, 0.0, QUARTZ, 16, True)


def steps(outline: dict[float, tuple[float, ...]], angles: list[float], share: float, part: str) -> list[Tier]:
    """Rows round an `outline` (distance of its sides and their indices), each with one angle all round and as high as
    `share` says; the first from the girdle's edge."""
    tiers = []
    inset, z = 0.0, math.copysign(HALF_GIRDLE, angles[0])
    for number, angle in enumerate(angles, start=1):
        for letter, (distance, indices) in zip("abc", outline.items(), strict=False):
            tiers.append(Tier(angle, through((distance - inset, z), angle), indices, f"{part}{number}{letter}"))
        inset += share / math.tan(math.radians(abs(angle)))
        z += math.copysign(share, angle)
    return tiers


def stepped(
    title: str,
    n_d: float,
    fold: int,
    outline: dict[float, tuple[float, ...]],
    below: tuple[list[float], float],
    above: tuple[list[float], float],
    table: float,
) -> FacetDesign:
    """A design of `steps`: angles and height of the rows `below` and `above`, and the height of the table."""
    girdle = [
        Tier(90.0, distance, indices, f"G{letter}")
        for letter, (distance, indices) in zip("abc", outline.items(), strict=False)
    ]
    tiers = (*steps(outline, *below, "P"), *girdle, *steps(outline, *above, "C"), Tier(0.0, table, (96.0,), "T"))
    return FacetDesign(title, tiers, 96, 0.0, n_d, fold, True)


if __name__ == "__main__":
    angles = {"crown_angle_deg": 40.0, "pavilion_angle_deg": 43.0, "diameter": 2.0, "table": 0.55}
    shaped("round_brilliant.asc", "Round brilliant for quartz", QUARTZ, shape="brilliant", **angles)
    write_asc(portuguese(), HERE / "portuguese.asc")
    emerald = {0.7: (24.0, 72.0), 1.0: (48.0, 96.0), 1.02: (12.0, 36.0, 60.0, 84.0)}
    rows_of_step_cut = ([-58.0, -49.0, -41.0], 0.25), ([50.0, 38.0, 26.0], 0.08)
    write_asc(stepped("Step cut for spinel", SPINEL, 2, emerald, *rows_of_step_cut, 0.26), HERE / "step_cut.asc")
    three = {0.62: (2.0, 30.0, 34.0, 62.0, 66.0, 94.0), 0.84: (16.0, 48.0, 80.0)}
    rows_of_trillion = ([-52.0, -40.0], 0.12), ([44.0, 32.0], 0.09)
    write_asc(stepped("Trillion for spinel", SPINEL, 3, three, *rows_of_trillion, 0.2), HERE / "trillion.asc")
