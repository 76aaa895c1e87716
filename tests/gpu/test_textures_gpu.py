"""Pictures on surfaces and round the scene: the store, and every function of lib/textures.glsl against its CPU
reference.

What the filter stands for is tested apart from how it does it: `test_textures_filter.py` compares with means by brute
force.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import textures as cpu_reference
from spectrasplat.base.errors import UserError
from spectrasplat.features.features import Features
from spectrasplat.gpu import mip_chain
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.gpu.texture_store import TextureStore, place_defines
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.mesh import Mesh, make_mesh
from spectrasplat.model.lights import PointLight
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import (
    Camera,
    Dielectric,
    Diffuse,
    Scene,
    SceneObject,
)
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment, Texture
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT = 2048
BINDING, UNIT = 9, 3
LIB = ["lib/textures.glsl"]
PLACES = {"BIND_PICTURES": BINDING, "UNIT_PICTURES": UNIT, "UNIT_CORNERS": UNIT + 1}
NO_PICTURE = 0xFFFFFFFF


def picture(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, 3), dtype=np.float32)


def quad(uv_scale: float = 1.0) -> Mesh:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return make_mesh("quad", np.column_stack([corners, np.zeros(4)]), faces, uv=uv_scale * corners[faces])


def scene_of(*pictures: Texture | None, environment: np.ndarray | None = None, mesh: Mesh | None = None) -> Scene:
    """A quad for each picture; None is one without."""
    objects = tuple(SceneObject(f"object {i}", mesh or quad(), Diffuse(texture=t)) for i, t in enumerate(pictures))
    light = PointLight("lamp", illuminant("D65"), position=(0.0, 0.0, 3.0))
    sky = None if environment is None else Environment(environment)
    return Scene("test", Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)), (light,), objects, environment=sky)


def store_of(gl, scene: Scene, **options) -> TextureStore:
    first = np.cumsum([0] + [len(o.mesh.triangles) for o in scene.objects])
    return TextureStore(gl.ctx, scene, first, np.tile(np.arange(3), (first[-1], 1)), **options)


def run(
    gl, store: TextureStore, body: str, inputs: dict[str, np.ndarray], outputs: dict[str, str]
) -> dict[str, np.ndarray]:
    defines = store.defines | place_defines(BINDING, UNIT)
    return evaluate(
        gl.ctx, LIB, body, inputs, outputs, defines, store.structs, binders=[lambda: store.bind(BINDING, UNIT)]
    )


@pytest.mark.parametrize("as_image", [True, False], ids=["image", "texture"])
def test_every_texel_of_every_level_is_found(gl, as_image: bool) -> None:
    pictures = [Texture(picture(h, w, seed=h)) for h, w in ((16, 16), (7, 12), (1, 19), (23, 1), (1, 1), (33, 20))]
    store = store_of(gl, scene_of(*pictures, environment=picture(9, 18)), as_image=as_image)
    wanted, at = [], []
    for index, levels in enumerate(
        [mip_chain.texture_levels(p.rgb) for p in pictures] + [mip_chain.environment_levels(picture(9, 18))]
    ):
        for k, level in enumerate(levels):
            rows, columns = np.indices(level.shape[:2]).reshape(2, -1)
            at.append(np.column_stack([np.full(rows.size, index), np.full(rows.size, k), columns, rows]))
            wanted.append(level.reshape(-1, 3))
    which, level, column, row = np.concatenate(at).astype(np.uint32).T
    body = (
        "rgb = picture_texel(level_origin(pictures[which], int(level)) + ivec2(column, line)); levels = "
        "pictures[which].levels;"
    )
    got = run(
        gl,
        store,
        body,
        {"which": which, "level": level, "column": column, "line": row},
        {"rgb": "vec3", "levels": "uint"},
    )
    np.testing.assert_array_equal(got["rgb"], np.concatenate(wanted))
    assert (got["levels"][:1] == 5).all()
    assert store.bytes > sum(p.rgb.size // 3 * 16 for p in pictures)
    store.release()


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
def test_a_patch_without_size_is_bilinear(gl, wrap: str) -> None:
    rgb = picture(37, 50)
    store = store_of(gl, scene_of(Texture(rgb, wrap)))
    uv = as_f32(np.random.default_rng(1).uniform(-1.5, 2.5, (COUNT, 2)))
    body = """
    rgb = texture_filtered(pictures[0], uv, vec2(0.0), vec2(0.0));
    bvec2 repeats = notEqual(pictures[0].repeats, uvec2(0u));
    direct = level_bilinear(level_origin(pictures[0], 0), vec2(pictures[0].size), repeats, vec2(uv.x, 1.0 - uv.y));
    """
    got = run(gl, store, body, {"uv": uv}, {"rgb": "vec3", "direct": "vec3"})
    want = cpu_reference.bilinear(rgb, np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]), (wrap == "repeat",) * 2)
    room = 3e-5  # a place is known to 2^-22 of the picture, 1e-5 of its 50 texels
    assert np.abs(got["rgb"] - want).max() < room and np.abs(got["direct"] - want).max() < room
    # Texel centres show their texel; row 0 is the top.
    rows, columns = np.indices(rgb.shape[:2]).reshape(2, -1)
    centres = np.column_stack([(columns + 0.5) / 50, 1.0 - (rows + 0.5) / 37])
    got = run(
        gl, store, "rgb = texture_filtered(pictures[0], uv, vec2(0.0), vec2(0.0));", {"uv": centres}, {"rgb": "vec3"}
    )
    assert np.abs(got["rgb"] - rgb.reshape(-1, 3)).max() < room
    store.release()


def test_repeated_pictures_go_on_and_clamped_ones_end(gl) -> None:
    rng = np.random.default_rng(2)
    rgb = picture(24, 40)
    store = store_of(gl, scene_of(Texture(rgb, "repeat"), Texture(rgb, "clamp")))
    uv, side = as_f32(rng.random((COUNT, 2))), as_f32(rng.normal(size=(COUNT, 2)) * 0.05)
    beyond = as_f32(uv + rng.integers(-3, 4, (COUNT, 2)))
    far = np.column_stack([rng.choice([-2.0, 3.0], COUNT), uv[:, 1]])
    body = """
    here = texture_filtered(pictures[0], uv, side, side.yx);
    there = texture_filtered(pictures[0], beyond, side, side.yx);
    border = texture_filtered(pictures[1], far, vec2(0.0), vec2(0.0));
    """
    got = run(
        gl,
        store,
        body,
        {"uv": uv, "side": side, "beyond": beyond, "far": far},
        {"here": "vec3", "there": "vec3", "border": "vec3"},
    )
    assert np.abs(got["here"] - got["there"]).max() < 1e-4
    edge = rgb[:, np.where(far[:, 0] < 0, 0, 39)].swapaxes(0, 1)  # (COUNT, 24, 3): the column it ends with
    want = np.stack(
        [
            cpu_reference.bilinear(e[:, None], np.array([[0.5, 1.0 - v]]), (False, False))[0]
            for e, v in zip(edge, far[:, 1], strict=True)
        ]
    )
    assert np.abs(got["border"] - want).max() < 3e-5
    store.release()


def turned_scene() -> tuple[Scene, np.ndarray]:
    """Glass, then textured needles of which one object is mirrored; uv is affine in the mesh's own coordinates."""
    rng = np.random.default_rng(5)
    affine = rng.normal(size=(3, 2)) * 3.0
    vertices = rng.normal(size=(90, 3))
    vertices[1::3] = vertices[::3] + 0.02 * rng.normal(size=(30, 3))  # a short edge somewhere
    faces = np.arange(90).reshape(30, 3)
    faces = np.take_along_axis(faces, (np.arange(30)[:, None] + np.arange(3)) % 3, axis=1)
    mesh = make_mesh("needles", vertices, faces, uv=(vertices @ affine)[faces])
    mirrored = np.diag([-1.5, 1.0, 0.5, 1.0])
    glass = SceneObject("block", primitives.box(), Dielectric(_glass()))
    texture = Texture(picture(8, 8), "clamp")
    worn = Diffuse(texture=texture)
    objects = (
        SceneObject("a", mesh, worn),
        glass,
        SceneObject("plain", mesh, Diffuse()),
        SceneObject("b", mesh, worn, mirrored),
    )
    return replace(scene_of(), objects=objects), affine


