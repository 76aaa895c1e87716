"""Arrangements of glass whose rays have known answers, as meshes, and what walks rays through them: photons of the
light pass, and single rays of queries.

Each walker gives the rays that took the arrangement's path, as they pass a plane beyond it, so that one test holds all
walkers against a known answer. Photon records hold no directions: those come from the same photons on two screens, and
so do derivatives of directions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from reference.curved_meshes import mirror_arc
from reference.known_answers import (
    AMICI_TILT_DEG,
    APEX,
    LINES,
    N_BK7_D,
    achromat_parts,
    n_of,
    rainbow_height,
)
from reference.surfaces import Plane, sphere
from reference.tracer import AIR, Ray, make_ray, through
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives import box, slab
from spectrasplat.model.geometry.primitives_lens import lens
from spectrasplat.model.geometry.primitives_round import sphere as sphere_mesh
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Camera, Diffuse, Mirror, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.vectors import frame_about
from spectrasplat.passes.ray_paths import RayPaths
from spectrasplat.reference.glasses import D_NM
from spectrasplat.reference.optics import normalised_derivative, unit
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.rigs.gpu_paths import (
    MIRRORED,
    REFLECTED,
    REFRACTED,
    Photons,
    extruded,
    glass,
    placed,
    screen,
    trace_beam,
    trace_light,
)


@dataclass(frozen=True, eq=False)
class Arrangement:
    """Glass or mirrors in a beam, or about a point of light; the rays of one path through it have a known answer."""

    objects: tuple[SceneObject, ...]
    start: np.ndarray
    """Middle of the beam's disc, or the point."""
    direction: np.ndarray
    radius: float
    """Of the beam; 0 for a point that sends light everywhere."""
    path: tuple[int, ...]
    """What a ray does at each surface (`REFRACTED`, …)."""
    axis: np.ndarray
    """About where rays go in the end."""
    near: float
    far: float
    """Two distances along the axis beyond the last surface."""
    half: float = 50.0
    """Rays pass within this of the axis."""


@cache
def ball_mesh(triangles: int) -> Mesh:
    return sphere_mesh(1.0, triangles)


def in_plane(angle_rad: float) -> np.ndarray:
    """Unit vector at an angle from +x in the x-y plane."""
    return np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])


def tilted_section(apex_rad: float) -> np.ndarray:
    """An isosceles triangle with its apex up, sides of length 1."""
    return np.array([[-np.sin(apex_rad / 2), 0], [np.sin(apex_rad / 2), 0], [0, np.cos(apex_rad / 2)]])


def lifted(mesh: Mesh, z: float) -> Mesh:
    matrix = np.eye(4)
    matrix[2, 3] = z
    return mesh.transformed(matrix)


def prism(name: str, incidence_rad: float, leaving_rad: float) -> Arrangement:
    """T2 and T14: `leaving_rad` is about where light goes, from +x."""
    direction = in_plane(incidence_rad - APEX / 2)
    middle = np.array([-np.sin(APEX / 2) / 2, np.cos(APEX / 2) / 2, 0])
    solid = placed("prism", extruded("prism", tilted_section(APEX)), glass(name))
    return Arrangement((solid,), middle - direction, direction, 0.04, (REFRACTED,) * 2, in_plane(leaving_rad), 1.5, 5.5)


def slab_at_45(name: str) -> Arrangement:
    """T3: the slab's lower face is z = −1/2."""
    aslant = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
    block = placed("slab", slab(8.0, 8.0, 1.0), glass(name))
    bottom = float(block.mesh.bounds()[0][2])
    start = np.array([-2, 0, bottom + 3])
    return Arrangement((block,), start, aslant, 0.3, (REFRACTED,) * 2, np.array([0.0, 0.0, -1.0]), 1.0, 21.0)


def ball() -> Arrangement:
    """T4: near is the plane x = 1.2."""
    ahead = np.array([1.0, 0.0, 0.0])
    solid = placed("ball", ball_mesh(327_680), glass("N-BK7"))
    return Arrangement((solid,), -3 * ahead, ahead, 0.85, (REFRACTED,) * 2, ahead, 1.2, 3.2)


def lenses_on_z(lenses: Mapping[str, Mesh], radius: float, near: float, far: float) -> Arrangement:
    """T5 and T11: by glass, along +z."""
    objects = tuple(placed(name, mesh, glass(name)) for name, mesh in lenses.items())
    up = np.array([0.0, 0.0, 1.0])
    return Arrangement(objects, -up, up, radius, (REFRACTED,) * (2 * len(objects)), up, near, far, 3.0)


def plano_convex() -> Arrangement:
    """T5."""
    return lenses_on_z({"N-BK7": lens(np.inf, -1.0, 0.1, 0.5, 20_000)}, 0.2, 0.5, 2.5)


