"""Geometric optics with closed answers, through the float64 reference tracer at 1e-6.

The numbers on the right are the literature's formulas evaluated on their own; the tracer
knows only Snell's law and its derivatives. All happens in the x-y plane, light runs along +x,
columns are with respect to the refractive index or the height h unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from reference.surfaces import Plane, Quadric, sphere
from reference.tracer import (
    AIR,
    Index,
    Ray,
    make_ray,
    onto,
    refracted,
    through,
)
from spectrasplat.reference import glasses, optics
from spectrasplat.reference.glasses import C_NM, D_NM, F_NM

N_BK7_D = float(glasses.index("N-BK7", D_NM))
BALL = sphere((0.0, 0.0, 0.0), 1.0)


def per_index(glass: str, nm: float) -> Index:
    """A glass whose single column is with respect to its own refractive index."""
    return Index(float(glasses.index(glass, nm)), 1.0)


def per_um(glass: str, nm: float) -> Index:
    """A glass whose single column is with respect to wavelength in micrometres."""
    return Index(float(glasses.index(glass, nm)), float(glasses.slope(glass, nm)))


def heading(ray: Ray) -> float:
    """Angle of the direction from +x, radians."""
    return float(np.arctan2(ray.direction[1], ray.direction[0]))


def dheading(ray: Ray, column: int = 0) -> float:
    """Derivative of the heading along a column."""
    (x, y, _), (dx, dy, _) = ray.direction, ray.ddirection[column]
    return float((x * dy - y * dx) / (x * x + y * y))


def axis_crossing(ray: Ray) -> float:
    """x where the ray's line meets the axis y = 0."""
    return float(ray.position[0] - ray.position[1] * ray.direction[0] / ray.direction[1])


def envelope(ray: Ray) -> np.ndarray:
    """Caustic point of a plane one-parameter family: where its column becomes parallel to the ray."""

    def cross(a, b):
        return a[0] * b[1] - a[1] * b[0]

    return ray.at(-cross(ray.dposition[0], ray.direction) / cross(ray.ddirection[0], ray.direction))


def zero_of(function: Callable[[float], float], low: float, high: float) -> float:
    """Root by bisection to the last bit; the ends must differ in sign."""
    sign = np.sign(function(low))
    assert sign != np.sign(function(high))
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        low, high = (middle, high) if np.sign(function(middle)) == sign else (low, middle)


def tilted(x: float, angle_rad: float) -> Plane:
    """A plane through (x, 0, 0) whose normal is +x turned by an angle."""
    return Plane((x, 0.0, 0.0), (np.cos(angle_rad), np.sin(angle_rad), 0.0))


def across_prism(incidence_rad: float, glass: Index, apex_rad: float = np.pi / 3) -> tuple[float, float]:
    """(deviation, its derivative along the glass's column) of a prism with its apex up; both positive down."""
    start = make_ray(
        [-1, 0, 0], [np.cos(incidence_rad - apex_rad / 2), np.sin(incidence_rad - apex_rad / 2), 0], [[0, 0, 0]]
    )
    inside = through(start, tilted(0.0, np.pi - apex_rad / 2), AIR, glass)
    out = through(inside, tilted(1.0, apex_rad / 2), glass, AIR)
    return heading(start) - heading(out), -dheading(out)


@pytest.mark.parametrize(
    ("glass", "n_fdc", "abbe", "slope_per_um"),
    [
        ("N-BK7", (1.522376, 1.516800, 1.514322), 64.167, -0.041799),
        ("F2", (1.632081, 1.620040, 1.615032), 36.366, -0.086493),
        ("N-SF11", (1.806513, 1.784720, 1.775955), 25.680, -0.152878),
        ("diamond", (2.435538, 2.417486, 2.409906), 55.301, -0.131002),
        ("water", (1.337492, 1.333403, 1.331513), 55.760, -0.031340),
        ("fused silica", (1.463126, 1.458464, 1.456367), 67.821, -0.035215),
    ],
)
def test_t1_glasses(glass: str, n_fdc: tuple[float, ...], abbe: float, slope_per_um: float) -> None:
    n_f, n_d, n_c = glasses.index(glass, np.array([F_NM, D_NM, C_NM]))
    np.testing.assert_allclose((n_f, n_d, n_c), n_fdc, atol=6e-7)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(abbe, abs=6e-4)
    assert glasses.slope(glass, D_NM) == pytest.approx(slope_per_um, abs=6e-7)