def _glass():
    from spectrasplat.model.optics import catalogue

    return catalogue.find("N-BK7", "test")


def test_texture_coordinates_follow_turned_and_mirrored_triangles(gl) -> None:
    scene, affine = turned_scene()
    settings = RenderSettings()
    features = Features.of(scene, settings)
    buffers = SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features))
    store = TextureStore(gl.ctx, scene, buffers.first_triangle, buffers.corner_turn)
    assert {tuple(turn) for turn in buffers.corner_turn} == {(0, 1, 2), (1, 2, 0), (2, 0, 1)}
    rng = np.random.default_rng(6)
    slot = rng.integers(0, buffers.triangle_count, COUNT, dtype=np.uint32)
    bary = as_f32(rng.dirichlet([1, 1, 1], COUNT)[:, :2])
    body = """
    Triangle t = triangle_at(slot); Object o = object_at(t.object);
    texture_ = o.texture; object = t.object; edge1 = t.edge1; edge2 = t.edge2;
    point = t.vertex + bary.x * t.edge1 + bary.y * t.edge2;
    if (o.texture != NONE) {
        Picture picture = pictures[o.texture];
        vec2 at; vec3 gu, gv;
        hit_uv(picture, t.source, bary, at); uv = at;
        uv_gradients(picture, t.source, t.edge1, t.edge2, gu, gv); gradient_u = gu; gradient_v = gv;
        first = corner_texel(picture.corners + 2u * t.source).xy;
    }
    """
    outputs = {"texture_": "uint", "object": "uint", "uv": "vec2", "first": "vec2"}
    outputs |= dict.fromkeys(("point", "edge1", "edge2", "gradient_u", "gradient_v"), "vec3")
    defines = {**features.defines(), **buffers.defines, **store.defines, **place_defines(BINDING, UNIT)}
    got = evaluate(
        gl.ctx,
        [*LIB, "lib/scene.glsl"],
        body,
        {"slot": slot, "bary": bary},
        outputs,
        defines,
        (*SCENE_STRUCTS, *store.structs),
        binders=[buffers.bind, lambda: store.bind(BINDING, UNIT)],
    )
    np.testing.assert_array_equal(got["texture_"], np.array([0, NO_PICTURE, NO_PICTURE, 1])[got["object"].astype(int)])
    for index in (0, 3):
        mine = got["object"] == index
        assert mine.sum() > 400
        matrix = scene.objects[index].object_to_world[:3, :3]
        # uv = affine^T M^-1 p_world, and the gradients are those rows within the triangle's plane.
        rows = np.linalg.inv(matrix).T @ affine
        want = buffers.space.to_world(got["point"][mine]) @ rows
        assert np.abs(got["uv"][mine] - want).max() < 3e-5
        edges = [got[name][mine] / buffers.space.scale for name in ("edge1", "edge2")]
        for axis, name in enumerate(("gradient_u", "gradient_v")):
            for edge in edges:
                along = np.einsum("ij,ij->i", got[name][mine] * buffers.space.scale, edge)
                assert np.abs(along - edge @ rows[:, axis]).max() < 2e-4
        # The CPU references are given the corners as the GPU holds them, uv from the affine map.
        corners = np.stack([np.zeros_like(edges[0]), *edges], axis=1)
        gradient_u, gradient_v = cpu_reference.uv_gradients(corners, corners @ rows)
        for name, gradient in (("gradient_u", gradient_u), ("gradient_v", gradient_v)):
            assert (
                np.linalg.norm(got[name][mine] * buffers.space.scale - gradient, axis=1)
                < 1e-3 * np.linalg.norm(gradient, axis=1)
            ).all()
        assert (
            np.abs(
                cpu_reference.hit_uv(corners @ rows + got["first"][mine][:, None], bary[mine]) - got["uv"][mine]
            ).max()
            < 3e-5
        )
    store.release()
    buffers.release()


