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


# numpy base -> GLSL to and from its bits
BITS = {"f4": ("floatBitsToUint", "uintBitsToFloat"), "u4": ("uint", "uint"), "i4": ("uint", "int")}


@dataclass(frozen=True)
class Field:
    """One member; `comment` states its unit and frame."""

    name: str
    type: str
    comment: str = ""
    count: int = 1
    """Array length; 1 is a plain member."""
    packing: str = ""
    """How a `PackedStruct` holds it; "": as it is."""

    @property
    def base(self) -> str:
        """Of numpy, of a component."""
        return _TYPES[self.type][0]

    @property
    def components(self) -> int:
        """Of a vector; 0: none."""
        return _TYPES[self.type][1] if _TYPES[self.type][1] > 1 else 0


_TEXEL = re.compile(r"texels\[(\d+)\]")


@dataclass(frozen=True)
class Struct:
    """A std430 struct without implicit padding."""

    name: str
    fields: tuple[Field, ...]
    texels: bool = False
    """Moved as groups of four words: GLSL also gets `NAME_TEXELS`, `to_texels`, `NAME_of` and `NAME_FROM`. A software
    renderer pays per access, not per byte, and a texel is one access."""

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        # Sources are kept by the structs that they hold, and a drag needs a dozen of them in every frame.
        return hash((self.name, self.fields, self.texels))

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
        """Bytes of one record."""
        return self.dtype.itemsize

    def offset(self, name: str) -> int:
        """Byte at which a field begins in a record."""
        assert self.dtype.fields is not None
        return self.dtype.fields[name][1]

    def glsl(self) -> str:
        """GLSL declaration of the struct."""
        lines = [f"struct {self.name} {{"]
        for field in self.fields:
            suffix = f"[{field.count}]" if field.count > 1 else ""
            comment = f"  // {field.comment}" if field.comment else ""
            lines.append(f"    {field.type} {field.name}{suffix};{comment}")
        return "\n".join(lines) + "\n};\n" + (self._texel_functions() if self.texels else "")

    def _texel_functions(self) -> str:
        """GLSL that turns the struct into `uvec4`s and back, bit for bit."""
        pack: list[str] = []
        unpack: list[str] = []
        word = 0
        for field in self.fields:
            base, components, _, _ = _TYPES[field.type]
            for item in range(field.count):
                member = f"value.{field.name}" + (f"[{item}]" if field.count > 1 else "")
                for component in range(components):
                    part = member + (f"[{component}]" if components > 1 else "")
                    texel = f"texels[{word // 4}][{word % 4}]"
                    to_bits, from_bits = BITS[base]
                    pack.append(f"    {texel} = {to_bits}({part});")
                    unpack.append(f"    {part} = {from_bits}({texel});")
                    word += 1
        return self._functions(word // 4, pack, unpack)

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