@pytest.mark.parametrize(
    ("glass", "incidence_deg", "deviations_deg", "slope_rad_um"),
    [
        ("N-BK7", 49.32335, (39.13905, 38.64670, 38.42932), -0.064130),
        ("F2", 54.09789, (49.38809, 48.19578, 47.70902), -0.147498),
        ("N-SF11", 63.17131, (69.25084, 66.34263, 65.24956), -0.338731),
    ],
)
def test_t2_prism_at_minimum_deviation(
    glass: str, incidence_deg: float, deviations_deg: tuple[float, ...], slope_rad_um: float
) -> None:
    apex = np.pi / 3
    incidence = float(np.arcsin(glasses.index(glass, D_NM) * np.sin(apex / 2)))
    assert np.degrees(incidence) == pytest.approx(incidence_deg, abs=6e-6)
    deviation, slope = across_prism(incidence, per_um(glass, D_NM))
    assert slope == pytest.approx(slope_rad_um, abs=6e-7)
    closed = 2 * np.sin(apex / 2) * glasses.slope(glass, D_NM) / np.cos((apex + deviation) / 2)
    assert slope == pytest.approx(closed, rel=1e-12)
    # All lines at the d line's incidence.
    for nm, expected_deg in zip((F_NM, D_NM, C_NM), deviations_deg, strict=True):
        assert np.degrees(across_prism(incidence, per_um(glass, nm))[0]) == pytest.approx(expected_deg, abs=6e-6)
    # It is the minimum: where the path is symmetric.
    neighbours = [across_prism(incidence + e, per_um(glass, D_NM))[0] for e in (-1e-3, 1e-3)]
    assert deviation < min(neighbours) < deviation + 1e-5
    assert deviation == pytest.approx(2 * incidence - apex, abs=1e-14)


@pytest.mark.parametrize(
    ("glass", "x", "dx_dum", "shift"), [("N-BK7", 0.526946, 0.018554, 0.334499), ("N-SF11", 0.431514, 0.043846, None)]
)
def test_t3_slab_leaves_direction_without_dispersion(glass: str, x: float, dx_dum: float, shift: float | None) -> None:
    index = per_um(glass, D_NM)
    start = make_ray([-1, 1, 0], [1, -1, 0], [[0, 0, 0]])
    inside = through(start, Plane((0, 0, 0), (0, 1, 0)), AIR, index)
    out = through(inside, Plane((0, -1, 0), (0, 1, 0)), index, AIR)
    assert out.position[0] == pytest.approx(x, abs=6e-7)
    assert out.dposition[0] == pytest.approx([dx_dum, 0, 0], abs=6e-7)
    assert inside.ddirection[0, 0] > 0.01  # there was something to cancel
    np.testing.assert_allclose(out.ddirection[0], 0, atol=1e-15)
    np.testing.assert_allclose(out.direction, start.direction, atol=1e-15)
    if shift is not None:
        assert np.linalg.norm(np.cross(out.position, out.direction)) == pytest.approx(shift, abs=6e-7)


@pytest.mark.parametrize("glass", ["N-BK7", "F2", "N-SF11"])
@pytest.mark.parametrize("nm", [F_NM, D_NM, C_NM])
def test_t3_t4_t5_formulas_in_every_glass(glass: str, nm: float) -> None:
    """Slab, ball and plano-convex lens against their formulas where the table prints no number."""
    index, n, slope, s = (
        per_um(glass, nm),
        float(glasses.index(glass, nm)),
        float(glasses.slope(glass, nm)),
        np.sin(np.pi / 4),
    )
    inside = through(make_ray([-1, 1, 0], [1, -1, 0], [[0, 0, 0]]), Plane((0, 0, 0), (0, 1, 0)), AIR, index)
    out = through(inside, Plane((0, -1, 0), (0, 1, 0)), index, AIR)
    assert out.position[0] == pytest.approx(s / np.sqrt(n * n - s * s), rel=1e-12)
    assert out.dposition[0, 0] == pytest.approx(-s * n * slope / (n * n - s * s) ** 1.5, rel=1e-12)
    np.testing.assert_allclose(out.ddirection, 0, atol=1e-15)
    assert -1 / through_ball(0.0, per_index(glass, nm)).ddirection[1, 1] == pytest.approx(n / (2 * (n - 1)), rel=1e-12)
    for height in (0.5, 0.8):
        ball, r = through_ball(height, per_index(glass, nm)), np.arcsin(height / n)
        assert -heading(ball) == pytest.approx(2 * (np.arcsin(height) - r), rel=1e-12)
        assert -dheading(ball) == pytest.approx(2 * np.tan(r) / n, rel=1e-12)
    flat = through(make_ray([-2, 0, 0], [1, 0, 0], [[0, 1, 0]]), Plane((0.5, 0, 0), (-1, 0, 0)), AIR, Index(n))
    assert -1 / through(flat, BALL, Index(n), AIR, root=1).ddirection[0, 1] == pytest.approx(1 / (n - 1), rel=1e-12)


