"""Every record that crosses between numpy and GLSL: both sides find every word of every field where the other put it.

The structs are collected, not listed, so that a new one is tested as soon as it exists. Words are all different, so
that two fields that changed places fail; `test_a_layout_that_drifts_is_seen` shows it.
"""

from __future__ import annotations

import importlib
import itertools
import pkgutil
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import spectrasplat.gpu
import spectrasplat.passes
from spectrasplat.base import paths
from spectrasplat.gpu import shader
from spectrasplat.gpu.records import photon_record, ray_record, trace_parameters
from spectrasplat.gpu.schema import Struct
from spectrasplat.passes import beam_splat, footprint, splat

pytestmark = pytest.mark.core

ONE = 0x3F800000
"""Bits of 1.0: words just above are ordinary floats, so that no driver flushes them."""
ROWS = 5
GROUP = 64
_BITS = {
    "float": ("floatBitsToUint", "uintBitsToFloat"),
    "vec": ("floatBitsToUint", "uintBitsToFloat"),
    "uint": ("", ""),
    "uvec": ("", ""),
    "int": ("uint", "int"),
}


def structs() -> list[Struct]:
    """Every struct of app/gpu and app/passes, and the records whose size the scene decides."""
    found: dict[tuple[str, int], Struct] = {}
    for package in (spectrasplat.gpu, spectrasplat.passes):
        for module in pkgutil.iter_modules(package.__path__):
            for value in vars(importlib.import_module(f"{package.__name__}.{module.name}")).values():
                if isinstance(value, Struct):
                    found[value.name, value.stride] = value
    for sized in (*map(photon_record, (0, 1, 4)), *map(ray_record, (0, 2, 3, 6)), trace_parameters(200)):
        found[sized.name, sized.stride] = sized
    return list(found.values())


STRUCTS = structs()


LONG = 16
"""Items of an array from which on a kernel loops over them: written out, 2,048 words took a driver minutes."""


def copies(struct: Struct, one: str) -> str:
    """GLSL: `one` for every word of every field, in order: a template of {word} (its number), {name} (the member),
    {to} and {back} (to its bits, from its bits)."""
    lines, word = [], 0
    for field in struct.fields:
        to_bits, from_bits = _BITS[re.match(r"[a-z]+", field.type)[0]]
        components = int(field.type[-1]) if field.type[-1].isdigit() else 1
        loops = field.count > LONG
        items = ["i"] if loops else [str(i) for i in range(field.count)]
        if loops:
            lines.append(f"    for (uint i = 0u; i < {field.count}u; ++i) {{")
        for item, component in itertools.product(items, range(components)):
            at = (
                f"{word + component}u + {components}u * i"
                if loops
                else f"{word}u + {int(item) * components + component}u"
            )
            name = field.name + (f"[{item}]" if field.count > 1 else "") + (f"[{component}]" if components > 1 else "")
            lines.append("    " + one.format(word=at, name=name, to=to_bits, back=from_bits))
        if loops:
            lines.append("    }")
        word += field.count * components
    return "\n".join(lines)


def pattern(struct: Struct, rows: int = ROWS) -> np.ndarray:
    """A different word everywhere: uint32 (rows, words)."""
    count = struct.stride // 4
    return (ONE + np.arange(rows * count, dtype=np.uint32)).reshape(rows, count)


def by_name(struct: Struct, values: np.ndarray) -> np.ndarray:
    """Records in which every field was set by its name, its words in the order of `values` (rows, words)."""
    filled = struct.zeros(len(values))
    word = 0
    for field in struct.fields:
        shape = filled[field.name].shape
        size = int(np.prod(shape[1:], dtype=int))
        filled[field.name] = values[:, word : word + size].copy().view(filled[field.name].dtype).reshape(shape)
        word += size
    assert word == values.shape[1]
    return filled


