"""Whole paths of polarised light, GPU against float64: Stokes parameters here, electric fields there.

Planes of incidence turn against each other from surface to surface, total reflection gives light that is elliptic, and
mirrors turn that over; every photon's throughput at three wavelengths is held against exact paths.
"""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.model.geometry.primitives import box, plane
from spectrasplat.model.geometry.primitives_gem import brilliant
from spectrasplat.model.placement import rotation_about
from spectrasplat.model.scene import Mirror, SceneObject
from spectrasplat.stress.rigs.gpu_paths import glass, placed

from tests.gpu.test_whole_paths_gpu import Case, ball, touching, weights_agree


def stone() -> tuple[SceneObject, ...]:
    """A brilliant of diamond in a light from aside: facets at every angle, many total reflections."""
    return (placed("stone", brilliant(), glass("diamond")),)


def mirrored() -> tuple[SceneObject, ...]:
    """Steep panes before and behind a mirror, askew to each other."""
    pane = box((0.3, 2.4, 2.4))
    places = (
        ("before", pane, (0.0, 0.6, 0.8), 60.0, (-1.5, 0.2, 0.15), glass("N-SF11")),
        ("behind", pane, (0.6, 0.5, 0.7), 65.0, (0.6, 1.8, 0.0), glass("N-SF11")),
        ("mirror", plane(2.0, 2.0), (1.0, 1.0, 0.0), -90.0, (0.6, 0.0, 0.0), Mirror((0.9, 0.9, 0.9))),
    )
    things = []
    for name, mesh, axis, turn_deg, place, material in places:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation_about(axis, np.radians(turn_deg)), place
        things.append(placed(name, mesh.transformed(matrix), material))
    return tuple(things)


CASES = {
    "stone": Case(stone, depth=5, refractions=2, tinted=False, lattice=120, polarisation=True, compared=30),
    "touching glass": Case(touching, refractions=3, lattice=200, polarisation=True),
    "panes with a mirror between": Case(
        mirrored, depth=5, refractions=4, tinted=False, lattice=400, polarisation=True, compared=30
    ),
    "curved": Case(
        lambda: (ball(glass("N-SF11"), (0.0, 0.6, 0.0), 0.8), ball(Mirror((0.9, 0.9, 0.9)), (0.3, -0.9, 0.1), 0.6)),
        depth=4,
        tinted=False,
        lattice=120,
        polarisation=True,
        compared=30,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_throughput_of_whole_paths(gl, name: str) -> None:
    weights_agree(gl, CASES[name])
