"""Many rays through large trees: nearest hits, no leaks, touching solids, and both ways to read the texels.

`test_glsl_intersect` asks small questions of each kind of geometry; here the numbers are large enough
that a crack of one ray in a million, or a wrong link deep in a tree, shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, SCENE_STRUCTS, TRIANGLE
from spectrasplat.gpu.scene_texels import SceneTexels, tree_texels
from spectrasplat.model.geometry.bvh import build_bvh
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.reference.optics import dot, unit
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate


@dataclass(frozen=True)
class Tree:
    """Triangles in a texture, and what programs must be told of them."""

    texels: SceneTexels
    order: np.ndarray
    defines: dict[str, int]

    def run(
        self, gl, body: str, inputs: dict[str, np.ndarray], outputs: dict[str, str], **defines: int | str
    ) -> dict[str, np.ndarray]:
        return evaluate(
            gl.ctx,
            ["lib/intersect.glsl"],
            body,
            inputs,
            outputs,
            self.defines | defines,
            SCENE_STRUCTS,
            binders=[self.texels.bind],
        )


def tree_of(
    gl,
    triangles: np.ndarray,
    owner: np.ndarray | None = None,
    objects: np.ndarray | None = None,
    as_image: bool | None = None,
) -> Tree:
    """The tree over `triangles` (T, 3, 3), one object unless `owner` (T,) says otherwise."""
    built = build_bvh(triangles.astype(np.float32), use_cache=False)
    ordered = triangles[built.order]
    records = TRIANGLE.zeros(len(ordered))
    records["vertex"] = ordered[:, 0]
    records["edge1"], records["edge2"] = ordered[:, 1] - ordered[:, 0], ordered[:, 2] - ordered[:, 0]
    records["normals"], records["source"] = NONE, built.order
    records["object"] = 0 if owner is None else owner[built.order]
    sections = {
        "TREE": tree_texels(built.nodes),
        "TRIANGLES": records,
        "OBJECTS": OBJECT.zeros(1) if objects is None else objects,
    }
    texels = SceneTexels(gl.ctx, sections, as_image)
    numbers = {
        "HAS_TREE": 1,
        "LOOSE_TRIANGLES": 1,
        "TREE_STACK": max(built.depth, 1),
        "TRIANGLE_COUNT": len(triangles),
        "SPECTRAL_SAMPLES": 2,
    }
    return Tree(texels, built.order, bindings.SCENE_DEFINES | texels.defines | numbers)


def soup(count: int, size: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return as_f32(rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, size, (count, 3, 3)))


def soup_rays(count: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    origins = as_f32(rng.uniform(-1.5, 1.5, (count, 3)))
    return {"o": origins, "d": as_f32(unit(rng.normal(0, 0.5, (count, 3)) - origins))}


CLOSEST = """
    Hit hit;
    bool met = intersect_closest(o, d, FAR_DISTANCE, RayOrigin(NONE, NONE, 0u, 0u), hit);
    distance = met ? hit.distance : -1.0;
    slot = hit.primitive;