def through_ball(height: float, index: Index) -> Ray:
    """A ray parallel to the axis through the unit ball; column 0 by its variable, column 1 by height."""
    columns = [[0, 0, 0], [0, 1, 0]]
    index = Index(index.n, np.array([float(index.dn), 0.0]))
    inside = through(make_ray([-2, height, 0], [1, 0, 0], columns), BALL, AIR, index)
    return through(inside, BALL, index, AIR, root=1)


@pytest.mark.parametrize(("nm", "focal_length"), [(F_NM, 1.45716), (D_NM, 1.46749), (C_NM, 1.47215)])
def test_t4_ball_lens_on_the_axis(nm: float, focal_length: float) -> None:
    index = per_index("N-BK7", nm)
    paraxial = -1 / through_ball(0.0, index).ddirection[1, 1]
    assert paraxial == pytest.approx(focal_length, abs=6e-6)
    assert paraxial == pytest.approx(index.n / (2 * (index.n - 1)), rel=1e-12)


@pytest.mark.parametrize(
    ("height", "deviation_deg", "crossing", "ddeviation_dn"),
    [(0.5, 21.505984, 1.363890, 0.460386), (0.8, 42.596776, 1.181973, 0.818556)],
)
def test_t4_ball_lens_off_the_axis(height: float, deviation_deg: float, crossing: float, ddeviation_dn: float) -> None:
    ray = through_ball(height, per_index("N-BK7", D_NM))
    assert np.degrees(-heading(ray)) == pytest.approx(deviation_deg, abs=6e-7)
    assert axis_crossing(ray) == pytest.approx(crossing, abs=6e-7)
    assert -dheading(ray) == pytest.approx(ddeviation_dn, abs=6e-7)


@pytest.mark.parametrize(("nm", "focal_length"), [(F_NM, 1.91433), (D_NM, 1.93498), (C_NM, 1.94431)])
def test_t5_plano_convex_lens_on_the_axis(nm: float, focal_length: float) -> None:
    index = Index(float(glasses.index("N-BK7", nm)))
    inside = through(make_ray([-2, 0, 0], [1, 0, 0], [[0, 1, 0]]), Plane((0.5, 0, 0), (-1, 0, 0)), AIR, index)
    out = through(inside, BALL, index, AIR, root=1)
    assert -1 / out.ddirection[0, 1] == pytest.approx(focal_length, abs=6e-6)


@pytest.mark.parametrize(
    ("nm", "angle_deg", "image"),
    [(D_NM, a, -1.516800) for a in (1, 10, 45, 80, 89)] + [(F_NM, 10, -1.5309890), (F_NM, 80, -1.5635224)],
)
def test_t6_aplanatic_sphere(nm: float, angle_deg: float, image: float) -> None:
    angle = np.radians(angle_deg)
    start = make_ray([-1 / N_BK7_D, 0, 0], [np.cos(angle), np.sin(angle), 0])
    out = through(start, BALL, Index(float(glasses.index("N-BK7", nm))), AIR, root=1)
    assert axis_crossing(out) == pytest.approx(image if nm == F_NM else -N_BK7_D, abs=1e-7)
    assert axis_crossing(out) == pytest.approx(image, abs=6e-7)


