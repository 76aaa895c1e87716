"""lib/bounce.glsl, lib/receiver_light.glsl and lib/covered.glsl against float64."""

from __future__ import annotations

import moderngl
import numpy as np
from spectrasplat.gpu import bindings
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.model.environment import constant
from spectrasplat.model.flat_faces import with_flat_faces
from spectrasplat.model.geometry import primitives
from spectrasplat.model.scene import Black, Camera, Diffuse, RenderDefaults, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.covered_places import covered_places
from spectrasplat.passes.environment_places import environment_places
from spectrasplat.reference import optics
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT, KNOWN = 4096, 6


def test_directions_are_as_likely_as_their_cosine(gl) -> None:
    rng = np.random.default_rng(3)
    normal = as_f32(optics.unit(rng.normal(size=(COUNT, 3))))
    unit = as_f32(rng.uniform(size=(COUNT, 2)))
    body = "found = cosine_direction(normal, unit);"
    found = evaluate(gl.ctx, ["lib/bounce.glsl"], body, {"normal": normal, "unit": unit}, {"found": "vec3"})["found"]
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=2e-6)
    cosine = (found * normal).sum(axis=1)
    # By concentric squares: the sine's square is that of the larger coordinate, uniform as (2u - 1)² of both is.
    expected = np.maximum(abs(2.0 * unit[:, 0] - 1.0), abs(2.0 * unit[:, 1] - 1.0)) ** 2
    np.testing.assert_allclose(1.0 - cosine**2, expected, atol=4e-6)
    # Azimuths are even: the mean direction is 2/3 of the normal.
    frame = found - cosine[:, None] * normal
    assert np.abs((frame @ np.array([1.0, 2.0, 3.0])).mean()) < 0.1 and abs(cosine.mean() - 2.0 / 3.0) < 0.02


def test_what_is_gathered_is_the_balance_heuristic(gl) -> None:
    rng = np.random.default_rng(4)
    inputs = {
        "cosine": as_f32(rng.uniform(1e-3, 1.0, COUNT)),
        "there": as_f32(rng.uniform(1e-3, 1.0, COUNT)),
        "distance2": as_f32(10.0 ** rng.uniform(-6.0, 2.0, COUNT)),
        "density": as_f32(np.where(rng.random(COUNT) < 0.2, 0.0, 10.0 ** rng.uniform(-3.0, 4.0, COUNT))),
    }
    body = "found = gathered(cosine, there, distance2, density);"
    found = evaluate(gl.ctx, ["lib/bounce.glsl"], body, inputs, {"found": "float"})["found"]
    cosine, there, distance2, density = (np.asarray(v, float) for v in inputs.values())
    by_cosine, by_area = cosine / np.pi, density * distance2 / there  # per steradian
    np.testing.assert_allclose(found, cosine / (by_cosine + by_area), rtol=3e-6)
    np.testing.assert_allclose(found[density == 0.0], np.pi, rtol=1e-6)


