"""Parts of the camera's program that stand alone: the box that a lookup averages over; when columns are dropped."""

from __future__ import annotations

import numpy as np
from spectrasplat.gpu import bindings
from spectrasplat.gpu.scene_records import SCENE_STRUCTS
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT = 4096


def test_the_box_of_three_sides_has_their_covariance(gl) -> None:
    """Three sides of any slant, down to sides of no length and all of one direction: Σ s sᵀ is kept, the axes stand
    across each other."""
    rng = np.random.default_rng(3)
    sides = rng.normal(size=(COUNT, 3, 2)) * 10.0 ** rng.uniform(-3, 1, (COUNT, 3, 1))
    sides[:200, 1:] = 0.0  # one side only
    sides[200:400, 1] = 2.0 * sides[200:400, 0]  # all in a row
    sides[200:400, 2] = -0.5 * sides[200:400, 0]
    sides[400:500] = 0.0
    sides[500:600] = np.array([[0.3, 0.0], [0.0, 0.3], [0.0, 0.0]])  # a circle has no axis of its own
    sides = as_f32(sides)
    body = "vec2 first, second; box_of_three(a, b, c, first, second); longer = first; shorter = second;"
    inputs = {"a": sides[:, 0], "b": sides[:, 1], "c": sides[:, 2]}
    got = evaluate(gl.ctx, ["lib/footprint.glsl"], body, inputs, {"longer": "vec2", "shorter": "vec2"})
    longer, shorter = got["longer"], got["shorter"]
    assert np.isfinite(longer).all() and np.isfinite(shorter).all()
    want = np.einsum("nki,nkj->nij", sides, sides)
    made = np.einsum("ni,nj->nij", longer, longer) + np.einsum("ni,nj->nij", shorter, shorter)
    size = np.trace(want, axis1=1, axis2=2)
    assert (np.abs(made - want).max(axis=(1, 2)) <= 2e-6 * size + 1e-30).all()
    assert (np.abs(np.sum(longer * shorter, axis=1)) <= 2e-6 * size).all()
    assert (np.linalg.norm(longer, axis=1) >= np.linalg.norm(shorter, axis=1) * (1.0 - 1e-6)).all()
    # Sides in a row leave a box without width: what rounding makes of it is a thousandth of its length.
    assert (np.linalg.norm(shorter[:400], axis=1) <= 1e-3 * np.linalg.norm(longer[:400], axis=1)).all()
    # The mutant: two of the three sides would not do.
    without = np.einsum("nki,nkj->nij", sides[:, :2], sides[:, :2])
    assert (np.abs(without - want).max(axis=(1, 2)) > 2e-6 * size + 1e-30)[600:].mean() > 0.9


PATH = bindings.SCENE_DEFINES | {"SPECTRAL_GROUPS": 0, "SPATIAL": 2, "PATH_COLUMNS": 2}
STANDALONE = """
struct Walk { uint none; };
#include "path/path.glsl"
"""


def test_columns_that_are_no_numbers_or_without_bound_are_dropped(gl) -> None:
    rng = np.random.default_rng(5)
    dp = rng.normal(size=(COUNT, 3)) * 10.0 ** rng.uniform(-4, 8, (COUNT, 1))
    dp = dp.astype(np.float32)
    dp[:50, 1], dp[50:100, 2], dp[100:150, 0] = np.nan, np.inf, -np.inf
    body = """
    Path path;
    for (int c = 0; c < COLUMNS_HELD; ++c) path.dposition[c] = path.ddirection[c] = vec3(0.5);
    path.dposition[1] = column;
    held = columns_hold(path) ? 1u : 0u;
    left = path.dposition[1];
    """
    got = evaluate(
        gl.ctx, [], body, {"column": dp}, {"held": "uint", "left": "vec3"}, PATH, SCENE_STRUCTS, declarations=STANDALONE
    )
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(dp.astype(np.float64), axis=1)
        good = length < 1e6
    clear = ~(np.abs(length - 1e6) < 100.0)
    assert (got["held"].astype(bool) == good)[clear].all()
    assert 0.3 < good.mean() < 0.95 and not got["held"][:150].any()
    assert (got["left"][~good & clear] == 0.0).all() and np.array_equal(
        got["left"][good & clear], dp[good & clear].astype(float)
    )