"""


def brute_force(
    triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """Nearest (distance or inf, triangle) in float64 among hits at most `margin` outside an edge (barycentric)."""
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    distances, winners = np.empty(len(origins)), np.empty(len(origins), int)
    for i, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        p = np.cross(direction, e2)  # Möller and Trumbore 1997: other arithmetic than the shader's
        determinant = dot(e1, p)
        inverse = 1.0 / np.where(determinant == 0, np.inf, determinant)
        to_origin = origin - a
        q = np.cross(to_origin, e1)
        u, v, t = dot(to_origin, p) * inverse, (q @ direction) * inverse, dot(e2, q) * inverse
        t = np.where((u >= -margin) & (v >= -margin) & (u + v <= 1 + margin) & (t > 0) & (determinant != 0), t, np.inf)
        winners[i] = t.argmin()
        distances[i] = t[winners[i]]
    return distances, winners


@pytest.mark.parametrize(("count", "size"), [(4000, 0.03), (700, 0.5), (3, 0.5)], ids=["small", "tangled", "one leaf"])
def test_nearest_of_a_soup(gl, count: int, size: float) -> None:
    triangles = soup(count, size, 1)
    rays = soup_rays(800, 2)
    tree = tree_of(gl, triangles)
    got = tree.run(gl, CLOSEST, rays, {"distance": "float", "slot": "uint"})
    want, winner = brute_force(triangles, rays["o"], rays["d"], 0.0)
    lenient, _ = brute_force(triangles, rays["o"], rays["d"], 1e-4)
    strict, _ = brute_force(triangles, rays["o"], rays["d"], -1e-4)
    clear = lenient == strict  # elsewhere an edge is nearer than float32 can tell
    assert clear.mean() > 0.97
    met = clear & np.isfinite(want)
    assert met.sum() > 10
    np.testing.assert_array_equal(got["distance"][clear] > 0, met[clear])
    # A ray along a facet meets it at a distance known to 1e-7 / cos only.
    error = np.abs(got["distance"][met] - want[met]) / want[met]
    assert np.quantile(error, 0.95) < 5e-6
    assert error.max() < 1e-3
    assert (tree.order[got["slot"][met]] == winner[met]).mean() > 0.995


def test_an_image_and_a_texture_are_read_alike(gl) -> None:
    triangles = soup(2000, 0.1, 3)
    rays = soup_rays(3000, 4)
    by_image, by_texture = (
        tree_of(gl, triangles, as_image=way).run(gl, CLOSEST, rays, {"distance": "float", "slot": "uint"})
        for way in (True, False)
    )
    np.testing.assert_array_equal(by_image["distance"], by_texture["distance"])
    np.testing.assert_array_equal(by_image["slot"], by_texture["slot"])
    assert (by_image["distance"] > 0).mean() > 0.5


def test_anything_within_reach_is_what_the_nearest_says(gl) -> None:
    triangles = soup(2000, 0.1, 5)
    rays = soup_rays(3000, 6) | {"far": as_f32(np.random.default_rng(7).uniform(0, 2, 3000))}
    body = CLOSEST + "any = intersect_any(o, d, far, RayOrigin(NONE, NONE, 0u, 0u)) ? 1u : 0u;"
    got = tree_of(gl, triangles).run(gl, body, rays, {"distance": "float", "slot": "uint", "any": "uint"})
    expected = (got["distance"] > 0) & (got["distance"] < rays["far"])
    np.testing.assert_array_equal(got["any"] == 1, expected)
    assert 0.1 < expected.mean() < 0.9


@pytest.fixture(scope="module")
def ball() -> np.ndarray:
    return as_f32(sphere(1.0, 81_920).corners())


def test_a_million_rays_stay_in_a_ball(gl, ball: np.ndarray) -> None:
    """Chords in a closed ball of 81,920 facets: a quarter of a million rays, four reflections each, no leak."""
    rng = np.random.default_rng(8)
    count = 250_000
    inputs = {"o": rng.uniform(-0.5, 0.5, (count, 3)), "d": unit(rng.normal(size=(count, 3)))}
    body = """
    RayOrigin origin = RayOrigin(NONE, NONE, 0u, 0u);
    for (int bounce = 0; bounce < 4 && lost == 0u; ++bounce) {
        Hit hit;
        if (intersect_closest(o, d, FAR_DISTANCE, origin, hit) && dot(hit.normal_g, d) > 0.0) {
            Triangle facet = triangle_at(hit.primitive);
            o = facet.vertex + hit.bary.x * facet.edge1 + hit.bary.y * facet.edge2;
            off = max(off, abs(length(o) - 1.0));
            d = normalize(d - 2.0 * dot(d, hit.normal_g) * hit.normal_g);
            origin = RayOrigin(hit.primitive, hit.object, 1u, 0u);
        } else {
            lost = 1u;
        }
    }
    """
    got = tree_of(gl, ball).run(gl, body, inputs, {"lost": "uint", "off": "float"})
    assert got["lost"].sum() == 0
    # The facets' middles lie this much inside the sphere.
    sagitta = 1.0 - np.linalg.norm(ball.mean(axis=1), axis=1).min()
    assert 0.5 * sagitta < got["off"].max() < 1.1 * sagitta


def test_corners_and_edges_of_a_ball_are_closed(gl, ball: np.ndarray) -> None:
    rng = np.random.default_rng(9)
    targets = np.concatenate(
        [
            ball[:, 0],
            0.5 * (ball[:, 0] + ball[:, 1]),
            ball[:, 1] + rng.random((len(ball), 1)) * (ball[:, 2] - ball[:, 1]),
        ]
    )
    origins = as_f32(rng.uniform(-0.4, 0.4, targets.shape))
    got = tree_of(gl, ball).run(
        gl, CLOSEST, {"o": origins, "d": unit(targets - origins)}, {"distance": "float", "slot": "uint"}
    )
    expected = np.linalg.norm(targets - origins, axis=1)
    assert (got["distance"] < 0).sum() == 0
    assert (np.abs(got["distance"] - expected) / expected).max() < 2e-5


def grid_box(low: np.ndarray, high: np.ndarray, cells: int) -> np.ndarray:
    """A box whose faces are grids of cells² squares: triangles (12 cells², 3, 3), outward."""
    faces = []
    s = np.linspace(0, 1, cells + 1)
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0.0, 1.0):
            grid = np.zeros((cells + 1, cells + 1, 3))
            grid[..., axis], grid[..., u], grid[..., v] = side, s[:, None], s[None, :]
            a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
            order = ((a, b, c), (a, c, d)) if side else ((a, c, b), (a, d, c))
            faces += [np.stack(corners, axis=-2).reshape(-1, 3, 3) for corners in order]
    return as_f32(low + np.concatenate(faces) * (high - low))


def test_touching_boxes_are_left_and_entered_once_each(gl) -> None:
    """Straight through two boxes with a common face, meshed differently: four crossings, none lost or repeated."""
    triangles = [
        grid_box(np.array([-1.0, -1, -1]), np.array([1.0, 1, 0]), 3),
        grid_box(np.array([-1.0, -1, 0]), np.array([1.0, 1, 1]), 5),
    ]
    owner = np.repeat([0, 1], [len(part) for part in triangles])
    objects = OBJECT.zeros(2)
    objects["stack_bit"] = [0, 1]
    tree = tree_of(gl, np.concatenate(triangles), owner, objects)
    count = 20_000
    rng = np.random.default_rng(10)
    start = np.column_stack([rng.uniform(-0.6, 0.6, (count, 2)), np.full(count, -3.0)])
    tilt = np.column_stack([rng.uniform(-0.1, 0.1, (count, 2)), np.ones(count)])
    upward = np.arange(count) % 2 == 0
    sign = np.where(upward, 1.0, -1.0)[:, None] * np.array([0.0, 0, 1]) + np.array([1.0, 1, 0])
    body = """
    RayOrigin origin = RayOrigin(NONE, NONE, 0u, 0u);
    Hit hit;
    while (crossings < 9u && intersect_closest(o, d, FAR_DISTANCE, origin, hit)) {
        bool entering = dot(d, hit.normal_g) < 0.0;
        uint bit = 1u << hit.object;
        wrong |= ((inside & bit) != 0u) == entering ? 1u : 0u;
        inside = entering ? inside | bit : inside & ~bit;
        void_inside |= crossings < 3u && inside == 0u ? 1u : 0u;
        Triangle facet = triangle_at(hit.primitive);
        o = facet.vertex + hit.bary.x * facet.edge1 + hit.bary.y * facet.edge2;
        origin = RayOrigin(hit.primitive, hit.object, uint(entering), inside);
        ++crossings;
    }
    """
    outputs = dict.fromkeys(("crossings", "inside", "wrong", "void_inside"), "uint")
    got = tree.run(gl, body, {"o": start * sign, "d": unit(tilt * sign)}, outputs, MEDIUM_STACK=1)
    np.testing.assert_array_equal(got["crossings"], 4)
    assert got["inside"].max() == 0
    assert got["wrong"].max() == 0
    assert got["void_inside"].max() == 0  # no film of air between the two