def test_light_is_looked_up_between_the_texels_of_either_side(gl) -> None:
    """A field that is linear over a plate comes back as it is; the fourth channel is the nearest texel's."""
    camera = Camera((0.0, -2.0, 1.0), (0.0, 0.0, 0.0))
    matrix = np.eye(4)
    matrix[:3, 3] = 0.3, 0.2, 0.1
    things = (SceneObject("plate", primitives.plane(2.0, 1.0), Diffuse(), matrix),)
    scene = Scene("plate", camera, (), things, render=RenderDefaults())
    buffers = scene_buffers(gl, scene, RenderSettings())
    places = environment_places(buffers, 0.1)
    assert covered_places(buffers, places) is places
    position = places.places["position"].astype(float)
    back = places.places["inside"].astype(float)
    light = np.stack([position @ [1.0, 2.0, 0.0] + 3.0, position @ [-1.0, 0.5, 0.0] + 3.0, back], axis=1)
    values = np.concatenate([light, np.arange(len(position))[:, None]], axis=1)
    texture = gl.ctx.texture(places.size, 4, places.image(values).tobytes(), dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    rng = np.random.default_rng(5)
    low, high = position.min(axis=0), position.max(axis=0)
    at, side = as_f32(rng.uniform(low, high, (COUNT, 3))), (np.arange(COUNT) % 2).astype(np.uint32)
    try:
        found = evaluate(
            gl.ctx,
            ["lib/covered.glsl"],
            "vec4 all = receiver_light(known, 0u, RayOrigin(NONE, 0u, side, 0u), at, vec3(0.0, 0.0, 1.0));"
            " light = all.rgb; nearest = all.a;",
            {"at": at, "side": side},
            {"light": "vec3", "nearest": "float"},
            buffers.features.defines() | bindings.SCENE_DEFINES | buffers.defines,
            SCENE_STRUCTS,
            binders=[buffers.bind, lambda: texture.use(KNOWN)],
            declarations="layout(binding = 6) uniform sampler2D known;",
        )
    finally:
        texture.release()
        buffers.release()
    at = np.asarray(at, float)
    # Bilinear interpolation is exact between middles, and goes on level beyond the last ones.
    within = np.all((at[:, :2] > low[:2]) & (at[:, :2] < high[:2]), axis=1)
    coarse = within & (side == 0)
    np.testing.assert_allclose(found["light"][coarse, 0], at[coarse] @ [1.0, 2.0, 0.0] + 3.0, atol=2e-5)
    np.testing.assert_allclose(found["light"][:, 2], side, atol=1e-6)
    nearest = np.round(found["nearest"]).astype(int)
    np.testing.assert_array_equal(back[nearest], side)
    gap = np.abs(position[nearest] - at)[:, :2]
    step = np.abs(places.places["span_u"][nearest] + places.places["span_v"][nearest])[:, :2]
    assert (gap <= 0.5 * step + 1e-5).all()


def test_what_is_covered_hangs_near_or_holds_the_place(gl) -> None:
    """A disc near a floor, one far above, a ball sunk into it to a third, a post of faces of its own; and the parts of
    texels that say so."""
    things = (
        ("near", primitives.disc(0.4), (-1.0, 0.0, 0.003), Black()),
        ("far", primitives.disc(0.4), (0.0, 0.0, 0.6), Black()),
        ("sunk", primitives.sphere(0.5, 20000), (1.0, 0.0, 0.25), Diffuse()),
        ("floor", primitives.plane(4.0, 2.0), (0.0, 0.0, 0.0), Diffuse()),
        ("post", primitives.box((0.3, 0.4, 0.9)), (0.0, -0.6, 0.1), Diffuse()),
    )
    items = [
        SceneObject(n, m, material, np.block([[np.eye(3), np.reshape(at, (3, 1))], [0, 0, 0, 1]]))
        for n, m, at, material in things
    ]
    camera = Camera((0.0, -4.0, 2.0), (0.0, 0.0, 0.0))
    scene = with_flat_faces(Scene("covers", camera, (), tuple(items), environment=constant((1.0, 1.0, 1.0))))
    buffers = scene_buffers(gl, scene, RenderSettings())
    places = environment_places(buffers)
    both = covered_places(buffers, places)
    texture = gl.ctx.texture(places.size, 4, places.image(np.zeros((len(places.places), 3))).tobytes(), dtype="f4")
    xy = np.random.default_rng(6).uniform((-2.0, -1.0), (2.0, 1.0), (COUNT, 2))
    try:
        found = evaluate(
            gl.ctx,
            ["lib/covered.glsl"],
            "covered = uint(is_covered(known, RayOrigin(NONE, 3u, 0u, 0u), at, vec3(0.0, 0.0, 1.0), reach));",
            {
                "at": as_f32(buffers.space.to_gpu(np.c_[xy, np.zeros(COUNT)])),
                "reach": np.full(COUNT, 0.05) * buffers.space.scale,
            },
            {"covered": "uint"},
            buffers.features.defines() | bindings.SCENE_DEFINES | buffers.defines,
            SCENE_STRUCTS,
            binders=[buffers.bind, lambda: texture.use(KNOWN)],
            declarations=f"layout(binding = {KNOWN}) uniform sampler2D known;",
        )["covered"]
    finally:
        texture.release()
        buffers.release()
    middles, radii = np.array([[-1.0, 0.0], [1.0, 0.0]]), np.array([0.4, np.sqrt(0.5**2 - 0.2**2)])
    post = (np.abs(xy - [0.0, -0.6]) - [0.15, 0.2]).max(axis=1)
    beyond = np.c_[np.linalg.norm(xy[:, None] - middles, axis=2) - radii, post]
    clear = np.abs(beyond).min(axis=1) > 0.005
    np.testing.assert_array_equal(found[clear], (beyond < 0.0).any(axis=1)[clear])
    assert len(both.places) > len(places.places)
