"""Records that take less memory on the device: where photons are traced on a GPU, memory is what it waits for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..features.program_switches import switched
from . import shader
from .schema import BITS, Field, Struct

if TYPE_CHECKING:
    import moderngl

_GROUP = 64
_GLSL = """
// Components of a column are counted in steps of their largest one's exponent. What is infinite, no number or a million
// times the scene becomes infinite.
uint column_exponent(vec4 v) {
    uvec4 size = floatBitsToUint(v) & 0x7fffffffu;
    return clamp(max(max(size.x, size.y), max(size.z, size.w)) >> 23u, 84u, 147u) - 84u;
}
uint column_steps(float v, uint exponent, uint bits) {
    int most = (1 << bits) - 1;
    int steps = int(round(v * uintBitsToFloat((169u + bits - exponent) << 23u)));
    return uint(clamp(steps, -most, most)) & ((2u << bits) - 1u);
}
float column_value(uint steps, uint exponent, uint bits) {
    float signed_steps = float(int(steps << (31u - bits)) >> int(31u - bits));
    return exponent == 63u ? uintBitsToFloat(0x7f800000u)
                           : signed_steps * uintBitsToFloat((exponent + 85u - bits) << 23u);
}
"""


_FORMS = {
    "exponent": ("exponent = column_exponent({m})", "exponent = {c};"),
    "columns": ("column_steps({m}, exponent, {bits}u - 1u)", "{m} = column_value({c}, exponent, {bits}u - 1u);"),
    "unit": ("uint(round(clamp({m}, 0.0, 1.0) * {most}.0))", "{m} = float({c}) / {most}.0;"),
    "float": ("(floatBitsToUint({m}) + {half}u) >> {left}u", "{m} = uintBitsToFloat({c} << {left}u);"),
    "index": ("{m} & {most}u", "code = {c}; {m} = code == {most}u ? 0xffffffffu : code;"),
    "whole f4": ("uint({m})", "{m} = float({c});"),
    "whole u4": ("{m} & {most}u", "{m} = {c};"),
} | {f"bits {base}": (f"{to}({{m}})", f"{{m}} = {back}({{c}});") for base, (to, back) in BITS.items()}
"""GLSL: what is stored of a member `m`, and the member made of that again."""


@dataclass(frozen=True)
class PackedStruct(Struct):
    """A struct whose texels hold fields as their `packing` says; `dtype` is what it holds where it is read and written.

    One or more of these, with a comma between them, of all components or of those that are named last: "columns N", N
    bits with the sign, in steps of the largest one's exponent; "unit N", of 0 to 1; "float N", the upper bits, rounded;
    "index N", all of them 1 for NONE; "whole N"; "first 32", of the first item only. "= GLSL": not at all, but made of
    the others again."""

    __hash__ = Struct.__hash__

    @cached_property
    def _parts(self) -> list[tuple[int, int, str, str]]:
        """Of each: how many bits from which on, and the texts of `_FORMS`."""
        parts: list[tuple[int, int, str, str]] = []

        def add(how: str, bits: int, member: str) -> None:
            at = sum(parts[-1][:2]) if parts else 0
            most, left = (1 << bits) - 1, 32 - bits
            words = {"m": member, "c": "{c}", "bits": bits, "most": most, "left": left, "half": 1 << max(left - 1, 0)}
            code, value = (text.format(**words) for text in _FORMS[how])
            parts.append((bits, at, code, value))

        for field in self.fields:
            for item, member in enumerate([] if field.packing.startswith("=") else _members(field)):
                for packing in (field.packing or "whole 32").split(", "):
                    how, bits, *named = packing.split()
                    components = named[0] if named else "xyzw"[: field.components]
                    if how == "first" and item:
                        continue
                    if how == "columns":
                        add("exponent", 6, f"vec4({member}.{components}{', 0.0' * (4 - len(components))})")
                    how = f"bits {field.base}" if bits == "32" else f"whole {field.base}" if how == "whole" else how
                    for each in [f"{member}.{c}" for c in components] or [member]:
                        add(how, int(bits), each)
        return parts

    @property
    def stride(self) -> int:
        """Bytes of one record on the device."""
        return 16 * -(-sum(self._parts[-1][:2]) // 128)

    def _texel_functions(self) -> str:
        pack, unpack = (["    uint code = 0u, exponent = 0u;"] for _ in range(2))
        partly = [field for field in self.fields if field.packing and field.components]
        unpack += [f"    {member} = {field.type}(0.0);" for field in partly for member in _members(field)]
        texels = [f"texels[{word // 4}][{word % 4}]" for word in range(self.stride // 4)]
        for bits, at, code, value in self._parts:
            word, shift = divmod(at, 32)
            pack.append(f"    code = {code};")
            pack.append(f"    {texels[word]} {'|=' if shift else '='} code << {shift}u;")
            found = f"{texels[word]} >> {shift}u"
            if shift + bits > 32:
                pack.append(f"    {texels[word + 1]} = code >> {32 - shift}u;")
                found = f"({found} | {texels[word + 1]} << {32 - shift}u)"
            unpack.append("    " + value.format(c=f"({found} & {(1 << bits) - 1}u)"))
        pack += [f"    {texel} = 0u;" for texel in texels[-(-sum(self._parts[-1][:2]) // 32) :]]
        unpack += [f"    value.{field.name} {field.packing};" for field in self.fields if field.packing[:1] == "="]
        text = _GLSL + self._functions(self.stride // 16, pack, unpack)
        return text.replace("column_", f"{self.name}_column_")  # of several structs in one program


def _members(field: Field) -> list[str]:
    """In GLSL, one an item."""
    return [f"value.{field.name}" + (f"[{item}]" if field.count > 1 else "") for item in range(field.count)]


def packed(struct: Struct, packs: bool) -> Struct:
    """The same with its fields packed, where `packs`."""
    return PackedStruct(struct.name, struct.fields, struct.texels) if packs else struct


def read_records(struct: Struct, buffer: moderngl.Buffer, count: int) -> np.ndarray:
    """The first `count` records of a buffer, (n,) of `struct.dtype`."""
    if not isinstance(struct, PackedStruct) or not count:
        return np.frombuffer(buffer.read(count * struct.stride) if count else b"", struct.dtype)
    found = buffer.ctx.buffer(reserve=count * struct.dtype.itemsize)
    _move(struct, buffer, found, count, packs=False)
    records = np.frombuffer(found.read(), struct.dtype)
    found.release()
    return records


def write_records(struct: Struct, buffer: moderngl.Buffer, records: np.ndarray) -> None:
    """Write `records` (n,) to the beginning of a buffer."""
    if not isinstance(struct, PackedStruct) or not len(records):
        buffer.write(np.ascontiguousarray(records))
        return
    given = buffer.ctx.buffer(np.ascontiguousarray(records))
    _move(struct, buffer, given, len(records), packs=True)
    given.release()


def _move(struct: Struct, texels: moderngl.Buffer, records: moderngl.Buffer, count: int, *, packs: bool) -> None:
    defines = switched(PACKS=packs) | {"WORKGROUP": _GROUP, "RECORD": struct.name}
    defines |= {f"RECORD_{what}": f"{struct.name}_{what}" for what in ("TEXELS", "FROM", "TO")}
    program = shader.compute(texels.ctx, "scene/records.comp", defines, (struct,))
    texels.bind_to_storage_buffer(0)
    records.bind_to_storage_buffer(1)
    program["count"].value = count
    texels.ctx.memory_barrier()
    program.run(-(-count // _GROUP))
    texels.ctx.memory_barrier()
    shader.release(program)
