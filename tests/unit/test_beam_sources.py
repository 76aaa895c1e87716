"""What light beams start with: the polygons that stand for round lamps and cones."""

from __future__ import annotations

import numpy as np
import pytest
from reference.beam_scenes import PRISM, lamp
from reference.beam_worlds import Rig, scene_of
from spectrasplat.beams.sources import RIM

RADIUS, HALF_ANGLE = 0.31, 14.0
AREA, OUTSIDE, INSIDE = 1e-9, 1e-3, 5e-4
"""Relative: of the area; of the radius, to either side of the circle."""
ROUND = {
    "aperture": (lamp((-1.2, 0.3, 2.5), (0.5, -0.1, -0.8), (RADIUS,)), RADIUS),
    "cone": (
        lamp((-1.2, 0.3, 2.5), (0.5, -0.1, -0.8), (), "spot", f"half_angle_deg = {HALF_ANGLE}\nsoftness = 0.0"),
        np.tan(np.radians(HALF_ANGLE)),
    ),
}


def corners_of(limits: np.ndarray) -> np.ndarray:
    """Where each half-plane's line l0 + l1 u + l2 v = 0 crosses the next one's, (n, 2)."""
    pairs = zip(limits, np.roll(limits, -1, axis=0), strict=True)
    return np.array([np.linalg.solve(np.stack([a[1:], b[1:]]), [-a[0], -b[0]]) for a, b in pairs])


def across(rig: Rig, emission, q: np.ndarray) -> np.ndarray:
    """Places q (n, 2) of a lamp's emission as places across it, about its axis: at its own plane, or one unit away."""
    source, light = emission.source[0], rig.scene.lights[0]
    right, up, forward = light.axes().T
    offset = q[:, :1] * source["right"] + q[:, 1:] * source["up"]
    if light.is_parallel:
        from_place = source["origin"] + offset - np.array(light.position)
    else:
        from_place = source["forward"] + offset
        from_place /= (from_place @ forward)[:, None]
    return np.column_stack([from_place @ right, from_place @ up])


@pytest.mark.parametrize("kind", ROUND)
def test_a_round_lamp_is_a_polygon_of_its_area_within_a_thousandth_of_its_radius(kind: str) -> None:
    text, radius = ROUND[kind]
    rig = Rig(scene_of(text + PRISM))
    (emission,) = rig.emissions()
    corners = across(rig, emission, corners_of(emission.limits))
    u, v = corners.T
    area = 0.5 * abs(np.sum(u * np.roll(v, -1) - v * np.roll(u, -1)))
    assert len(corners) == RIM
    assert area == pytest.approx(np.pi * radius**2, rel=AREA)
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    farthest, nearest = np.linalg.norm(corners, axis=1).max(), np.linalg.norm(middles, axis=1).min()
    assert radius * (1.0 - INSIDE) < nearest < radius < farthest < radius * (1.0 + OUTSIDE)
