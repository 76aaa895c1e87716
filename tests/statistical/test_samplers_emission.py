"""Directions, places and wavelengths of emitted rays against the densities that physics asks for, light by light.

Rays are those of the real emission pass, weighted ones thinned to counts; expected shares are exact integrals over
each cell, in solid angle, area or wavelength, and never over the shaders' own plane. A tilt of the size in
`DETECTABLE` of any density is refused with probability 0.99 (non-central chi²; asserted in every test), and each test
refuses a mutant. Sums of weights are the measure of the light's domain, to a lattice's accuracy.
"""

from __future__ import annotations

import numpy as np
import pytest
from reference.lamps import cosine, isotropic, lamp, lopsided
from reference.samplers import drawn_wavelengths
from spectrasplat.model.lights import AreaLight, CollimatedLight, DirectionalLight, PointLight, SpotLight
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.reference.optics import unit

from tests.statistical.chi_square import ALPHA, chi_square, smallest_tilt, thinned
from tests.statistical.emitted import Emitted, box, emit

DETECTABLE = 0.045
"""Amplitude of a linear tilt of a density that would be seen."""
MEASURE_ERROR = 2e-4
"""Of sums of weights: the rim of a domain cuts a lattice."""
WHITE = constant(1.0)
AXIS = unit(np.array([0.3, -0.5, 0.8]))
BAND = (0.2, 0.7)
"""Of x, that rays are emitted in."""
INSIDE = (0.3, 0.2, -0.1)
"""Within the unit box: glass all round."""


def cells(*coordinates: np.ndarray, bins: tuple[int, ...]) -> np.ndarray:
    """Counts of coordinates in [0, 1] in equal cells."""
    counts, _ = np.histogramdd(np.column_stack(coordinates), bins=bins, range=[(0.0, 1.0)] * len(bins))
    return counts


def uniform_expected(shape: tuple[int, ...]) -> np.ndarray:
    return np.full(shape, 1.0)


