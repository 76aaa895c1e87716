"""From a shader's file name to a compiled program, with errors that name file and line.

moderngl's own includes go one level deep and lose line numbers, so sources are flattened
here: `#include "lib/x.glsl"` (relative to the shaders folder, each file once), then
`#version`, the defines of the scene's `Features`, and the structs of `records` on top. What then cannot
run is left out (`dead_code`), so the text that is compiled holds only what the scene needs. A table
from flattened line to (file, line) turns a compiler message back into something to click on.
"""

from __future__ import annotations

import re
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from ..base import paths
from ..features.features import all_symbols
from .glsl_conditionals import Line
from .linker import linker_of
from .schema import Struct
from .stripped_store import stripped

if TYPE_CHECKING:
    import moderngl

    AnyProgram = moderngl.ComputeShader | moderngl.Program

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
_MESA_LINE = re.compile(r"\b\d+:(\d+)(?=\()")
_NVIDIA_LINE = re.compile(r"\b\d+\((\d+)\)")


class ShaderError(RuntimeError):
    """A shader that does not exist, compile or link; the message names file and line."""


class Releasable(Protocol):
    """Anything that holds device memory."""

    def release(self) -> None: ...


@dataclass(frozen=True)
class Source:
    """Flattened GLSL, as the driver gets it, and where each of its lines came from."""

    name: str
    text: str
    origin: tuple[tuple[str, int], ...]

    def explain(self, compiler_log: str) -> str:
        """The compiler's log with flattened line numbers replaced by file:line."""

        def locate(match: re.Match[str]) -> str:
            line = int(match.group(1))
            if 1 <= line <= len(self.origin):
                return "{}:{} ".format(*self.origin[line - 1])
            return match.group(0)

        return _NVIDIA_LINE.sub(locate, _MESA_LINE.sub(locate, compiler_log))


@cache
def _switches() -> frozenset[str]:
    return frozenset(all_symbols())


_files: dict[Path, tuple[tuple[int, int], list[tuple[Line, str]]]] = {}
"""By shader file: its time and size when it was read, and its lines: most programs include the same dozen."""


def _read(root: Path, file: str) -> list[tuple[Line, str]]:
    """A file's lines, each with the name of the file that it includes or "". Raises OSError."""
    path = root / file
    status = path.stat()
    stamp = status.st_mtime_ns, status.st_size
    if path not in _files or _files[path][0] != stamp:
        lines = []
        for number, text in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
            include = _INCLUDE.match(text) if "#include" in text else None
            lines.append((Line(text, file, number), include.group(1) if include else ""))
        _files[path] = stamp, lines
    return _files[path][1]


def load_source(
    name: str,
    defines: Mapping[str, int | float | str] | None = None,
    structs: Sequence[Struct] = (),
    root: Path | None = None,
    extensions: Sequence[str] = (),
) -> Source:
    """Flatten the shader `name` (path under the shaders folder) and leave out what cannot run.

    `extensions`: of GLSL that it needs; they have to come before everything else. Raises `ShaderError` naming the
    including file and line when an include is missing.
    """
    root = root or paths.shaders_dir()
    identity = (name, tuple((defines or {}).items()), tuple(structs), root, tuple(extensions))
    if _kept and (known := _sources.get(identity)) is not None:
        return known
    lines: list[Line] = []

    def emit(text: str, file: str, line: int) -> None:
        lines.append(Line(text, file, line))

    emit("#version 430 core", "<generated>", 1)
    for extension in extensions:
        emit(f"#extension {extension} : require", "<generated>", 1)
    for key, value in (defines or {}).items():
        emit(f"#define {key} {value}", "<features>", 1)
    for struct in structs:
        for text in struct.glsl().splitlines():
            emit(text, f"<struct {struct.name}>", 1)

    seen: set[str] = set()

    def flatten(file: str, includer: str) -> None:
        if file in seen:
            return
        seen.add(file)
        try:
            read = _read(root, file)
        except OSError as error:
            raise ShaderError(f"shader {file} included by {includer} cannot be read: {error.strerror}") from error
        for line, included in read:
            if included:
                flatten(included, f"{file}:{line.number}")
            else:
                lines.append(line)

    flatten(name, "the program")
    kept = stripped(lines, _switches())
    text = "\n".join(line.text.lstrip() for line in kept) + "\n"
    source = Source(name, text, tuple((line.file, line.number) for line in kept))
    if _kept:
        _sources[identity] = source
        for old in list(_sources)[: -2 * KEPT_PROGRAMS]:
            _sources.pop(old, None)  # other threads' engines use them too
    return source


_kept: dict[int, OrderedDict[tuple[str, ...], AnyProgram]] = {}
_keepers: Counter[int] = Counter()
"""`keep_programs` not yet undone, by context."""
_owners: Counter[int] = Counter()
"""How many hold a program that was lent while programs were kept, by its id."""
_sources: dict[Hashable, Source] = {}
"""Flattened sources, where programs are kept."""
KEPT_PROGRAMS = 96
"""Programs that a context with `keep_programs` holds for the next user of the same text."""


