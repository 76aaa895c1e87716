"""Three ways to find the nearest surface — tree, loop, half-spaces — against a float64 search of every triangle."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, SCENE_STRUCTS, SOLID, TRIANGLE
from spectrasplat.gpu.scene_texels import SceneTexels, tree_texels
from spectrasplat.model.geometry import bvh
from spectrasplat.reference import optics
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

BODY = """
    Hit hit;
    RayOrigin origin = RayOrigin(from, from_object, uint(inside != 0u), 0u);
    bool met = intersect_closest(o, d, FAR_DISTANCE, origin, hit);
    distance = met ? hit.distance : -1.0;
    slot = hit.primitive;
    normal = hit.normal_g;
    bary = hit.bary;
"""
OUTPUTS = {"distance": "float", "slot": "uint", "normal": "vec3", "bary": "vec2"}


def uv_sphere(rings: int, sectors: int) -> np.ndarray:
    """Closed unit sphere, corners (T, 3, 3), outward."""
    u, v = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, sectors + 1), indexing="ij")
    v[:, -1] = 0  # the seam closes exactly
    p = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1)
    p[0], p[-1] = [0, 0, 1], [0, 0, -1]
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    lower, upper = np.stack([a, b, c], -2)[:-1], np.stack([a, c, d], -2)[1:]
    return as_f32(np.concatenate([lower.reshape(-1, 3, 3), upper.reshape(-1, 3, 3)]))


def soup(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return as_f32(rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, 0.1, (count, 3, 3)))


def nearest(
    triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray, margin: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(distance or inf, triangle) per ray; hits may lie `margin` (in barycentric weight) outside an edge."""
    distances, winners = [], []
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = np.cross(e1, e2)
    for origin, direction in zip(origins, directions, strict=True):
        facing = normal @ direction
        t = optics.dot(a - origin, normal) / np.where(facing == 0, np.inf, facing)
        offset = origin + t[:, None] * direction - a
        square = optics.dot(normal, normal)
        u = optics.dot(np.cross(offset, e2), normal) / square
        v = optics.dot(np.cross(e1, offset), normal) / square
        met = (facing != 0) & (t > 0) & (u >= -margin) & (v >= -margin) & (u + v <= 1 + margin)
        t = np.where(met, t, np.inf)
        winners.append(int(t.argmin()))
        distances.append(t.min())
    return np.array(distances), np.array(winners)


class Shaders:
    """`intersect_closest` over one list of triangles."""

    def __init__(
        self,
        gl,
        triangles: np.ndarray,
        tree: bool,
        defines: dict[str, int] | None = None,
        buffers: dict | None = None,
        binders: tuple = (),
    ) -> None:
        self.ctx = gl.ctx
        built = bvh.build_bvh(triangles.astype(np.float32), use_cache=False)
        self.order = built.order if tree else np.arange(len(triangles), dtype=np.int32)
        ordered = triangles[self.order]
        records = TRIANGLE.zeros(len(ordered))
        records["vertex"] = ordered[:, 0]
        records["edge1"], records["edge2"] = ordered[:, 1] - ordered[:, 0], ordered[:, 2] - ordered[:, 0]
        records["normals"], records["source"] = NONE, self.order
        self.texels = SceneTexels(
            gl.ctx, {"TREE": tree_texels(built.nodes), "TRIANGLES": records, "OBJECTS": OBJECT.zeros(1)}
        )
        self.buffers = buffers or {}
        self.binders = [self.texels.bind, *binders]
        chosen = {"HAS_TREE": 1, "LOOSE_TRIANGLES": 1, "TREE_STACK": bvh.MAX_DEPTH} if tree else {"LOOSE_TRIANGLES": 1}
        if defines is not None:
            chosen = defines
        self.defines = {
            **bindings.SCENE_DEFINES,
            **self.texels.defines,
            "TRIANGLE_COUNT": len(triangles),
            "SPECTRAL_SAMPLES": 2,
            **chosen,
        }

    def closest(
        self, origins: np.ndarray, directions: np.ndarray, slots: np.ndarray | None = None, inside: int = 0
    ) -> dict[str, np.ndarray]:
        """Per ray: distance (-1 where nothing was met), slot in the tree's order, normal, weights."""
        count = len(origins)
        inputs = {
            "o": origins,
            "d": directions,
            "from": np.full(count, NONE, np.uint32) if slots is None else slots.astype(np.uint32),
            "from_object": np.full(count, NONE if slots is None else 0, np.uint32),
            "inside": np.full(count, inside, np.uint32),
        }
        return evaluate(
            self.ctx,
            ["lib/intersect.glsl"],
            BODY,
            inputs,
            OUTPUTS,
            self.defines,
            SCENE_STRUCTS,
            self.buffers,
            self.binders,
        )