def test_large_texture_coordinates_of_a_repeating_picture_keep_their_digits(gl) -> None:
    mesh = make_mesh(
        "far",
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [[0, 1, 2]],
        uv=np.array([[[1e6, -1e6], [1e6 + 1, -1e6], [1e6, -1e6 + 1]]]),
    )
    store = store_of(gl, scene_of(Texture(picture(4, 4)), mesh=mesh))
    bary = as_f32(np.random.default_rng(7).dirichlet([1, 1, 1], COUNT)[:, :2])
    got = run(gl, store, "vec2 at; hit_uv(pictures[0], 0u, bary, at); uv = at;", {"bary": bary}, {"uv": "vec2"})
    assert np.abs(got["uv"] - bary).max() < 1e-6
    store.release()


# -- the store --------------------------------------------------------------------------------


def test_a_scene_without_pictures_has_nothing(gl) -> None:
    store = store_of(gl, scene_of(None, None))
    assert not store.defines and not store.structs and store.bytes == 0
    store.bind(BINDING, UNIT)
    store.release()
    only_sky = store_of(gl, scene_of(None, environment=picture(8, 16)))
    assert "HAS_TEXTURES" not in only_sky.defines and only_sky.defines["PICTURE_COUNT"] == 1
    only_sky.release()
    only_texture = store_of(gl, scene_of(Texture(picture(8, 16))))
    assert "HAS_ENVIRONMENT_MAP" not in only_texture.defines
    only_texture.release()


