"""Programs made by calls of our own, which moderngl then adopts.

moderngl waits for every program, holds Python's lock meanwhile, and knows no binaries. Here the driver compiles without
the lock, and programs side by side where it has threads for them (GL_KHR_parallel_shader_compile): nothing waits for a
program before its first use. Binaries are kept on the disk (`program_store`), so that a later process compiles nothing.
"""

from __future__ import annotations

import ctypes
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import moderngl

from . import program_store
from .device_traits import DeviceTraits
from .program_store import Binary
from .unlocked import unlocked

_COMPUTE_SHADER, _VERTEX_SHADER, _FRAGMENT_SHADER = 0x91B9, 0x8B31, 0x8B30
_COMPILE_STATUS, _LINK_STATUS, _COMPLETION_STATUS, _LOG_LENGTH = 0x8B81, 0x8B82, 0x91B1, 0x8B84
_BINARY_HINT, _BINARY_LENGTH, _BINARY_FORMATS = 0x8257, 0x8741, 0x87FE
_PARALLEL = "GL_KHR_parallel_shader_compile"
_KINDS = {1: {"compute": _COMPUTE_SHADER}, 2: {"vertex": _VERTEX_SHADER, "fragment": _FRAGMENT_SHADER}}
"""By the number of stages."""
_STUB = "#version 430 core\nvoid main() {}\n"
_COMPUTE_STUB = f"{_STUB}layout(local_size_x = 1) in;\n"
"""What moderngl compiles in place of a program that it adopts."""
_LOOK_S = 0.002
_UINT, _INT, _POINTER = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
_FUNCTYPE = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)


class Loader(Protocol):
    """A current context, in the form in which `moderngl.create_context(context=…)` takes it."""

    def load(self, name: str) -> int: ...
    def release(self) -> None: ...
    def __enter__(self) -> object: ...
    def __exit__(self, *exception: object) -> None: ...


