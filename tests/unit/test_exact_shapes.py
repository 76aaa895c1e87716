"""Shapes that the reference meets as true surfaces: equations, meshes that converge to them, foci with closed forms.

Numbers T4 to T15 are known answers of geometrical optics, computed from their formulas here or quoted with six digits.
"""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.glass import constant as constant_index
from spectrasplat.model.optics.spectrum import constant
from spectrasplat.model.scene import Absorption, Camera, Dielectric, Diffuse, Material, Mirror, Scene, SceneObject
from spectrasplat.model.scene_objects import make_shape
from spectrasplat.model.texture import Texture
from spectrasplat.reference import photon_reference
from spectrasplat.reference.direct_light import seen_directly
from spectrasplat.reference.photon_intersect import blocked, nearest
from spectrasplat.reference.photon_reference import reference_key, render_reference
from spectrasplat.reference.photon_scene import PhotonScene, photon_scene
from spectrasplat.reference.sampling import scratch
from spectrasplat.reference.scattering import AIR
from spectrasplat.reference.scene_surfaces import FORM_SIZE, TURNS, as_triangles, pieces

from tests.unit.camera_scenes import normal_at, scatter

CROWN = 1.5168
WHITE = Diffuse((0.8, 0.8, 0.8))
GLASS = Dielectric(constant_index(CROWN))
ABOVE = Camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), kind="orthographic", vertical_extent=1.0)
BEAM = CollimatedLight("beam", constant(1.0), (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), radius=0.4)

SHAPES: dict[str, dict[str, Any]] = {
    "sphere": {"radius": 0.8},
    "ellipsoid": {"semi_axes": [0.4, 0.7, 0.5]},
    "torus": {"major_radius": 0.6, "minor_radius": 0.25},
    "lens": {"radius1": 0.9, "radius2": -1.4, "thickness": 0.5, "diameter": 1.2},
    "meniscus": {"radius1": 0.9, "radius2": 0.7, "thickness": 0.3, "diameter": 1.1},
    "conics": {"radius1": 0.9, "radius2": -0.8, "thickness": 0.6, "diameter": 1.2, "conic1": -2.5, "conic2": -1.0},
    "plano-convex": {"radius1": 0.9, "radius2": math.inf, "thickness": 0.4, "diameter": 1.2},
    "cylinder": {"profile": [[0.0, -0.7], [0.5, -0.7], [0.5, 0.7], [0.0, 0.7]]},
    "cone": {"profile": [[0.0, -0.7], [0.6, -0.7], [0.2, 0.6], [0.0, 0.6]]},
    "ring": {"profile": [[0.4, -0.2], [0.8, -0.1], [0.7, 0.3], [0.4, -0.2]]},
    "vase": {"profile": [[0.0, -0.7], [0.5, -0.7], [0.6, -0.3], [0.55, 0.2], [0.3, 0.7], [0.0, 0.7]]},
}
KINDS = {"meniscus": "lens", "conics": "lens", "plano-convex": "lens"} | dict.fromkeys(
    ("cylinder", "cone", "ring", "vase"), "revolution"
)


def shape(name: str, size: int = 20_000) -> Mesh:
    kind = KINDS.get(name, name)
    fine = {"segments": size // 64} if kind == "revolution" else {"triangles": size}
    return make_shape(kind, **SHAPES[name], **fine)


def placement(seed: int, mirrored: bool = False) -> np.ndarray:
    """A turn, a stretch by three numbers, then another turn, and a shift."""
    rng = np.random.default_rng(seed)
    turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2)]
    turns = [turn * np.sign(np.linalg.det(turn)) for turn in turns]
    matrix = np.eye(4)
    matrix[:3, :3] = turns[0] @ np.diag([0.7, 1.6, -1.1 if mirrored else 1.1]) @ turns[1]
    matrix[:3, 3] = rng.normal(size=3)
    return matrix


