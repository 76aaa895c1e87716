"""One description of a GPU record, from which both sides are generated.

A struct written twice drifts apart silently; here the numpy dtype and the GLSL text come
from the same fields, and any padding std430 would slip in is an error instead of a surprise.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

# type -> (numpy base, components, std430 alignment in bytes, size in bytes)
_TYPES = {
    "float": ("f4", 1, 4, 4),
    "uint": ("u4", 1, 4, 4),
    "int": ("i4", 1, 4, 4),
    "vec2": ("f4", 2, 8, 8),
    "uvec2": ("u4", 2, 8, 8),
    "vec3": ("f4", 3, 16, 12),
    "vec4": ("f4", 4, 16, 16),
    "uvec4": ("u4", 4, 16, 16),
}


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
# GLSL: what is stored of a member `m`, and the member made of that again
_FORMS = {
    "exponent": ("exponent = column_exponent({m})", "exponent = {c};"),
    "columns": ("column_steps({m}, exponent, {bits}u - 1u)", "{m} = column_value({c}, exponent, {bits}u - 1u);"),
    "unit": ("uint(round(clamp({m}, 0.0, 1.0) * {most}.0))", "{m} = float({c}) / {most}.0;"),
    "float": ("(floatBitsToUint({m}) + {half}u) >> {left}u", "{m} = uintBitsToFloat({c} << {left}u);"),
    "index": ("{m} & {most}u", "code = {c}; {m} = code == {most}u ? 0xffffffffu : code;"),
    "whole f4": ("uint({m})", "{m} = float({c});"),
    "whole u4": ("{m} & {most}u", "{m} = {c};"),
    "bits f4": ("floatBitsToUint({m})", "{m} = uintBitsToFloat({c});"),
    "bits u4": ("{m}", "{m} = {c};"),
    "bits i4": ("uint({m})", "{m} = int({c});"),
}


@dataclass(frozen=True)
class Field:
    """One member; `comment` states its unit and frame."""

    name: str
    type: str
    comment: str = ""
    count: int = 1
    """Array length; 1 is a plain member."""
    packing: str = ""
    """How it is held where a struct `packs`; "": as it is. Else one or more of these, with a comma between them, of all
    components or of those that are named last: "columns N", N bits with the sign, in steps of the largest one's
    exponent; "unit N", of 0 to 1; "float N", the upper bits, rounded; "index N", all of them 1 for NONE; "whole N";
    "first 32", of the first item only. "= GLSL": not at all, but made of the others again."""

    @property
    def base(self) -> str:
        """numpy's type of a component."""
        return _TYPES[self.type][0]

    @property
    def components(self) -> int:
        """Components of a vector; 0 for a scalar."""
        return _TYPES[self.type][1] if _TYPES[self.type][1] > 1 else 0

    @property
    def members(self) -> list[str]:
        """In GLSL, of `value`, one an item."""
        return [f"value.{self.name}" + (f"[{item}]" if self.count > 1 else "") for item in range(self.count)]


_TEXEL = re.compile(r"texels\[(\d+)\]")


