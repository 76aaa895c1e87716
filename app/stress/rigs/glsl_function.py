"""Runs any pure GLSL function over arrays, so that it can be compared with its float64 reference.

    out = evaluate(gl.ctx, ["lib/optics.glsl"], "r = reflect_direction(d, n, dot(d, n));",
                   {"d": directions, "n": normals}, {"r": "vec3"})["r"]

Inputs are rounded to float32 first (`as_f32`), and the CPU reference is given the rounded values cast up:
then the difference is the arithmetic's error alone.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...gpu import shader

if TYPE_CHECKING:
    import moderngl

    from ...gpu.schema import Struct

_FLOATS = {(): "float", (2,): "vec2", (3,): "vec3", (4,): "vec4"}
_COMPONENTS = {"float": 1, "uint": 1, "vec2": 2, "vec3": 3, "vec4": 4, "uvec2": 2}
_BIND_IN, _BIND_OUT = 14, 15
_GROUP = 64


def as_f32(values: np.ndarray) -> np.ndarray:
    """Values as float32 sees them, in float64: what both sides must be given."""
    return np.asarray(values, np.float32).astype(np.float64)


def evaluate(
    ctx: moderngl.Context,
    includes: Sequence[str],
    body: str,
    inputs: Mapping[str, np.ndarray],
    outputs: Mapping[str, str],
    defines: Mapping[str, int | float | str] | None = None,
    structs: Sequence[Struct] = (),
    buffers: Mapping[int, np.ndarray] | None = None,
    binders: Sequence[Callable[[], None]] = (),
    declarations: str = "",
) -> dict[str, np.ndarray]:
    """Run `body` once per row of the inputs.

    Inputs are (N,) or (N, 2..4) arrays (unsigned integers (N,) or (N, 2) stay integers) and appear
    in `body` as locals of their names; `body` assigns the outputs, named with their GLSL types. `buffers` fills
    bindings of the included files, `binders` are called to bind their textures; `declarations` is GLSL put after the
    includes. Returns float64 (uint32 for unsigned) arrays of N rows.
    """
    count = len(next(iter(inputs.values())))
    fetched, words, offset = [], [], 0
    for name, values in inputs.items():
        values = np.asarray(values)
        if len(values) != count:
            raise ValueError(f"input {name} has {len(values)} rows, expected {count}")
        unsigned = values.dtype.kind == "u"
        kind = {(): "uint", (2,): "uvec2"}[values.shape[1:]] if unsigned else _FLOATS[values.shape[1:]]
        rounded = np.ascontiguousarray(values, np.uint32 if unsigned else np.float32)
        words.append(rounded.reshape(-1).view(np.uint32))
        size = _COMPONENTS[kind]
        fetches = [f"words_in[{offset}u + {size}u * row + {c}u]" for c in range(size)]
        if not unsigned:
            fetches = [f"uintBitsToFloat({fetch})" for fetch in fetches]
        fetched.append(f"    {kind} {name} = {kind}({', '.join(fetches)});")
        offset += words[-1].size

    stores, sizes, start = [], {}, 0
    for name, kind in outputs.items():
        size = _COMPONENTS[kind]
        fetched.append(f"    {kind} {name} = {kind}(0);")
        for c in range(size):
            value = name if size == 1 else f"{name}[{c}]"
            value = value if kind.startswith("u") else f"floatBitsToUint({value})"
            stores.append(f"    words_out[{start}u + {size}u * row + {c}u] = {value};")
        sizes[name] = (start, size)
        start += size * count

    lines = [
        f"layout(local_size_x = {_GROUP}) in;",
        *(f'#include "{name}"' for name in includes),
        declarations,
        f"layout(std430, binding = {_BIND_IN}) readonly buffer WordsIn {{ uint words_in[]; }};",
        f"layout(std430, binding = {_BIND_OUT}) writeonly buffer WordsOut {{ uint words_out[]; }};",
        "void main() {",
        "    uint row = gl_GlobalInvocationID.x;",
        f"    if (row >= {count}u) return;",
        *fetched,
        body,
        *stores,
        "}",
    ]
    held = {_BIND_IN: ctx.buffer(np.concatenate(words).tobytes()), _BIND_OUT: ctx.buffer(reserve=4 * start)}
    for binding, values in (buffers or {}).items():
        held[binding] = ctx.buffer(np.ascontiguousarray(values).tobytes())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "harness.comp"
        path.write_text("\n".join(lines) + "\n")
        # An absolute name is read as it is; its includes still come from the shaders folder.
        kernel = shader.compute(ctx, str(path), defines, structs)
    try:
        for binding, buffer in held.items():
            buffer.bind_to_storage_buffer(binding)
        for bind in binders:
            bind()
        kernel.run(-(-count // _GROUP))
        ctx.finish()
        raw = np.frombuffer(held[_BIND_OUT].read(), np.uint32)
    finally:
        shader.release(kernel)
        for buffer in held.values():
            buffer.release()
    results = {}
    for name, (first, size) in sizes.items():
        part = raw[first : first + size * count]
        if not outputs[name].startswith("u"):
            part = part.view(np.float32).astype(np.float64)
        results[name] = part.copy() if size == 1 else part.reshape(count, size).copy()
    return results
