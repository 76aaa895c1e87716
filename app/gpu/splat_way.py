"""Whether splats are drawn by the rasteriser or added by compute shaders: a device is fast at one of the two.

Data-centre GPUs have next to no raster hardware. Elsewhere the rasteriser is kept. A software renderer then adds in
photons' order, and the same picture comes out every time; on GPUs many photons are added at once, in any order.
"""

from __future__ import annotations

import os
import time
import weakref
from dataclasses import dataclass

import moderngl

from ..base.errors import UserError, suggestion
from . import shader
from .device_traits import DeviceTraits, is_software_renderer
from .framebuffers import adding, park
from .limits import Limits

ENVIRONMENT_VARIABLE = "SPECTRASPLAT_SPLATS"
FLOAT_ATOMICS = "GL_NV_shader_atomic_float"
"""Extension of OpenGL and of GLSL: `atomicAdd` of a float in a storage block."""
SLOW_BLENDING = 8e9
"""Fragments a second, of RGBA32F: below it compute shaders add faster."""
_WAYS = ("raster", "compute")
_SIDE, _QUADS = 1024, 8
_PATIENCE_S = 0.1
"""Seconds for a device to wake up and be fast; what is fast at once needs no more than a round."""
_VERTEX = """#version 430 core
void main() {
    gl_Position = vec4(vec2(gl_VertexID % 3 == 1 ? 3.0 : -1.0, gl_VertexID % 3 == 2 ? 3.0 : -1.0), 0.0, 1.0);
}
"""
_FRAGMENT = """#version 430 core
layout(location = 0) out vec4 colour;
void main() { colour = vec4(gl_FragCoord.xy, 1.0, 1.0); }
"""


@dataclass(frozen=True)
class SplatWay:
    """How a context's splats are drawn."""

    by_compute: bool
    reason: str
    """What decided, for people."""
    largest_block: int
    """Bytes of a storage block: what sums of compute shaders may take."""
    extensions: tuple[str, ...] = ()
    """Extensions of GLSL that adding needs; without them it compares and swaps."""
    in_bulk: bool = False
    """Many photons at a time and in any order, as GPUs like it: sums are read where they are, and seldom moved."""
    packs: bool = False
    """`DeviceTraits.packs_records`."""

    def for_maps(self, size: tuple[int, int], targets: int) -> bool:
        """Whether splats go by compute shaders into maps of so many texels and textures."""
        return self.by_compute and sums_bytes(size, targets) <= self.largest_block

    @property
    def sentence(self) -> str:
        """For `doctor`."""
        if not self.by_compute:
            return f"drawn by the rasteriser ({self.reason})"
        return f"added by compute shaders ({self.reason}; maps over {self.largest_block >> 20} MiB by the rasteriser)"


def sums_bytes(size: tuple[int, int], targets: int) -> int:
    """Size of the sums that compute shaders add splats to: whole blocks of 4 by 2 texels (`light/splat_sums.glsl`)."""
    width, height = size
    return -(-width // 4) * -(-height // 2) * 8 * 16 * targets


_ways: weakref.WeakKeyDictionary[moderngl.Context, SplatWay] = weakref.WeakKeyDictionary()


def way_of(ctx: moderngl.Context) -> SplatWay:
    """The way of a context, found out once: on a GPU that has float atomics by drawing for a few milliseconds.

    Raises `UserError` where the environment names a way that there is not."""
    if ctx not in _ways:
        _ways[ctx] = _found(ctx)
    return _ways[ctx]


def _found(ctx: moderngl.Context) -> SplatWay:
    renderer = ctx.info["GL_RENDERER"]
    extensions = (FLOAT_ATOMICS,) if FLOAT_ATOMICS in ctx.extensions else ()
    largest = Limits.read(ctx.info).storage_block_bytes
    traits, forced = DeviceTraits.of(renderer), _from_environment()
    if forced:
        by_compute, reason = forced == "compute", f"{ENVIRONMENT_VARIABLE} is set"
    elif is_software_renderer(renderer):
        # Where a GPU is assumed its programs are for strict compilers too: without extensions.
        by_compute, reason, extensions = traits.splats_by_compute, "as on all software renderers", ()
    elif not extensions:
        by_compute, reason = False, f"it has no {FLOAT_ATOMICS}"
    else:
        rate = blending_rate(ctx)
        by_compute, reason = rate < SLOW_BLENDING, f"it blends {rate / 1e9:.1f} G fragments/s"
    return SplatWay(by_compute, reason, largest, extensions, traits.work_is_queued, traits.packs_records)


def _from_environment() -> str:
    name = os.environ.get(ENVIRONMENT_VARIABLE, "").strip().casefold()
    if not name or name in _WAYS:
        return name
    hint = suggestion(name, _WAYS) or ", use 'raster' or 'compute'"
    raise UserError(f"{ENVIRONMENT_VARIABLE} is '{name}', which is no way to draw splats{hint}")


def blending_rate(ctx: moderngl.Context) -> float:
    """Fragments that the device adds to an RGBA32F texture a second, by the wall clock: the best of rounds that end
    when it is no longer slow, or after `_PATIENCE_S`."""
    texture = ctx.texture((_SIDE, _SIDE), 4, dtype="f4")
    framebuffer = ctx.framebuffer([texture])
    program = ctx.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
    array = ctx.vertex_array(program, [])
    framebuffer.use()
    framebuffer.clear()
    with adding(ctx):
        array.render(moderngl.TRIANGLES, vertices=3)
        ctx.finish()
        rate, until = 0.0, time.perf_counter() + _PATIENCE_S
        while rate < SLOW_BLENDING and time.perf_counter() < until:
            started = time.perf_counter()
            array.render(moderngl.TRIANGLES, vertices=3 * _QUADS)
            ctx.finish()
            rate = max(rate, _SIDE * _SIDE * _QUADS / (time.perf_counter() - started))
    park(ctx)
    shader.release(array, program, framebuffer, texture)
    return rate
