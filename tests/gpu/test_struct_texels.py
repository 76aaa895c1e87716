"""Records that move as texels: GLSL finds every member where numpy wrote it, and packs the same bits again."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.gpu.records import OUTCOME, photon_record, ray_record
from spectrasplat.gpu.schema import Field, Struct
from spectrasplat.stress.rigs.glsl_function import evaluate

MIXED = Struct(
    "Mixed",
    (
        Field("a", "vec3"),
        Field("b", "uint"),
        Field("c", "vec2"),
        Field("d", "uvec2"),
        Field("e", "float", "", 3),
        Field("f", "int"),
        Field("g", "vec4", "", 2),
    ),
    texels=True,
)
ONE = 0x3F800000
ROWS = 70


def words(struct: Struct) -> np.ndarray:
    """A different word everywhere, each a float just above 1: uint32 (ROWS, words of the struct)."""
    count = struct.stride // 4
    return (
        ONE + np.arange(ROWS, dtype=np.uint32)[:, None] * np.uint32(count) + np.arange(count, dtype=np.uint32)
    ).astype(np.uint32)


def fill(struct: Struct) -> str:
    count = struct.stride // 4
    return f"""
    uvec4 texels[{struct.name}_TEXELS];
    for (uint i = 0u; i < {count}u; ++i) texels[i / 4u][i % 4u] = {ONE}u + number * {count}u + i;
    {struct.name} value = {struct.name}_of(texels);
    """


@pytest.mark.parametrize("struct", [MIXED, OUTCOME, photon_record(2), ray_record(3)], ids=lambda s: s.name)
def test_packing_again_gives_the_same_bits(gl, struct: Struct) -> None:
    body = (
        fill(struct)
        + f"""
    uvec4 again[{struct.name}_TEXELS];
    to_texels(value, again);
    for (int i = 0; i < {struct.name}_TEXELS; ++i) same += all(equal(texels[i], again[i])) ? 1u : 0u;
    """
    )
    got = evaluate(
        gl.ctx,
        ["lib/random.glsl"],
        body,
        {"number": np.arange(ROWS, dtype=np.uint32)},
        {"same": "uint"},
        structs=[struct],
    )
    np.testing.assert_array_equal(got["same"], struct.stride // 16)


def test_members_lie_where_numpy_has_them(gl) -> None:
    body = (
        fill(MIXED)
        + "a = value.a; b = value.b; c = value.c; d = value.d; e = value.e[2]; f = uint(value.f); g = value.g[1];"
    )
    outputs = {"a": "vec3", "b": "uint", "c": "vec2", "d": "uvec2", "e": "float", "f": "uint", "g": "vec4"}
    got = evaluate(
        gl.ctx, ["lib/random.glsl"], body, {"number": np.arange(ROWS, dtype=np.uint32)}, outputs, structs=[MIXED]
    )
    want = words(MIXED).view(MIXED.dtype)[:, 0]
    for name in ("a", "b", "c", "d"):
        np.testing.assert_array_equal(got[name], want[name])
    np.testing.assert_array_equal(got["e"], want["e"][:, 2])
    np.testing.assert_array_equal(got["f"], want["f"])
    np.testing.assert_array_equal(got["g"], want["g"][:, 1])


def test_a_record_that_does_not_fill_texels_is_refused() -> None:
    with pytest.raises(ValueError, match="whole texels"):
        Struct("Short", (Field("a", "uint"), Field("b", "uint")), texels=True)