def test_t7_cartesian_ellipsoid() -> None:
    eccentricity = 1 / N_BK7_D
    solid = Quadric((0, 0, 0), (1, np.sqrt(1 - eccentricity**2), np.sqrt(1 - eccentricity**2)))
    focal_plane = Plane((eccentricity, 0, 0), (1, 0, 0))

    def miss(nm: float, height: float) -> float:
        index = Index(float(glasses.index("N-BK7", nm)))
        return float(onto(through(make_ray([-2, height, 0], [1, 0, 0]), solid, AIR, index), focal_plane).position[1])

    assert 1 + eccentricity == pytest.approx(1.659283, abs=6e-7)
    for height in (0.01, 0.3, 0.6, 0.7):
        assert abs(miss(D_NM, height)) < 1e-15
    assert miss(F_NM, 0.3) == pytest.approx(-0.002093068, abs=6e-10)
    assert miss(C_NM, 0.3) == pytest.approx(0.000934928, abs=6e-10)
    # A perfect focus is where the footprint vanishes.
    glass = Index(N_BK7_D)
    inside = through(make_ray([-2, 0.3, 0.1], [1, 0, 0], [[0, 1, 0], [0, 0, 1]]), solid, AIR, glass)
    np.testing.assert_allclose(onto(inside, focal_plane).dposition, 0, atol=1e-15)


def test_t8_diacaustic_of_a_plane() -> None:
    angle = np.radians(25)
    # A point in glass at depth 1 under the plane y = 0; the column turns the ray about the point.
    start = make_ray([0, -1, 0], [np.sin(angle), np.cos(angle), 0], [[0, 0, 0]], [[np.cos(angle), -np.sin(angle), 0]])
    x, y, _ = envelope(through(start, Plane((0, 0, 0), (0, 1, 0)), Index(N_BK7_D), AIR))
    assert (x, y) == (pytest.approx(0.131883, abs=6e-7), pytest.approx(-0.400415, abs=6e-7))
    lame = (N_BK7_D * -y) ** (2 / 3) + (np.sqrt(N_BK7_D**2 - 1) * x) ** (2 / 3)
    assert lame == pytest.approx(1, abs=1e-13)


@pytest.mark.parametrize("t_deg", [0.0, 10.0, 30.0, 60.0, 80.0])
def test_t9_mirror_nephroid(t_deg: float) -> None:
    t = np.radians(t_deg)
    start = make_ray([-2, np.sin(t), 0], [1, 0, 0], [[0, 1, 0]])
    point = envelope(through(start, BALL, AIR, AIR, root=1, mirror=True))
    expected = [(3 * np.cos(t) - np.cos(3 * t)) / 4, (3 * np.sin(t) - np.sin(3 * t)) / 4, 0]
    np.testing.assert_allclose(point, expected, atol=1e-14)
    if t_deg == 30.0:
        np.testing.assert_allclose(point[:2], [0.649519, 0.125], atol=6e-7)


@pytest.mark.parametrize(
    ("bounces", "radii_deg", "dradius_dn"),
    [(1, (40.5674, 42.0195, 42.4405), -2.53492), (2, (53.6198, 50.9964, 50.2379), 4.57002)],
)
def test_t10_rainbows(bounces: int, radii_deg: tuple[float, ...], dradius_dn: float) -> None:
    def out(height: float, index: Index) -> Ray:
        index = Index(index.n, np.array([1.0, 0.0]))
        ray = through(make_ray([-2, height, 0], [1, 0, 0], [[0, 0, 0], [0, 1, 0]]), BALL, AIR, index)
        for _ in range(bounces):
            ray = through(ray, BALL, index, index, root=1, mirror=True)
        return through(ray, BALL, index, AIR, root=1)

    for nm, expected in zip((400.0, D_NM, 700.0), radii_deg, strict=True):
        index = Index(float(glasses.index("water", nm)))
        turning = zero_of(lambda h, index=index: dheading(out(h, index), column=1), 0.5, 0.999)
        n, k = index.n, bounces
        assert np.sqrt(1 - turning**2) == pytest.approx(np.sqrt((n * n - 1) / (k * (k + 2))), abs=1e-9)
        ray = out(turning, index)
        radius = np.arccos(-ray.direction[0])
        assert np.degrees(radius) == pytest.approx(expected, abs=6e-5)
        if nm == D_NM:
            towards = -np.sign(ray.direction[1])  # the radius is the angle from -x
            assert towards * dheading(ray) == pytest.approx(dradius_dn, abs=6e-6)


