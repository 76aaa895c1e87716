"""Calls into the driver that may compile, made without Python's lock.

A driver compiles when a program is linked, or as late as its first dispatch, for seconds; moderngl holds Python's lock
meanwhile, and so every other thread stands still. Where a thread of its own draws (`render/viewer/threaded_engine`),
these calls go through ctypes, which lets others run.
"""

from __future__ import annotations

import ctypes
import time
import weakref
from collections.abc import Callable

import moderngl

_COMPUTE_SHADER, _VERTEX_SHADER, _FRAGMENT_SHADER = 0x91B9, 0x8B31, 0x8B30
_DISPATCH_INDIRECT_BUFFER = 0x90EE
_WORTH_KEEPING_S, _WRITING_S = 0.05, 0.1
_UINT, _INT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
_FUNCTYPE = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)


class DriverCalls:
    """OpenGL's functions that compile, for whichever context is current; `load` finds their addresses.

    Raises `LookupError` where one is missing.
    """

    def __init__(self, load: Callable[[str], int]) -> None:
        def function(name: str, *arguments: type, result: type | None = None) -> Callable[..., int]:
            address = load(name)
            if not address:
                raise LookupError(f"OpenGL has no {name}")
            return _FUNCTYPE(result, *arguments)(address)

        self._create_program = function("glCreateProgram", result=_UINT)
        self._create_shader = function("glCreateShader", _UINT, result=_UINT)
        self._shader_source = function("glShaderSource", _UINT, _INT, ctypes.POINTER(ctypes.c_char_p), _POINTER)
        self._compile_shader = function("glCompileShader", _UINT)
        self._attach_shader = function("glAttachShader", _UINT, _UINT)
        self._link_program = function("glLinkProgram", _UINT)
        self._delete_shader = function("glDeleteShader", _UINT)
        self._delete_program = function("glDeleteProgram", _UINT)
        self._use_program = function("glUseProgram", _UINT)
        self._bind_buffer = function("glBindBuffer", _UINT, _UINT)
        self._dispatch = function("glDispatchCompute", _UINT, _UINT, _UINT)
        self._dispatch_indirect = function("glDispatchComputeIndirect", _POINTER)

    def compile(self, texts: tuple[str, ...]) -> None:
        """Link a program of these stages (one: compute, two: vertex and fragment) and forget it.

        The driver's cache has it then for moderngl, which holds the lock. Mistakes are for moderngl to find.
        """
        kinds = (_COMPUTE_SHADER,) if len(texts) == 1 else (_VERTEX_SHADER, _FRAGMENT_SHADER)
        program = self._create_program()
        for kind, text in zip(kinds, texts, strict=True):
            shader = self._create_shader(kind)
            self._shader_source(shader, 1, (ctypes.c_char_p * 1)(text.encode()), None)
            self._compile_shader(shader)
            self._attach_shader(program, shader)
            self._delete_shader(shader)  # once its program is
        began = time.perf_counter()
        self._link_program(program)
        self._delete_program(program)
        took_s = time.perf_counter() - began
        if took_s > _WORTH_KEEPING_S:
            time.sleep(min(0.1 * took_s, _WRITING_S))  # Mesa's cache is written by a thread

    def dispatch(self, program: int, x: int, y: int, z: int) -> None:
        """Run a compute program."""
        self._use_program(program)
        self._dispatch(x, y, z)

    def dispatch_indirect(self, program: int, buffer: int, offset: int) -> None:
        """Run a compute program; how many groups is in `buffer`."""
        self._use_program(program)
        self._bind_buffer(_DISPATCH_INDIRECT_BUFFER, buffer)
        self._dispatch_indirect(offset)


_calls: weakref.WeakKeyDictionary[moderngl.Context, DriverCalls] = weakref.WeakKeyDictionary()


def unlock(ctx: moderngl.Context, load: Callable[[str], int]) -> None:
    """From now on the driver compiles what `ctx` is given without Python's lock. `load` finds OpenGL's functions."""
    _calls[ctx] = DriverCalls(load)


def calls_of(ctx: moderngl.Context) -> DriverCalls | None:
    """Those of a context that was unlocked."""
    return _calls.get(ctx)


class UnlockedCompute(moderngl.ComputeShader):
    """A compute program whose runs let other threads go on."""

    def run(self, group_x: int = 1, group_y: int = 1, group_z: int = 1) -> None:
        """As of any compute program."""
        _calls[self.ctx].dispatch(self.glo, group_x, group_y, group_z)

    def run_indirect(self, buffer: moderngl.Buffer, offset: int = 0) -> None:
        """As of any compute program."""
        _calls[self.ctx].dispatch_indirect(self.glo, buffer.glo, offset)


def unlocked(program: moderngl.ComputeShader) -> moderngl.ComputeShader:
    """`program` itself; in an unlocked context with runs that let other threads go on."""
    if program.ctx in _calls:
        program.__class__ = UnlockedCompute
    return program