def test_a_picture_used_twice_is_packed_once_and_edits_keep_it(gl) -> None:
    rgb = picture(64, 64)
    one, two = store_of(gl, scene_of(Texture(rgb))), store_of(gl, scene_of(Texture(rgb), None, Texture(rgb, "clamp")))
    pictures = [
        store.bytes - store._records.size - store._corners.size[0] * store._corners.size[1] * 16 for store in (one, two)
    ]
    assert pictures[0] == pictures[1]
    packed = one._pictures
    longer = scene_of(None, Texture(rgb, "clamp"), mesh=quad(2.0))
    assert one.follow(longer, np.array([0, 2, 4]), np.tile(np.arange(3), (4, 1))) and one._pictures is packed
    got = run(
        gl,
        one,
        "vec2 at; hit_uv(pictures[0], 2u + which, vec2(1.0, 0.0), at); uv = at;",
        {"which": np.arange(2, dtype=np.uint32)},
        {"uv": "vec2"},
    )
    np.testing.assert_allclose(got["uv"], [[2, 0], [2, 2]], atol=1e-6)
    assert not one.follow(scene_of(Texture(rgb.copy())), np.array([0, 2]), np.tile(np.arange(3), (2, 1)))
    assert not one.follow(
        replace(longer, environment=Environment(rgb)), np.array([0, 2, 4]), np.tile(np.arange(3), (4, 1))
    )
    for store in (one, two):
        store.release()


def test_what_does_not_fit_or_has_no_coordinates_is_told(gl) -> None:
    with pytest.raises(UserError, match=r"wall\.png: its 100 x 40 pixels do not fit.*smaller"):
        store_of(
            gl,
            scene_of(Texture(picture(40, 100), source="wall.png"), Texture(picture(8, 8), source="small.png")),
            max_side=128,
        )
    bare = replace(quad(), uv=None)
    with pytest.raises(UserError, match="object 'object 0'.*no texture coordinates"):
        store_of(gl, scene_of(Texture(picture(4, 4)), mesh=bare))
    store = store_of(gl, scene_of(Texture(rgb := picture(4, 4))))
    with pytest.raises(UserError, match="no texture coordinates"):
        store.follow(scene_of(Texture(rgb), mesh=bare), np.array([0, 2]), np.tile(np.arange(3), (2, 1)))
    store.bind(BINDING, UNIT)  # as it was
    got = run(
        gl,
        store,
        "vec2 at; hit_uv(pictures[0], which, vec2(1.0, 0.0), at); uv = at;",
        {"which": np.arange(2, dtype=np.uint32)},
        {"uv": "vec2"},
    )
    np.testing.assert_array_equal(got["uv"], [[1, 0], [1, 1]])
    store.release()
    broken = replace(quad(), uv=np.full((2, 3, 2), np.nan))
    with pytest.raises(UserError, match="object 'object 0'.*not finite"):
        store_of(gl, scene_of(Texture(picture(4, 4)), mesh=broken))
