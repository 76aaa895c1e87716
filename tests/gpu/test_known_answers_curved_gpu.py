"""T5, T6, T7, T9, T10 and T11 through the real emit and trace shaders, on finely tessellated shapes.

Facets leave an error of second order in their width (`test_tessellation_gpu.py` shows the order):
tolerances are that of the meshes used here, or float32's 1e-4 where the meshes are better.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from reference.curved_meshes import mirror_arc
from reference.far_field import OutgoingRays, outgoing
from reference.surfaces import Plane, sphere
from reference.tracer import AIR, Index, make_ray, through
from spectrasplat.gpu.context import Context
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.geometry.primitives_lens import lens
from spectrasplat.model.geometry.primitives_round import ellipsoid
from spectrasplat.model.geometry.primitives_round import sphere as sphere_mesh
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Diffuse, Mirror, SceneObject
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import C_NM, D_NM, F_NM
from spectrasplat.reference.optics import dot
from spectrasplat.stress.rigs.glsl_function import evaluate
from spectrasplat.stress.rigs.gpu_paths import (
    MIRRORED,
    REFLECTED,
    REFRACTED,
    glass,
    placed,
    screen,
    trace_beam,
    trace_light,
)

pytestmark = pytest.mark.core

N_BK7_D = float(glasses.index("N-BK7", D_NM))
LINES = (F_NM, D_NM, C_NM)


@cache
def ball_mesh(triangles: int) -> Mesh:
    return sphere_mesh(1.0, triangles)


def lifted(mesh: Mesh, z: float) -> Mesh:
    matrix = np.eye(4)
    matrix[2, 3] = z
    return mesh.transformed(matrix)


def focal_lengths(gl: Context, lenses: tuple[SceneObject, ...], radius: float, near: float, far: float) -> list[float]:
    """Effective focal length for F, d, C of lenses on the z axis: h over the slope of the rays that leave, on the
    axis."""
    surfaces = 2 * len(lenses)

    def traced_onto(target: Mesh):
        bands = [(nm, nm) for nm in LINES]
        return trace_beam(
            gl, lenses, None, target, (0, 0, -1), (0, 0, 1), radius, bands, count=300, max_depth=surfaces
        ).of_choices(*[REFRACTED] * surfaces)

    rays = outgoing(traced_onto, (0, 0, 1), near, far, half=3.0)
    across = rays.photons.start * [1, 1, 0]
    height = np.linalg.norm(across, axis=1)
    length = -(height**2) * rays.direction[:, 2] / dot(rays.direction, across)
    found = []
    for band in range(len(LINES)):
        chosen = (rays.photons.band == band) & (height > 0.2 * radius)
        assert np.count_nonzero(chosen) > 200
        # f falls as h²: what is left at h = 0.
        found.append(float(np.polyfit(height[chosen] ** 2, length[chosen], 2)[-1]))
    return found


def test_t5_plano_convex_lens_on_the_axis(gl) -> None:
    solid = placed("lens", lens(np.inf, -1.0, 0.1, 0.5, 20_000), glass("N-BK7"))
    assert focal_lengths(gl, (solid,), 0.2, 0.5, 2.5) == pytest.approx([1.91433, 1.93498, 1.94431], rel=1e-4)


def test_t6_aplanatic_sphere(gl) -> None:
    # The light stands inside the glass.
    light = PointLight("light", constant(1.0), position=(-1 / N_BK7_D, 0.0, 0.0))
    ball = placed("ball", ball_mesh(81_920), glass("N-BK7"))

    def traced_onto(target: Mesh):
        bands = [(D_NM, D_NM), (F_NM, F_NM)]
        return trace_light(gl, (ball, placed("screen", target, Diffuse())), light, bands, 1500, 1).of_choices(REFRACTED)

    rays = outgoing(traced_onto, (1, 0, 0), 1.2, 3.2)
    angle = np.arccos(rays.photons.direction[:, 0])
    across = rays.photons.position * [0, 1, 1]
    image = rays.photons.position[:, 0] - np.linalg.norm(across, axis=1) ** 2 * rays.direction[:, 0] / dot(
        rays.direction, across
    )

    def exact(angle_rad: float, nm: float) -> float:
        start = make_ray([-1 / N_BK7_D, 0, 0], [np.cos(angle_rad), np.sin(angle_rad), 0])
        ray = through(start, sphere((0, 0, 0), 1.0), Index(float(glasses.index("N-BK7", nm))), AIR, root=1)
        return float(ray.position[0] - ray.position[1] * ray.direction[0] / ray.direction[1])

    for band, nm in enumerate((D_NM, F_NM)):
        for low, high, tolerance in ((5, 50, 2e-4), (50, 70, 5e-4), (70, 81, 2e-3)):
            chosen = (rays.photons.band == band) & (angle > np.radians(low)) & (angle < np.radians(high))
            assert np.count_nonzero(chosen) > 50
            want = np.array([exact(a, nm) for a in angle[chosen]])
            assert np.abs(image[chosen] - want).max() < tolerance
    assert exact(np.radians(10), F_NM) == pytest.approx(-1.5309890, abs=6e-7)
    assert exact(np.radians(80), F_NM) == pytest.approx(-1.5635224, abs=6e-7)


def test_t6_up_to_89_degrees_on_the_exact_sphere(gl) -> None:
    """The GLSL refraction at points of the sphere itself."""
    for nm, expected in ((D_NM, {}), (F_NM, {10: -1.5309890, 80: -1.5635224})):
        degrees = np.array([1, 10, 30, 45, 60, 80, 89])
        angle, n = np.radians(degrees), float(glasses.index("N-BK7", nm))
        direction = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
        source = np.array([-1 / N_BK7_D, 0, 0])
        along = -direction @ source + np.sqrt((direction @ source) ** 2 + 1 - source @ source)
        point = source + along[:, None] * direction
        got = evaluate(
            gl.ctx,
            ["lib/optics.glsl"],
            "float theta = dot(d, n); out_d = refract_direction(d, n, theta, eta, sqrt(transmitted_cosine2(theta, "
            "eta)));",
            {"d": direction, "n": -point, "eta": np.full(len(angle), n)},
            {"out_d": "vec3"},
        )["out_d"]
        image = point[:, 0] - point[:, 1] * got[:, 0] / got[:, 1]
        if nm == D_NM:
            np.testing.assert_allclose(image, -N_BK7_D, rtol=1e-4)
        for wanted, x in expected.items():
            assert image[degrees == wanted] == pytest.approx(x, rel=1e-4)


def test_t7_cartesian_ellipsoid(gl) -> None:
    eccentricity = 1 / N_BK7_D
    short = np.sqrt(1 - eccentricity**2)
    solid = placed("ellipsoid", ellipsoid((1.0, short, short), 81_920), glass("N-BK7"))
    # The screen stands in the far focus, inside the glass.
    target = screen((eccentricity, 0, 0), (1, 0, 0), 0.1)
    photons = trace_beam(
        gl, (solid,), None, target, (-2, 0, 0), (1, 0, 0), 0.6, [(nm, nm) for nm in LINES], count=400, max_depth=1
    )
    across = photons.start * [0, 1, 1]
    height = np.linalg.norm(across, axis=1)
    miss = dot(photons.position, across) / height
    for band, expected in enumerate((-0.002093068, 0.0, 0.000934928)):
        of_line = photons.band == band
        near = of_line & (np.abs(height - 0.3) < 0.1)
        # 82k facets leave 4e-6; float32 alone 1e-7.
        assert np.polyval(np.polyfit(height[near] - 0.3, miss[near], 2), 0.0) == pytest.approx(expected, abs=6e-6)
        if expected == 0.0:
            assert np.median(np.abs(miss[of_line])) < 6e-6
            assert np.abs(miss[of_line]).max() < 6e-5


def test_t9_mirror_nephroid(gl) -> None:
    mirror = (placed("mirror", mirror_arc(4096), Mirror()),)

    def traced_onto(target: Mesh):
        photons = trace_beam(gl, mirror, None, target, (-1.0, 0, 0), (1, 0, 0), 0.7, D_NM, count=600, max_depth=1)
        return photons.of_choices(MIRRORED)

    rays = outgoing(traced_onto, (-1, 0, 0), 1.2, 2.2)
    photons = rays.photons
    # The beam's own frame need not lie in the plane: the column by height.
    frame = [photons.emitter.domain.tangent[1], photons.emitter.domain.bitangent[1]]
    dposition = frame[0] * photons.dposition_ds + frame[1] * photons.dposition_dt
    ddirection = frame[0] * rays.ddirection_ds + frame[1] * rays.ddirection_dt

    def cross(a, b):
        return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]

    caustic = (
        photons.position
        - (cross(dposition, rays.direction) / cross(ddirection, rays.direction))[:, None] * rays.direction
    )
    t = np.arcsin(photons.start[:, 1])
    exact = np.column_stack([3 * np.cos(t) - np.cos(3 * t), 3 * np.sin(t) - np.sin(3 * t)]) / 4
    off = np.linalg.norm(caustic[:, :2] - exact, axis=1)
    # Beyond 33° light meets the mirror twice.
    assert len(t) > 350 and np.abs(t).max() > np.radians(33)
    # A column sees the facet's own slope: first order, 3/4096 of a radian here.
    assert off.max() < 2e-3 and np.median(off) < 5e-4
    # The slope has both signs on a facet, so a fit through many is of second order again.
    near = np.abs(t - np.radians(30)) < np.radians(6)
    for axis, expected in ((0, 0.649519), (1, 0.125)):
        assert np.polyval(np.polyfit(t[near] - np.radians(30), caustic[near, axis], 3), 0.0) == pytest.approx(
            expected, abs=2e-4
        )
    cusp = np.abs(t) < np.radians(6)
    assert np.polyval(np.polyfit(t[cusp], caustic[cusp, 0], 2), 0.0) == pytest.approx(0.5, abs=2e-4)


def rainbow(gl: Context, bounces: int, wavelengths_nm: tuple[float, ...]) -> OutgoingRays:
    """Rays near the turning height of a water ball after so many inner reflections."""
    n = float(glasses.index("water", D_NM))
    height = np.sqrt(1 - (n * n - 1) / (bounces * (bounces + 2)))
    # One side of the ball only; its light leaves downwards after one bounce and upwards after two.
    exact = in_ball(height, n, bounces)
    path = (REFRACTED, *[REFLECTED] * bounces, REFRACTED)
    ball = (placed("ball", ball_mesh(81_920), glass("water")),)

    def traced_onto(target: Mesh):
        bands = [(nm, nm) for nm in wavelengths_nm]
        return trace_beam(
            gl, ball, None, target, (-4, height, 0), (1, 0, 0), 0.045, bands, count=300, max_depth=len(path)
        ).of_choices(*path)

    return outgoing(traced_onto, exact.direction, 3.0, 6.0, half=1.0)


def in_ball(height: float, n: float, bounces: int):
    """The exact ray."""
    ball, glass_index = sphere((0, 0, 0), 1.0), Index(n)
    ray = through(make_ray([-2, height, 0], [1, 0, 0]), ball, AIR, glass_index)
    for _ in range(bounces):
        ray = through(ray, ball, glass_index, glass_index, root=1, mirror=True)
    return through(ray, ball, glass_index, AIR, root=1)


@pytest.mark.parametrize(
    ("bounces", "radii_deg", "dradius_dn"),
    [(1, (40.5674, 42.0195, 42.4405), -2.53492), (2, (53.6198, 50.9964, 50.2379), 4.57002)],
)
def test_t10_rainbows(gl, bounces: int, radii_deg: tuple[float, ...], dradius_dn: float) -> None:
    lines = (400.0, D_NM, 700.0)
    rays = rainbow(gl, bounces, lines)
    impact = np.linalg.norm(rays.photons.start[:, 1:], axis=1)
    sine = np.linalg.norm(rays.direction[:, 1:], axis=1)
    radius = np.arctan2(sine, -rays.direction[:, 0])  # the angle from -x
    dradius = rays.ddirection_dvar[:, 0, 0] / sine
    for band, (nm, expected_deg) in enumerate(zip(lines, radii_deg, strict=True)):
        n = float(glasses.index("water", nm))
        turning = np.sqrt(1 - (n * n - 1) / (bounces * (bounces + 2)))
        near = (rays.photons.band == band) & (np.abs(impact - turning) < 0.03)
        assert np.count_nonzero(near) > 80
        fit = np.polynomial.Polynomial.fit(impact[near] - turning, radius[near], 4)
        # The stationary value, wherever it is.
        offsets = np.linspace(-0.02, 0.02, 401)
        extreme = fit(offsets).max() if bounces == 1 else fit(offsets).min()
        assert np.degrees(extreme) == pytest.approx(expected_deg, rel=1e-4)
        assert fit.deriv()(0.0) == pytest.approx(0.0, abs=0.02)
        if nm == D_NM:
            slope = np.polynomial.Polynomial.fit(impact[near] - turning, dradius[near], 3)(0.0)
            # First order in the facets' width, three or four surfaces.
            assert slope == pytest.approx(dradius_dn, rel=5e-3)


def test_t11_achromat_of_two_thin_lenses(gl) -> None:
    n_1, n_2 = (glasses.index(name, np.array(LINES)) for name in ("N-BK7", "F2"))
    abbe_1, abbe_2 = ((n[1] - 1) / (n[0] - n[2]) for n in (n_1, n_2))
    focal_1, focal_2 = 100 * (abbe_1 - abbe_2) / abbe_1, -100 * (abbe_1 - abbe_2) / abbe_2
    assert (focal_1, focal_2) == (pytest.approx(43.3255, abs=6e-5), pytest.approx(-76.4463, abs=6e-5))
    # Plano-curved, R = (n - 1) f; 3 parts in 10 000 of the focal length thick, with air between the two.
    radius_1, radius_2 = focal_1 * (n_1[1] - 1), focal_2 * (n_2[1] - 1)
    lenses = (
        placed("crown", lens(radius_1, np.inf, 0.02, 1.0, 20_000), glass("N-BK7")),
        placed("flint", lifted(lens(radius_2, np.inf, 0.01, 1.0, 20_000), 0.02), glass("F2")),
    )
    got = focal_lengths(gl, lenses, 0.45, 50.0, 150.0)

    def exact(i: int) -> float:
        ray = make_ray([-1, 0, 0], [1, 0, 0], [[0, 1, 0]])
        for radius, n, front, back in ((radius_1, n_1[i], -0.01, 0.01), (radius_2, n_2[i], 0.015, 0.025)):
            curved = sphere((front + radius, 0, 0), abs(radius))
            ray = through(ray, curved, AIR, Index(float(n)), root=0 if radius > 0 else 1)
            ray = through(ray, Plane((back, 0, 0), (1, 0, 0)), Index(float(n)), AIR)
        return float(-1 / ray.ddirection[0, 1])

    # The same real lenses in float64, and the thin ones of the table: 6e-4 apart by their thickness.
    assert got == pytest.approx([exact(i) for i in range(3)], rel=3e-5)
    assert got == pytest.approx([100.04996, 100.0, 100.04996], rel=7e-4)
    # What an achromat is: F and C together, d a twentieth of a unit before them. Float32 leaves 2e-3.
    assert got[0] - got[2] == pytest.approx(exact(0) - exact(2), abs=4e-3)
    assert 0.5 * (got[0] + got[2]) - got[1] == pytest.approx(0.04996, abs=4e-3)
