"""Dispatches made without Python's lock.

Some drivers compile as late as a program's first dispatch, for seconds; moderngl holds Python's lock meanwhile, and so
every other thread stands still. Where a thread of its own draws (`render/viewer/threaded_engine`), these calls go
through ctypes, which lets others run.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable

import moderngl

_DISPATCH_INDIRECT_BUFFER = 0x90EE
_UINT, _INT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
_FUNCTYPE = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)


class DriverCalls:
    """OpenGL's functions that dispatch, for whichever context is current; `load` finds their addresses.

    Raises `LookupError` where one is missing.
    """

    def __init__(self, load: Callable[[str], int]) -> None:
        def function(name: str, *arguments: type, result: type | None = None) -> Callable[..., int]:
            address = load(name)
            if not address:
                raise LookupError(f"OpenGL has no {name}")
            return _FUNCTYPE(result, *arguments)(address)

        self._use_program = function("glUseProgram", _UINT)
        self._bind_buffer = function("glBindBuffer", _UINT, _UINT)
        self._dispatch = function("glDispatchCompute", _UINT, _UINT, _UINT)
        self._dispatch_indirect = function("glDispatchComputeIndirect", _POINTER)

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
    """From now on `ctx` dispatches without Python's lock. `load` finds OpenGL's functions."""
    _calls[ctx] = DriverCalls(load)


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
