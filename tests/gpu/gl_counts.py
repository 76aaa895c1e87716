"""Counts what a piece of the program asks of OpenGL: moderngl's methods are watched, nothing else changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import moderngl
import numpy as np

_TEXTURES = (moderngl.Texture, moderngl.TextureArray, moderngl.Texture3D, moderngl.TextureCube)
_MADE = ("buffer", "texture", "texture3d", "texture_array", "texture_cube", "depth_texture", "framebuffer")
_MADE += ("simple_framebuffer", "renderbuffer", "depth_renderbuffer", "vertex_array", "query", "sampler")
_COMPILED = ("compute_shader", "program")


@dataclass
class Counts:
    """Since counting began (bytes are of buffers and textures alike)."""

    dispatches: int = 0
    draws: int = 0
    reads: int = 0
    read_bytes: int = 0
    finishes: int = 0
    writes: int = 0
    written_bytes: int = 0
    barriers: int = 0
    made: list[str] = field(default_factory=list)
    """Buffers, textures, framebuffers, …: kind and size of each."""
    programs: int = 0
    groups: list[tuple[int, int, int]] = field(default_factory=list)
    """Work groups of each direct dispatch."""

    @property
    def waits(self) -> int:
        """How often the processor waited for the device."""
        return self.reads + self.finishes


def _bytes(data: Any) -> int:
    return memoryview(data).nbytes


@contextmanager
def counted() -> Iterator[Counts]:
    """What is asked of any context of moderngl's within the block."""
    counts = Counts()

    def noting(owner: Any, name: str, note: Callable[..., None]) -> Any:
        real = getattr(owner, name)

        def watched(self: Any, *arguments: Any, **named: Any) -> Any:
            result = real(self, *arguments, **named)
            note(self, result, *arguments, **named)
            return result

        return mock.patch.object(owner, name, watched)

    def dispatched(_self: Any, _result: Any, x: int = 1, y: int = 1, z: int = 1, **_: Any) -> None:
        counts.dispatches += 1
        counts.groups.append((x, y, z))

    def dispatched_indirect(*_: Any, **__: Any) -> None:
        counts.dispatches += 1

    def drawn(*_: Any, **__: Any) -> None:
        counts.draws += 1

    def finished(*_: Any, **__: Any) -> None:
        counts.finishes += 1

    def barred(*_: Any, **__: Any) -> None:
        counts.barriers += 1

    def read(_self: Any, result: bytes, *_: Any, **__: Any) -> None:
        counts.reads += 1
        counts.read_bytes += len(result)

    def read_into(_self: Any, _result: Any, into: Any, *_: Any, **__: Any) -> None:
        counts.reads += 1
        counts.read_bytes += 0 if isinstance(into, moderngl.Buffer) else _bytes(into)

    def wrote(_self: Any, _result: Any, data: Any, *_: Any, **__: Any) -> None:
        counts.writes += 1
        counts.written_bytes += 0 if isinstance(data, moderngl.Buffer) else _bytes(data)

    def made(name: str) -> Callable[..., None]:
        def note(_self: Any, result: Any, *arguments: Any, **_: Any) -> None:
            size = getattr(result, "size", "")
            counts.made.append(f"{name} {size}")
            given = arguments[0] if name == "buffer" and arguments else arguments[2] if len(arguments) > 2 else None
            if isinstance(given, (bytes, bytearray, memoryview, np.ndarray)):
                counts.writes += 1
                counts.written_bytes += _bytes(given)

        return note

    def compiled(*_: Any, **__: Any) -> None:
        counts.programs += 1

    context = moderngl.Context
    with ExitStack() as stack:
        stack.enter_context(noting(moderngl.ComputeShader, "run", dispatched))
        stack.enter_context(noting(moderngl.ComputeShader, "run_indirect", dispatched_indirect))
        for name in ("render", "render_indirect"):
            stack.enter_context(noting(moderngl.VertexArray, name, drawn))
        for owner in (moderngl.Buffer, *_TEXTURES, moderngl.Framebuffer):
            stack.enter_context(noting(owner, "read", read))
            stack.enter_context(noting(owner, "read_into", read_into))
        for owner in (moderngl.Buffer, *_TEXTURES):
            stack.enter_context(noting(owner, "write", wrote))
        stack.enter_context(noting(context, "finish", finished))
        stack.enter_context(noting(context, "memory_barrier", barred))
        for name in _MADE:
            stack.enter_context(noting(context, name, made(name)))
        for name in _COMPILED:
            stack.enter_context(noting(context, name, compiled))
        yield counts