def achromat() -> tuple[Arrangement, tuple[float, float, float]]:
    """T11 with lenses that are 3 parts in 10,000 of the focal length thick, and their focal lengths at the lines by
    float64."""
    radii = [focal * (n_of(name, D_NM) - 1) for focal, name in zip(achromat_parts(), ("N-BK7", "F2"), strict=True)]
    crown = lens(radii[0], np.inf, 0.02, 1.0, 20_000)
    flint = lifted(lens(radii[1], np.inf, 0.01, 1.0, 20_000), 0.02)

    def exact(nm: float) -> float:
        height = 1e-4
        ray = make_ray([-1, height, 0], [1, 0, 0])
        for name, radius, front, back in (("N-BK7", radii[0], -0.01, 0.01), ("F2", radii[1], 0.015, 0.025)):
            index = n_of(name, nm)
            curved = sphere((front + radius, 0, 0), abs(radius))
            ray = through(ray, curved, AIR, index, root=0 if radius > 0 else 1)
            ray = through(ray, Plane((back, 0, 0), (1, 0, 0)), index, AIR)
        return float(-height / ray.direction[1])

    f, d, c = (exact(nm) for nm in LINES)
    return lenses_on_z({"N-BK7": crown, "F2": flint}, 0.45, 50.0, 150.0), (f, d, c)


def aplanatic_ball() -> Arrangement:
    """T6."""
    ball = placed("ball", ball_mesh(81_920), glass("N-BK7"))
    ahead = np.array([1.0, 0.0, 0.0])
    return Arrangement((ball,), -ahead / N_BK7_D, ahead, 0.0, (REFRACTED,), ahead, 1.2, 3.2)


def block_over_a_point() -> Arrangement:
    """T8: the face is z = 1.5."""
    up = np.array([0.0, 0.0, 1.0])
    block = placed("block", box((8.0, 8.0, 3.0)), glass("N-BK7"))
    return Arrangement((block,), 0.5 * up, up, 0.0, (REFRACTED,), up, 1.6, 3.6)


def cylinder_mirror() -> Arrangement:
    """T9."""
    ahead = np.array([1.0, 0.0, 0.0])
    mirror = placed("mirror", mirror_arc(4096), Mirror())
    return Arrangement((mirror,), -ahead, ahead, 0.7, (MIRRORED,), -ahead, 1.2, 2.2)


def rainbow(reflections: int) -> Arrangement:
    """T10: one side of a ball, near the height of the ray that turns."""
    n = n_of("water", D_NM)
    height = rainbow_height(n, reflections)
    path = (REFRACTED, *[REFLECTED] * reflections, REFRACTED)
    leaving = in_ball(height, n, reflections).direction
    ball = placed("ball", ball_mesh(81_920), glass("water"))
    ahead = np.array([1.0, 0.0, 0.0])
    return Arrangement((ball,), np.array([-4.0, height, 0.0]), ahead, 0.045, path, leaving, 3.0, 6.0, 1.0)


def in_ball(height: float, n: float, reflections: int) -> Ray:
    """The exact ray, from x = −2 along +x, after so many reflections inside the ball of radius 1."""
    ball = sphere((0, 0, 0), 1.0)
    ray = through(make_ray([-2, height, 0], [1, 0, 0]), ball, AIR, n)
    for _ in range(reflections):
        ray = through(ray, ball, n, n, root=1, mirror=True)
    return through(ray, ball, n, AIR, root=1)


def amici() -> Arrangement:
    """T12: three solids that touch."""
    tilts = np.tan(np.radians([AMICI_TILT_DEG, -45.0, 45.0, -AMICI_TILT_DEG]))
    ends = [np.array([[x + 0.3 * tilt, -0.3], [x - 0.3 * tilt, 0.3]]) for x, tilt in enumerate(tilts)]
    solids = tuple(
        placed(f"{k} {name}", extruded(name, np.array([*ends[k], *ends[k + 1]])[[0, 2, 3, 1]]), glass(name))
        for k, name in enumerate(("N-BK7", "N-SF11", "N-BK7"))
    )
    ahead = np.array([1.0, 0.0, 0.0])
    return Arrangement(solids, -ahead, ahead, 0.05, (REFRACTED,) * 4, ahead, 4.5, 9.5, 3.0)


# ---- walkers ---------------------------------------------------------------------------------

GOLDEN = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class Columns:
    """Derivatives of rays: (N, 3) by the emission domain's coordinates, (N, G, 3) by each glass's index."""

    photons: Photons
    ddirection_ds: np.ndarray
    ddirection_dt: np.ndarray
    ddirection_dn: np.ndarray