def polar(direction: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine to the axis, and azimuth as a share of a turn."""
    first = unit(np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0]))
    second = np.cross(axis, first)
    turn = np.arctan2(direction @ second, direction @ first) / (2.0 * np.pi) % 1.0
    return np.clip(direction @ axis, -1.0, 1.0), turn


def accept(counts: np.ndarray, expected: np.ndarray) -> None:
    assert smallest_tilt(counts.sum(), counts.size) < DETECTABLE
    result = chi_square(counts, expected)
    assert result.accepted, result


def refuse(counts: np.ndarray, expected: np.ndarray) -> None:
    assert chi_square(counts, expected).p_value < 1e-3 * ALPHA


@pytest.fixture(scope="module")
def sphere(gl) -> Emitted:
    return emit(gl, PointLight("l", WHITE, position=INSIDE), box(1.0), passes=8)


def test_a_point_shines_evenly_over_the_sphere(sphere: Emitted) -> None:
    assert sphere.weight.sum() == pytest.approx(4.0 * np.pi, rel=MEASURE_ERROR)
    cosine, turn = polar(sphere.direction, AXIS)
    accept(cells(0.5 * (1.0 + cosine), turn, bins=(8, 8)), uniform_expected((8, 8)))
    # Mutant: the plane's radius taken for the angle (equidistant), which is no equal-area map.
    to_middle = -unit(np.array(INSIDE))
    angle = np.arccos(np.clip(sphere.direction @ to_middle, -1, 1))
    stretched = 0.5 * (1.0 + np.cos(2.0 * np.sin(0.5 * angle) * 0.5 * np.pi))
    accept(cells(0.5 * (1.0 + np.cos(angle)), bins=(64,)), uniform_expected((64,)))
    refuse(cells(stretched, bins=(64,)), uniform_expected((64,)))


def test_wavelengths_are_drawn_by_brightness_within_the_band(sphere: Emitted) -> None:
    lo, hi = BAND
    assert sphere.x.min() >= lo and sphere.x.max() <= hi
    # Here x is plain wavelength and the light even over it: what is bright is the observer's choice.
    axis = SpectralAxis.build([])
    places = (np.arange(64 * 4096) + 0.5) / (64 * 4096)
    x, per_density = drawn_wavelengths(WHITE, axis, BAND, places)
    expected = cells((x - lo) / (hi - lo), bins=(64,))
    counts = cells((sphere.x - lo) / (hi - lo), bins=(64,))
    accept(counts, expected)
    # A photon's weight is one over the density it was drawn with: weighted, every wavelength has its share again.
    weight = sphere.throughput / (8 * sphere.weight)
    np.testing.assert_allclose(weight.mean(), hi - lo, rtol=5e-3)
    weighted, _ = np.histogram(sphere.x, bins=16, range=BAND, weights=weight)
    np.testing.assert_allclose(weighted / len(weight), (hi - lo) / 16, rtol=2e-2)
    order = np.argsort(x)
    np.testing.assert_allclose(
        weight, np.interp(sphere.x, x[order], per_density[order]), rtol=0.05, atol=0.02 * weight.max()
    )
    # Whatever the direction: no colour goes another way than the others.
    share = np.interp(sphere.x, x[order], places)
    cosine, turn = polar(sphere.direction, AXIS)
    for other in (0.5 * (1.0 + cosine), turn):
        accept(cells(share, other, bins=(8, 8)), uniform_expected((8, 8)))
    # Mutants: drawn evenly, and drawn by brightness over the whole spectrum and squeezed into the band.
    refuse(counts, uniform_expected((64,)))
    everywhere, _ = drawn_wavelengths(WHITE, axis, (0.0, 1.0), places)
    refuse(counts, cells(everywhere, bins=(64,)))


def smoothstep(angle: np.ndarray, inner: float, outer: float) -> np.ndarray:
    t = np.clip((outer - angle) / (outer - inner), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def ring_integrals(intensity: np.ndarray, angle: np.ndarray, rings: int) -> np.ndarray:
    """Integral of intensity dΩ over equal steps of the cosine from cos(angle[0]) to cos(angle[-1]), by a running
    sum."""
    density = intensity * np.sin(angle)
    running = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(angle))])
    edges = np.linspace(np.cos(angle[0]), np.cos(angle[-1]), rings + 1)
    return 2.0 * np.pi * np.diff(np.interp(edges[::-1], np.cos(angle)[::-1], running[::-1])[::-1])


def test_a_spot_has_its_penumbra(gl) -> None:
    inner, outer = np.radians([20.0, 50.0])
    light = SpotLight(
        "l", WHITE, position=INSIDE, direction=tuple(AXIS), inner_half_angle_deg=20.0, outer_half_angle_deg=50.0
    )
    rays = emit(gl, light, box(1.0), passes=8)
    angle = np.linspace(0.0, outer, 100_001)
    rings = ring_integrals(smoothstep(angle, inner, outer), angle, 16)
    assert rays.weight.sum() == pytest.approx(rings.sum(), rel=MEASURE_ERROR)
    cosine, turn = polar(rays.direction, AXIS)
    kept = thinned(rays.weight, rays.weight.max(), seed=1)
    counts = cells((1.0 - cosine[kept]) / (1.0 - np.cos(outer)), turn[kept], bins=(16, 4))
    accept(counts, np.repeat(rings[:, None], 4, axis=1))
    linear = ring_integrals(np.clip((outer - angle) / (outer - inner), 0.0, 1.0), angle, 16)
    refuse(counts, np.repeat(linear[:, None], 4, axis=1))


@pytest.mark.parametrize(
    ("text", "band_sr"),
    [(isotropic(), 4.0 * np.pi), (cosine(), np.pi), (lopsided(), None)],
    ids=["isotropic", "cosine", "lopsided"],
)
def test_a_lamp_emits_what_its_file_integrates_to(gl, tmp_path, text: str, band_sr: float | None) -> None:
    light = lamp(tmp_path, WHITE, text, position=INSIDE, direction=tuple(AXIS), rotation_deg=33.0)
    rays = emit(gl, light, box(1.0), passes=8)
    assert rays.weight.sum() == pytest.approx(light.profile.integral_sr, rel=MEASURE_ERROR)
    if band_sr is not None:
        assert rays.weight.sum() == pytest.approx(band_sr, rel=1e-4 + MEASURE_ERROR)
    # Over the sphere about the lamp's own axes, against the table's own values.
    cosine_of, _ = polar(rays.direction, AXIS)
    u, v = light.across
    turn = np.arctan2(rays.direction @ v, rays.direction @ u) / (2.0 * np.pi) % 1.0
    kept = thinned(rays.weight, rays.weight.max(), seed=4)
    fine = 64
    z, phi = (np.arange(16 * fine) + 0.5) / (8 * fine) - 1.0, 2.0 * np.pi * (np.arange(8 * fine) + 0.5) / (8 * fine)
    dense = light.profile.at(np.arccos(z)[:, None], phi[None, :])
    expected = dense.reshape(16, fine, 8, fine).sum(axis=(1, 3))
    lit = expected.sum(axis=1) > 0.0
    counts = cells(0.5 * (cosine_of[kept] + 1.0), turn[kept], bins=(16, 8))
    assert counts[~lit].sum() == 0
    accept(counts[lit], expected[lit])
    if band_sr is None:  # a table that was turned the other way
        refuse(counts, expected[:, ::-1])


def test_a_hard_spot_fills_its_cone(gl) -> None:
    light = SpotLight(
        "l", WHITE, position=INSIDE, direction=tuple(AXIS), inner_half_angle_deg=35.0, outer_half_angle_deg=35.0
    )
    rays = emit(gl, light, box(1.0), passes=4)
    assert rays.weight.sum() == pytest.approx(2.0 * np.pi * (1.0 - np.cos(np.radians(35.0))), rel=MEASURE_ERROR)
    cosine, turn = polar(rays.direction, AXIS)
    # The edge is softened as footprints are broad, a lattice spacing to either side.
    assert (rays.weight < 0.999 * rays.weight.max()).mean() < 0.06
    within = np.cos(np.radians(34.0))
    chosen = cosine > within
    accept(cells((1.0 - cosine[chosen]) / (1.0 - within), turn[chosen], bins=(8, 8)), uniform_expected((8, 8)))


@pytest.mark.parametrize("shape", ["disc", "rectangle"])
def test_an_area_light_is_lambertian_and_even(gl, shape: str) -> None:
    radius, width, height = 0.2, 0.3, 0.2
    light = AreaLight(
        "l",
        WHITE,
        position=INSIDE,
        direction=tuple(AXIS),
        tangent=(1.0, 0.0, 0.0),
        shape=shape,
        radius=radius,
        width=width,
        height=height,
    )
    rays = emit(gl, light, box(1.0), passes=12, light_points=8192)
    area = np.pi * radius**2 if shape == "disc" else width * height
    assert rays.weight.sum() == pytest.approx(np.pi * area, rel=10 * MEASURE_ERROR)
    kept = thinned(rays.weight, rays.weight.max(), seed=2)
    cosine, turn = polar(rays.direction[kept], AXIS)
    across = unit(np.array([1.0, 0.0, 0.0]) - AXIS * AXIS[0])
    offset = rays.position[kept] - INSIDE
    u, v = offset @ across, offset @ np.cross(AXIS, across)
    assert np.abs(offset @ AXIS).max() < 1e-6
    if shape == "disc":
        place = ((u**2 + v**2) / radius**2).clip(0.0, 1.0), np.arctan2(v, u) / (2.0 * np.pi) % 1.0
    else:
        place = u / width + 0.5, v / height + 0.5
    # A Lambertian density is even in the squared cosine.
    counts = cells(cosine**2, turn, bins=(8, 8))
    accept(counts, uniform_expected((8, 8)))
    accept(cells(*place, bins=(4, 4)), uniform_expected((4, 4)))
    accept(cells(cosine**2, place[0], place[1], bins=(4, 4, 4)), uniform_expected((4, 4, 4)))
    drawn, _ = drawn_wavelengths(WHITE, SpectralAxis.build([]), BAND, np.linspace(0.0, 1.0, 4097))
    colour = np.interp(rays.x[kept], drawn, np.linspace(0.0, 1.0, 4097))
    accept(cells(colour, place[0], bins=(8, 8)), uniform_expected((8, 8)))
    even = thinned(np.ones(len(rays.weight)), 1.0, seed=3) & (rays.weight > 0)
    refuse(cells(polar(rays.direction[even], AXIS)[0].clip(0.0, 1.0) ** 2, bins=(64,)), uniform_expected((64,)))
    if shape == "disc":  # a radius drawn evenly crowds the middle
        refuse(cells(np.sqrt(place[0]), bins=(16,)), uniform_expected((16,)))


def test_the_sun_is_even_over_its_disc_and_over_the_ground(gl) -> None:
    light = DirectionalLight("l", WHITE, direction=(0.0, 0.0, -1.0), angular_diameter_deg=2.0)
    rays = emit(gl, light, box(1.0), passes=12, light_points=8192)
    tilt = rays.direction[:, :2] / -rays.direction[:, 2:] / np.tan(np.radians(1.0))
    ground = rays.position - rays.direction * (rays.position[:, 2:] / rays.direction[:, 2:])
    inner = 0.9
    chosen = np.abs(ground[:, :2]).max(axis=1) < inner
    assert rays.weight[chosen].sum() == pytest.approx(4.0 * inner**2, rel=5 * MEASURE_ERROR)
    ring, turn = (
        (tilt**2).sum(axis=1)[chosen].clip(0.0, 1.0),
        (np.arctan2(tilt[:, 1], tilt[:, 0]) / (2.0 * np.pi) % 1.0)[chosen],
    )
    x, y = (0.5 + 0.5 * ground[chosen, :2] / inner).T
    accept(cells(x, y, bins=(8, 8)), uniform_expected((8, 8)))
    accept(cells(ring, turn, bins=(4, 8)), uniform_expected((4, 8)))
    accept(cells(x, y, ring, bins=(4, 4, 4)), uniform_expected((4, 4, 4)))
    refuse(cells(np.sqrt(ring), turn, bins=(4, 8)), uniform_expected((4, 8)))
    refuse(cells(x**1.05, y, bins=(8, 8)), uniform_expected((8, 8)))


def test_a_rectangular_beam_s_edges_are_as_soft_as_its_lattice_is_wide_across_them(gl) -> None:
    """Lattices are stretched as rectangles are: twice as wide, twice as soft."""
    width, height = 0.8, 0.4
    light = CollimatedLight(
        "l", WHITE, position=(0.0, 0.0, 3.0), direction=(0.0, 0.0, -1.0), tangent=(1.0, 0.0, 0.0),
        shape="rectangle", width=width, height=height,
    )  # fmt: skip
    rays = emit(gl, light, box(1.0), passes=8)
    x, y = np.abs(rays.position[:, 0]) / width, np.abs(rays.position[:, 1]) / height
    soft = (rays.weight > 0.02 * rays.weight.max()) & (rays.weight < 0.98 * rays.weight.max())
    across_x, across_y = width * np.ptp(x[soft & (y < 0.3)]), height * np.ptp(y[soft & (x < 0.3)])
    assert across_x / across_y == pytest.approx(width / height, rel=0.15)


@pytest.mark.parametrize("shape", ["disc", "rectangle"])
def test_a_beam_fills_its_aperture(gl, shape: str) -> None:
    radius, width, height = 0.5, 0.9, 0.4
    light = CollimatedLight(
        "l",
        WHITE,
        position=(0.1, -0.1, 3.0),
        direction=(0.0, 0.0, -1.0),
        tangent=(1.0, 0.0, 0.0),
        shape=shape,
        radius=radius,
        width=width,
        height=height,
    )
    rays = emit(gl, light, box(1.0), passes=8)
    np.testing.assert_allclose(rays.direction, [[0.0, 0.0, -1.0]] * len(rays.weight), atol=1e-7)
    np.testing.assert_allclose(rays.position[:, 2], 3.0, atol=1e-6)
    x, y = rays.position[:, 0] - 0.1, rays.position[:, 1] + 0.1
    area = np.pi * radius**2 if shape == "disc" else width * height
    assert rays.weight.sum() == pytest.approx(area, rel=MEASURE_ERROR)
    # Within the softened edge every weight is the same, and places are even.
    if shape == "disc":
        ring = (x**2 + y**2) / (0.98 * radius) ** 2
        inside = ring < 1.0
        places = ring[inside], (np.arctan2(y, x) / (2.0 * np.pi) % 1.0)[inside]
    else:
        u, v = 0.5 + x / (0.98 * width), 0.5 + y / (0.98 * height)
        inside = (np.abs(u - 0.5) < 0.5) & (np.abs(v - 0.5) < 0.5)
        places = u[inside], v[inside]
    np.testing.assert_allclose(rays.weight[inside], rays.weight.max(), rtol=1e-5)
    accept(cells(*places, bins=(8, 8)), uniform_expected((8, 8)))
    refuse(cells(places[0] ** (0.5 if shape == "disc" else 1.05), places[1], bins=(8, 8)), uniform_expected((8, 8)))