def keep_programs(ctx: moderngl.Context) -> None:
    """From now on a program whose text was compiled before in `ctx` is not compiled again.

    For a viewer, where an edit makes all passes anew: compiling takes a software renderer longer than tracing. Programs
    then have several owners, who set every uniform before each use and give them back with `release`. Every call wants
    one of
    `forget_programs`.
    """
    _kept.setdefault(id(ctx), OrderedDict())
    _keepers[id(ctx)] += 1


def forget_programs(ctx: moderngl.Context) -> None:
    """Undo one `keep_programs`; after the last one programs stay only as long as they have owners."""
    if id(ctx) not in _kept:
        return
    _keepers[id(ctx)] -= 1
    if _keepers[id(ctx)] <= 0:
        drop_programs(ctx)
        del _kept[id(ctx)], _keepers[id(ctx)]


def drop_programs(ctx: moderngl.Context) -> None:
    """Compile every program again from now on, from the text that is on the disk then."""
    _sources.clear()
    programs = _kept.get(id(ctx), OrderedDict())
    while programs:
        _drop(programs.popitem(last=False)[1])


def release(*resources: Releasable | None) -> None:
    """Give programs (or any other resources) back, but for None; a program is freed when its last owner does so and its
    context keeps it no longer."""
    for owned in resources:
        if owned is None:
            continue
        owners = _owners.get(id(owned))
        if owners is None:
            if (frame := getattr(owned, "extra", None)) is not None:  # `framebuffers.frame_of`
                frame.release()
            owned.release()
            continue
        if owners <= 0:  # given back already
            continue
        _owners[id(owned)] = owners - 1
        if owners <= 1 and not any(
            owned is held for programs in list(_kept.values()) for held in list(programs.values())
        ):
            _drop(owned)


def _drop(program: Releasable) -> None:
    """Free a program that is kept no longer, unless it has owners."""
    if _owners.get(id(program), 0) <= 0:
        _owners.pop(id(program), None)
        program.release()


def _kept_or(ctx: moderngl.Context, texts: tuple[str, ...], compiled: Callable[[], AnyProgram]) -> AnyProgram:
    programs = _kept.get(id(ctx))
    if programs is None:
        return compiled()
    if texts not in programs:
        programs[texts] = compiled()
        if len(programs) > KEPT_PROGRAMS:
            _drop(programs.popitem(last=False)[1])
    programs.move_to_end(texts)
    _owners[id(programs[texts])] += 1
    return programs[texts]


@dataclass(frozen=True)
class Built:
    """A program as the driver got it."""

    stages: tuple[Source, ...]
    """The vertex shader of a drawing program comes first."""
    seconds: float
    """Until the driver had compiled and linked it (some do the rest at the first use); 0 where it was kept."""

    @property
    def name(self) -> str:
        """Its shaders' names."""
        return " + ".join(stage.name for stage in self.stages)

    @property
    def texts(self) -> tuple[str, ...]:
        """What distinguishes it from others."""
        return tuple(stage.text for stage in self.stages)


_recordings: list[list[Built]] = []


@contextmanager
def recorded() -> Iterator[list[Built]]:
    """Collects every program that is built meanwhile, also those that were kept."""
    programs: list[Built] = []
    _recordings.append(programs)
    try:
        yield programs
    finally:
        _recordings.pop()


def _built(ctx: moderngl.Context, stages: tuple[Source, ...]) -> AnyProgram:
    """The program of these stages, kept or new. It is recorded before it is compiled, in case that ends everything."""
    texts = tuple(stage.text for stage in stages)
    started = time.perf_counter()
    is_new = texts not in _kept.get(id(ctx), ())
    for programs in _recordings:
        programs.append(Built(stages, 0.0))

    def refusal(log: str) -> ShaderError:
        source = stages[-1] if "fragment" in log.lower() else stages[0]
        names = " with ".join(stage.name for stage in stages)
        return ShaderError(f"{names} does not compile:\n{source.explain(log)}")

    at_once = bool(_recordings)  # seconds are asked for
    program = _kept_or(ctx, texts, lambda: linker_of(ctx).program(ctx, texts, refusal, at_once))
    for programs in _recordings:
        programs[-1] = Built(stages, time.perf_counter() - started if is_new else 0.0)
    return program


def compiled_by(ctx: moderngl.Context, deadline: float) -> bool:
    """Whether all programs of `ctx` can be used without waiting for the driver, now or soon before `deadline`
    (`time.perf_counter`)."""
    return linker_of(ctx).compiled_by(deadline)


def compute(
    ctx: moderngl.Context,
    name: str,
    defines: Mapping[str, int | float | str] | None = None,
    structs: Sequence[Struct] = (),
    extensions: Sequence[str] = (),
) -> moderngl.ComputeShader:
    """The compute shader `name`; raises `ShaderError` with file and line, at its first use where the driver compiles
    it meanwhile."""
    source = load_source(name, defines, structs, extensions=extensions)
    return cast("moderngl.ComputeShader", _built(ctx, (source,)))


def program(
    ctx: moderngl.Context,
    vertex: str,
    fragment: str,
    defines: Mapping[str, int | float | str] | None = None,
    structs: Sequence[Struct] = (),
) -> moderngl.Program:
    """A vertex and a fragment shader linked; raises as `compute` does."""
    stages = load_source(vertex, defines, structs), load_source(fragment, defines, structs)
    return cast("moderngl.Program", _built(ctx, stages))
