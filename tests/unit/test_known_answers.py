"""Geometric optics with closed answers, through the tests' own float64 tracer at 1e-6: one answer of each kind (glass,
refraction and its derivative, curved faces, mirrors, total reflection, Fresnel). All of T1 to T16,
through the shaders: `tests/gpu/test_known_answers_*.py`.

The numbers on the right are the literature's formulas evaluated on their own; the tracer
knows only Snell's law and its derivatives. All happens in the x-y plane, light runs along +x,
columns are with respect to the refractive index or the height h unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from reference import known_answers as known
from reference.known_answers import LINES, N_BK7_D
from reference.surfaces import Plane, sphere
from reference.textbook_optics import fresnel_reflectance
from reference.tracer import AIR, Index, Ray, make_ray, refracted, through
from spectrasplat.reference import glasses, optics
from spectrasplat.reference.glasses import D_NM

pytestmark = pytest.mark.core

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


@pytest.mark.parametrize("glass", known.INDEX_TABLES)
def test_t1_glasses(glass: str) -> None:
    expected = known.INDEX_TABLES[glass]
    n_f, n_d, n_c = glasses.index(glass, np.array(LINES))
    np.testing.assert_allclose((n_f, n_d, n_c), expected.n_fdc, atol=6e-7)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(expected.abbe, abs=6e-4)
    assert glasses.slope(glass, D_NM) == pytest.approx(expected.slope_per_um, abs=6e-7)


@pytest.mark.parametrize("glass", known.MINIMUM_DEVIATIONS)
def test_t2_prism_at_minimum_deviation(glass: str) -> None:
    expected, apex = known.MINIMUM_DEVIATIONS[glass], known.APEX
    incidence = float(np.arcsin(glasses.index(glass, D_NM) * np.sin(apex / 2)))
    assert np.degrees(incidence) == pytest.approx(expected.incidence_deg, abs=6e-6)
    deviation, slope = across_prism(incidence, per_um(glass, D_NM))
    assert slope == pytest.approx(expected.slope_rad_um, abs=6e-7)
    closed = 2 * np.sin(apex / 2) * glasses.slope(glass, D_NM) / np.cos((apex + deviation) / 2)
    assert slope == pytest.approx(closed, rel=1e-12)
    # All lines at the d line's incidence.
    for nm, expected_deg in zip(LINES, expected.deviations_deg, strict=True):
        assert np.degrees(across_prism(incidence, per_um(glass, nm))[0]) == pytest.approx(expected_deg, abs=6e-6)
    # It is the minimum: where the path is symmetric.
    neighbours = [across_prism(incidence + e, per_um(glass, D_NM))[0] for e in (-1e-3, 1e-3)]
    assert deviation < min(neighbours) < deviation + 1e-5
    assert deviation == pytest.approx(2 * incidence - apex, abs=1e-14)


def through_ball(height: float, index: Index) -> Ray:
    """A ray parallel to the axis through the unit ball; column 0 by its variable, column 1 by height."""
    columns = [[0, 0, 0], [0, 1, 0]]
    index = Index(index.n, np.array([float(index.dn), 0.0]))
    inside = through(make_ray([-2, height, 0], [1, 0, 0], columns), BALL, AIR, index)
    return through(inside, BALL, index, AIR, root=1)


@pytest.mark.parametrize("height", known.BALL_RAYS)
def test_t4_ball_lens_off_the_axis(height: float) -> None:
    deviation_deg, crossing, ddeviation_dn = known.BALL_RAYS[height]
    ray = through_ball(height, per_index("N-BK7", D_NM))
    assert np.degrees(-heading(ray)) == pytest.approx(deviation_deg, abs=6e-7)
    assert axis_crossing(ray) == pytest.approx(crossing, abs=6e-7)
    assert -dheading(ray) == pytest.approx(ddeviation_dn, abs=6e-7)


@pytest.mark.parametrize("bounces", known.RAINBOWS)
def test_t10_rainbows(bounces: int) -> None:
    radii_deg, dradius_dn = known.RAINBOWS[bounces]

    def out(height: float, index: Index) -> Ray:
        index = Index(index.n, np.array([1.0, 0.0]))
        ray = through(make_ray([-2, height, 0], [1, 0, 0], [[0, 0, 0], [0, 1, 0]]), BALL, AIR, index)
        for _ in range(bounces):
            ray = through(ray, BALL, index, index, root=1, mirror=True)
        return through(ray, BALL, index, AIR, root=1)

    for nm, expected in zip(known.RAINBOW_LINES, radii_deg, strict=True):
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


def test_t13_band_split_by_total_reflection() -> None:
    internal = np.radians(known.SPLIT_DEG)
    ray = make_ray([0, -1, 0], [np.sin(internal), np.cos(internal), 0])

    def passes(nm: float) -> float:
        n = float(glasses.index("N-BK7", nm))
        out = refracted(ray, np.array([0, -1.0, 0]), np.zeros((0, 3)), Index(n), AIR)
        return -1.0 if out is None else 1.0

    split = zero_of(passes, 400.0, 700.0)
    assert split == pytest.approx(known.SPLIT_NM, abs=6e-4)
    assert glasses.index("N-BK7", split) == pytest.approx(known.SPLIT_INDEX, abs=6e-7)
    assert (passes(split - 1), passes(split + 1)) == (-1.0, 1.0)


@pytest.mark.parametrize(("angle_deg", "reflectance"), known.FRESNEL.items())
def test_t16_fresnel(angle_deg: float, reflectance: float) -> None:
    angle = np.radians(angle_deg)
    direction = np.array([np.sin(angle), -np.cos(angle), 0])
    up = np.array([0, 1.0, 0])
    assert fresnel_reflectance(direction, up, 1 / N_BK7_D) == pytest.approx(reflectance, abs=6e-7)
    # The same interface from the other side reflects the same share (Stokes).
    inside = optics.refract(direction, up, 1 / N_BK7_D)
    assert fresnel_reflectance(inside, up * np.sign(-inside[1]), N_BK7_D) == pytest.approx(reflectance, abs=6e-7)


def test_t16_brewster() -> None:
    brewster = np.arctan(N_BK7_D)
    assert np.degrees(brewster) == pytest.approx(known.BREWSTER_DEG, abs=6e-5)
    direction = np.array([np.sin(brewster), -np.cos(brewster), 0])
    beyond = optics.refract(direction, np.array([0, 1.0, 0]), 1 / N_BK7_D)
    mirrored = optics.reflect(direction, np.array([0, 1.0, 0]))
    assert abs(beyond @ mirrored) < 1e-15  # the refracted and reflected rays are at right angles
    # There p-light is not reflected: half the s-reflectance is all there is.
    s = (np.cos(brewster) - N_BK7_D * -beyond[1]) / (np.cos(brewster) + N_BK7_D * -beyond[1])
    assert fresnel_reflectance(direction, np.array([0, 1.0, 0]), 1 / N_BK7_D) == pytest.approx(s * s / 2, rel=1e-12)