@dataclass(frozen=True, eq=False)
class Rays:
    """N rays, world units, as they pass the plane at `Arrangement.near`."""

    line: np.ndarray
    """(N,): which of the wavelengths."""
    start: np.ndarray
    start_direction: np.ndarray
    position: np.ndarray
    direction: np.ndarray
    columns: Columns | None = None
    """Only light has them."""

    @property
    def heading(self) -> np.ndarray:
        """Angle of the direction from +x in the x-y plane, rad (N,)."""
        return np.arctan2(self.direction[:, 1], self.direction[:, 0])

    def dheading_dn(self, group: int = 0) -> np.ndarray:
        """Its derivative (N,) by a glass's index."""
        assert self.columns is not None
        (x, y), derivative = self.direction[:, :2].T, self.columns.ddirection_dn[:, group]
        return (x * derivative[:, 1] - y * derivative[:, 0]) / (x * x + y * y)


def by_light(gl: Context, arrangement: Arrangement, lines_nm: Sequence[float], count: int) -> Rays:
    """`count` photons a line, those that took the path."""
    bands, depth = [(nm, nm) for nm in lines_nm], len(arrangement.path)

    def traced_onto(target: Mesh) -> Photons:
        if arrangement.radius:
            beam = arrangement.start, arrangement.direction, arrangement.radius
            found = trace_beam(gl, arrangement.objects, None, target, *beam, bands, count=count, max_depth=depth)
        else:
            objects = *arrangement.objects, placed("screen", target, Diffuse())
            lamp = PointLight("lamp", constant(1.0), position=tuple(arrangement.start.tolist()))
            found = trace_light(gl, objects, lamp, bands, count, depth)
        return found.of_choices(*arrangement.path)

    near, far = (
        traced_onto(screen(distance * arrangement.axis, arrangement.axis, arrangement.half))
        for distance in (arrangement.near, arrangement.far)
    )
    _, in_near, in_far = np.intersect1d(near.records["photon_id"], far.records["photon_id"], return_indices=True)
    near, far = near.where(in_near), far.where(in_far)
    way = far.position - near.position
    ds, dt = (
        normalised_derivative(way, getattr(far, name) - getattr(near, name))
        for name in ("dposition_ds", "dposition_dt")
    )
    dn = normalised_derivative(way[:, None], far.dposition_dvar - near.dposition_dvar)
    return Rays(near.band, near.start, near.direction, near.position, unit(way), Columns(near, ds, dt, dn))


def by_queries(gl: Context, arrangement: Arrangement, lines_nm: Sequence[float], count: int) -> Rays:
    """`count` rays a line over the beam's disc, or over the half of all directions round the arrangement's own."""
    number = np.arange(count) + 0.5
    circle = np.column_stack([np.cos(GOLDEN * number), np.sin(GOLDEN * number)])
    frame = frame_about(arrangement.direction)[:2]
    if arrangement.radius:
        starts = arrangement.start + arrangement.radius * np.sqrt(number / count)[:, None] * (circle @ frame)
        directions = np.tile(arrangement.direction, (count, 1))
    else:
        cosine = (number / count)[:, None]
        starts = np.tile(arrangement.start, (count, 1))
        directions = cosine * arrangement.direction + np.sqrt(1.0 - cosine**2) * (circle @ frame)
    line = np.repeat(np.arange(len(lines_nm)), count)
    starts, directions = np.tile(starts, (len(lines_nm), 1)), np.tile(directions, (len(lines_nm), 1))
    lamp = PointLight("lamp", constant(1.0), position=(0.0, 0.0, 50.0))
    scene = Scene("question", Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)), (lamp,), arrangement.objects)
    features = Features.of(scene, RenderSettings())
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    queries = RayPaths(gl, buffers)
    try:
        inside = arrangement.path.count(REFLECTED)
        paths = queries.trace(starts, directions, np.asarray(lines_nm)[line], arrangement.far, inside)
    finally:
        queries.release()
        buffers.release()
    points = [_apart(path.points) for path in paths]
    taken = [i for i, path in enumerate(points) if len(path) == len(arrangement.path) + 2]
    last, end = (np.array([points[i][k] for i in taken]) for k in (-2, -1))
    direction = unit(end - last)
    distance = (arrangement.near - last @ arrangement.axis) / (direction @ arrangement.axis)
    return Rays(line[taken], starts[taken], directions[taken], last + distance[:, None] * direction, direction)


def _apart(points: np.ndarray) -> np.ndarray:
    """The points of a path, where two solids touch only once."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return points[np.append(True, lengths > 1e-5)]


WALKERS: dict[str, Callable[[Context, Arrangement, Sequence[float], int], Rays]] = {
    "light": by_light,
    "queries": by_queries,
}