def test_t11_thin_achromat() -> None:
    def power(glass: str, nm: float | np.ndarray) -> np.ndarray:
        return (glasses.index(glass, nm) - 1) / (glasses.index(glass, D_NM) - 1)

    def abbe(glass: str) -> float:
        n_f, n_d, n_c = glasses.index(glass, np.array([F_NM, D_NM, C_NM]))
        return float((n_d - 1) / (n_f - n_c))

    v1, v2 = abbe("N-BK7"), abbe("F2")
    phi1, phi2 = 0.01 * v1 / (v1 - v2), -0.01 * v2 / (v1 - v2)
    assert (1 / phi1, 1 / phi2) == (pytest.approx(43.3255, abs=6e-5), pytest.approx(-76.4463, abs=6e-5))

    # The same two lenses as thin real ones, back to back: four vertices within 4e-9 of the origin.
    def focal_length(nm: float) -> float:
        ray = make_ray([-1, 0, 0], [1, 0, 0], [[0, 1, 0]])
        x = 0.0
        for phi, glass in ((phi1, "N-BK7"), (phi2, "F2")):
            index = Index(float(glasses.index(glass, nm)))
            radius = (float(glasses.index(glass, D_NM)) - 1) / phi  # plano-curved: R = (n - 1)/φ
            curved = sphere((x + radius, 0, 0), abs(radius))
            ray = through(ray, curved, AIR, index, root=0 if radius > 0 else 1)
            ray = through(ray, Plane((x + 1e-9, 0, 0), (1, 0, 0)), index, AIR)
            x += 2e-9
        return float(-1 / ray.ddirection[0, 1])

    assert focal_length(D_NM) == pytest.approx(100, abs=1e-6)
    assert focal_length(F_NM) == pytest.approx(100.04996, abs=6e-6)
    assert focal_length(C_NM) == pytest.approx(100.04996, abs=6e-6)

    def dfocus(um: float) -> float:
        # f = 1/(φ1 p1 + φ2 p2): stationary where the slopes of the powers cancel.
        return float(
            phi1 * glasses.slope("N-BK7", um * 1e3) / (glasses.index("N-BK7", D_NM) - 1)
            + phi2 * glasses.slope("F2", um * 1e3) / (glasses.index("F2", D_NM) - 1)
        )

    assert zero_of(dfocus, 0.5, 0.62) == pytest.approx(0.5565, abs=6e-5)


def test_t12_amici_prism() -> None:
    tilt = np.radians(31.388079)
    faces = [tilted(0.0, tilt), tilted(1.0, -np.pi / 4), tilted(2.0, np.pi / 4), tilted(3.0, -tilt)]

    def out(nm: float) -> Ray:
        crown, flint = per_um("N-BK7", nm), per_um("N-SF11", nm)
        ray = make_ray([-1, 0, 0], [1, 0, 0], [[0, 0, 0]])
        media = [AIR, crown, flint, crown, AIR]
        for face, n_i, n_t in zip(faces, media[:-1], media[1:], strict=True):
            ray = through(ray, face, n_i, n_t)
        return ray

    assert abs(np.degrees(heading(out(D_NM)))) < 1e-6
    sign = np.sign(dheading(out(D_NM)))
    assert sign * dheading(out(D_NM)) == pytest.approx(0.257201, abs=6e-7)
    for nm, expected_deg in ((F_NM, -2.21096), (C_NM, 0.82305), (400.0, -6.65042)):
        assert sign * np.degrees(heading(out(nm))) == pytest.approx(expected_deg, abs=6e-6)


def test_t13_band_split_by_total_reflection() -> None:
    internal = np.radians(41.10)
    ray = make_ray([0, -1, 0], [np.sin(internal), np.cos(internal), 0])

    def passes(nm: float) -> float:
        n = float(glasses.index("N-BK7", nm))
        out = refracted(ray, np.array([0, -1.0, 0]), np.zeros((0, 3)), Index(n), AIR)
        return -1.0 if out is None else 1.0

    split = zero_of(passes, 400.0, 700.0)
    assert split == pytest.approx(503.239, abs=6e-4)
    assert glasses.index("N-BK7", split) == pytest.approx(1.521201, abs=6e-7)
    assert (passes(split - 1), passes(split + 1)) == (-1.0, 1.0)


