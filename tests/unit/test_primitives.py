"""Primitives are closed, face outward, have the right size, and converge to the exact shape at order 2."""

from __future__ import annotations

import math

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.model.geometry import primitives, primitives_round
from spectrasplat.model.geometry.mesh import Mesh, make_mesh
from spectrasplat.model.geometry.primitives import solid_of_revolution
from spectrasplat.model.scene_objects import make_shape

SOLIDS = [
    primitives.box((1.0, 2.0, 3.0)),
    primitives.slab(1.0, 2.0, 0.1),
    primitives.prism(70.0, 1.3, 2.0),
    primitives.polygon_prism(7, 0.4, 1.1),
    primitives.sphere(1.3, 500),
    primitives.ellipsoid((1.0, 0.5, 2.0), 320),
    primitives.torus(1.0, 0.3, 900),
    primitives.lens(0.8, -1.1, 0.3, 0.7, 800),
    primitives.lens(-2.0, 1.0, 0.1, 0.7, 800),
    primitives.lens(0.5, math.inf, 0.5, 1.0, 800),
    primitives.lens(1.0, 1.5, 0.2, 0.9, 300, conic1=-1.0, conic2=2.0),
    primitives.brilliant(2.0),
    primitives.brilliant(girdle=0.0),
    primitives.height_field(0.05 * np.random.default_rng(3).random((6, 9)), (2.0, 1.0)),
    primitives.rippled_water(resolution=24),
    primitives.solid_of_revolution([(0, 0), (1, 0), (1, 0.1), (0.2, 0.2), (0.8, 2), (0.7, 2), (0, 0.3)], 40),
    primitives.solid_of_revolution([(1, 0), (2, 0), (1.5, 1), (1, 0)], 24),
]
SMOOTH = [mesh for mesh in SOLIDS if mesh.corner_normals is not None]
BY_NAME = {"ids": lambda value: value.name if isinstance(value, Mesh) else None}


@pytest.mark.parametrize("mesh", SOLIDS, **BY_NAME)
def test_solid_is_closed_and_faces_outward(mesh: Mesh) -> None:
    assert mesh.is_closed
    assert mesh.volume() > 0.0
    assert mesh.areas().min() > 1e-9 * mesh.areas().max()
    assert len(np.unique(mesh.vertices.round(12), axis=0)) == len(mesh.vertices)


@pytest.mark.parametrize("mesh", SMOOTH, **BY_NAME)
def test_corner_normals_are_unit_and_agree_with_the_faces(mesh: Mesh) -> None:
    np.testing.assert_allclose(np.linalg.norm(mesh.corner_normals, axis=2), 1.0, atol=1e-12)
    cosines = np.einsum("tcj,tj->tc", mesh.corner_normals, mesh.face_normals())
    assert cosines.min() > 0.5


@pytest.mark.parametrize(
    ("mesh", "count", "volume"),
    [
        (primitives.box((1.0, 2.0, 3.0)), 6, 6.0),
        (primitives.prism(60.0, 1.0, 2.0), 5, math.sqrt(3.0) / 2.0),
        (primitives.polygon_prism(6, 1.0, 1.0), 8, 1.5 * math.sqrt(3.0)),
    ],
    **BY_NAME,
)
def test_flat_solid_volume_and_half_spaces(mesh: Mesh, count: int, volume: float) -> None:
    assert mesh.volume() == pytest.approx(volume, rel=1e-12)
    assert mesh.convex_planes is not None and len(mesh.convex_planes) == count


def _cap(radius: float, aperture: float) -> float:
    """Volume under a spherical cap."""
    sag = radius - math.sqrt(radius**2 - aperture**2)
    return math.pi * sag**2 * (3.0 * radius - sag) / 3.0


@pytest.mark.parametrize(
    ("make", "exact"),
    [
        (lambda n: primitives.sphere(1.0, n), 4.0 / 3.0 * math.pi),
        (lambda n: primitives.ellipsoid((1.0, 2.0, 0.5), n), 4.0 / 3.0 * math.pi),
        (lambda n: primitives.torus(1.0, 0.25, n), 2.0 * math.pi**2 / 16.0),
        (
            lambda n: primitives.lens(1.0, -2.0, 0.5, 1.2, n),
            math.pi * 0.36 * (0.5 - (1.0 - 0.8) - (2.0 - math.sqrt(3.64))) + _cap(1.0, 0.6) + _cap(2.0, 0.6),
        ),
    ],
)
def test_volume_converges_at_second_order(make, exact: float) -> None:
    coarse, fine = (abs(make(n).volume() - exact) for n in (2_000, 32_000))
    # Sixteen times the triangles is a quarter of the edge: 16 times the accuracy at order 2.
    assert math.log(coarse / fine, 4.0) == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("conic", [0.0, -1.0, 1.5])
