"""Records that move as texels: GLSL finds every member where numpy wrote it, and packs the same bits again."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.gpu.packed_records import PackedStruct
from spectrasplat.gpu.records import NONE, OUTCOME, photon_record, ray_record
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


def test_a_packed_record_keeps_what_it_says(gl) -> None:
    """Columns to 18 bits of their largest component, small indices and all else whole; numpy packs the same words."""
    fields = (
        Field("columns", "vec4", "", 2, "columns, w"),
        Field("first", "uint", packing="index"),
        Field("second", "uint", packing="index"),
        Field("whole", "vec2"),
    )
    struct = PackedStruct("Packed", fields, texels=True)
    assert struct.stride == 32 and struct.dtype.itemsize == 48
    random = np.random.default_rng(3)
    records = struct.zeros(ROWS)
    records["columns"] = random.normal(size=(ROWS, 2, 4)) * 10.0 ** random.uniform(-10, 5, (ROWS, 2, 1))
    records["columns"][0] = 0.0
    records["columns"][1, :, 0] = 1e9
    records["first"], records["second"] = random.integers(0, 0xFFFF, (2, ROWS))
    records["second"][::3] = NONE
    records["whole"] = random.normal(size=(ROWS, 2))
    words = struct.packed(records)
    texels = {f"half{i}": np.ascontiguousarray(words[:, 2 * i : 2 * i + 2]) for i in range(4)}
    body = """
    uvec4 texel0 = uvec4(half0, half1), texel1 = uvec4(half2, half3);
    Packed value = Packed_of(uvec4[2](texel0, texel1));
    uvec4 texels[2];
    to_texels(value, texels);
    same = all(equal(texels[0], texel0)) && all(equal(texels[1], texel1)) ? 1u : 0u;
    column = value.columns[1].xyz; edge = value.columns[0].w;
    first = value.first; second = value.second; whole = value.whole;
    """
    outputs = {"same": "uint", "column": "vec3", "edge": "float", "first": "uint", "second": "uint", "whole": "vec2"}
    got = evaluate(gl.ctx, ["lib/random.glsl"], body, texels, outputs, structs=[struct])
    for name in ("first", "second", "whole"):
        np.testing.assert_array_equal(got[name], records[name])
    np.testing.assert_array_equal(got["edge"], records["columns"][:, 0, 3])
    assert (got["same"][2:] == 1).all() and not np.isfinite(got["column"][1]).any()
    column, wanted = got["column"][2:].astype(float), records["columns"][2:, 1, :3].astype(float)
    assert (np.abs(column - wanted) <= np.abs(wanted).max(axis=1)[:, None] * 2.0**-18).all()
