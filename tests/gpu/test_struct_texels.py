"""Records that move as texels: GLSL finds every member where numpy wrote it, and packs the same bits again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu.packed_records import read_records, write_records
from spectrasplat.gpu.records import NONE, OUTCOME, photon_record, ray_record
from spectrasplat.gpu.schema import Field, Struct
from spectrasplat.passes.footprint import SPLAT
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


@pytest.mark.parametrize("name", ["RayRecord", "PhotonRecord", "SplatRecord"])
def test_a_packed_record_keeps_what_it_says(gl, name: str) -> None:
    """Within half a step of every field's packing, the mean of many within a thirtieth (half a bit is rounded up), and
    what needs no rounding to the bit."""
    structs = {
        s.name: s for s in (ray_record(4, packs=True), photon_record(1, False, True, False), replace(SPLAT, packs=True))
    }
    struct, random, count = structs[name], np.random.default_rng(3), 4000
    records = struct.zeros(count)
    for field in struct.fields:
        values = records[field.name]
        if field.base == "f4":
            sizes = 10.0 ** random.uniform(-9.0, 4.0, (count,) + (1,) * (values.ndim - 1))
            values[...] = random.uniform(-1.0, 1.0, values.shape) * (sizes if "columns" in field.packing else 1.0)
            if field.packing.startswith(("unit", "whole", "float")):
                values[...] = random.integers(0, 1 << 16, values.shape) if "whole" in field.packing else np.abs(values)
        else:
            values[...] = random.integers(0, NONE if not field.packing else 0xFFFF, values.shape)
            values[::3] = NONE if "index" in field.packing else values[::3]
    buffer = gl.ctx.buffer(reserve=count * struct.stride)
    write_records(struct, buffer, records)
    found = read_records(struct, buffer, count)
    assert struct.stride == {"RayRecord": 160, "PhotonRecord": 80, "SplatRecord": 96}[name] < struct.dtype.itemsize
    for field in struct.fields:
        how, bits, *_ = (field.packing or "whole 32").split(", ")[0].split()
        if how == "=":
            continue
        some = slice(3) if "xyz" in field.packing else slice(None)
        want, got = (each[field.name].astype(float) for each in (records, found))
        want, got = (each[..., some] if field.components else each[:, None] for each in (want, got))
        size = np.abs(want).max(axis=-1, keepdims=True) if how == "columns" else np.abs(want) + 1e-30
        exponent = np.floor(np.log2(size))
        step = {"columns": 2.0 ** (exponent + 2.0 - int(bits)), "float": 2.0 ** (exponent + 9.0 - int(bits))}
        errors = (got - want) / step.get(how, 1.0 / (2.0 ** int(bits) - 1.0))
        # A column's largest component has no next power of two to be rounded to.
        assert np.abs(errors).max() <= {"columns": 1.0, "float": 0.52, "unit": 0.52}.get(how, 0.0), field.name
        assert abs(errors.mean()) < 0.03, field.name
    if name == "RayRecord":
        np.testing.assert_array_equal(found["dposition"][:, 0, 3], records["dposition"][:, 0, 3])


def test_a_column_that_is_no_number_or_too_large_is_infinite(gl) -> None:
    struct = photon_record(1, packs=True)
    records = struct.zeros(4)
    records["dposition_ds"][:, 1] = (np.inf, np.nan, 1e9, 0.0)
    buffer = gl.ctx.buffer(reserve=4 * struct.stride)
    write_records(struct, buffer, records)
    found = read_records(struct, buffer, 4)["dposition_ds"]
    assert np.isposinf(found[:3]).all() and not found[3].any()