def test_lens_surfaces_follow_the_conic_and_its_normal(conic: float) -> None:
    radius, thickness = 0.9, 0.3
    mesh = primitives.lens(radius, math.inf, thickness, 1.0, 1_500, conic1=conic)
    front = mesh.corner_normals[:, :, 2] < -1e-9
    p, n = mesh.corners()[front], mesh.corner_normals[front]
    z = p[:, 2] + 0.5 * thickness
    r2 = p[:, 0] ** 2 + p[:, 1] ** 2
    np.testing.assert_allclose(r2 - 2.0 * radius * z + (1.0 + conic) * z**2, 0.0, atol=1e-13)
    gradient = np.column_stack([p[:, 0], p[:, 1], (1.0 + conic) * z - radius])
    np.testing.assert_allclose(np.cross(gradient, n), 0.0, atol=1e-13)
    assert (np.einsum("ij,ij->i", gradient, n) > 0.0).all()
    # The back is flat and the rim radial.
    assert set(np.unique(mesh.corner_normals[~front][:, 2].round(12))) == {0.0, 1.0}


def test_cemented_lenses_share_their_surface_exactly() -> None:
    front, back = (
        primitives.lens(0.6, -0.45, 0.2, 0.5, 1_500, front=-0.2),
        primitives.lens(-0.45, -1.6, 0.08, 0.5, 1_500, front=0.0),
    )

    def cemented(mesh: Mesh, sign: float) -> set[frozenset[tuple[float, ...]]]:
        faces = np.flatnonzero((sign * mesh.corner_normals[:, :, 2] > 1e-9).all(axis=1))
        return {frozenset(map(tuple, corners)) for corners in mesh.corners()[faces]}

    shared = cemented(front, 1.0)
    assert shared == cemented(back, -1.0)
    assert len(shared) > 500


def test_brilliant_has_its_facets_and_angles() -> None:
    mesh = primitives.brilliant(2.0, girdle=0.02)
    planes = mesh.convex_planes
    assert len(planes) == 57 + 16
    tilt = np.degrees(np.arccos(np.abs(planes[:, 2])))
    up = planes[:, 2] > 0.01
    assert np.isclose(tilt[up], 34.5, atol=1e-9).sum() == 8
    assert np.isclose(tilt[planes[:, 2] < -0.01], 40.75, atol=1e-9).sum() == 8
    assert np.isclose(tilt, 90.0, atol=1e-9).sum() == 16
    assert np.isclose(tilt, 0.0, atol=1e-9).sum() == 1
    assert len(primitives.brilliant(girdle=0.0).convex_planes) == 57
    low, high = mesh.bounds()
    np.testing.assert_allclose((low[0], high[0]), (-1.0, 1.0), atol=1e-12)
    assert high[2] == pytest.approx(0.02 + 0.47 * math.tan(math.radians(34.5)))
    assert low[2] == pytest.approx(-0.02 - math.tan(math.radians(40.75)))


def test_ripple_normals_match_the_surface() -> None:
    coarse, fine = (primitives.rippled_water(resolution=n, amplitude=0.02, wavelength=0.5) for n in (100, 200))
    errors = []
    for mesh in (coarse, fine):
        top = (mesh.corner_normals[:, :, 2] > 0.5).all(axis=1)
        edge = np.diff(mesh.corners()[top][:, :2], axis=1)[:, 0]
        normals = mesh.corner_normals[top][:, :2]
        slope = (-normals[:, :, :2] / normals[:, :, 2:]).mean(axis=1)
        errors.append(np.abs(edge[:, 2] - np.einsum("ij,ij->i", slope, edge[:, :2])).max())
    # The trapezium rule along an edge errs by O(h³) when the slopes at its ends are exact.
    assert math.log2(errors[0] / errors[1]) == pytest.approx(3.0, abs=0.2)
    heights = coarse.vertices[: 101 * 101, 2]
    assert math.sqrt(2.0) * heights.std() == pytest.approx(0.02, rel=0.25)
    one = primitives.rippled_water(resolution=200, waves=1, amplitude=0.02, wavelength=0.5)
    assert one.vertices[:, 2].max() == pytest.approx(0.02, rel=1e-3)


