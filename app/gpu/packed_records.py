"""Records that take less memory on the device: where photons are traced on a GPU, memory is what it waits for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .schema import BITS, Field, Struct

_BITS, _LOWEST, _TOO_LARGE = 18, 84, 63
"""Bits of a component besides its sign; the exponent (as IEEE 754 stores it) below which all are nothing; and how much
larger ones are that a column cannot have."""
_COLUMN_GLSL = """
// Three components to 19 bits each, in units of the largest one's exponent. What is infinite, no number or a million
// times the scene becomes infinite.
uvec2 packed_column(vec3 v) {
    uvec3 size = floatBitsToUint(v) & 0x7fffffffu;
    uint exponent = max(max(size.x, max(size.y, size.z)) >> 23u, 84u);
    if (exponent >= 147u) return uvec2(0u, 63u << 25u);
    uvec3 q = uvec3(clamp(ivec3(round(v * uintBitsToFloat((271u - exponent) << 23u))), -262143, 262143)) & 0x7ffffu;
    return uvec2(q.x | q.y << 19u, q.y >> 13u | q.z << 6u | (exponent - 84u) << 25u);
}
vec3 unpacked_column(uvec2 w) {
    uint above = w.y >> 25u;
    if (above == 63u) return vec3(uintBitsToFloat(0x7f800000u));
    uvec3 q = uvec3(w.x, w.x >> 19u | w.y << 13u, w.y >> 6u) << 13u;
    return vec3(ivec3(q) >> 13) * uintBitsToFloat((above + 67u) << 23u);
}
"""


@dataclass(frozen=True)
class PackedStruct(Struct):
    """A struct whose texels hold fields as their `packing` says; `dtype` is what it holds where it is read and written.

    "columns": xyz of every vec4, the largest component to 18 bits and a sign; "columns, w": also w of the first.
    "index": of two such fields after each other 16 bits each, all of them 1 for NONE."""

    __hash__ = Struct.__hash__

    @cached_property
    def _words(self) -> list[tuple[Field, int, str]]:
        """Words in order: a field, its item and which part of it."""
        words = []
        for field in self.fields:
            if field.packing.startswith("columns"):
                words += [(field, item, part) for item in range(field.count) for part in ("low", "high")]
                words += [(field, 0, "w")] if field.packing.endswith("w") else []
            elif field.packing != "index":
                parts = ("",) if not field.components else "xyzw"[: field.components]
                words += [(field, item, part) for item in range(field.count) for part in parts]
            elif not words or words[-1][2] != "first":
                words.append((field, 0, "first"))
            else:
                words[-1:] = [(words[-1][0], 0, f"with {field.name}")]
        return words

    @property
    def stride(self) -> int:
        """Bytes of one record on the device."""
        return 16 * -(-len(self._words) // 4)

    def packed(self, records: np.ndarray) -> np.ndarray:
        """Records (n,) as the device has them, uint32 (n, words)."""
        found = np.zeros((len(records), self.stride // 4), np.uint32)
        for at, (field, item, part) in enumerate(self._words):
            values = records[field.name]
            values = values[:, item] if field.count > 1 else values
            if part in ("low", "high"):
                found[:, at] = _packed_columns(values[:, :3])[:, int(part == "high")]
            elif part.startswith("with "):
                found[:, at] = values & 0xFFFF | records[part[5:]] << np.uint32(16)
            else:
                values = values[:, "xyzw".index(part)] if part else values
                found[:, at] = np.ascontiguousarray(values).view(np.uint32)
        return found

    def _texel_functions(self) -> str:
        count, pack, unpack = self.stride // 16, [], []
        for at, (field, item, part) in enumerate(self._words):
            member = f"value.{field.name}" + (f"[{item}]" if field.count > 1 else "")
            texel, after = (f"texels[{word // 4}][{word % 4}]" for word in (at, at + 1))
            to_bits, from_bits = BITS[field.base]
            if part == "low":
                pack.append(f"    column = packed_column({member}.xyz);")
                pack += [f"    {texel} = column.x;", f"    {after} = column.y;"]
                unpack.append(f"    {member} = vec4(unpacked_column(uvec2({texel}, {after})), 0.0);")
            elif part.startswith("with "):
                other = f"value.{part[5:]}"
                pack.append(f"    {texel} = ({member} & 0xffffu) | {other} << 16u;")
                unpack.append(f"    {member} = ({texel} & 0xffffu) == 0xffffu ? 0xffffffffu : {texel} & 0xffffu;")
                unpack.append(f"    {other} = {texel} >> 16u == 0xffffu ? 0xffffffffu : {texel} >> 16u;")
            elif part != "high":
                value = f"{member}.{part}" if part else member
                pack.append(f"    {texel} = {to_bits}({value});")
                unpack.append(f"    {value} = {from_bits}({texel});")
        for word in range(len(self._words), 4 * count):
            pack.append(f"    texels[{word // 4}][{word % 4}] = 0u;")
        return _COLUMN_GLSL + self._functions(count, ["    uvec2 column;", *pack], unpack)


def _packed_columns(v: np.ndarray) -> np.ndarray:
    """(n, 2) words of (n, 3)."""
    exponent = np.maximum(np.abs(v).max(axis=1).astype(np.float32).view(np.uint32) >> 23, _LOWEST)
    above, largest = np.minimum(exponent - _LOWEST, _TOO_LARGE), (1 << _BITS) - 1
    steps = np.rint(np.ldexp(v.astype(float), 126 + _BITS - exponent.astype(int)[:, None]))
    q = np.clip(steps, -largest, largest).astype(np.int32).view(np.uint32) & (2 * largest + 1)
    return np.stack([q[:, 0] | q[:, 1] << 19, q[:, 1] >> 13 | q[:, 2] << 6 | above << 25], axis=1)
