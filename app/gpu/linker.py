"""Programs made by calls of our own, which moderngl then adopts.

moderngl waits for every program, holds Python's lock meanwhile, and knows no binaries. Here the driver compiles without
the lock, and programs side by side where it has threads for them (GL_KHR_parallel_shader_compile): nothing waits for a
program before its first use. Binaries are kept on the disk (`BINARIES`), so that a later process compiles nothing.
"""

from __future__ import annotations

import ctypes
import hashlib
import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import moderngl

from ..base.kept_files import KeptFiles
from .device_traits import DeviceTraits

_COMPUTE_SHADER, _VERTEX_SHADER, _FRAGMENT_SHADER = 0x91B9, 0x8B31, 0x8B30
_COMPILE_STATUS, _LINK_STATUS, _COMPLETION_STATUS, _LOG_LENGTH = 0x8B81, 0x8B82, 0x91B1, 0x8B84
_BINARY_HINT, _BINARY_LENGTH, _BINARY_FORMATS = 0x8257, 0x8741, 0x87FE
_PARALLEL = "GL_KHR_parallel_shader_compile"
_KINDS = {1: {"compute": _COMPUTE_SHADER}, 2: {"vertex": _VERTEX_SHADER, "fragment": _FRAGMENT_SHADER}}
"""By the number of stages."""
_STUB = "#version 430 core\nvoid main() {}\n"
_COMPUTE_STUB = f"{_STUB}layout(local_size_x = 1) in;\n"
"""What moderngl compiles in place of a program that it adopts."""
BINARIES = KeptFiles("programs", 64 << 20, most_bytes=256 << 20)
"""Form (4 bytes) and code of each, as glGetProgramBinary gives them for one device and driver."""
_LOOK_S = 0.002
_UINT, _INT, _POINTER, _TEXT = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_char_p
_INTEGER = ctypes.POINTER(_INT)
_FUNCTYPE = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)
_SIGNATURES: dict[str, tuple[Any, ...]] = {
    "CreateProgram GetError": (_UINT,),
    "CreateShader": (_UINT, _UINT),
    "ShaderSource": (None, _UINT, _INT, ctypes.POINTER(_TEXT), _POINTER),
    "CompileShader LinkProgram DeleteShader DeleteProgram": (None, _UINT),
    "AttachShader DetachShader": (None, _UINT, _UINT),
    "GetShaderiv GetProgramiv": (None, _UINT, _UINT, _INTEGER),
    "GetShaderInfoLog GetProgramInfoLog": (None, _UINT, _INT, _INTEGER, _TEXT),
    "ProgramParameteri": (None, _UINT, _UINT, _INT),
    "GetProgramBinary": (None, _UINT, _INT, _INTEGER, ctypes.POINTER(_UINT), _TEXT),
    "ProgramBinary": (None, _UINT, _UINT, _TEXT, _INT),
    "GetIntegerv": (None, _UINT, _INTEGER),
    "MaxShaderCompilerThreadsKHR": (None, _UINT),
    "GenQueries": (None, _INT, ctypes.POINTER(_UINT)),
    "BeginQuery": (None, _UINT, _UINT),
    "EndQuery": (None, _UINT),
    "GetQueryObjectuiv": (None, _UINT, _UINT, ctypes.POINTER(_UINT)),
    "GetQueryObjectui64v": (None, _UINT, _UINT, ctypes.POINTER(ctypes.c_uint64)),
}
"""Result and arguments of OpenGL's functions."""
_SIZE = ctypes.c_ssize_t
_LONG: dict[str, tuple[Any, ...]] = {
    "Finish": (None,),
    "MapBufferRange": (_POINTER, _UINT, _SIZE, _SIZE, _UINT),
    "GetTexImage": (None, _UINT, _INT, _UINT, _UINT, _POINTER),
    "ReadPixels": (None, _INT, _INT, _INT, _INT, _UINT, _UINT, _POINTER),
    "DispatchCompute": (None, _UINT, _UINT, _UINT),
    "DispatchComputeIndirect": (None, _SIZE),
    "DrawArraysInstanced": (None, _UINT, _INT, _INT, _INT),
}
"""Those that wait for the device; and some drivers compile as late as the first dispatch or drawing, for seconds."""


