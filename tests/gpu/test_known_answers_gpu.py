"""The known answers T1 to T16 by all that walks rays on the device: photons of the real emit and trace shaders, and the
single rays of queries. T3 by camera pictures is in `test_camera_known_answers.py`.

Float32: 1e-4 relative, mostly much better. Facets of curved shapes leave an error of second order in their width:
tolerances are that of the meshes used here where it is larger.
"""

from __future__ import annotations

import numpy as np
import pytest
from reference import known_answers as known
from reference import walkers as rigs
from reference.known_answers import BREWSTER_DEG, FRESNEL, LINES, N_BK7_D, n_of
from reference.surfaces import Plane, sphere
from reference.tracer import AIR, make_ray, onto, through
from reference.walkers import WALKERS, Columns, Rays, ball_mesh, in_plane
from spectrasplat.features.features import Features
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.model.geometry.primitives import box, slab
from spectrasplat.model.geometry.primitives_round import ellipsoid
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Camera, Diffuse, Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference import glasses
from spectrasplat.reference.glasses import D_NM, F_NM
from spectrasplat.reference.optics import dot
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.case import FLUX_CLOSURE
from spectrasplat.stress.rigs.glsl_function import evaluate
from spectrasplat.stress.rigs.gpu_paths import (
    REFLECTED,
    REFRACTED,
    Photons,
    extruded,
    glass,
    placed,
    screen,
    trace_beam,
)

pytestmark = pytest.mark.core
walkers = pytest.mark.parametrize("walker", WALKERS)


def enough(rays: Rays, lines: int, each: int) -> Rays:
    """The rays, of which there must be more than `each` of every line."""
    assert np.bincount(rays.line, minlength=lines).min() > each, "paths"
    return rays


def columns_of(rays: Rays) -> Columns:
    assert rays.columns is not None
    return rays.columns


@pytest.mark.parametrize("name", known.INDEX_TABLES)
def test_t1_index_tables(gl, name: str) -> None:
    expected = known.INDEX_TABLES[name]
    scene = Scene(
        "glass",
        Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)),
        (PointLight("light", constant(1.0), position=(0, 0, 5)),),
        (placed("block", box(), glass(name)), placed("floor", screen((0, 0, -2), (0, 0, 1)), Diffuse())),
    )
    # By the λ-column, so that the table of slopes is dn/dλ.
    features = Features.of(scene, RenderSettings(method="srd-lambda"))
    axis = spectral_axis(scene, features)
    nm = np.concatenate([LINES, np.linspace(381.0, 779.0, 500)])
    # Rounded to float32, x is that of another wavelength, at which n is expected.
    x = axis.x_of_nm(nm).astype(np.float32)
    buffers = SceneBuffers(gl.ctx, scene, features, axis)
    try:
        got = evaluate(
            gl.ctx,
            ["lib/scene.glsl"],
            "n = spectral_row(uint(INDEX_ROW), x); slope = spectral_row(uint(SLOPE_ROW), x);",
            {"x": x},
            {"n": "float", "slope": "float"},
            features.defines() | buffers.defines,
            SCENE_STRUCTS,
            binders=[buffers.bind],
        )
    finally:
        buffers.release()
    exact_nm = axis.nm_of_x(x.astype(float))
    assert np.abs(got["n"] - glasses.index(name, exact_nm)).max() < 4e-7
    np.testing.assert_allclose(got["slope"], glasses.slope(name, exact_nm), rtol=2e-4)
    n_f, n_d, n_c = got["n"][:3]
    np.testing.assert_allclose((n_f, n_d, n_c), expected.n_fdc, atol=1e-6)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(expected.abbe, rel=1e-4)
    assert got["slope"][1] == pytest.approx(expected.slope_per_um, rel=1e-4)


@walkers
@pytest.mark.parametrize("name", known.MINIMUM_DEVIATIONS)
def test_t2_prism_at_minimum_deviation(gl, name: str, walker: str) -> None:
    expected = known.MINIMUM_DEVIATIONS[name]
    incidence = float(np.arcsin(n_of(name, D_NM) / 2))
    start = incidence - known.APEX / 2
    arrangement = rigs.prism(name, incidence, start - np.radians(expected.deviations_deg[1]))
    rays = enough(WALKERS[walker](gl, arrangement, LINES, 256), 3, 100)
    for i, deviation_deg in enumerate(expected.deviations_deg):
        assert np.degrees(start - rays.heading[rays.line == i]) == pytest.approx(deviation_deg, rel=1e-5)
    if rays.columns:
        slope = -rays.dheading_dn()[rays.line == 1] * glasses.slope(name, D_NM)
        assert slope == pytest.approx(expected.slope_rad_um, rel=1e-4)


