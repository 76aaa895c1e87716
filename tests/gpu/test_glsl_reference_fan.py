"""lib/fan.glsl against float64 and a closed form: light of a point meets a plane where footprints that fan out say."""

from __future__ import annotations

import numpy as np
from spectrasplat.reference import optics
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

LIBRARY = ["lib/fan.glsl"]
COUNT = 2000


def test_light_of_a_point_lands_where_its_footprint_says(gl) -> None:
    """A point a way above a plane: directions d + s a + t b meet it exactly at (s side_s + t side_t) / W. Without W
    places are off by up to their own distance."""
    rng = np.random.default_rng(5)
    normal = as_f32(optics.unit(rng.normal(size=(COUNT, 3))))
    direction = optics.unit(rng.normal(size=(COUNT, 3)))
    direction = as_f32(direction - optics.times(np.maximum(0.3 + optics.dot(direction, normal), 0.0), normal))
    way = as_f32(np.exp(rng.uniform(-1.0, 1.0, COUNT)))
    turns = as_f32(rng.normal(size=(2, COUNT, 3)))
    body = """
    vec3 zero = vec3(0.0);
    vec2 change = vec2(change_of_way(zero, a, d, n, w), change_of_way(zero, b, d, n, w));
    vec3 s = w * a + change.x * d, t = w * b + change.y * d;
    vec2 axis = longest_axis(vec3(dot(s, s), dot(s, t), dot(t, t)));
    fan = fan_of_footprint(s, t, a, b, change, d, n);
    length_along = length(axis.x * s + axis.y * t);
    """
    inputs = {"n": normal, "d": direction, "w": way, "a": turns[0], "b": turns[1]}
    got = evaluate(gl.ctx, LIBRARY, body, inputs, {"fan": "vec2", "length_along": "float"})
    n, d, w, a, b = (np.asarray(x, float) for x in (normal, direction, way, *turns))
    sides = []
    for turn in (a, b):
        moved = optics.times(w, turn)
        sides.append(moved - optics.times(optics.dot(moved, n) / optics.dot(d, n), d))
    longest = np.linalg.svd(np.stack(sides, axis=-1), compute_uv=False)[:, 0]
    np.testing.assert_allclose(np.asarray(got["length_along"]).reshape(-1), longest, rtol=1e-4)
    s, t = 0.1, -0.05
    turned = d + s * a + t * b
    landed = optics.times(w * optics.dot(d, n) / optics.dot(turned, n), turned) - optics.times(w, d)
    divisor = 1.0 + np.asarray(got["fan"]) @ [s, t]
    usable = divisor > 0.3
    told = optics.times(1.0 / divisor, s * sides[0] + t * sides[1])
    size = np.linalg.norm(landed, axis=1)
    assert usable.mean() > 0.8
    assert (np.linalg.norm(told - landed, axis=1) / size)[usable].max() < 2e-3
    straight = s * sides[0] + t * sides[1]
    assert np.median(np.linalg.norm(straight - landed, axis=1) / size) > 0.03


def test_what_is_drawn_ends_before_the_horizon(gl) -> None:
    rng = np.random.default_rng(6)
    fan = rng.uniform(-3.0, 3.0, (COUNT, 2))
    along = np.abs(fan[:, 0]) >= np.abs(fan[:, 1])
    fan[along, 1] = np.clip(fan[along, 1], -0.05, 0.05)
    fan[~along, 0] = np.clip(fan[~along, 0], -0.05, 0.05)
    got = evaluate(gl.ctx, LIBRARY, "part = part_that_fans(fan);", {"fan": as_f32(fan)}, {"part": "vec4"})["part"]
    part = np.asarray(got, float)
    least = 1.0 + np.minimum(fan * part[:, :2], fan * part[:, 2:]).sum(axis=1)
    assert least.min() > 0.15 - 1e-5
    assert (part[:, 2:] >= 0.0).all() and (part[:, :2] <= 0.0).all()
    small = np.abs(fan).sum(axis=1) < 0.8
    np.testing.assert_array_equal(part[small], np.tile([-1.0, -1.0, 1.0, 1.0], (small.sum(), 1)))


def test_sides_are_kept_within_what_is_believed(gl) -> None:
    """The footprint is compressed along its own axes, and the directions' change with it: the same points of the
    lattice, nearer together. What is within stays bit for bit."""
    rng = np.random.default_rng(8)
    sides = as_f32(rng.normal(size=(2, COUNT, 3)) * 10.0 ** rng.uniform(-3.0, 3.0, (2, COUNT, 1)))
    turns = as_f32(rng.normal(size=(2, COUNT, 3)))
    body = "vec3 a = s, b = t, c = u, d = v; keep_within(0.5, a, b, c, d); ka = a; kb = b; kc = c; kd = d;"
    inputs = {"s": sides[0], "t": sides[1], "u": turns[0], "v": turns[1]}
    got = evaluate(gl.ctx, LIBRARY, body, inputs, dict.fromkeys(("ka", "kb", "kc", "kd"), "vec3"))
    before = np.stack(sides, axis=-1).astype(float)
    left, sizes, right = np.linalg.svd(before, full_matrices=False)
    shares = np.minimum(1.0, 0.5 / sizes)
    held = np.einsum("nij,nj,njk->nik", left, sizes * shares, right)
    # The same combinations of the columns' changes: by the right singular vectors.
    to_axes = np.einsum("nki,nk,nkj->nij", right, shares, right)
    turned = np.stack(turns, axis=-1).astype(float) @ to_axes
    apart = sizes[:, 0] > 1.001 * sizes[:, 1]  # else the axes are any
    size = np.linalg.norm(before, axis=(1, 2))[:, None]
    for names, want, scale in ((("ka", "kb"), held, np.minimum(size, 0.5)), (("kc", "kd"), turned, 1.0)):
        for name, column in zip(names, (want[..., 0], want[..., 1]), strict=True):
            assert (np.abs(got[name] - column) / scale)[apart].max() < 2e-3
    within = sizes[:, 0] <= 0.499
    assert within.any() and np.array_equal(got["ka"][within], sides[0][within])
    assert np.array_equal(got["kd"][within], turns[1][within])
