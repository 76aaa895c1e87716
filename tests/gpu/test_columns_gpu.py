"""Every derivative column of the photons against float64 central differences of whole paths, 1e-4 relative.

From the emission domain of each kind of light, through refraction, internal and outer reflection at flat and
smooth facets, glass that touches and nests, to a room's walls: ∂/∂s, ∂/∂t, and by each glass's
index, by wavelength, or by a variable that glasses share. All branches up to a depth are there. Mutants of the shaders
show which mistake each case would catch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from reference.path_check import ReferenceScene, choices_of
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.geometry.primitives_lens import lens
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.lights import AreaLight, CollimatedLight, DirectionalLight, PointLight, SpotLight
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Diffuse, Light, Mirror, SceneObject
from spectrasplat.reference.optics import unit
from spectrasplat.stress.rigs.gpu_paths import REFRACTED, extruded, glass, placed, trace_light

NM = 580.0
COLUMN = 1e-4
"""Largest relative error of a column; measured: 2e-5."""
SMALL = 0.01
"""Columns shorter than this (world units over a unit of domain, index or µm) are held to `COLUMN` times this."""


def room() -> SceneObject:
    """A cube of side 16 without its wall towards -x, where sunlight comes in."""
    cube = box((16.0, 16.0, 16.0))
    return placed(
        "room", make_mesh("room", cube.vertices, cube.triangles[cube.corners()[:, :, 0].max(axis=1) > -7.9]), Diffuse()
    )


def ball(
    name: str = "F2", centre: tuple[float, float, float] = (0, 0, 0), radius: float = 1.0, priority: int = 0
) -> SceneObject:
    matrix = np.eye(4)
    matrix[:3, 3] = centre
    return placed(name, sphere(radius, 320).transformed(matrix), replace(glass(name), priority=priority))


def point() -> Light:
    return PointLight("light", constant(1.0), position=(-3.0, 0.4, 0.3))


def blocks(*names: str) -> tuple[SceneObject, ...]:
    """Cemented blocks along x with tilted faces, one of each glass."""
    tilts = np.tan(np.radians([31.4, -45.0, 40.0, -31.4, 20.0, -12.0]))
    faces = 0.9 * (np.arange(len(names) + 1) - 0.5 * len(names))
    left = [np.array([[x + 0.4 * t, -0.4], [x - 0.4 * t, 0.4]]) for x, t in zip(faces, tilts, strict=False)]
    return tuple(
        placed(name, extruded(name, np.array([a[0], b[0], b[1], a[1]])), glass(name))
        for name, a, b in zip(names, left[:-1], left[1:], strict=True)
    )


def cemented() -> tuple[SceneObject, ...]:
    """A coarse doublet, its axis turned to x."""
    turn = np.eye(4)[[2, 1, 0, 3]] * np.array([1, -1, 1, 1])[:, None]
    crown, flint = lens(2.0, -1.6, 0.5, 1.4, 300, front=-0.5), lens(-1.6, 9.0, 0.25, 1.4, 300, front=0.0)
    return placed("crown", crown.transformed(turn), glass("N-BK7")), placed(
        "flint", flint.transformed(turn), glass("F2")
    )


@dataclass(frozen=True)
class Case:
    """Objects in a room, a light, and how deep its paths are followed."""

    objects: Callable[[], tuple[SceneObject, ...]]
    light: Light
    depth: int = 3
    method: str = "srd"
    groups: int = 1
    lattice: int = 100
    each: int = 4
    """Photons compared of each sequence of choices."""
    refractions: int = 0
    """Only paths with at least so many are compared."""


def needle() -> Light:
    """A thin beam that goes through all blocks."""
    return CollimatedLight(
        "light",
        constant(1.0),
        position=(-4.0, 0.0, 0.0),
        direction=tuple(unit(np.array([1.0, 0.02, -0.03]))),
        radius=0.2,
    )


SLANT = tuple(unit(np.array([1.0, -0.1, 0.2])))
CASES = {
    "point": Case(lambda: (ball(),), point()),
    "spot": Case(
        lambda: (ball(),),
        SpotLight(
            "light",
            point().spectral_power,
            point().position,
            SLANT,
            inner_half_angle_deg=5.0,
            outer_half_angle_deg=25.0,
        ),
    ),
    "sun": Case(lambda: (ball(),), DirectionalLight("light", constant(1.0), direction=SLANT, angular_diameter_deg=8.0)),
    "beam": Case(
        lambda: (ball(),),
        CollimatedLight("light", constant(1.0), position=(-3.0, 0.0, 0.0), direction=SLANT, radius=2.0),
    ),
    "panel": Case(
        lambda: (ball(),),
        AreaLight(
            "light", constant(1.0), position=(-3.0, 0, 0), direction=SLANT, shape="rectangle", width=1.0, height=0.6
        ),
    ),
    "disc": Case(
        lambda: (ball(),), AreaLight("light", constant(1.0), position=(-3.0, 0, 0), direction=SLANT, radius=0.6)
    ),
    "inner reflections": Case(lambda: (ball("water"),), point(), depth=5, each=3, refractions=1),
    "total reflection": Case(
        lambda: (placed("half cube", extruded("half cube", np.array([[0, -1.0], [0, 1.0], [-1, 0]])), glass("N-BK7")),),
        point(),
        depth=4,
        each=2,
    ),
    "mirror ball": Case(
        lambda: (placed("mirror", sphere(0.8, 320), Mirror()), ball(centre=(-0.6, 1.9, 0.3), radius=0.9)),
        point(),
        depth=3,
        each=2,
    ),
    "doublet": Case(cemented, point(), groups=2, each=6, refractions=2),
    "three glasses": Case(lambda: blocks("N-BK7", "N-SF11", "F2"), needle(), depth=4, groups=3, each=6, refractions=4),
    "four glasses": Case(
        lambda: blocks("N-BK7", "N-SF11", "F2", "water"), needle(), depth=5, groups=4, each=6, refractions=5
    ),
    "five glasses": Case(
        lambda: blocks("N-BK7", "N-SF11", "F2", "water", "fused silica"),
        needle(),
        depth=6,
        groups=4,
        each=6,
        refractions=6,
    ),
    "nested": Case(
        lambda: (ball("water"), ball("N-SF11", (0.2, 0.1, 0.0), 0.5, priority=1)),
        point(),
        depth=4,
        groups=2,
        each=6,
        refractions=3,
    ),
    "overlapping": Case(
        lambda: (ball("water", (0, 0.4, 0), 0.8, priority=1), ball("F2", (0.3, -0.3, 0), 0.8)),
        point(),
        groups=2,
        each=4,
        refractions=2,
    ),
    "by wavelength": Case(cemented, point(), method="srd-lambda", each=6, refractions=2),
    "no spectrum": Case(lambda: (ball(),), point(), method="regular-7", groups=0),
}


def some_of_each(choices: list[tuple[int, ...]], case: Case) -> list[int]:
    """Rows of photons to compare: some of every sequence of choices that has refractions enough."""
    rows: dict[tuple[int, ...], list[int]] = {}
    for i in np.random.default_rng(1).permutation(len(choices)):
        if choices[i].count(REFRACTED) >= case.refractions:
            rows.setdefault(choices[i], []).append(int(i))
    return sorted(i for found in rows.values() for i in found[: case.each])


def columns_agree(gl: Context, case: Case) -> None:
    """Compare; AssertionError where a column is off."""
    objects = (*case.objects(), room())
    photons = trace_light(gl, objects, case.light, [(NM, NM)], case.lattice, case.depth, case.method, place=(0.3, 0.8))
    assert photons.groups.count == case.groups
    assert photons.tally.fallbacks["footprint_dropped"] == 0
    reference = ReferenceScene.of(objects)
    choices = choices_of(photons, case.depth)
    bodies = reference.bodies(NM)
    compared, skipped, sensitive = 0, 0, np.zeros(2 + case.groups)
    for i in some_of_each(choices, case):
        path = reference.path(photons, photons.q[i], choices[i], bodies)
        near = np.linalg.norm(path.ray.position - photons.position[i]) < 1e-3
        if not (near and path.landed and len(path.reflections) == len(choices[i])):
            skipped += 1  # float32 chose the neighbouring triangle at an edge
            continue
        compared += 1
        want = reference.columns(photons, i, choices[i], path.triangles)
        got = np.array([photons.dposition_ds[i], photons.dposition_dt[i], *photons.dposition_dvar[i]])
        length = np.linalg.norm(want, axis=1)
        assert (np.linalg.norm(got - want, axis=1) <= COLUMN * np.maximum(length, SMALL)).all(), (
            f"column after {choices[i]}: {got - want}"
        )
        assert photons.records["flux_w"][i] == pytest.approx(
            photons.weight[i] * path.transmittance, rel=1e-4, abs=1e-6 * photons.flux_w
        )
        sensitive += length > SMALL
    assert compared >= 6 and skipped <= 1, f"paths differ: {compared} the same, {skipped} others"
    assert (sensitive >= 3).all(), sensitive


@pytest.mark.parametrize("name", CASES)
def test_columns_against_central_differences(gl, name: str) -> None:
    columns_agree(gl, CASES[name])
