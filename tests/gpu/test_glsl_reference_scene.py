"""Media, spectral rows, scene records, Gaussians and the small tests of an intersection against their CPU references in
app/reference."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from reference import gaussians, medium
from spectrasplat.gpu import bindings
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_records import OBJECT, SCENE_STRUCTS, TRIANGLE
from spectrasplat.gpu.scene_texels import SceneTexels, spectra_texture
from spectrasplat.gpu.schema import Struct
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COVERS = {
    "medium.glsl": (
        "medium_of",
        "is_inside",
        "current_medium",
        "medium_weight_row",
        "cross_boundary",
        "medium_index",
        "interface_indices",
        "medium_slope",
        "index_ratio_derivative",
    ),
    "scene.glsl": ("scene_texel", "triangle_at", "object_at", "corner_normal", "spectral_pair", "spectral_row"),
    "gaussian.glsl": ("erf_approx", "gaussian_box", "gaussian_box_fast", "normal_excess", "sinc_pi"),
    "intersect.glsl": ("accept_hit", "crossing_key", "box_entry"),
}
COUNT = 4096
SAMPLES = 65
ORDER = (4, 0, 2)
"""Objects of the stack by rising priority; 1 and 3 lie alone."""
OBJECTS = 5
DIFFUSE, GLASS = 1, 3
KINDS = GLASS, GLASS, GLASS, DIFFUSE, GLASS
STACK = {"MEDIUM_STACK": 1, "STACK_SIZE": len(ORDER), "STACK_OBJECTS": "uint[](4u, 0u, 2u)"}
COMMON = {
    "SPECTRAL_SAMPLES": SAMPLES,
    "INDEX_ROW": 0,
    "SLOPE_ROW": 3,
    "VARIABLE_ROW": 0,
    "WEIGHT_ROW": 0,
    "SPECTRAL_GROUPS": 2,
    "MERGED_GROUPS": 1,
    "TRIANGLE_COUNT": 0,
}


class Scene:
    """Objects with glasses (three media, two spectral groups) and their tables."""

    def __init__(self, gl) -> None:
        rng = np.random.default_rng(1)
        self.ctx = gl.ctx
        self.objects = OBJECT.zeros(OBJECTS)
        self.objects["kind"] = KINDS
        self.objects["medium"] = 0, 1, 2, 0, 1
        self.objects["group"] = 0, 1, NONE, 0, 1
        self.objects["weight_row"] = 7, NONE, 9, 3, 1
        self.objects["stack_bit"] = NONE
        self.objects["stack_bit"][list(ORDER)] = range(len(ORDER))
        self.table = rng.uniform(1.0, 2.0, (6, SAMPLES)).astype(np.float32)
        self.triangles = TRIANGLE.zeros(4500)
        for name in ("vertex", "edge1", "edge2"):
            self.triangles[name] = rng.normal(size=(4500, 3))
        self.triangles["object"], self.triangles["normals"], self.triangles["source"] = (
            np.arange(4500),
            np.arange(4500) * 3,
            np.arange(4500)[::-1],
        )
        self.normals = rng.normal(size=(900, 4)).astype(np.float32)

    def evaluate(
        self,
        body: str,
        inputs: Mapping[str, np.ndarray],
        outputs: Mapping[str, str],
        stack: bool = False,
        as_image: bool | None = None,
        include: str = "lib/medium.glsl",
    ) -> dict[str, np.ndarray]:
        texels = SceneTexels(
            self.ctx, {"TRIANGLES": self.triangles, "NORMALS": self.normals, "OBJECTS": self.objects}, as_image
        )
        spectra = spectra_texture(self.ctx, self.table)
        defines = {**bindings.SCENE_DEFINES, **texels.defines, **COMMON, **(STACK if stack else {})}
        structs: tuple[Struct, ...] = SCENE_STRUCTS
        try:
            return evaluate(
                self.ctx,
                [include],
                body,
                inputs,
                outputs,
                defines,
                structs,
                binders=[texels.bind, lambda: texels.bind_spectra(spectra)],
            )
        finally:
            texels.release()
            spectra.release()


@pytest.fixture(scope="module")
def scene(gl) -> Scene:
    return Scene(gl)


@pytest.mark.parametrize("stack", [False, True], ids=["alone", "stack"])
def test_media_on_both_sides_of_a_surface(scene: Scene, stack: bool) -> None:
    masks = range(8) if stack else (0,)
    cases = [
        (mask, alone, hit, enters)
        for mask in masks
        for alone in (NONE, 1, 3)
        for hit in range(OBJECTS)
        for enters in (0, 1)
    ]
    mask, alone, hit, enters = np.array(cases, np.uint32).T
    body = """
    MediumStack stack = MediumStack(mask, alone);
    MediumInterface c = cross_boundary(stack, hit, enters != 0u);
    before = c.before; after = c.after; mask_after = c.behind.mask; object_after = c.behind.object;
    changes = c.changes ? 1u : 0u;
    inside = is_inside(stack) ? 1u : 0u; now = current_medium(stack); weight = medium_weight_row(stack);
    """
    names = ("before", "after", "mask_after", "object_after", "changes", "inside", "now", "weight")
    got = scene.evaluate(
        body, {"mask": mask, "alone": alone, "hit": hit, "enters": enters}, dict.fromkeys(names, "uint"), stack
    )
    for row, (held, solid, surface, entering) in enumerate(cases):
        ranks = frozenset(rank for rank in range(3) if held >> rank & 1)
        want = medium.cross(ranks, solid, surface, bool(entering), ORDER if stack else ())
        now = medium.medium(ranks, solid, ORDER)
        weight = NONE if now == NONE else int(scene.objects["weight_row"][now])
        expected = (
            want.before,
            want.after,
            medium.mask_of(want.inside),
            want.object_after,
            want.changes,
            bool(ranks) or solid != NONE,
            now,
            weight,
        )
        assert tuple(int(got[name][row]) for name in names) == tuple(map(int, expected)), cases[row]


def test_the_medium_of_every_mask(scene: Scene) -> None:
    masks = np.arange(8, dtype=np.uint32)
    got = scene.evaluate("m = medium_of(mask);", {"mask": masks}, {"m": "uint"}, stack=True)["m"]
    want = [medium.medium(frozenset(r for r in range(3) if m >> r & 1), NONE, ORDER) for m in range(8)]
    np.testing.assert_array_equal(got, np.array(want, np.uint32))


@pytest.mark.parametrize("stack", [False, True], ids=["alone", "stack"])
def test_indices_and_their_slopes_at_a_surface(scene: Scene, stack: bool) -> None:
    rng = np.random.default_rng(2)
    # Without a stack one side is air.
    before = rng.choice(np.array([*range(OBJECTS), NONE], np.uint32), COUNT)
    after = rng.choice(np.array([*range(OBJECTS), NONE], np.uint32), COUNT)
    if not stack:
        before = np.where(rng.random(COUNT) < 0.5, np.uint32(NONE), before)
        after = np.where(before == NONE, np.where(after == NONE, np.uint32(0), after), np.uint32(NONE)).astype(
            np.uint32
        )
    x = as_f32(rng.uniform(-0.05, 1.05, (COUNT, 3)))
    body = """
    MediumInterface c = MediumInterface(before, after, MediumStack(0u, NONE), true);
    interface_indices(c, x, n_i, n_t);
    single = medium_index(before, x.x);
    row2 = spectral_row(2u, x.z);
    slope = medium_slope(after == NONE ? 0u : after, x.y);
    d0 = index_ratio_derivative(c, 0u, x.y, n_i.y, n_t.y);
    d1 = index_ratio_derivative(c, 1u, x.y, n_i.y, n_t.y);
    """
    outputs = {
        "n_i": "vec3",
        "n_t": "vec3",
        "single": "float",
        "row2": "float",
        "slope": "float",
        "d0": "float",
        "d1": "float",
    }
    got = scene.evaluate(body, {"before": before, "after": after, "x": x}, outputs, stack)

    def rows(of: np.ndarray, first: int, at: np.ndarray, air: float) -> np.ndarray:
        values = np.full(COUNT, air)
        for item in range(OBJECTS):
            chosen = of == item
            values[chosen] = medium.linear_row(scene.table[first + scene.objects["medium"][item]], at[chosen])
        return values

    n_i, n_t = (np.column_stack([rows(side, 0, x[:, k], 1.0) for k in range(3)]) for side in (before, after))
    room = 2e-5  # steps of the random table are up to 1 in a cell of 1/64, x is known to 1e-7 of it
    assert np.abs(got["n_i"] - n_i).max() < room and np.abs(got["n_t"] - n_t).max() < room
    assert np.abs(got["single"] - n_i[:, 0]).max() < room
    assert np.abs(got["row2"] - medium.linear_row(scene.table[2], x[:, 2])).max() < room
    glass_behind = after != NONE
    assert np.abs(got["slope"] - rows(after, 3, x[:, 1], 0.0))[glass_behind].max() < room
    for g in (0, 1):
        of_group = [np.isin(side, np.flatnonzero(scene.objects["group"] == g)) for side in (before, after)]
        dn_i, dn_t = (
            np.where(member, rows(side, 3, x[:, 1], 0.0), 0.0)
            for member, side in zip(of_group, (before, after), strict=True)
        )
        want = medium.index_ratio_slope(n_i[:, 1], n_t[:, 1], dn_i, dn_t)
        assert np.abs(got[f"d{g}"] - want).max() < 2 * room
        assert (want != 0).mean() > 0.2


@pytest.mark.parametrize("as_image", [False, True], ids=["texture", "image"])
def test_scene_records_are_found_in_the_texture(scene: Scene, as_image: bool) -> None:
    # 4500 triangles of three texels pass the end of the texture's first row of 4096.
    slot = np.random.default_rng(3).integers(0, 4500, COUNT, dtype=np.uint32)
    slot[:3] = 0, 4499, 1365
    body = """
    Triangle t = triangle_at(slot);
    vertex = t.vertex; edge1 = t.edge1; edge2 = t.edge2; object = t.object; normals = t.normals; source = t.source;
    corner = corner_normal(slot % 900u);
    Object o = object_at(slot % 5u);
    medium = o.medium; weight = o.weight_row; bit_ = o.stack_bit; group_ = o.group;
    raw = scene_texel(uint(NORMALS_AT) + slot % 900u).w;
    """
    outputs = {
        "vertex": "vec3",
        "edge1": "vec3",
        "edge2": "vec3",
        "object": "uint",
        "normals": "uint",
        "source": "uint",
        "corner": "vec3",
        "medium": "uint",
        "weight": "uint",
        "bit_": "uint",
        "group_": "uint",
        "raw": "uint",
    }
    got = scene.evaluate(body, {"slot": slot}, outputs, as_image=as_image)
    for name in ("vertex", "edge1", "edge2", "object", "normals", "source"):
        np.testing.assert_array_equal(got[name], scene.triangles[name][slot], err_msg=name)
    np.testing.assert_array_equal(got["corner"], scene.normals[slot % 900, :3])
    np.testing.assert_array_equal(got["raw"], scene.normals[slot % 900, 3].view(np.uint32))
    for name, member in (("medium", "medium"), ("weight", "weight_row"), ("bit_", "stack_bit"), ("group_", "group")):
        np.testing.assert_array_equal(got[name], scene.objects[member][slot % 5], err_msg=member)


def test_gaussians(gl) -> None:
    rng = np.random.default_rng(4)
    x = as_f32(np.concatenate([rng.normal(0, 2.5, COUNT - 4), [0.0, 1e-20, 30.0, -30.0]]))
    width = as_f32(rng.uniform(0.01, 3.0, COUNT))
    body = (
        "e = erf_approx(x); box = gaussian_box(x, w); fast = gaussian_box_fast(x, w); excess = normal_excess(x); s = "
        "sinc_pi(x);"
    )
    got = evaluate(
        gl.ctx,
        ["lib/gaussian.glsl"],
        body,
        {"x": x, "w": width},
        dict.fromkeys(("e", "box", "fast", "excess", "s"), "float"),
    )
    assert np.abs(got["e"] - gaussians.erf(x)).max() < 2e-6
    want = gaussians.gaussian_box(x, width)
    assert np.abs(got["box"] - want).max() < 2e-6
    assert np.abs(got["fast"] - want).max() < 6e-4
    near = np.abs(x) < 8
    assert (np.abs(got["excess"] - gaussians.normal_excess(x)) / (1 + np.abs(x)))[near].max() < 2e-6
    assert np.abs(got["s"] - gaussians.sinc_pi(x))[np.abs(x) < 20].max() < 5e-6
    # Boxes side by side add up exactly by either formula.
    edges = as_f32(np.arange(-8, 8, 0.25))
    middles, half = 0.5 * (edges[1:] + edges[:-1]), np.full(len(edges) - 1, 0.125)
    sides = evaluate(
        gl.ctx,
        ["lib/gaussian.glsl"],
        body,
        {"x": middles, "w": half},
        dict.fromkeys(("e", "box", "fast", "excess", "s"), "float"),
    )
    assert abs(sides["box"].sum() - 1.0) < 1e-5 and abs(sides["fast"].sum() - 1.0) < 1e-5


def test_which_hits_count(scene: Scene) -> None:
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
    for stack in (False, True):
        got = scene.evaluate(body, inputs, {"ok": "uint", "key": "float"}, stack, include="lib/intersect.glsl")
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


def test_where_a_ray_enters_a_box(scene: Scene) -> None:
    rng = np.random.default_rng(5)
    low = as_f32(rng.uniform(-1, 0.5, (COUNT, 3)))
    high = as_f32(low + rng.uniform(0, 1, (COUNT, 3)))
    start = as_f32(rng.uniform(-2, 2, (COUNT, 3)))
    direction = rng.normal(size=(COUNT, 3))
    direction[::2] = (low + rng.random((COUNT, 3)) * (high - low) - start)[::2]
    direction = as_f32(direction / np.linalg.norm(direction, axis=1, keepdims=True))
    far = as_f32(rng.uniform(0, 4, COUNT))
    body = "entry = box_entry(low, high, start, 1.0 / direction, 0.0, far);"
    texels = SceneTexels(scene.ctx, {})
    defines = {**bindings.SCENE_DEFINES, **texels.defines, **COMMON, "HAS_TREE": 1, "TREE_STACK": 2}
    inputs = {"low": low, "high": high, "start": start, "direction": direction, "far": far}
    got = evaluate(
        scene.ctx,
        ["lib/intersect.glsl"],
        body,
        inputs,
        {"entry": "float"},
        defines,
        SCENE_STRUCTS,
        binders=[texels.bind],
    )["entry"]
    texels.release()
    # By sampling the definition: the ray's parameters inside each slab, and their common part.
    t = np.stack([(low - start) / direction, (high - start) / direction])
    enter, leave = np.maximum(t.min(axis=0).max(axis=1), 0.0), np.minimum(t.max(axis=0).min(axis=1), far)
    met = enter <= leave
    clear = np.abs(enter - leave) > 1e-5
    np.testing.assert_array_equal((got < 1e29)[clear], met[clear])
    assert np.abs(got - enter)[met].max() < 2e-5
    assert 0.2 < met.mean() < 0.8
    assert (got < 1e29)[met].all()  # conservative: no box that is met is missed