@dataclass(frozen=True)
class Struct:
    """A std430 struct without implicit padding."""

    name: str
    fields: tuple[Field, ...]
    texels: bool = False
    """Moved as groups of four words: GLSL also gets `NAME_TEXELS`, `to_texels`, `NAME_of` and `NAME_FROM`. A software
    renderer pays per access, not per byte, and a texel is one access."""
    packs: bool = False
    """Texels hold fields as their `packing` says; `dtype` is what they hold where they are read and written."""

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        # Sources are kept by the structs that they hold, and a drag needs a dozen of them in every frame.
        return hash((self.name, self.fields, self.texels, self.packs))

    def __post_init__(self) -> None:
        offset, widest = 0, 4
        for field in self.fields:
            _, _, align, size = _TYPES[field.type]
            if offset % align:
                raise ValueError(f"{self.name}.{field.name} would be padded: offset {offset}, alignment {align}")
            if field.count > 1 and size % align:
                raise ValueError(f"{self.name}.{field.name}: an array of {field.type} is padded")
            offset += size * field.count
            widest = max(widest, align)
        if offset % widest:
            raise ValueError(f"{self.name} is {offset} bytes, which std430 pads to a multiple of {widest}")
        if self.texels and offset % 16:
            raise ValueError(f"{self.name} is {offset} bytes, which does not fill whole texels of 16")

    @cached_property
    def dtype(self) -> np.dtype:
        """Packed numpy dtype of one record."""
        members = []
        for field in self.fields:
            base, components, _, _ = _TYPES[field.type]
            shape = tuple(n for n in (field.count, components) if n > 1)
            members.append((field.name, base, shape) if shape else (field.name, base))
        return np.dtype(members)

    @property
    def stride(self) -> int:
        """Bytes of one record on the device."""
        return 16 * -(-sum(self._parts[-1][:2]) // 128) if self.packs else self.dtype.itemsize

    def offset(self, name: str) -> int:
        """Byte at which a field begins in a record."""
        assert self.dtype.fields is not None
        return self.dtype.fields[name][1]

    def glsl(self) -> str:
        """GLSL declaration of the struct."""
        return self._declaration

    @cached_property
    def _declaration(self) -> str:
        lines = [f"struct {self.name} {{"]
        for field in self.fields:
            suffix = f"[{field.count}]" if field.count > 1 else ""
            comment = f"  // {field.comment}" if field.comment else ""
            lines.append(f"    {field.type} {field.name}{suffix};{comment}")
        return "\n".join(lines) + "\n};\n" + (self._texel_functions() if self.texels else "")

    @cached_property
    def _parts(self) -> list[tuple[int, int, str, str]]:
        """For each part of a packed record: how many bits from which on, and the texts of `_FORMS`."""
        parts: list[tuple[int, int, str, str]] = []

        def add(how: str, bits: int, member: str) -> None:
            at = sum(parts[-1][:2]) if parts else 0
            most, left = (1 << bits) - 1, 32 - bits
            words = {"m": member, "c": "{c}", "bits": bits, "most": most, "left": left, "half": 1 << max(left - 1, 0)}
            code, value = (text.format(**words) for text in _FORMS[how])
            parts.append((bits, at, code, value))

        for field in self.fields:
            packing = (self.packs and field.packing) or "whole 32"
            for item, member in enumerate([] if packing.startswith("=") else field.members):
                for each in packing.split(", "):
                    how, bits, *named = each.split()
                    components = named[0] if named else "xyzw"[: field.components]
                    if how == "first" and item:
                        continue
                    if how == "columns":
                        add("exponent", 6, f"vec4({member}.{components}{', 0.0' * (4 - len(components))})")
                    how = f"bits {field.base}" if bits == "32" else f"whole {field.base}" if how == "whole" else how
                    for part in [f"{member}.{c}" for c in components] or [member]:
                        add(how, int(bits), part)
        return parts

    def _texel_functions(self) -> str:
        """GLSL that turns the struct into `uvec4`s and back."""
        pack, unpack = (["    uint code = 0u, exponent = 0u;"] * self.packs for _ in range(2))
        packed = [field for field in self.fields if self.packs and field.packing]
        unpack += [f"    {m} = {field.type}(0.0);" for field in packed if field.components for m in field.members]
        texels = [f"texels[{word // 4}][{word % 4}]" for word in range(self.stride // 4)]
        for bits, at, code, value in self._parts:
            word, shift = divmod(at, 32)
            if bits == 32 and not shift:
                pack.append(f"    {texels[word]} = {code};")
                unpack.append("    " + value.format(c=texels[word]))
                continue
            found = f"{texels[word]} >> {shift}u" if shift else texels[word]
            if shift + bits > 32:
                pack.append(f"    code = {code};")
                code = "code"
            pack.append(f"    {texels[word]} |= ({code}) << {shift}u;" if shift else f"    {texels[word]} = {code};")
            if shift + bits > 32:
                pack.append(f"    {texels[word + 1]} = code >> {32 - shift}u;")
                found = f"({found} | {texels[word + 1]} << {32 - shift}u)"
            unpack.append("    " + value.format(c=f"({found} & {(1 << bits) - 1}u)"))
        pack += [f"    {texel} = 0u;" for texel in texels[-(-sum(self._parts[-1][:2]) // 32) :]]
        unpack += [f"    value.{field.name} {field.packing};" for field in packed if field.packing[0] == "="]
        text = _GLSL * self.packs + self._functions(len(texels) // 4, pack, unpack)
        return text.replace("column_", f"{self.name}_column_")  # of several structs in one program

    def _functions(self, texels: int, pack: list[str], unpack: list[str]) -> str:
        count = f"{self.name}_TEXELS"
        # Without a loop: a compiler with orders not to unroll (camera.comp) would load every texel, into memory, where
        # most callers want one member.
        loads = ", ".join(f"load((at) + {i}u)" for i in range(texels))
        # Texel by texel: all together would be held beside what they are made of.
        stores, at = [], 0
        for line in pack:
            if (found := _TEXEL.search(line)) and int(found[1]) > at:
                stores.append(f"store((at) + {at}u, texel);")
                at += 1
            stores.append(_TEXEL.sub("texel", line.strip()).replace("value.", "(value)."))
        stores.append(f"store((at) + {at}u, texel);")
        return "\n".join(
            [
                f"#define {count} {texels}",
                f"void to_texels({self.name} value, out uvec4 texels[{count}]) {{",
                *pack,
                "}",
                f"{self.name} {self.name}_of(uvec4 texels[{count}]) {{",
                f"    {self.name} value;",
                *unpack,
                "    return value;",
                "}",
                f"#define {self.name}_FROM(load, at) {self.name}_of(uvec4[{count}]({loads}))",
                f"#define {self.name}_TO(store, at, value) {{ uvec4 texel; {' '.join(stores)} }}\n",
            ]
        )

    def zeros(self, count: int) -> np.ndarray:
        """`count` records of zero bytes."""
        return np.zeros(count, self.dtype)
