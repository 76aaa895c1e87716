"""What single things cost on a device: a dispatch, a wait, a read, an addition to memory, a program to compile.

Schedules are chosen by these. All times are the wall clock's about work that is waited for.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..gpu import shader
from ..gpu.linker import linker_of
from ..gpu.splat_way import FLOAT_ATOMICS, blending_rate

if TYPE_CHECKING:
    import moderngl

    from ..gpu.context import Context
    from ..gpu.shader import Built

T = TypeVar("T")
Figures = dict[str, float]
Named = tuple[str, Figures]
"""What was measured, and its figures with units in their names."""

CHANNELS = (1, 4, 12)
_TEXELS = 1 << 20
_GROUP = 64
_RUNS, _PATIENCE_S = 21, 1.0
"""Of each measurement at most; none is begun after so many seconds, but for the first three."""
_EMPTY = """#version 430 core
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Words { uint words[]; };
void main() { if (words[0] == 0xffffffffu) words[1] = 1u; }
"""
_ADDING = """#version 430 core
{extension}
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Sums {{ {kind} sums[]; }};
uint hash(uint x) {{
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}}
void add(uint at) {{ {add} }}
void main() {{
    uint texel = {texel} % {texels}u;
    for (uint channel = 0u; channel < {channels}u; ++channel) add(texel * {channels}u + channel);
}}
"""
_SWAPPED = """uint seen = sums[at], before;
    do { before = seen; seen = atomicCompSwap(sums[at], before, floatBitsToUint(uintBitsToFloat(before) + 1.0)); }
    while (seen != before);"""
_TEXEL = {
    "scattered": "hash(gl_GlobalInvocationID.x)",
    "side by side": "hash(gl_WorkGroupID.x) + gl_LocalInvocationIndex",
}
"""Texel of an invocation: its own by chance, or those of a group next to each other, as in a splat."""


def dispatch_costs(context: Context, repeats: int) -> Iterator[Named]:
    """Microseconds of a dispatch, a wait and a read, each on average of so many `repeats`."""
    ctx = context.ctx
    words, groups, others = ctx.buffer(bytes(64)), ctx.buffer(bytes(16)), ctx.buffer(bytes(64))
    groups.write(np.array([0, 1, 1, 0], np.uint32).tobytes())
    program = ctx.compute_shader(_EMPTY)
    words.bind_to_storage_buffer(0)

    def empty_indirect() -> None:
        program.run_indirect(groups)
        ctx.memory_barrier()

    def waited() -> None:
        program.run(1)
        context.finish()

    def read_new() -> None:
        program.run(1)
        words.read(4)

    try:
        for name, work in (
            ("empty indirect dispatch and barrier, queued", empty_indirect),
            ("dispatch of one group, queued", lambda: program.run(1)),
            ("dispatch of one group, finish", waited),
            ("finish of nothing", context.finish),
            ("dispatch of one group, read of 4 bytes", read_new),
            ("read of 4 bytes that nothing writes", lambda: others.read(4)),
            ("write of 64 bytes", lambda: others.write(bytes(64))),
        ):
            yield name, {"us": round(1e6 * _each_s(context, work, repeats), 2)}
    finally:
        shader.release(program, words, groups, others)


def _each_s(context: Context, work: Callable[[], object], repeats: int) -> float:
    work()
    context.finish()
    started = time.perf_counter()
    for _ in range(repeats):
        work()
    context.finish()
    return (time.perf_counter() - started) / repeats


def addition_rates(context: Context, count: int) -> Iterator[Named]:
    """Additions of a float to memory, and texels blended, by channels of a texel; `count` texels at a time."""
    ctx = context.ctx
    is_atomic = FLOAT_ATOMICS in ctx.extensions
    sums = ctx.buffer(reserve=4 * _TEXELS * max(CHANNELS))
    for pattern, texel in _TEXEL.items():
        for channels in CHANNELS:
            program = ctx.compute_shader(
                _ADDING.format(
                    extension=f"#extension {FLOAT_ATOMICS} : require" if is_atomic else "",
                    kind="float" if is_atomic else "uint",
                    add="atomicAdd(sums[at], 1.0);" if is_atomic else _SWAPPED,
                    texel=texel,
                    texels=_TEXELS,
                    channels=channels,
                )
            )
            sums.clear()
            sums.bind_to_storage_buffer(0)
            texels_s = count / median_s(ctx, partial(program.run, count // _GROUP))
            program.release()
            yield (
                f"{'float atomics' if is_atomic else 'compare and swap'}, {channels} channels, {pattern}",
                {
                    "texels_g_per_s": _significant(texels_s / 1e9),
                    "adds_g_per_s": _significant(channels * texels_s / 1e9),
                },
            )
    sums.release()
    for dtype in ("f4", "f2"):
        yield f"blending RGBA{8 * int(dtype[1])}F", {"texels_g_per_s": _significant(blending_rate(ctx, dtype) / 1e9)}


def repeated(run: Callable[[int], T]) -> list[T]:
    """What `run` of 1, 2, … gives; that of 0 only warms up."""
    run(0)
    found, started = [run(1)], time.perf_counter()
    while len(found) < 3 or (len(found) < _RUNS and time.perf_counter() - started < _PATIENCE_S):
        found.append(run(len(found) + 1))
    return found


def median_s(ctx: moderngl.Context, work: Callable[[], object]) -> float:
    """What `work` takes the device, s."""

    def run(_: int) -> float:
        ctx.finish()
        started = time.perf_counter()
        work()
        ctx.finish()
        return time.perf_counter() - started

    return float(np.median(repeated(run)))


def _significant(value: float) -> float:
    return float(f"{value:.3g}")


def compile_times(programs: Sequence[Built], make: Callable[[], Context]) -> Iterator[Named]:
    """Driver seconds of `programs` as they were compiled, one after the other, the longest first; then of all of them
    as a start has them, in a context from `make`, and in one more, which may take what the first one has kept."""
    longest = sorted(programs, key=lambda built: built.seconds, reverse=True)
    for built in longest[:12]:
        yield built.name, {"alone_s": round(built.seconds, 3), "text_kb": round(sum(map(len, built.texts)) / 1e3, 1)}
    alone_s = round(sum(built.seconds for built in longest), 3)
    for name in ("side by side", "from what was kept"):
        with make() as context:
            started = time.perf_counter()
            linker = linker_of(context.ctx)
            made = [linker.program(context.ctx, built.texts, RuntimeError, at_once=False) for built in longest]
            sent = time.perf_counter()
            assert all(program.glo for program in made)  # waits
            now = time.perf_counter()
        figures = {"programs": len(made), "alone_s": alone_s, "sent_s": sent - started, "s": now - started}
        yield name, {key: round(figure, 3) for key, figure in figures.items()}