@walkers
@pytest.mark.parametrize("name", ["N-BK7", "F2", "N-SF11"])
def test_t3_slab_leaves_direction_without_dispersion(gl, name: str, walker: str) -> None:
    x, dx_dum = known.slab_advance(name)
    if name in known.SLABS:
        assert (x, dx_dum) == pytest.approx(known.SLABS[name], abs=6e-7)
    arrangement = rigs.slab_at_45(name)
    rays = enough(WALKERS[walker](gl, arrangement, (D_NM,), 256), 1, 100)
    # Straight at 45° but for the unit of thickness, which is crossed at a steeper angle.
    drop = rays.start[:, 2] + arrangement.near - 1
    assert rays.position[:, 0] - rays.start[:, 0] - drop == pytest.approx(x, abs=1e-4 * x + 1e-6)
    assert np.abs(rays.direction - arrangement.direction).max() < 2e-6
    if rays.columns:
        slope = glasses.slope(name, D_NM)
        assert rays.columns.photons.dposition_dn[:, 0] * slope == pytest.approx(dx_dum, rel=1e-4), "column"
        assert np.abs(rays.columns.ddirection_dn.mean(0) * slope).max() < 1e-6, "column"


def beside_axis(rays: Rays) -> tuple[np.ndarray, np.ndarray]:
    """(height (N,), unit vector (N, 3) away from the x axis) of each start."""
    height = np.linalg.norm(rays.start[:, 1:], axis=1)
    return height, rays.start * [0, 1, 1] / height[:, None]


def through_ball(height: float, n: float) -> np.ndarray:
    """Exact ball: (position, ∂/∂n) on the plane x = 1.2, as rows."""

    def landed(n: float) -> np.ndarray:
        ball = sphere((0, 0, 0), 1)
        inside = through(make_ray([-2, height, 0], [1, 0, 0]), ball, AIR, n)
        return onto(through(inside, ball, n, AIR, root=1), Plane((1.2, 0, 0), (1, 0, 0))).position

    return np.array([landed(n), (landed(n + 1e-5) - landed(n - 1e-5)) / 2e-5])


@walkers
def test_t4_ball_lens(gl, walker: str) -> None:
    rays = enough(WALKERS[walker](gl, rigs.ball(), LINES, 600), 3, 400)
    height, radial = beside_axis(rays)
    indices = [n_of("N-BK7", nm) for nm in LINES]
    exact = np.array([through_ball(h, indices[line]) for h, line in zip(height, rays.line, strict=True)])
    assert height.max() > 0.84
    # The facets of 330k triangles are 0.005 wide: second order leaves 5e-5.
    off = np.abs(dot(rays.position, radial) - exact[:, 0, 1])
    assert off.max() < 1e-4 and np.median(off) < 5e-5
    # Effective focal length from the innermost rays: y = h (1 - (x - principal plane)/f), principal plane in the
    # centre.
    focal_lengths = 1.2 / (1 - dot(rays.position, radial) / height)
    for line, expected in enumerate(known.BALL_FOCAL_LENGTHS):
        assert np.median(focal_lengths[(rays.line == line) & (height < 0.12)]) == pytest.approx(expected, rel=1e-2)
    if rays.columns:
        spectral = np.abs(dot(rays.columns.photons.dposition_dn, radial) - exact[:, 1, 1])
        assert np.median(spectral / np.abs(exact[:, 1, 1])) < 2e-3 and spectral.max() < 0.02


def focal_lengths(rays: Rays, radius: float) -> list[float]:
    """Of lenses on the z axis at the lines: height over the slope of the rays that leave, on the axis."""
    across = rays.start * [1, 1, 0]
    height = np.linalg.norm(across, axis=1)
    length = -(height**2) * rays.direction[:, 2] / dot(rays.direction, across)
    lines = [(rays.line == line) & (height > 0.2 * radius) for line in range(len(LINES))]
    # f falls as h²: what is left at h = 0.
    return [float(np.polyfit(height[line] ** 2, length[line], 2)[-1]) for line in lines]