class Linker:
    """Makes the programs of a context; for moderngl the loader of its functions."""

    def __init__(self, loader: Loader) -> None:
        """Raises `LookupError` where OpenGL lacks a function."""
        self._loader = loader

        def function(name: str, *arguments: Any, result: Any = None) -> Callable[..., int]:
            address = loader.load(name)
            if not address:
                raise LookupError(f"OpenGL has no {name}")
            return _FUNCTYPE(result, *arguments)(address)

        text, integer = ctypes.c_char_p, ctypes.POINTER(_INT)
        self._create_program = function("glCreateProgram", result=_UINT)
        self._create_shader = function("glCreateShader", _UINT, result=_UINT)
        self._shader_source = function("glShaderSource", _UINT, _INT, ctypes.POINTER(text), _POINTER)
        self._compile_shader = function("glCompileShader", _UINT)
        self._attach_shader = function("glAttachShader", _UINT, _UINT)
        self._detach_shader = function("glDetachShader", _UINT, _UINT)
        self._link_program = function("glLinkProgram", _UINT)
        self._delete_shader = function("glDeleteShader", _UINT)
        self._delete_program = function("glDeleteProgram", _UINT)
        self._of_shader = function("glGetShaderiv", _UINT, _UINT, integer)
        self._of_program = function("glGetProgramiv", _UINT, _UINT, integer)
        self._shader_log = function("glGetShaderInfoLog", _UINT, _INT, integer, text)
        self._program_log = function("glGetProgramInfoLog", _UINT, _INT, integer, text)
        self._set_parameter = function("glProgramParameteri", _UINT, _UINT, _INT)
        self._get_binary = function("glGetProgramBinary", _UINT, _INT, integer, ctypes.POINTER(_UINT), text)
        self._set_binary = function("glProgramBinary", _UINT, _UINT, text, _INT)
        self._get_integer = function("glGetIntegerv", _UINT, integer)
        self._get_error = function("glGetError", result=_UINT)
        self._adopted = 0
        """What moderngl gets for the program that it makes now; 0: a new one."""
        self._callbacks = {
            "glCreateProgram": _FUNCTYPE(_UINT)(lambda: self._adopted or self._create_program()),
            "glAttachShader": _FUNCTYPE(None, _UINT, _UINT)(self._attach_for_moderngl),
            "glLinkProgram": _FUNCTYPE(None, _UINT)(self._link_for_moderngl),
        }
        self._device: tuple[str, ...] = ()
        """Names of driver and device; none where no binaries are kept."""
        self._is_parallel = False
        self._pending: weakref.WeakSet[Pending] = weakref.WeakSet()

    # ---- for moderngl ------------------------------------------------------------------------

    def load(self, name: str) -> int:
        """Address of the OpenGL function `name`, 0 when unknown."""
        ours = self._callbacks.get(name)
        return self._loader.load(name) if ours is None else ctypes.cast(ours, _POINTER).value or 0

    def release(self) -> None:
        """As of its loader."""
        self._loader.release()

    def __enter__(self) -> object:
        return self._loader.__enter__()

    def __exit__(self, *exception: object) -> None:
        self._loader.__exit__(*exception)

    def _attach_for_moderngl(self, program: int, shader: int) -> None:
        if not self._adopted:
            self._attach_shader(program, shader)

    def _link_for_moderngl(self, program: int) -> None:
        if not self._adopted:
            self._link_program(program)

    # ---- programs ----------------------------------------------------------------------------

    def work_ahead(self, info: Mapping[str, Any], extensions: set[str]) -> None:
        """From now on compile side by side and keep binaries, as far as the driver, as moderngl tells of it, can."""
        self._is_parallel = _PARALLEL in extensions
        if self._integer(self._get_integer, _BINARY_FORMATS):
            self._device = tuple(str(info[name]) for name in ("GL_VENDOR", "GL_RENDERER", "GL_VERSION"))

    def compiled_by(self, deadline: float) -> bool:
        """Whether using its programs waits for nothing, now or soon before `deadline` (`time.perf_counter`)."""
        while not all(map(self._is_done, self._pending)):
            if time.perf_counter() >= deadline:
                return False
            time.sleep(_LOOK_S)
        return True

    def _is_done(self, made: Pending) -> bool:
        return bool(self._integer(self._of_program, made.program, _COMPLETION_STATUS))

    def program(
        self, ctx: moderngl.Context, texts: Sequence[str], refusal: Callable[[str], Exception], at_once: bool
    ) -> moderngl.ComputeShader | moderngl.Program:
        """One of these stages (one: compute, two: vertex and fragment). Raises what `refusal` makes of the driver's
        log; at the first use where the driver compiles meanwhile, unless it shall be there `at_once`."""
        made = (PendingCompute if len(texts) == 1 else PendingProgram)(ctx, self, refusal)
        self._begin(made, texts)
        if at_once or not self._is_parallel:
            made.complete()
        else:
            self._pending.add(made)
        return made

    def _begin(self, made: Pending, texts: Sequence[str]) -> None:
        program = made.program = self._create_program()
        key = program_store.key_of(self._device, texts) if self._device else ""
        if key and (binary := program_store.load(key)) is not None:
            self._set_binary(program, binary.form, binary.code, len(binary.code))
            if self._integer(self._of_program, program, _LINK_STATUS):
                return
            self._get_error()  # another version of the driver under the same name
        for (stage, kind), text in zip(_KINDS[len(texts)].items(), texts, strict=True):
            shader = made.shaders[stage] = self._create_shader(kind)
            self._shader_source(shader, 1, (ctypes.c_char_p * 1)(text.encode()), None)
            self._compile_shader(shader)
            self._attach_shader(program, shader)
        made.key = key
        if key:
            self._set_parameter(program, _BINARY_HINT, 1)
        self._link_program(program)

    def finish(self, made: Pending) -> None:
        """Wait until it is compiled. Raises as `program` does."""
        self._pending.discard(made)
        if made.shaders and not self._integer(self._of_program, made.program, _LINK_STATUS):
            made.problem = made.refusal(self._log_of(made))
            self._delete(made)
            raise made.problem
        for shader in made.shaders.values():
            self._detach_shader(made.program, shader)
            self._delete_shader(shader)
        self._keep(made)

    def _keep(self, made: Pending) -> None:
        if made.key and (size := self._integer(self._of_program, made.program, _BINARY_LENGTH)):
            form, written, code = _UINT(), _INT(), ctypes.create_string_buffer(size)
            self._get_binary(made.program, size, written, form, code)
            if written.value > 0:
                program_store.save(made.key, Binary(form.value, code.raw[: written.value]))

    def _log_of(self, made: Pending) -> str:
        log = self._log(self._of_program, self._program_log, made.program)
        for stage, shader in made.shaders.items():
            if not self._integer(self._of_shader, shader, _COMPILE_STATUS):
                log = f"{stage} shader:\n{self._log(self._of_shader, self._shader_log, shader)}"
        return log

    def drop(self, made: Pending) -> None:
        """Free it, compiled or not."""
        self._pending.discard(made)
        if self._is_done(made):
            self._keep(made)
        self._delete(made)

    def _delete(self, made: Pending) -> None:
        for shader in made.shaders.values():
            self._delete_shader(shader)
        self._delete_program(made.program)

    def adopt(self, made: Pending) -> moderngl.ComputeShader | moderngl.Program:
        """moderngl's own object of it, once it is compiled."""
        self._adopted = made.program
        try:
            if isinstance(made, PendingCompute):
                return unlocked(made.ctx.compute_shader(_COMPUTE_STUB))
            return made.ctx.program(_STUB, _STUB)
        finally:
            self._adopted = 0

    def _integer(self, ask: Callable[..., int], *of: int) -> int:
        answer = _INT()
        ask(*of, answer)
        return answer.value

    def _log(self, ask: Callable[..., int], read: Callable[..., int], of: int) -> str:
        text = ctypes.create_string_buffer(self._integer(ask, of, _LOG_LENGTH) + 1)
        read(of, len(text), None, text)
        return text.value.decode(errors="replace")


