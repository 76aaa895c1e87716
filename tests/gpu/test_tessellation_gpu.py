"""How fast tessellated shapes approach the smooth ones: order of convergence in the facets' width.

Corners and corner normals are exact, so facets leave the surface by h² and interpolated normals turn by
h²: positions and directions converge with order 2. A photon's columns follow its own facet: the
foot of a displaced ray slides in the facet's plane, which is tilted by up to h/2 against the
surface, so their error is of order 1 in the end; where an h² part is large (a lens, near its focus) the
order that coarse meshes show lies between 1 and 2. Without normals positions
converge with order 1 and columns not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from reference.curved_meshes import mirror_arc
from reference.surfaces import Plane, Quadric, sphere
from reference.tracer import (
    AIR,
    Index,
    Ray,
    make_ray,
    onto,
    through,
)
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives_lens import lens
from spectrasplat.model.geometry.primitives_round import ellipsoid
from spectrasplat.model.geometry.primitives_round import sphere as sphere_mesh
from spectrasplat.model.scene import Mirror
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import D_NM
from spectrasplat.stress.rigs.gpu_paths import (
    MIRRORED,
    REFRACTED,
    Photons,
    glass,
    placed,
    screen,
    trace_beam,
)

N = Index(float(glasses.index("N-BK7", D_NM)), np.array([0.0, 0.0, 1.0]))


def refracted_twice(front: Quadric, back: Quadric) -> Callable[[Ray], Ray]:
    """Through glass whose far side is where each surface's outer root is."""
    return lambda ray: through(through(ray, front, AIR, N), back, N, AIR, root=1)


@dataclass(frozen=True)
class Shape:
    """A family of meshes, the exact surface they approach, and a beam and a screen for them."""

    mesh: Callable[[int], Mesh]
    sizes: tuple[int, ...]
    """Each halves the facets' width."""
    exact: Callable[[Ray], Ray]
    start: tuple[float, float, float]
    radius: float
    screen_x: float
    path: tuple[int, ...] = (REFRACTED, REFRACTED)


def towards_x(mesh: Mesh) -> Mesh:
    """What stands along z turned to stand along x."""
    turn = np.eye(4)[[2, 1, 0, 3]] * np.array([1, -1, 1, 1])[:, None]
    return mesh.transformed(turn)


AXES = (0.8, 1.1, 0.9)
TRIANGLES = (1280, 5120, 20_480, 81_920, 327_680)
SHAPES = {
    "sphere": Shape(
        lambda size: sphere_mesh(1.0, size),
        TRIANGLES,
        refracted_twice(sphere((0, 0, 0), 1), sphere((0, 0, 0), 1)),
        (-3, 0, 0),
        0.7,
        1.6,
    ),
    "ellipsoid": Shape(
        lambda size: ellipsoid(AXES, size),
        TRIANGLES,
        refracted_twice(Quadric((0, 0, 0), AXES), Quadric((0, 0, 0), AXES)),
        (-3, 0, 0),
        0.6,
        2.0,
    ),
    "lens": Shape(
        lambda size: towards_x(lens(1.2, -0.9, 0.5, 1.2, size)),
        (12 * 8 * 9, 12 * 16 * 17, 12 * 32 * 33, 12 * 64 * 65, 12 * 128 * 129),
        refracted_twice(sphere((0.95, 0, 0), 1.2), sphere((-0.65, 0, 0), 0.9)),
        (-3, 0, 0),
        0.45,
        1.5,
    ),
    "mirror cylinder": Shape(
        mirror_arc,
        (32, 64, 128, 256, 512),
        lambda ray: through(ray, Quadric((0, 0, 0), (1, 1, np.inf)), AIR, AIR, root=1, mirror=True),
        (-0.8, 0, 0),
        0.5,
        -1.0,
        (MIRRORED,),
    ),
}


def traced(gl: Context, shape: Shape, mesh: Mesh) -> Photons:
    solid = placed("solid", mesh, Mirror() if MIRRORED in shape.path else glass("N-BK7"))
    target = screen((shape.screen_x, 0, 0), (1, 0, 0), 6.0)
    return trace_beam(
        gl,
        (solid,),
        None,
        target,
        shape.start,
        (1, 0.02, 0.03),
        shape.radius,
        D_NM,
        count=160,
        max_depth=len(shape.path),
    ).of_choices(*shape.path)


def errors(gl: Context, shape: Shape, mesh: Mesh) -> np.ndarray:
    """(3,): median error of position, root mean square error of ∂p/∂s and ∂p/∂t together, and of ∂p/∂n."""
    photons = traced(gl, shape, mesh)
    assert len(photons.records) > 100
    domain = photons.emitter.domain
    seeds = [domain.tangent, domain.bitangent, np.zeros(3)]
    plane = Plane((shape.screen_x, 0, 0), (1, 0, 0))
    exact = [
        onto(shape.exact(make_ray(p, d, seeds)), plane) for p, d in zip(photons.start, photons.direction, strict=True)
    ]
    position = photons.position - [ray.position for ray in exact]
    got = np.stack([photons.dposition_ds, photons.dposition_dt, photons.dposition_dn], axis=1)
    columns = np.sum((got - [ray.dposition for ray in exact]) ** 2, axis=2)
    return np.array(
        [np.median(np.linalg.norm(position, axis=1)), np.sqrt(columns[:, :2].mean()), np.sqrt(columns[:, 2].mean())]
    )


def orders(gl: Context, shape: Shape, levels: int) -> np.ndarray:
    """(3,) of `errors`: slope of the line through log2 of the errors against the level."""
    found = np.array([errors(gl, shape, shape.mesh(size)) for size in shape.sizes[:levels]])
    return -np.polyfit(np.arange(levels), np.log2(np.maximum(found, 1e-12)), 1)[0]


@pytest.mark.slow
@pytest.mark.parametrize("levels", [3, pytest.param(5, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SHAPES)
def test_order_of_convergence(gl, name: str, levels: int) -> None:
    position, spatial, spectral = orders(gl, SHAPES[name], levels)
    assert position == pytest.approx(2.0, abs=0.15)
    assert 0.85 < spatial < 2.1
    assert 0.85 < spectral < 2.1 or MIRRORED in SHAPES[name].path


def test_facets_without_normals_converge_with_order_one_only(gl) -> None:
    """What the test above would see, were normals not interpolated."""
    shape = SHAPES["sphere"]
    faceted = replace(shape, mesh=lambda size: replace(sphere_mesh(1.0, size), corner_normals=None))
    position, spatial, _ = orders(gl, faceted, 2)
    assert position == pytest.approx(1.0, abs=0.2)
    assert abs(spatial) < 0.1