def run(
    gl,
    declarations: str,
    body: str,
    known: tuple[Struct, ...],
    storage: dict[int, bytes],
    uniform: bytes | None = None,
    rows: int = ROWS,
) -> dict[int, bytes]:
    """A kernel of one thread a row; returns what the storage buffers hold afterwards."""
    text = (
        f"layout(local_size_x = {GROUP}) in;\n{declarations}\nvoid main() {{\n"
        f"    uint row = gl_GlobalInvocationID.x;\n    if (row >= {rows}u) return;\n{body}\n}}\n"
    )
    held = {binding: gl.ctx.buffer(content) for binding, content in storage.items()}
    block = gl.ctx.buffer(uniform) if uniform is not None else None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layout.comp"
        file.write_text(text)
        kernel = shader.compute(gl.ctx, str(file), structs=known)
    for binding, buffer in held.items():
        buffer.bind_to_storage_buffer(binding)
    if block is not None:
        block.bind_to_uniform_block(0)
    kernel.run(1)
    gl.ctx.finish()
    results = {binding: buffer.read() for binding, buffer in held.items()}
    for owned in (kernel, *held.values(), *([block] if block is not None else [])):
        shader.release(owned)
    return results


WORDS_OUT = "layout(std430, binding = 1) buffer Words { uint words[]; };"


def read_words(struct: Struct, source: str) -> str:
    """GLSL that copies every member of `source` to words of its row."""
    return copies(struct, f"words[row * {struct.stride // 4}u + {{word}}] = {{to}}({source}{{name}});")


@pytest.mark.parametrize("struct", STRUCTS, ids=lambda s: f"{s.name}-{s.stride}")
def test_a_kernel_reads_what_numpy_wrote_and_numpy_what_a_kernel_wrote(gl, struct: Struct) -> None:
    values = pattern(struct)
    items = f"layout(std430, binding = 0) buffer Items {{ {struct.name} items[]; }};\n" + WORDS_OUT
    out = run(
        gl,
        items,
        read_words(struct, "items[row]."),
        (struct,),
        {0: by_name(struct, values).tobytes(), 1: bytes(values.nbytes)},
    )
    np.testing.assert_array_equal(np.frombuffer(out[1], np.uint32).reshape(values.shape), values)
    word = f"{ONE}u + row * {struct.stride // 4}u + {{word}}"
    writes = copies(struct, f"items[row].{{name}} = {{back}}({word});")
    out = run(gl, items, writes, (struct,), {0: bytes(ROWS * struct.stride), 1: bytes(4)})
    written = np.frombuffer(out[0], struct.dtype)
    expected = by_name(struct, values)
    for field in struct.fields:
        np.testing.assert_array_equal(
            written[field.name].view(np.uint32), expected[field.name].view(np.uint32), err_msg=field.name
        )


@pytest.mark.parametrize("struct", [s for s in STRUCTS if s.texels], ids=lambda s: f"{s.name}-{s.stride}")
def test_records_packed_as_texels_lie_as_in_a_buffer(gl, struct: Struct) -> None:
    values = pattern(struct)
    texels = struct.stride // 16
    declared = "layout(std430, binding = 0) buffer Texels { uvec4 at[]; };\n" + WORDS_OUT
    body = f"""    uvec4 texels[{struct.name}_TEXELS];
    for (uint i = 0u; i < {texels}u; ++i) texels[i] = at[row * {texels}u + i];
    {struct.name} item = {struct.name}_of(texels);
{read_words(struct, "item.")}
    to_texels(item, texels);
    for (uint i = 0u; i < {texels}u; ++i) at[row * {texels}u + i] = texels[i] + 1u;"""
    out = run(gl, declared, body, (struct,), {0: by_name(struct, values).tobytes(), 1: bytes(values.nbytes)})
    np.testing.assert_array_equal(np.frombuffer(out[1], np.uint32).reshape(values.shape), values)
    np.testing.assert_array_equal(np.frombuffer(out[0], np.uint32).reshape(values.shape), values + 1)


_BLOCK = re.compile(r"layout\(std140,[^)]*\)\s*uniform\s+(\w+)\s*\{([^}]*)\}")
HAND_WRITTEN = {
    "light/footprint_parameters.glsl": footprint.PARAMETERS,
    "light/splat_parameters.glsl": splat.PARAMETERS,
    "light/beam.vert": beam_splat.PARAMETERS,
}
"""Shaders whose parameter block lists its members itself: it must be this struct."""