class Pending:
    """A program that the driver may still compile. Whatever is asked of it waits for that, and makes it moderngl's."""

    def __init__(self, ctx: moderngl.Context, linker: Linker, refusal: Callable[[str], Exception]) -> None:
        self.ctx, self._linker, self.refusal = ctx, linker, refusal
        self.program, self.key = 0, ""
        """OpenGL's name of it, and where its binary is to be kept, if it is."""
        self.shaders: dict[str, int] = {}
        """By stage; none where it was made of a binary."""
        self.problem: Exception | None = None
        """Why it cannot be used."""

    def complete(self) -> None:
        """Wait for the driver. Raises as `Linker.program` does."""
        if self.problem is not None:
            raise self.problem
        self._linker.finish(self)
        made: Any = self._linker.adopt(self)
        self.__dict__, made.__dict__ = made.__dict__, {}
        self.__class__ = type(made)

    def __getattr__(self, name: str) -> Any:
        self.complete()
        return getattr(self, name)

    def release(self) -> None:
        """Free it, compiled or not."""
        if self.problem is None:
            self.problem = RuntimeError("this program was released")
            self._linker.drop(self)

    def __del__(self) -> None:
        """moderngl's would wait for the driver."""


class PendingCompute(Pending, moderngl.ComputeShader):
    """A compute program."""


class PendingProgram(Pending, moderngl.Program):
    """A program that draws."""


_linkers: weakref.WeakKeyDictionary[moderngl.Context, Linker] = weakref.WeakKeyDictionary()


def adopting_context(loader: Loader, require: int, standalone: bool = False) -> moderngl.Context:
    """moderngl's context for the current one, of at least this version of OpenGL (430: 4.3)."""
    linker: Any = Linker(loader)
    ctx = moderngl.create_context(require=require, standalone=standalone, context=linker)
    _linkers[ctx] = linker
    if DeviceTraits.of(ctx.info["GL_RENDERER"]).compiles_ahead:
        linker.work_ahead(ctx.info, ctx.extensions)
    return ctx


def linker_of(ctx: moderngl.Context) -> Linker:
    """That of a context that `adopting_context` made."""
    return _linkers[ctx]