def test_height_field_differences_are_exact_for_a_paraboloid() -> None:
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 11), np.linspace(-0.5, 0.5, 9))
    mesh = primitives.height_field(0.1 * (x * x - 2.0 * y * y + x * y), (2.0, 1.0))
    top = mesh.corner_normals[:, :, 2] > 0.5
    p, n = mesh.corners()[top], mesh.corner_normals[top]
    slope = 0.1 * np.column_stack([2.0 * p[:, 0] + p[:, 1], p[:, 0] - 4.0 * p[:, 1]])
    np.testing.assert_allclose(-n[:, :2] / n[:, 2:], slope, atol=1e-12)


def test_revolution_keeps_creases_and_smooths_the_rest() -> None:
    t = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 65)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    circle[[0, -1], 0] = 0.0
    ball = primitives.solid_of_revolution(circle, 96)
    np.testing.assert_allclose(ball.corner_normals, ball.corners(), atol=1e-12)
    cylinder = primitives.solid_of_revolution([(0, 1), (1, 1), (1, 0), (0, 0)], 32)  # either direction will do
    assert cylinder.volume() == pytest.approx(16.0 * math.sin(math.pi / 16.0), rel=1e-12)
    assert set(np.unique(np.abs(cylinder.corner_normals[:, :, 2]).round(12))) == {0.0, 1.0}


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: primitives.sphere(-1.0), "sphere: radius"),
        (lambda: primitives.sphere(float("nan")), "sphere: radius"),
        (lambda: primitives.sphere(1.0, 3), "sphere: triangles"),
        (lambda: primitives.box((1.0, 0.0, 1.0)), "box: size along y"),
        (lambda: primitives.prism(180.0), "prism: apex_angle_deg"),
        (lambda: primitives.torus(0.2, 0.3), "minor_radius"),
        (lambda: primitives.lens(0.4, -1.0, 0.3, 1.0), "reaches a diameter of 0.8"),
        (lambda: primitives.lens(1.0, -1.0, 0.1, 1.0), "surfaces cross"),
        (lambda: primitives.lens(-1.0, 1.0, 1e-3, 1.0, conic1=float("nan")), "conic1"),
        (lambda: primitives.lens(0.0, 1.0), "radius1"),
        (lambda: primitives.brilliant(star_length=0.001, crown_angle_deg=80.0, table=0.9), "convex"),
        (lambda: primitives.brilliant(table=1.2), "brilliant: table"),
        (lambda: primitives.height_field(np.zeros((2, 2))), "at least 3"),
        (lambda: primitives.height_field(np.full((3, 3), -1.0)), "below the bottom"),
        (lambda: primitives.solid_of_revolution([(0, 0), (1, 0), (1, 1)]), "radius 0"),
        (lambda: primitives.solid_of_revolution([(0, 0), (-1, 0), (0, 1)]), "negative"),
        (lambda: primitives.solid_of_revolution([(0, 0), (1, 0), (1, 0), (0, 1)]), "coincide"),
        (lambda: primitives.solid_of_revolution([(0, 0), (1, 1), (1, 0), (0.2, 1.5), (0, 2)]), "crosses itself"),
    ],
)
def test_impossible_dimensions_are_one_sentence(make, says: str) -> None:
    with pytest.raises(UserError, match=says):
        make()


@pytest.mark.parametrize(
    ("shape", "volume"), [("cylinder", math.pi / 4), ("cone", math.pi / 12), ("dome", math.pi / 12)]
)
def test_everyday_names_are_other_shapes(shape: str, volume: float) -> None:
    mesh = make_shape(shape)
    assert mesh.is_closed and mesh.volume() == pytest.approx(volume, rel=1e-3)
    assert np.abs(mesh.bounds()).max() <= 0.5 + 1e-12 and mesh.recipe["shape"] in ("revolution", "lens")


def test_half_spaces_only_for_closed_convex_flat_solids() -> None:
    box = primitives.box()
    concave = make_mesh("dent", np.vstack([box.vertices, [0.0, 0.0, 0.3]]), _dented(box.triangles))
    assert concave.is_closed and concave.convex_planes is None
    assert primitives.plane().convex_planes is None
    assert primitives.sphere(1.0, 20).convex_planes is None
    flat_ball = make_mesh("ball", primitives.sphere(1.0, 80).vertices, primitives.sphere(1.0, 80).triangles)
    assert len(flat_ball.convex_planes) == 80
    many = primitives.sphere(1.0, 320)
    assert make_mesh("many", many.vertices, many.triangles).convex_planes is None
    # float32 coordinates far from the origin still merge coplanar triangles.
    stone = primitives.brilliant()
    rounded = make_mesh("stone", stone.vertices.astype(np.float32), stone.triangles)
    assert len(rounded.convex_planes) == 73