@walkers
def test_t5_plano_convex_lens_on_the_axis(gl, walker: str) -> None:
    rays = enough(WALKERS[walker](gl, rigs.plano_convex(), LINES, 300), 3, 200)
    assert focal_lengths(rays, 0.2) == pytest.approx(known.PLANO_CONVEX_FOCAL_LENGTHS, rel=1e-4)


@walkers
def test_t6_aplanatic_sphere(gl, walker: str) -> None:
    lines = (D_NM, F_NM)
    rays = WALKERS[walker](gl, rigs.aplanatic_ball(), lines, 1500)
    angle = np.arccos(rays.start_direction[:, 0])
    across = rays.position * [0, 1, 1]
    image = rays.position[:, 0] - np.linalg.norm(across, axis=1) ** 2 * rays.direction[:, 0] / dot(
        rays.direction, across
    )

    def exact(angle_rad: float, nm: float) -> float:
        start = make_ray([-1 / N_BK7_D, 0, 0], [np.cos(angle_rad), np.sin(angle_rad), 0])
        ray = through(start, sphere((0, 0, 0), 1.0), n_of("N-BK7", nm), AIR, root=1)
        return float(ray.position[0] - ray.position[1] * ray.direction[0] / ray.direction[1])

    for line, nm in enumerate(lines):
        for low, high, tolerance in ((5, 50, 3e-4), (50, 70, 5e-4), (70, 81, 2e-3)):
            chosen = (rays.line == line) & (angle > np.radians(low)) & (angle < np.radians(high))
            assert np.count_nonzero(chosen) > 50
            want = np.array([exact(a, nm) for a in angle[chosen]])
            assert np.abs(image[chosen] - want).max() < tolerance
    for (nm, degrees), expected in known.APLANATIC_IMAGES.items():
        assert exact(np.radians(degrees), nm) == pytest.approx(expected, abs=6e-7)


def test_t7_cartesian_ellipsoid(gl) -> None:
    eccentricity = 1 / N_BK7_D
    short = np.sqrt(1 - eccentricity**2)
    solid = placed("ellipsoid", ellipsoid((1.0, short, short), 81_920), glass("N-BK7"))
    # The screen is in the far focus, inside the glass.
    target = screen((eccentricity, 0, 0), (1, 0, 0), 0.1)
    photons = trace_beam(
        gl, (solid,), None, target, (-2, 0, 0), (1, 0, 0), 0.6, [(nm, nm) for nm in LINES], count=400, max_depth=1
    )
    across = photons.start * [0, 1, 1]
    height = np.linalg.norm(across, axis=1)
    miss = dot(photons.position, across) / height
    for line, expected in enumerate(known.ELLIPSOID_MISSES):
        of_line = photons.band == line
        near = of_line & (np.abs(height - 0.3) < 0.1)
        # 82k facets leave 4e-6; float32 alone 1e-7.
        assert np.polyval(np.polyfit(height[near] - 0.3, miss[near], 2), 0.0) == pytest.approx(expected, abs=6e-6)
        if expected == 0.0:
            assert np.median(np.abs(miss[of_line])) < 6e-6
            assert np.abs(miss[of_line]).max() < 6e-5