@pytest.mark.parametrize(
    ("glass", "incidence_deg", "x_mm", "dnm_dmm"),
    [
        ("N-BK7", 49.39911, (19.1320, 4.4542, -3.4169, -8.3520), (4.788, 9.743, 16.545, 24.675)),
        ("N-SF11", 63.58268, (143.1368, 26.3026, -18.2710, -41.9603), None),
    ],
)
def test_t14_prism_spectrum_on_a_screen(
    glass: str, incidence_deg: float, x_mm: tuple[float, ...], dnm_dmm: tuple[float, ...] | None
) -> None:
    incidence = float(np.arcsin(glasses.index(glass, 550.0) * 0.5))
    assert np.degrees(incidence) == pytest.approx(incidence_deg, abs=6e-6)
    centre, _ = across_prism(incidence, per_um(glass, 550.0))
    for i, nm in enumerate((400.0, 500.0, 600.0, 700.0)):
        deviation, slope = across_prism(incidence, per_um(glass, nm))
        assert 1000 * np.tan(deviation - centre) == pytest.approx(x_mm[i], abs=6e-5)
        if dnm_dmm:
            dmm_dnm = slope / np.cos(deviation - centre) ** 2  # rad/um = mm/nm at one metre
            assert -1 / dmm_dnm == pytest.approx(dnm_dmm[i], abs=6e-4)


def test_t15_energy_near_the_fold_of_a_ball() -> None:
    screen = Plane((1.2, 0, 0), (1, 0, 0))

    def landing(height: float, nm: float = D_NM) -> tuple[float, float]:
        ray = onto(through_ball(height, per_index("N-BK7", nm)), screen)
        return float(ray.position[1]), float(ray.dposition[1, 1])

    def fold(nm: float) -> tuple[float, float]:
        height = zero_of(lambda h: landing(h, nm)[1], 0.2, 0.8)
        return height, landing(height, nm)[0]

    height, radius = fold(D_NM)
    assert height == pytest.approx(0.5028279, abs=6e-8)
    assert radius == pytest.approx(0.06458174, abs=6e-9)
    assert fold(F_NM)[1] == pytest.approx(0.0615807, abs=6e-8)
    assert fold(C_NM)[1] == pytest.approx(0.0659364, abs=6e-8)

    def flux_beyond(inner: float) -> float:
        """Share of a unit disc beam that lands between `inner` and the ring, from the heights at the edges."""
        rising = zero_of(lambda h: landing(h)[0] - inner, 0.0, height)
        falling = zero_of(lambda h: landing(h)[0] - inner, height, 0.99)
        # Rays near the rim cross the axis before the screen and meet the ring from the other side.
        crossed_in = zero_of(lambda h: landing(h)[0] + inner, height, 0.99)
        crossed_out = zero_of(lambda h: landing(h)[0] + radius, height, 0.99)
        return falling**2 - rising**2 + crossed_out**2 - crossed_in**2

    for share, expected in ((0.9, 0.237054), (0.99, 0.0740836), (0.999, 0.0232736)):
        assert flux_beyond(share * radius) == pytest.approx(expected, abs=1e-6)
    # Inside the ring: every height below the one that leaves it on the far side.
    assert zero_of(lambda h: landing(h)[0] + radius, height, 0.99) ** 2 == pytest.approx(0.717808, abs=6e-7)


@pytest.mark.parametrize(("angle_deg", "reflectance"), [(0, 0.042165), (45, 0.052595), (60, 0.091958), (75, 0.256144)])
def test_t16_fresnel(angle_deg: float, reflectance: float) -> None:
    angle = np.radians(angle_deg)
    direction = np.array([np.sin(angle), -np.cos(angle), 0])
    up = np.array([0, 1.0, 0])
    assert optics.fresnel_reflectance(direction, up, 1 / N_BK7_D) == pytest.approx(reflectance, abs=6e-7)
    # The same interface from the other side reflects the same share (Stokes).
    inside = optics.refract(direction, up, 1 / N_BK7_D)
    assert optics.fresnel_reflectance(inside, up * np.sign(-inside[1]), N_BK7_D) == pytest.approx(reflectance, abs=6e-7)


def test_t16_brewster() -> None:
    brewster = np.arctan(N_BK7_D)
    assert np.degrees(brewster) == pytest.approx(56.6038, abs=6e-5)
    direction = np.array([np.sin(brewster), -np.cos(brewster), 0])
    beyond = optics.refract(direction, np.array([0, 1.0, 0]), 1 / N_BK7_D)
    mirrored = optics.reflect(direction, np.array([0, 1.0, 0]))
    assert abs(beyond @ mirrored) < 1e-15  # the refracted and reflected rays are at right angles
    # There p-light is not reflected: half the s-reflectance is all there is.
    s = (np.cos(brewster) - N_BK7_D * -beyond[1]) / (np.cos(brewster) + N_BK7_D * -beyond[1])
    assert optics.fresnel_reflectance(direction, np.array([0, 1.0, 0]), 1 / N_BK7_D) == pytest.approx(
        s * s / 2, rel=1e-12
    )