def _dented(triangles: np.ndarray) -> np.ndarray:
    """Replace the box's two top triangles by four that meet at vertex 8, inside."""
    top = {4, 5, 6, 7}
    sides = [t for t in triangles.tolist() if not set(t) <= top]
    return np.array(sides + [(4, 5, 8), (5, 6, 8), (6, 7, 8), (7, 4, 8)])


@pytest.mark.parametrize(("points", "segments"), [(5, 512), (100, 400), (2_000, 128)])
def test_a_solid_of_revolution_is_as_fine_as_its_profile_allows(points: int, segments: int) -> None:
    """Few large facets would stripe the light that grazes them."""
    angle = np.linspace(0.0, np.pi, points)
    profile = np.column_stack([np.sin(angle), -np.cos(angle)])
    profile[[0, -1], 0] = 0.0
    solid = primitives.solid_of_revolution(profile)
    # Counted on one ring.
    widest = solid.vertices[(solid.vertices[:, 2] == profile[points // 2, 1])]
    assert len(widest) == segments


TAPERED = [(0.0, 0.0), (0.62, 0.0), (0.8, 1.56), (0.0, 1.56)]


def uneven_share(segments: int) -> float:
    """How far the interpolated normal of a tapered tumbler's wall is ahead of or behind its place, in segments."""
    mesh = solid_of_revolution(TAPERED, segments=segments)
    assert mesh.corner_normals is not None
    wall = np.abs(mesh.face_normals()[:, 2]) < 0.5
    weights = np.random.default_rng(3).dirichlet(np.ones(3), (64, np.count_nonzero(wall)))
    place = np.einsum("rtc,tcj->rtj", weights, mesh.corners()[wall])
    normal = np.einsum("rtc,tcj->rtj", weights, mesh.corner_normals[wall])
    ahead = np.arctan2(normal[..., 1], normal[..., 0]) - np.arctan2(place[..., 1], place[..., 0])
    ahead = (ahead + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.abs(ahead).max()) * segments / (2.0 * np.pi)


def test_normals_turn_as_their_places_do() -> None:
    """To half of a row's taper at most over a segment, however narrow segments are (a quarter of it, at the worst
    place, is what a triangle's edge between two rings leaves)."""
    for segments in (64, 512):
        assert uneven_share(segments) < 0.3 * primitives_round.TAPER


def test_rows_keep_the_profile() -> None:
    """Its points stay, rows lie on its segments, and none tapers by more than is said but towards a tip."""
    points = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.8, 2.2), (0.0, 3.0)])
    normals = np.array([(0.0, -1.0), (1.0, 0.0), (0.97, -0.24), (0.71, 0.71)])
    found, start, end = primitives_round.in_rows(points, normals, normals, loop=False)
    assert all((found == point).all(axis=1).any() for point in points)
    # Discs and cylinders stay one row.
    assert (found[:3] == points[:3]).all()
    assert (found[-1] == points[-1]).all()
    assert len(start) == len(end) == len(found) - 1
    assert start == pytest.approx(end)
    radii = found[:, 0]
    upper, lower = np.maximum(radii[1:], radii[:-1]), np.minimum(radii[1:], radii[:-1])
    cones = np.flatnonzero((upper != lower) & (found[1:, 1] != found[:-1, 1]))
    shoulder = [row for row in cones if found[row, 1] < 2.2]
    assert len(shoulder) > 5
    assert (upper[shoulder] / lower[shoulder] <= 1.0 + primitives_round.TAPER + 1e-9).all()
    assert len(cones) - len(shoulder) == primitives_round.MOST_ROWS


def test_rows_of_a_smooth_loop_turn_from_end_to_end() -> None:
    """A ring whose profile is smooth: every row begins with the normal that the one before it ends with."""
    angle = 2.0 * np.pi * np.arange(12) / 12
    circle = np.stack([1.0 + 0.3 * np.cos(angle), 0.3 * np.sin(angle)], axis=1)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found, start, end = primitives_round.in_rows(circle, normals, np.roll(normals, -1, axis=0), loop=True)
    assert len(found) == len(start) == len(end) > 12
    assert np.roll(start, -1, axis=0) == pytest.approx(end)
    assert np.linalg.norm(start, axis=1) == pytest.approx(1.0)