def cross2(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def envelope(point: np.ndarray, direction: np.ndarray, dpoint: np.ndarray, ddirection: np.ndarray) -> np.ndarray:
    """(N, 2): where each ray of a plane family touches its caustic, by its own column."""
    return point - (cross2(dpoint, direction) / cross2(ddirection, direction))[:, None] * direction


def at(x: np.ndarray, y: np.ndarray, place: float, order: int = 3) -> float:
    """y(place) by a polynomial through its neighbours."""
    return float(np.polyval(np.polyfit(x - place, y, order), 0.0))


def test_t8_diacaustic_of_a_plane(gl) -> None:
    rays = WALKERS["light"](gl, rigs.block_over_a_point(), (D_NM,), 2000)
    columns = columns_of(rays)
    photons, angle = columns.photons, np.arccos(rays.start_direction[:, 2])
    radial = rays.start_direction * [1, 1, 0] / np.sin(angle)[:, None]
    # The column that turns the ray in its own plane of incidence: along |q| of the emission domain.
    outward = photons.q / np.linalg.norm(photons.q, axis=1)[:, None]

    def along(ds: np.ndarray, dt: np.ndarray) -> np.ndarray:
        return in_own_plane(outward[:, :1] * ds + outward[:, 1:] * dt)

    def in_own_plane(vectors: np.ndarray) -> np.ndarray:
        return np.column_stack([dot(vectors, radial), vectors[:, 2]])

    x, y = envelope(
        in_own_plane(rays.position - [0, 0, 1.5]),
        in_own_plane(rays.direction),
        along(photons.dposition_ds, photons.dposition_dt),
        along(columns.ddirection_ds, columns.ddirection_dt),
    ).T
    ordinary = (angle > np.radians(3)) & (angle < np.radians(38))
    assert np.count_nonzero(ordinary) > 120
    np.testing.assert_allclose(known.diacaustic_lame(x, y)[ordinary], 1, atol=1e-4)
    place = np.radians(known.DIACAUSTIC_DEG)
    near = np.abs(angle - place) < np.radians(3)
    found = [at(angle[near], values[near], place) for values in (x, y)]
    assert found == pytest.approx(known.DIACAUSTIC_POINT, rel=1e-4)


def test_t9_mirror_nephroid(gl) -> None:
    rays = WALKERS["light"](gl, rigs.cylinder_mirror(), (D_NM,), 600)
    columns = columns_of(rays)
    photons = columns.photons
    # The beam's own frame need not lie in the plane: the column by height.
    ds, dt = photons.emitter.domain.tangent[1], photons.emitter.domain.bitangent[1]
    caustic = envelope(
        rays.position[:, :2],
        rays.direction[:, :2],
        (ds * photons.dposition_ds + dt * photons.dposition_dt)[:, :2],
        (ds * columns.ddirection_ds + dt * columns.ddirection_dt)[:, :2],
    )
    t = np.arcsin(rays.start[:, 1])
    off = np.linalg.norm(caustic - known.nephroid(t), axis=1)
    # Beyond 33° light meets the mirror twice.
    assert len(t) > 350 and np.abs(t).max() > np.radians(33)
    # A column sees the facet's own slope: first order, 3/4096 of a radian here.
    assert off.max() < 2e-3 and np.median(off) < 5e-4
    # The slope has both signs on a facet, so a fit through many is of second order again.
    place = np.radians(known.NEPHROID_DEG)
    near, cusp = np.abs(t - place) < np.radians(6), np.abs(t) < np.radians(6)
    found = [at(t[near], caustic[near, axis], place) for axis in (0, 1)]
    assert found == pytest.approx(known.NEPHROID_POINT, abs=2e-4)
    assert at(t[cusp], caustic[cusp, 0], 0.0, 2) == pytest.approx(0.5, abs=2e-4)


@walkers
@pytest.mark.parametrize("reflections", known.RAINBOWS)
def test_t10_rainbows(gl, reflections: int, walker: str) -> None:
    radii_deg, dradius_dn = known.RAINBOWS[reflections]
    rays = WALKERS[walker](gl, rigs.rainbow(reflections), known.RAINBOW_LINES, 300)
    impact = np.linalg.norm(rays.start[:, 1:], axis=1)
    sine = np.linalg.norm(rays.direction[:, 1:], axis=1)
    radius = np.arctan2(sine, -rays.direction[:, 0])  # the angle from -x
    for line, (nm, expected_deg) in enumerate(zip(known.RAINBOW_LINES, radii_deg, strict=True)):
        turning = known.rainbow_height(n_of("water", nm), reflections)
        near = (rays.line == line) & (np.abs(impact - turning) < 0.03)
        assert np.count_nonzero(near) > 80
        fit = np.polynomial.Polynomial.fit(impact[near] - turning, radius[near], 4)
        # The stationary value, wherever it is.
        around = fit(np.linspace(-0.02, 0.02, 401))
        extreme = around.max() if reflections == 1 else around.min()
        assert np.degrees(extreme) == pytest.approx(expected_deg, rel=1e-4)
        assert fit.deriv()(0.0) == pytest.approx(0.0, abs=0.02)
        if nm == D_NM and rays.columns:
            dradius = rays.columns.ddirection_dn[:, 0, 0] / sine
            slope = np.polynomial.Polynomial.fit(impact[near] - turning, dradius[near], 3)(0.0)
            # First order in the facets' width, three or four surfaces.
            assert slope == pytest.approx(dradius_dn, rel=5e-3)


@walkers
def test_t11_achromat_of_two_thin_lenses(gl, walker: str) -> None:
    assert known.achromat_parts() == pytest.approx(known.ACHROMAT_PARTS, abs=6e-5)
    arrangement, exact = rigs.achromat()
    got = focal_lengths(enough(WALKERS[walker](gl, arrangement, LINES, 300), 3, 200), 0.45)
    # The same real lenses in float64, and the thin ones of the table: 6e-4 apart by their thickness.
    assert got == pytest.approx(exact, rel=3e-5)
    assert got == pytest.approx(known.ACHROMAT_FOCAL_LENGTHS, rel=7e-4)
    # What an achromat is: F and C together, d a twentieth of a unit before them. Float32 leaves 2e-3.
    assert got[0] - got[2] == pytest.approx(exact[0] - exact[2], abs=4e-3)
    assert 0.5 * (got[0] + got[2]) - got[1] == pytest.approx(0.04996, abs=4e-3)


@walkers
def test_t12_amici_prism_of_three_touching_solids(gl, walker: str) -> None:
    rays = enough(WALKERS[walker](gl, rigs.amici(), tuple(known.AMICI_DEVIATIONS_DEG), 60), 4, 30)
    for line, (nm, expected_deg) in enumerate(known.AMICI_DEVIATIONS_DEG.items()):
        heading = rays.heading[rays.line == line]
        assert np.degrees(heading) == pytest.approx(expected_deg, rel=1e-4, abs=1e-4), f"deviation at {nm}"
    if rays.columns:
        of_d = rays.line == 1
        slope = sum(rays.dheading_dn(g)[of_d] * glasses.slope(name, D_NM) for g, name in enumerate(("N-BK7", "N-SF11")))
        assert slope == pytest.approx(known.AMICI_SLOPE, rel=1e-4), "slope"


def test_t13_band_split_by_total_reflection(gl) -> None:
    # Straight into one face of a prism, so that the other is met at the apex angle.
    apex = np.radians(known.SPLIT_DEG)
    solid = extruded("splitter", rigs.tilted_section(apex))
    direction = in_plane(-apex / 2)
    entry = np.array([-np.sin(apex / 2) * 0.6, np.cos(apex / 2) * 0.4, 0])
    photons = trace_beam(
        gl, solid, glass("N-BK7"), screen([2, 0, 0], [1, 0, 0]), entry - direction, direction, 0.03, (400.0, 700.0)
    ).of_depth(2)
    passed = photons.where(photons.records["x_hi"] > photons.axis.x_of_nm(699.0))
    assert len(passed.records) > 50
    split_nm = photons.axis.nm_of_x(passed.records["x_lo"])
    # x is stored in 24 bits and n in 1e-7: dλ = dn/n' is about 2e-3 nm.
    assert split_nm == pytest.approx(known.SPLIT_NM, abs=0.05)
    assert photons.tally.fallbacks["band_cut"] >= len(passed.records)
    # Nothing shorter got out here.
    assert (photons.axis.nm_of_x(photons.records["x_lo"]) > known.SPLIT_NM - 0.14).all()
    assert photons.tally.imbalance < FLUX_CLOSURE


@walkers
@pytest.mark.parametrize("name", known.SPECTRA)
def test_t14_prism_spectrum_on_a_screen(gl, name: str, walker: str) -> None:
    _, x_mm, dnm_dmm = known.SPECTRA[name]
    incidence = float(np.arcsin(n_of(name, 550.0) / 2))
    straight = known.APEX / 2 - incidence
    rays = enough(WALKERS[walker](gl, rigs.prism(name, incidence, straight), known.SPECTRUM_NM, 256), 4, 100)
    for line, nm in enumerate(known.SPECTRUM_NM):
        of_line = rays.line == line
        off = straight - rays.heading[of_line]
        # Near the axis 1e-4 of so small an angle is below what float32 holds: 1e-6 rad.
        assert 1000 * np.median(np.tan(off)) == pytest.approx(x_mm[line], rel=1e-4, abs=1e-3)
        assert np.abs(1000 * np.tan(off) - x_mm[line]).max() < 5e-3  # each ray's angle to 5e-6 rad
        if dnm_dmm and rays.columns:
            dmm_dnm = -rays.dheading_dn()[of_line] * glasses.slope(name, nm) / np.cos(off) ** 2
            assert -1 / dmm_dnm == pytest.approx(dnm_dmm[line], rel=1e-4)


def on_fold_plane(gl, radius: float, lines: tuple[float, ...], count: int) -> tuple[Photons, np.ndarray, np.ndarray]:
    """T15: (photons straight through the ball, their height, where they land)."""
    beam = (-3, 0, 0), (1, 0, 0), radius, [(nm, nm) for nm in lines]
    target = screen([known.FOLD_PLANE, 0, 0], [1, 0, 0])
    photons = trace_beam(gl, ball_mesh(81_920), glass("N-BK7"), target, *beam, count=count).of_depth(2)
    height, landed = (np.linalg.norm(places[:, 1:], axis=1) for places in (photons.start, photons.position))
    return photons, height, landed


def test_t15_energy_near_the_fold_of_a_ball(gl) -> None:
    # One photon a lattice point, all of the same weight before Fresnel: counting them leaves Fresnel out.
    photons, height, landed = on_fold_plane(gl, 1.0, (D_NM,), 60_000)
    emitted, fold = photons.lattice_in_disc, known.FOLD_RADII[1]
    assert len(landed) / emitted == pytest.approx(0.99505, abs=1e-3)  # above h = 0.99752 the ball turns light back
    rings = [np.count_nonzero((landed >= s * fold) & (landed <= fold)) / emitted for s in (0.9, 0.99)]
    assert rings[0] == pytest.approx(known.FOLD_SHARES[0.9], rel=2e-3)
    # The narrow ring is 6e-4 wide and the facets blur it by a tenth of that: it loses at the outer edge what sqrt says.
    assert rings[1] == pytest.approx(known.FOLD_SHARES[0.99], rel=3e-2)
    assert np.count_nonzero(landed <= fold) / emitted == pytest.approx(known.FOLD_INSIDE, rel=1e-3)
    # On the fold itself the footprint collapses: dr/dh changes sign with h.
    near = np.abs(height - known.FOLD_HEIGHT) < 0.004
    assert landed[near].max() == pytest.approx(fold, rel=2e-3)


def test_t15_fold_of_each_line(gl) -> None:
    photons, height, landed = on_fold_plane(gl, 0.55, LINES, 3000)
    for line, fold in enumerate(known.FOLD_RADII):
        near = (photons.band == line) & (np.abs(height - 0.5) < 0.05)
        # The largest radius of a parabola through them; facets leave 1e-5.
        c, b, a = np.polynomial.polynomial.polyfit(height[near] - 0.5, landed[near], 2)
        assert c - b * b / (4 * a) == pytest.approx(fold, rel=1e-3)


@pytest.mark.parametrize("angle_deg", [*FRESNEL, BREWSTER_DEG])
def test_t16_fresnel_of_a_slab(gl, angle_deg: float) -> None:
    angle = np.radians(angle_deg)
    # At Brewster's angle no p-light is reflected: half of the other.
    r = FRESNEL.get(angle_deg, 0.5 * np.cos(2 * angle) ** 2)
    direction = np.array([np.sin(angle), 0, -np.cos(angle)])
    start, block = np.array([0, 0, 0.5]) - 3 * direction, slab(12.0, 12.0, 1.0)
    expected = {
        (REFLECTED,): r,
        (REFRACTED, REFRACTED): (1 - r) ** 2,
        (REFRACTED, REFLECTED, REFRACTED): (1 - r) ** 2 * r,
        (REFRACTED, REFLECTED, REFLECTED, REFRACTED): (1 - r) ** 2 * r**2,
    }
    seen = set()
    for target in (screen((0, 0, -4), (0, 0, 1)), screen((0, 0, 9), (0, 0, 1))):
        photons = trace_beam(gl, block, glass("N-BK7"), target, start, direction, 0.2, D_NM, count=60, max_depth=5)
        for path, share in expected.items():
            taken = photons.of_choices(*path)
            if len(taken.records):
                seen.add(path)
                assert len(taken.records) == photons.lattice_in_disc
                assert taken.records["flux_w"] / taken.weight == pytest.approx(share, rel=1e-4)
    assert seen == set(expected)