class Linker:
    """Makes the programs of a context; for moderngl the loader of its functions."""

    def __init__(self, loader: Any, unlocked: bool = False) -> None:
        """`loader`: of the current context, in the form that `moderngl.create_context(context=…)` takes; `unlocked`:
        whatever may take long lets other threads go on."""
        self._loader = loader
        self.gl = SimpleNamespace(
            **{
                name: _FUNCTYPE(*signature)(loader.load(f"gl{name}"))
                for names, signature in _SIGNATURES.items()
                for name in names.split()
            }
        )
        self._adopted = 0
        """What moderngl gets for the program that it makes now; 0: a new one."""
        self._callbacks = {
            "glCreateProgram": _FUNCTYPE(_UINT)(lambda: self._adopted or self.gl.CreateProgram()),
            "glAttachShader": _FUNCTYPE(None, _UINT, _UINT)(lambda *of: self._adopted or self.gl.AttachShader(*of)),
            "glLinkProgram": _FUNCTYPE(None, _UINT)(lambda *of: self._adopted or self.gl.LinkProgram(*of)),
        }
        for name, signature in _LONG.items() if unlocked else ():
            kind = _FUNCTYPE(*signature)
            self._callbacks[f"gl{name}"] = kind(kind(loader.load(f"gl{name}")))
        self._device: tuple[str, ...] = ()
        """Names of driver and device; none where no binaries are kept."""
        self._is_parallel = False
        self._pending: weakref.WeakSet[Pending] = weakref.WeakSet()

    # ---- for moderngl ------------------------------------------------------------------------

    def load(self, name: str) -> int:
        """Address of the OpenGL function `name`, 0 when unknown."""
        ours = self._callbacks.get(name)
        return self._loader.load(name) if ours is None else ctypes.cast(ours, _POINTER).value or 0

    load_opengl_function = load  # moderngl takes the one or the other

    def __getattr__(self, name: str) -> Any:
        """The rest is its loader's."""
        return getattr(self._loader, name)

    # ---- programs ----------------------------------------------------------------------------

    def work_ahead(self, info: Mapping[str, Any], extensions: set[str]) -> None:
        """From now on compile side by side and keep binaries, as far as the driver, as moderngl tells of it, can."""
        self._is_parallel = _PARALLEL in extensions
        if self._is_parallel:
            self.gl.MaxShaderCompilerThreadsKHR(0xFFFFFFFF)  # as many as it likes
        if self._integer(self.gl.GetIntegerv, _BINARY_FORMATS):
            self._device = tuple(str(info[name]) for name in ("GL_VENDOR", "GL_RENDERER", "GL_VERSION"))

    def compiled_by(self, deadline: float) -> bool:
        """Whether using its programs waits for nothing, now or soon before `deadline` (`time.perf_counter`)."""
        while not all(map(self._is_done, self._pending)):
            if time.perf_counter() >= deadline:
                return False
            time.sleep(_LOOK_S)
        return True

    def _is_done(self, made: Pending) -> bool:
        return bool(self._integer(self.gl.GetProgramiv, made.program, _COMPLETION_STATUS))

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
        program = made.program = self.gl.CreateProgram()
        key = hashlib.sha256("\0".join((*self._device, *texts)).encode()).hexdigest() if self._device else ""
        if key and (kept := BINARIES.load(key)) is not None:
            form, code = int.from_bytes(kept[:4], "little"), kept[4:]
            self.gl.ProgramBinary(program, form, code, len(code))
            if self._integer(self.gl.GetProgramiv, program, _LINK_STATUS):
                return
            self.gl.GetError()  # another version of the driver under the same name
        for (stage, kind), text in zip(_KINDS[len(texts)].items(), texts, strict=True):
            shader = made.shaders[stage] = self.gl.CreateShader(kind)
            self.gl.ShaderSource(shader, 1, (ctypes.c_char_p * 1)(text.encode()), None)
            self.gl.CompileShader(shader)
            self.gl.AttachShader(program, shader)
        made.key = key
        if key:
            self.gl.ProgramParameteri(program, _BINARY_HINT, 1)
        self.gl.LinkProgram(program)

    def _keep(self, made: Pending) -> None:
        if made.key and (size := self._integer(self.gl.GetProgramiv, made.program, _BINARY_LENGTH)):
            form, written, code = _UINT(), _INT(), ctypes.create_string_buffer(size)
            self.gl.GetProgramBinary(made.program, size, written, form, code)
            if written.value > 0:
                BINARIES.save(made.key, form.value.to_bytes(4, "little") + code.raw[: written.value])

    def _log_of(self, made: Pending) -> str:
        log = self._log(self.gl.GetProgramiv, self.gl.GetProgramInfoLog, made.program)
        for stage, shader in made.shaders.items():
            if not self._integer(self.gl.GetShaderiv, shader, _COMPILE_STATUS):
                log = f"{stage} shader:\n{self._log(self.gl.GetShaderiv, self.gl.GetShaderInfoLog, shader)}"
        return log

    def drop(self, made: Pending) -> None:
        """Free it, compiled or not."""
        if made in self._pending:
            self._pending.discard(made)
            if self._is_done(made):
                self._keep(made)
        for shader in made.shaders.values():
            self.gl.DeleteShader(shader)
        self.gl.DeleteProgram(made.program)

    def adopted(self, made: Pending) -> moderngl.ComputeShader | moderngl.Program:
        """moderngl's own object of it; waits until it is compiled. Raises as `program` does."""
        self._pending.discard(made)
        if made.shaders and not self._integer(self.gl.GetProgramiv, made.program, _LINK_STATUS):
            made.problem = made.refusal(self._log_of(made))
            self.drop(made)
            raise made.problem
        for shader in made.shaders.values():
            self.gl.DetachShader(made.program, shader)
            self.gl.DeleteShader(shader)
        self._keep(made)
        self._adopted = made.program
        try:
            if isinstance(made, PendingCompute):
                return made.ctx.compute_shader(_COMPUTE_STUB)
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
        made: Any = self._linker.adopted(self)
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


def adopting_context(loader: Any, require: int, standalone: bool = False, unlocked: bool = False) -> moderngl.Context:
    """moderngl's context for the current one, of at least this version of OpenGL (430: 4.3); the rest as `Linker`
    takes it."""
    linker: Any = Linker(loader, unlocked)
    ctx = moderngl.create_context(require=require, standalone=standalone, context=linker)
    _linkers[ctx] = linker
    if DeviceTraits.of(ctx.info["GL_RENDERER"]).compiles_ahead:
        linker.work_ahead(ctx.info, ctx.extensions)
    return ctx


def linker_of(ctx: moderngl.Context) -> Linker:
    """That of a context that `adopting_context` made."""
    return _linkers[ctx]
