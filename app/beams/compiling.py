"""The functions of this folder as machine code.

numba compiles them, which takes it most of a minute for all. What it made is kept in the user's cache folder, by the
content of its source, and from then on loaded by llvmlite alone: numba itself takes longer to start (half a second)
than most searches for beams.
"""

from __future__ import annotations

import ctypes
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any, Literal

import numpy as np

from ..base.compiling import version_of
from ..base.kept_files import KeptFiles

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
_OPTIONS |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""References are not counted, so nothing may be allocated inside: scratch comes from the caller (`search.WORK`)."""
_KEPT = KeptFiles(os.path.join(os.environ.get("NUMBA_CACHE_DIR", ""), "compiled"), 1 << 26, most_files=256)
"""Next to what numba keeps (`base.compiled_place`)."""
_RESULTS: dict[str, Any] = {"none": ctypes.c_void_p, "bool": ctypes.c_bool, "float64": ctypes.c_double}
_COMPILERS = "numba", "llvmlite"
_KNOWN = ("0.68.",)
"""Versions of numba whose way to call functions, which it does not promise to keep, is the one of `_Native`. Others
are called through numba itself, which only takes longer to start."""
_SUCCESS = 0, -2
"""What functions of numba return; -2: their result is None."""
_lock = Lock()

Kind = tuple[np.dtype, int, Literal["C", "A"]] | Literal["int64", "float64"]
"""What numba compiles for: of an array dtype, dimensions and layout, or the type of a number."""


class Part:
    """A function that only compiled functions call."""

    def __init__(self, function: Callable) -> None:
        self._function = function

    @cached_property
    def _dispatcher(self) -> Any:
        from numba import njit

        return njit(**_OPTIONS)(self._function)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes a global variable of this class for."""
        from numba import types

        return types.Dispatcher(self._dispatcher)


class Kernel:
    """A function that Python calls with arrays, integers and floats; it holds no lock of the interpreter."""

    def __init__(self, function: Callable) -> None:
        self._function = function
        self._calls: dict[tuple[Kind, ...], Callable] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Compile it for arguments of these kinds where that was never done, then call it."""
        kinds = tuple(_kind_of(argument) for argument in arguments)
        call = self._calls.get(kinds)
        if call is None:
            with _lock:
                call = self._calls.get(kinds) or self._call_for(kinds)
            self._calls[kinds] = call
        return call(*arguments)

    def _call_for(self, kinds: tuple[Kind, ...]) -> Callable:
        """From the disk where it was compiled before."""
        function = self._function
        version = version_of([_version().encode(), repr(kinds).encode()])
        key = f"{Path(function.__code__.co_filename).stem}.{function.__name__}-{version}"
        kept = _KEPT.load(key)
        if kept is not None:
            return _Native(_MachineCode.unpacked(kept), kinds)
        import numba

        if not numba.__version__.startswith(_KNOWN):
            return numba.njit(error_model="numpy", nogil=True)(function)
        machine = _compiled(function, kinds)
        _KEPT.save(key, machine.packed())
        return _Native(machine, kinds)


@dataclass(frozen=True)
class _MachineCode:
    """One function for arguments of some kinds."""

    triple: str
    """LLVM's name of the platform."""
    symbol: str
    """Its name in the object file."""
    result: str
    """One of `_RESULTS`."""
    needs: list[str]
    """Functions of the C library that it calls."""
    code: bytes
    """An object file."""

    @staticmethod
    def unpacked(content: bytes) -> _MachineCode:
        """What `packed` made."""
        head, _, code = content.partition(b"\n")
        return _MachineCode(**json.loads(head), code=code)

    def packed(self) -> bytes:
        """A line that describes it, then the object file."""
        head = {name: value for name, value in vars(self).items() if name != "code"}
        return json.dumps(head).encode() + b"\n" + self.code


class _Native:
    """Machine code in memory, called as numba calls it: pointers to the result and to what was raised, then each array
    as owner, parent, elements, bytes of one, data, shape, strides."""

    def __init__(self, machine: _MachineCode, kinds: tuple[Kind, ...]) -> None:
        from llvmlite import binding

        empty = binding.parse_assembly(f'target triple = "{machine.triple}"')
        self._engine = binding.create_mcjit_compiler(empty, _target_machine(machine.triple))
        if not all(binding.address_of_symbol(name) for name in machine.needs):
            from numba.core.registry import cpu_target  # knows where this platform has them

            assert cpu_target.target_context
        self._engine.add_object_file(binding.ObjectFileRef.from_data(machine.code))
        self._engine.finalize_object()
        self._result = _RESULTS[machine.result]
        types: list[Any] = [ctypes.c_void_p, ctypes.c_void_p]
        for kind in kinds:
            if isinstance(kind, str):
                types.append(ctypes.c_double if kind == "float64" else ctypes.c_int64)
            else:
                pointer, number = ctypes.c_void_p, ctypes.c_int64
                types += [pointer, pointer, number, number, pointer, *[number] * (2 * kind[1])]
        self._call = ctypes.CFUNCTYPE(ctypes.c_int32, *types)(self._engine.get_function_address(machine.symbol))

    def __call__(self, *arguments: Any) -> Any:
        values: list[Any] = []
        for a in arguments:
            if isinstance(a, np.ndarray):
                values += (None, None, a.size, a.itemsize, a.ctypes.data, *a.shape, *a.strides)
            else:
                values.append(a)
        result, raised = self._result(), ctypes.c_void_p()
        status = self._call(ctypes.byref(result), ctypes.byref(raised), *values)
        if status not in _SUCCESS:
            raise RuntimeError(f"compiled code raised an exception ({status})")
        return result.value


def _kind_of(argument: Any) -> Kind:
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, "C" if argument.flags.c_contiguous else "A"
    return "float64" if isinstance(argument, float) else "int64"


def _compiled(function: Callable, kinds: tuple[Kind, ...]) -> _MachineCode:
    from llvmlite import binding
    from numba import from_dtype, njit, types

    dispatcher = njit(**_OPTIONS)(function)
    arguments = tuple(
        getattr(types, kind) if isinstance(kind, str) else types.Array(from_dtype(kind[0]), *kind[1:]) for kind in kinds
    )
    dispatcher.compile(arguments)
    symbol = dispatcher.overloads[arguments].fndesc.llvm_func_name
    module = binding.parse_assembly(dispatcher.inspect_llvm(arguments))
    return _MachineCode(
        module.triple,
        symbol,
        str(dispatcher.overloads[arguments].signature.return_type),
        [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")],
        _target_machine(module.triple).emit_object(module),
    )


def _target_machine(triple: str) -> Any:
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    cpu, features = binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    return binding.Target.from_triple(triple).create_target_machine(cpu, features, opt=3, jit=True)


@cache
def _version() -> str:
    """Changes with the functions, with what compiles them and with the processor."""
    from llvmlite import binding

    texts = [path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py"))]
    sources = [text for text in texts if b"compiling import" in text]  # this file too
    packages = [Path(str(spec.origin)).parent for spec in map(find_spec, _COMPILERS) if spec]
    compilers = [(package / "_version.py").read_bytes() for package in packages]
    machine = binding.get_process_triple(), binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    return version_of([*sources, *compilers, *(text.encode() for text in machine)])


def jit(function: Callable) -> Kernel:
    """`function` for Python to call; it calls no function that allocates."""
    return Kernel(function)


def part(function: Callable) -> Any:
    """`function` for compiled functions to call."""
    return Part(function)