def uniform_blocks() -> list[tuple[str, str, str]]:
    """(file, block, text between its braces) of every std140 block of the shaders."""
    files = sorted(paths.shaders_dir().rglob("*.*"))
    shown = [(file.relative_to(paths.shaders_dir()).as_posix(), file) for file in files if file.suffix != ".md"]
    return [(name, *found) for name, file in shown for found in _BLOCK.findall(file.read_text())]


@pytest.mark.parametrize(("file", "name", "text"), uniform_blocks(), ids=lambda value: value if len(value) < 20 else "")
def test_uniform_blocks_read_what_numpy_wrote(gl, file: str, name: str, text: str) -> None:
    """std140 rounds arrays and structs up to 16 bytes where std430 does not: these must not need it."""
    typed = re.fullmatch(r"\s*(\w+)\s+(\w+)(\[\w+\])?;\s*", text)
    known = {s.name: s for s in STRUCTS}
    if typed and typed[1] == "vec4":
        return  # an array of vec4 has the same layout everywhere
    if typed and typed[1] in known:
        struct = known[typed[1]]
        rows, many = (ROWS, f"[{ROWS}]") if typed[3] else (1, "")
        values = pattern(struct, rows)
        declared = f"layout(std140, binding = 0) uniform Block {{ {struct.name} item{many}; }};\n{WORDS_OUT}"
        body = read_words(struct, "item[row]." if typed[3] else "item.")
        out = run(gl, declared, body, (struct,), {1: bytes(values.nbytes)}, by_name(struct, values).tobytes(), rows)
    else:
        struct = HAND_WRITTEN[file]
        values = pattern(struct, 1)
        declared = f"layout(std140, binding = 0) uniform Block {{ {text} }};\n{WORDS_OUT}"
        out = run(
            gl, declared, read_words(struct, ""), (), {1: bytes(values.nbytes)}, by_name(struct, values).tobytes(), 1
        )
    np.testing.assert_array_equal(np.frombuffer(out[1], np.uint32).reshape(values.shape), values)


def test_all_structs_are_found() -> None:
    names = {struct.name for struct in STRUCTS}
    assert {
        "PhotonRecord",
        "RayRecord",
        "Outcome",
        "ChunkCount",
        "QueueState",
        "EmitParameters",
        "TraceParameters",
        "Placement",
        "Receiver",
    } <= names
    assert {
        "Triangle",
        "Solid",
        "Object",
        "CameraLight",
        "CameraParameters",
        "SplatRecord",
        "FootprintParameters",
        "DrawParameters",
    } <= names
    declared = "".join(
        file.read_text() for file in (Path(spectrasplat.__path__[0])).rglob("*.py") if file.name != "schema.py"
    )
    assert set(re.findall(r'Struct\(\s*"(\w+)"', declared)) <= names


def test_a_layout_that_drifts_is_seen(gl) -> None:
    """Mutant: two fields change places on one side only."""
    struct = next(s for s in STRUCTS if s.name == "Receiver")
    fields = list(struct.fields)
    places = [f.name for f in fields]
    i, j = places.index("placement"), places.index("first_triangle")
    fields[i], fields[j] = fields[j], fields[i]
    drifted = replace(struct, fields=tuple(fields))
    values = pattern(struct)
    meant, written = by_name(struct, values), drifted.zeros(ROWS)
    for field in fields:
        written[field.name] = meant[field.name]
    items = f"layout(std430, binding = 0) buffer Items {{ {struct.name} items[]; }};\n" + WORDS_OUT
    out = run(gl, items, read_words(struct, "items[row]."), (struct,), {0: written.tobytes(), 1: bytes(values.nbytes)})
    read = np.frombuffer(out[1], np.uint32).reshape(values.shape)
    assert np.count_nonzero(read != values) == 2 * ROWS


def test_structs_are_told_apart_by_what_they_hold() -> None:
    """By their hash, too, which is worked out once: sources are kept by the structs in them."""
    found = structs()
    again = [Struct(struct.name, struct.fields, struct.texels) for struct in found]
    assert again == found and [hash(struct) for struct in again] == [hash(struct) for struct in found]
    assert len(set(found + again)) == len(found) == len({hash(struct) for struct in found})