def rays(count: int, seed: int, spread: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    origins = as_f32(rng.uniform(-spread, spread, (count, 3)))
    return origins, as_f32(optics.unit(rng.normal(0, 0.5, (count, 3)) - origins))


def test_tree_and_loop_agree_to_the_bit(gl) -> None:
    triangles = uv_sphere(12, 24)
    origins, directions = rays(4000, 3, spread=1.5)
    by_tree, by_loop = (Shaders(gl, triangles, tree).closest(origins, directions) for tree in (True, False))
    np.testing.assert_array_equal(by_tree["distance"], by_loop["distance"])
    assert (by_tree["distance"] > 0).mean() > 0.5


@pytest.mark.parametrize("grazing_deg", [60.0, 5.0, 1.0])
def test_a_ray_does_not_meet_the_surface_it_leaves(gl, grazing_deg: float) -> None:
    triangles = uv_sphere(24, 48)
    shaders = Shaders(gl, triangles, tree=True)
    ordered = triangles[shaders.order]
    rng = np.random.default_rng(5)
    weights = rng.dirichlet([1, 1, 1], len(ordered))
    start = as_f32(np.einsum("tc,tcx->tx", weights, ordered))
    normal = optics.unit(np.cross(ordered[:, 1] - ordered[:, 0], ordered[:, 2] - ordered[:, 0]))
    along = optics.unit(np.cross(normal, rng.normal(size=normal.shape)))
    tilt = np.radians(grazing_deg)
    inward = as_f32(np.cos(tilt) * along - np.sin(tilt) * normal)
    slots = np.arange(len(ordered))
    got = shaders.closest(start, inward, slots, inside=1)
    assert (got["distance"] > 0).all()  # never out through a crack
    assert (got["slot"] != slots).all()
    # The chord of a sphere; of a coarse facet near its edge less.
    chord = 2 * np.sin(tilt)
    assert np.median(got["distance"]) == pytest.approx(chord, rel=0.2 if grazing_deg > 10 else 1.5)
    assert (optics.dot(got["normal"], inward) > 0).all()  # it meets the inner side
    outward = as_f32(np.cos(tilt) * along + np.sin(tilt) * normal)
    assert (shaders.closest(start, outward, slots, inside=0)["distance"] < 0).all()  # convex: nothing outside


@pytest.mark.parametrize("in_storage", [False, True], ids=["uniform", "storage"])
def test_half_spaces_equal_the_triangles_of_a_cube(gl, in_storage: bool) -> None:
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    planes = np.column_stack([axes, np.full(6, 0.5)]).astype(np.float32)
    faces = []
    for axis in axes:
        side = np.roll(axis, 1)
        up = np.cross(axis, side)
        a, b, c, d = (0.5 * (axis + s * side + t * up) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
        faces += [[a, b, c], [a, c, d]]
    cube = as_f32(np.array(faces))
    solid = SOLID.zeros(1)
    solid["plane_count"] = 6
    defines = {"CONVEX_SOLIDS": 1, "SOLID_COUNT": 1, "PLANE_COUNT": 6}
    blocks = {bindings.SOLIDS: solid, bindings.PLANES: planes}
    if in_storage:
        shaders = Shaders(gl, cube, tree=False, defines=defines | {"SOLIDS_IN_STORAGE": 1}, buffers=blocks)
    else:
        held = {binding: gl.ctx.buffer(block) for binding, block in blocks.items()}
        binders = tuple(lambda b=binding, h=buffer: h.bind_to_uniform_block(b) for binding, buffer in held.items())
        shaders = Shaders(gl, cube, tree=False, defines=defines, binders=binders)
    origins, directions = rays(1500, 6, spread=1.5)
    got = shaders.closest(origins, directions)
    want, _ = nearest(cube, origins, directions)
    lenient, _ = nearest(cube, origins, directions, 1e-5)
    clear = np.isfinite(want) == np.isfinite(lenient)
    np.testing.assert_array_equal((got["distance"] >= 0)[clear], np.isfinite(want)[clear])
    met = clear & np.isfinite(want)
    assert met.sum() > 200
    assert np.abs(got["distance"][met] - want[met]).max() < 3e-6
    assert (np.abs(np.abs(got["normal"][met]).max(-1) - 1) < 1e-6).all()


DIFFUSE, GLASS = 1, 3
KINDS = GLASS, GLASS, GLASS, DIFFUSE, GLASS
ORDER = (4, 0, 2)
"""Objects of the stack by rising priority; 1 and 3 lie alone."""
STACK = {"MEDIUM_STACK": 1, "STACK_SIZE": len(ORDER), "STACK_OBJECTS": "uint[](4u, 0u, 2u)"}


def test_which_hits_count(gl) -> None:
    near = 3e-5
    cases = [
        (distance, facing, obj, from_object, inside, mask)
        for distance in (-1.0, -2e-5, -1e-7, 0.0, 1e-7, 1e-5, 1.0)
        for facing in (-0.5, 0.5)
        for obj in (0, 1, 3)
        for from_object in (0, 1, NONE)
        for inside in (0, 1)
        for mask in range(0, 8, 3)
    ]
    columns = list(zip(*cases, strict=True))
    inputs = {name: as_f32(np.array(column)) for name, column in zip(("distance", "facing"), columns[:2], strict=True)}
    inputs |= {
        name: np.array(column, np.uint32)
        for name, column in zip(("object", "from_object", "inside", "mask"), columns[2:], strict=True)
    }
    body = """
    RayOrigin o = RayOrigin(NONE, from_object, uint(inside != 0u), mask);
    ok = accept_hit(distance, facing, object, o) ? 1u : 0u;
    key = crossing_key(distance, facing);
    """
    objects = OBJECT.zeros(len(KINDS))
    objects["kind"], objects["stack_bit"] = KINDS, NONE
    objects["stack_bit"][list(ORDER)] = range(len(ORDER))
    texels = SceneTexels(gl.ctx, {"TRIANGLES": TRIANGLE.zeros(1), "OBJECTS": objects})
    numbers = {"SPECTRAL_SAMPLES": 2, "INDEX_ROW": 0, "SPECTRAL_GROUPS": 0, "TRIANGLE_COUNT": 0}
    for stack in (False, True):
        defines = bindings.SCENE_DEFINES | texels.defines | numbers | (STACK if stack else {})
        outputs = {"ok": "uint", "key": "float"}
        got = evaluate(
            gl.ctx, ["lib/intersect.glsl"], body, inputs, outputs, defines, SCENE_STRUCTS, binders=[texels.bind]
        )
        for row, (distance, facing, obj, from_object, inside, mask) in enumerate(cases):
            same, enters = obj == from_object, facing < 0
            if same:  # a solid is not left twice nor entered from within at once
                want = distance > 0 and not (distance < near and bool(inside) == enters)
            else:
                want = distance > -near
                if from_object == NONE:  # nothing is in contact with a lamp, which leaves what it lies on or enters it
                    enters_glass = abs(distance) < 2e-7 and enters and KINDS[obj] == GLASS
                    want = distance > 2e-7 or enters_glass
                if stack and obj in ORDER and distance < near:  # what the mask knows to be crossed is not crossed again
                    want = want and (mask >> ORDER.index(obj) & 1 == 1) != enters
            assert got["ok"][row] == want, (stack, cases[row])
        leaves = np.array([facing > 0 for _, facing, *_ in cases])
        np.testing.assert_allclose(got["key"] - inputs["distance"], np.where(leaves & stack, near, 0.0), atol=1e-7)
    texels.release()