def scene_of(*objects: tuple[Mesh, Material, np.ndarray]) -> Scene:
    items = (SceneObject(f"{i}", mesh, material, matrix) for i, (mesh, material, matrix) in enumerate(objects))
    return Scene("test", ABOVE, (BEAM,), tuple(items))


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def first_hits(scene: Scene, starts: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World places (N, 3), NaN where nothing is met, and the normals there."""
    photons, centre = photon_scene(scene)
    memory = scratch()
    places, normals = np.full(starts.shape, np.nan), np.full(starts.shape, np.nan)
    for k, (start, way) in enumerate(zip(starts - centre, ways, strict=True)):
        t, surface, _, _ = nearest(photons, tuple(start), tuple(way), -1, False, np.uint64(0), memory)
        if surface >= 0:
            places[k] = start + t * way + centre
            normals[k] = normal_at(photons, surface, tuple(start + t * way))
    return places, normals


def rays(matrix: np.ndarray, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """From all round at places within the object's reach."""
    rng = np.random.default_rng(seed)
    towards = rng.uniform(-0.7, 0.7, (count, 3)) @ matrix[:3, :3].T + matrix[:3, 3]
    ways = rng.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return towards - 5.0 * ways, ways


def equation(name: str, p: np.ndarray) -> np.ndarray:
    """0 on the surface of a shape whose equation is one line, (N,), of places (N, 3) in its own frame."""
    radius = np.hypot(p[:, 0], p[:, 1])
    given = SHAPES[name]
    if name == "torus":
        return np.hypot(radius - given["major_radius"], p[:, 2]) - given["minor_radius"]
    axes = np.array(given.get("semi_axes", [given.get("radius")] * 3), float)
    return np.linalg.norm(p / axes, axis=1) - 1.0


@pytest.mark.parametrize("name", ["sphere", "ellipsoid", "torus"])
def test_places_and_normals_are_those_of_the_equation(name: str) -> None:
    matrix = placement(3)
    starts, ways = rays(matrix, 400, 4)
    places, normals = first_hits(scene_of((shape(name), GLASS, matrix)), starts, ways)
    met = ~np.isnan(places[:, 0])
    assert 100 < met.sum() < 400
    own = (places[met] - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    assert np.abs(equation(name, own)).max() < 1e-13
    steps = 1e-6 * np.eye(3)
    slope = np.stack([equation(name, own + s) - equation(name, own - s) for s in steps], axis=1)
    outward = slope @ np.linalg.inv(matrix[:3, :3])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    np.testing.assert_allclose(normals[met], outward, atol=1e-8)


@pytest.mark.parametrize("name", SHAPES)
def test_meshes_converge_to_the_surface(name: str) -> None:
    """A quarter of the triangles' area, a quarter of the error, and the same rays miss; turned, stretched, mirrored."""
    matrix = placement(5, mirrored=True)
    starts, ways = rays(matrix, 250, 6)
    exact, normals = first_hits(scene_of((shape(name), GLASS, matrix)), starts, ways)
    errors = []
    for size in (4_000, 16_000 if KINDS.get(name) != "revolution" else 8_000):
        meshed, coarse = first_hits(as_triangles(scene_of((shape(name, size), GLASS, matrix))), starts, ways)
        both = ~np.isnan(exact[:, 0]) & ~np.isnan(meshed[:, 0])
        assert np.count_nonzero(np.isnan(exact[:, 0]) != np.isnan(meshed[:, 0])) <= 4
        aside = np.linalg.norm(exact[both] - meshed[both], axis=1)
        errors.append(float(np.median(aside[aside > 1e-13])) if (aside > 1e-13).any() else 0.0)
        assert np.median(np.einsum("ij,ij->i", normals[both], coarse[both])) > 0.998
    assert errors[1] < 1e-3
    assert errors[0] == pytest.approx(4.0 * errors[1], rel=0.45)


def test_what_is_in_the_way_is_the_surface_too() -> None:
    photons, centre = photon_scene(scene_of((shape("torus"), WHITE, at())))
    memory = scratch()

    def hidden(x: float, far: float) -> bool:
        start = np.array([x, 0.0, 3.0]) - centre
        return blocked(photons, tuple(start), (0.0, 0.0, -1.0), far, -1, memory.stack)

    assert hidden(0.6, 5.0) and not hidden(0.0, 5.0) and not hidden(0.6, 2.5)
    assert hidden(0.6 + 0.2499, 5.0) and not hidden(0.6 + 0.2501, 5.0)


# ---- known answers --------------------------------------------------------------------------


def refracted_path(photons: PhotonScene, start: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(place, direction) of a ray that is refracted wherever it can be, when it has left all glass."""
    memory = scratch()
    last, within, mask, alone = -1, False, np.uint64(0), AIR
    for _ in range(20):
        t, surface, u, v = nearest(photons, tuple(start), tuple(way), last, within, mask, memory)
        if surface < 0:
            return start, way
        start, last = start + t * way, surface
        way, mask, alone, within, _, _, _ = scatter(
            photons, surface, tuple(start), u, v, tuple(way), mask, alone, 587.6, 1.0, np.uint64(1), 0, memory.field
        )
        way = np.array(way)
    raise AssertionError("the ray stays inside")


def crossing_of_axis(item: SceneObject, height: float, way: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> float:
    """z at which a ray that comes in along z at x = `height` crosses the axis."""
    photons, centre = photon_scene(Scene("test", ABOVE, (BEAM,), (item,)))
    place, leaves = refracted_path(photons, np.array([height, 0.0, -9.0]) - centre, np.array(way, float))
    place = place + centre
    assert abs(place[1]) < 1e-12
    return float(place[2] - leaves[2] * place[0] / leaves[0])


def solid(kind: str, **sizes: Any) -> SceneObject:
    return SceneObject("solid", make_shape(kind, **sizes, triangles=200), GLASS, np.eye(4))


@pytest.mark.parametrize("height, expected", [(0.5, 1.363890), (0.8, 1.181973)])
def test_ball_lens(height: float, expected: float) -> None:
    """T4, δ = 2 (i − r) and the axis at h / sin δ, whatever the triangles: here 200."""
    deviation = 2.0 * (math.asin(height) - math.asin(height / CROWN))
    assert height / math.sin(deviation) == pytest.approx(expected, abs=1e-6)
    assert crossing_of_axis(solid("sphere", radius=1.0), height) == pytest.approx(
        height / math.sin(deviation), abs=1e-13
    )
    triangles = as_triangles(Scene("test", ABOVE, (BEAM,), (solid("sphere", radius=1.0),))).objects[0]
    assert abs(crossing_of_axis(triangles, height) - expected) > 1e-3


def test_ellipsoid_focuses_perfectly() -> None:
    """T7: with eccentricity 1/n rays along the axis meet in the far focus; a sphere cut through it lets them out."""
    b = math.sqrt(1.0 - 1.0 / CROWN**2)
    ball = SceneObject("solid", make_shape("ellipsoid", semi_axes=[b, b, 1.0], triangles=200), GLASS, np.eye(4))
    photons, centre = photon_scene(Scene("test", ABOVE, (BEAM,), (ball,)))
    memory = scratch()
    for height in (0.1, 0.3, 0.7):
        start, way = np.array([height, 0.0, -9.0]) - centre, (0.0, 0.0, 1.0)
        t, surface, u, v = nearest(photons, tuple(start), tuple(way), -1, False, np.uint64(0), memory)
        place = start + t * np.array(way)
        nothing, number = np.uint64(0), np.uint64(0)
        (x, y, z), *_ = scatter(
            photons, surface, tuple(place), u, v, way, nothing, AIR, 587.6, 1.0, number, 0, memory.field
        )
        place = place + centre
        assert place[2] - z * place[0] / x == pytest.approx(1.0 / CROWN, abs=1e-12) and abs(y) < 1e-15


def test_normals_of_a_smooth_profile_turn_as_the_mesh_s_do() -> None:
    """A profile is given by points, smooth where it bends little: exact all round, and along itself as fine meshes."""
    matrix = placement(8)
    scene = scene_of((shape("vase", 60_000), GLASS, matrix))
    starts, ways = rays(matrix, 40, 9)
    exact, meshed = photon_scene(scene), photon_scene(as_triangles(scene))
    aside, flat = [], []
    for start, way in zip(starts - exact[1], ways, strict=True):
        try:
            (_, one), (_, two) = (refracted_path(photons, start, way) for photons, _ in (exact, meshed))
        except AssertionError:
            continue  # light that stays inside
        unturned = exact[0]._replace(forms=np.where(np.arange(FORM_SIZE) == TURNS, 0.0, exact[0].forms))
        aside.append(np.linalg.norm(one - two))
        flat.append(np.linalg.norm(one - refracted_path(unturned, start, way)[1]))
    assert len(aside) > 20 and np.median(aside) < 1e-4 and np.median(flat) > 1e-2


# ---- whole pictures ---------------------------------------------------------------------------


@pytest.fixture
def short_pilot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photon_reference, "_PILOT_PHOTONS", 1 << 12)


def nested() -> Scene:
    """Water that reaches into a glass vase, a bubble in the water, a cemented doublet, and a mirror torus."""
    water = Dielectric(constant_index(1.333), Absorption(np.full(401, 0.5)), 1)
    cemented = {"radius1": 0.9, "radius2": -0.9, "radius3": -5.0, "thickness1": 0.3, "thickness2": 0.1, "diameter": 0.9}
    front, back = (make_shape("doublet", **cemented, part=part, triangles=800) for part in ("front", "back"))
    return scene_of(
        (
            make_shape("sphere", radius=0.5, triangles=500),
            Dielectric(constant_index(CROWN), None, 2),
            at(0.0, 0.0, 1.0),
        ),
        (make_shape("sphere", radius=0.4, triangles=500), replace(water, priority=3), at(0.0, 0.0, 1.0)),
        (make_shape("sphere", radius=0.1, triangles=80), Dielectric(constant_index(1.0), None, 4), at(0.1, 0.0, 1.1)),
        (front, Dielectric(constant_index(CROWN)), at(0.0, 0.0, 2.0)),
        (back, Dielectric(constant_index(1.62)), at(0.0, 0.0, 2.0)),
        (shape("torus", 800), Mirror((0.9, 0.9, 0.9)), at(0.0, 0.0, 0.4)),
        (primitives.plane(20.0, 20.0), WHITE, at()),
    )


def test_energy_closes_where_exact_solids_nest_and_touch(short_pilot: None) -> None:
    balance = render_reference(nested(), 8, 8, photons=40_000).fates
    assert balance["lost_numeric"] == 0.0
    fates = sum(value for name, value in balance.items() if name != "emitted")
    assert fates == pytest.approx(balance["emitted"], rel=1e-9) and balance["absorbed"] > 0.0


def test_fine_triangles_give_the_same_picture_and_coarse_ones_do_not(short_pilot: None) -> None:
    """40 k photons in four pixels scatter by half a hundredth; an icosahedron of 20 faces errs by far more."""
    view = replace(ABOVE, vertical_extent=0.5)

    def picture(triangles: int, exact: bool) -> np.ndarray:
        ball = make_shape("sphere", radius=0.5, triangles=triangles)
        scene = replace(scene_of((ball, GLASS, at(0, 0, 1.2)), (primitives.plane(9.0, 9.0), WHITE, at())), camera=view)
        scene = replace(scene, camera=replace(view, position=(0.0, 0.0, 0.6)))
        return render_reference(scene if exact else as_triangles(scene), 2, 2, photons=40_000).xyz[..., 1]

    exact = picture(20, True)
    np.testing.assert_allclose(picture(20_480, False), exact, rtol=0.025)
    assert np.abs(picture(20, False) / exact - 1.0).max() > 0.1


def test_a_picture_on_it_keeps_an_object_s_triangles_and_keys_tell_apart() -> None:
    ball, floor = make_shape("sphere", radius=0.5, triangles=80), (primitives.plane(9.0, 9.0), WHITE, at())
    scene = scene_of((ball, WHITE, at()), floor)
    printed = scene_of((ball, Diffuse(texture=Texture(np.ones((2, 2, 3), np.float32), "clamp")), at()), floor)
    assert [len(pieces(item)) for item in scene.objects] == [1, 0]
    assert not any(pieces(item) for s in (printed, as_triangles(scene)) for item in s.objects)
    assert len(photon_scene(scene)[0].owner) == 3 and len(photon_scene(as_triangles(scene))[0].owner) == 82
    assert reference_key(scene, 8, 8, 64) != reference_key(as_triangles(scene), 8, 8, 64)
    assert reference_key(as_triangles(scene), 8, 8, 64) == reference_key(as_triangles(as_triangles(scene)), 8, 8, 64)


def test_a_scene_that_goes_to_another_process_keeps_its_shapes() -> None:
    ball, floor = make_shape("sphere", radius=0.5, triangles=80), (primitives.plane(9.0, 9.0), WHITE, at())
    scene = scene_of((ball, WHITE, at()), floor)
    for one in (scene, as_triangles(scene)):
        again = pickle.loads(pickle.dumps(one))
        assert reference_key(again, 8, 8, 64) == reference_key(one, 8, 8, 64)
        assert [len(pieces(item)) for item in again.objects] == [len(pieces(item)) for item in one.objects]


def test_outlines_are_round() -> None:
    """An icosahedron's outline is none of the ball's that it stands for."""
    scene = scene_of(
        (make_shape("sphere", radius=0.4, triangles=20), GLASS, at()), (primitives.plane(9, 9), WHITE, at(z=-2))
    )
    y, x = np.mgrid[:64, :64] + 0.5
    radius = np.hypot(x / 64 - 0.5, y / 64 - 0.5)
    seen = ~seen_directly(scene, 64, 64)
    assert seen[radius < 0.4 - 0.02].all() and not seen[radius > 0.4 + 0.02].any()
    assert not (~seen_directly(as_triangles(scene), 64, 64))[radius < 0.4 - 0.02].all()
