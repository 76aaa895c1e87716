"""Programs before compilers that forgive nothing: Khronos' reference front end and the validator of its SPIR-V.

Drivers are lenient in different places; what both of these accept is GLSL by the book. They are programs of their own
(Debian: glslang-tools, spirv-tools), so a machine may lack them. What NVIDIA's compiler was seen to refuse although it
is by the book is looked for in the front end's syntax tree.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from ..base.errors import UserError
from .glsl_conditionals import Line, macros_of, value_of
from .live_state import LiveState, live_state
from .shader import Built

FRONT_END, VALIDATOR, OPTIMISER, DISASSEMBLER = "glslangValidator", "spirv-val", "spirv-opt", "spirv-dis"
_ENVIRONMENT = "opengl4.5"
APT_LINE = "apt-get install glslang-tools spirv-tools"
PATIENCE_S = 60.0
_MOST_UNROLLED = 32
"""Rounds."""
_LOOP = re.compile(r"\bfor \(u?int (\w+) = 0u?; \1 < (?:uint\()?(\w+?)u?\)?; \+\+\1\)")
_BODY = re.compile(r"\s*(?:[^{;]*;|\{(?:[^{}]|\{[^{}]*\})*\})")
"""A statement, or a block with none but flat ones in it."""
_LINKED, _REFLECTION = "\nLinked ", "Uniform block reflection:"
_STAGES = ".comp", ".vert", ".geom", ".frag"
_NODE = re.compile(r"\d+:(\d+)( +)(.*)")
"""A node of a syntax tree: line, depth, what it is."""
_QUALIFIED_RECORD = re.compile(r"[^{]*\b(?:restrict|readonly|writeonly|coherent)\b[^{]*\bstructure\{")
_REFUSED = {
    "Function Call: ": (_QUALIFIED_RECORD, "a record of a qualified block is handed to a function: copy it first"),
    "direct index (": (
        re.compile(r"[^{]*\bbuffer runtime-sized array\b"),
        "an array without a size has a constant index, and is taken for as long as the largest: give it a size",
    ),
}
"""By what a node begins with: what may not stand directly below it, and why."""


def missing() -> str:
    """A sentence that names what is not installed and how to get it; "" where all is there."""
    absent = [tool for tool in (FRONT_END, VALIDATOR, OPTIMISER, DISASSEMBLER) if shutil.which(tool) is None]
    return f"{', '.join(absent)} not installed: run '{APT_LINE}' as root" if absent else ""


def complaints(built: Built) -> list[str]:
    """What front end and validator say against a program, with files and lines; empty where they accept it.

    Raises `UserError` where they are not installed or hang."""
    code, output = _read(built)
    said = [line for line in output.splitlines() if line.startswith(("ERROR:", "WARNING:"))]
    if said or code:  # what does not compile need not be translated
        return [_located(built, line) for line in said or [_ended(FRONT_END, code, output)]]
    with tempfile.TemporaryDirectory() as folder:
        said = _refused_by_nvidia(output.partition(_LINKED)[0])
        for file in _written(built, Path(folder)):
            said += _run(*_translation(file))
            said += _run(VALIDATOR, "--target-env", _ENVIRONMENT, f"{file}.spv")
    return [_located(built, line) for line in said]


def _refused_by_nvidia(trees: str) -> list[str]:
    """By the syntax trees of all stages, each after its file's name."""
    said, above, file = [], [(-1, "")], ""
    for line in trees.splitlines():
        node = _NODE.match(line)
        if node is None:
            file = line if line.endswith(_STAGES) else file
            continue
        number, indent, words = node.groups()
        while above[-1][0] >= len(indent):
            above.pop()
        for begin, (refused, why) in _REFUSED.items():
            if above[-1][1].startswith(begin) and refused.match(words):
                said.append(f"ERROR: {file}:{number}: {why}")
        above.append((len(indent), words))
    return said


def blocks(built: Built) -> set[str]:
    """Names of the uniform and storage blocks that the front end finds in use, all stages together."""
    _, _, after = _read(built)[1].partition(_REFLECTION)
    return {line.partition(":")[0] for line in after.strip().split("\n\n")[0].splitlines() if ": offset" in line}


@lru_cache(maxsize=1)
def _read(built: Built) -> tuple[int, str]:
    """The front end's exit code, and complaints, syntax trees and blocks in use."""
    with tempfile.TemporaryDirectory() as folder:
        return _output(FRONT_END, "-l", "-i", "-q", *_written(built, Path(folder)))


def live_states(built: Built) -> tuple[LiveState, ...]:
    """What each stage of a program holds at once, after an optimiser that inlines everything.

    Raises `UserError` where the tools are not installed, hang or refuse the program."""
    stages = tuple(replace(stage, text=_unrolled(stage.text)) for stage in built.stages)
    with tempfile.TemporaryDirectory() as folder:
        return tuple(_live_state(file) for file in _written(replace(built, stages=stages), Path(folder)))


def _unrolled(text: str) -> str:
    """Loops marked that drivers unroll: over elements of arrays, here or in a function that is called, of known length
    and few, which become values so. Where the driver is told not to, there are none."""
    if "unroll none" in text:
        return text
    macros = macros_of([(Line(line, "", 0),) for line in text.splitlines() if line.startswith("#define")])

    def marked(found: re.Match[str]) -> str:
        body = _BODY.match(text, found.end())
        rounds = value_of(found[2], macros)
        indexes = body is not None and re.search(rf"\[[^\]]*\b{found[1]}\b|, {found[1]}\)", body[0])
        return f"[[unroll]] {found[0]}" if indexes and rounds and rounds <= _MOST_UNROLLED else found[0]

    version, _, rest = _LOOP.sub(marked, text).partition("\n")
    return f"{version}\n#extension GL_EXT_control_flow_attributes : require\n{rest}"


def _live_state(file: str) -> LiveState:
    optimise = (OPTIMISER, f"--target-env={_ENVIRONMENT}", "-O", f"{file}.spv", "-o", f"{file}.opt")
    for command in (_translation(file), optimise):
        if said := _run(*command):
            raise UserError(f"{Path(file).name} is refused by {command[0]}: {said[0]}")
    return live_state(_output(DISASSEMBLER, "--raw-id", "--no-header", f"{file}.opt")[1])


def _translation(file: str) -> tuple[str, ...]:
    return FRONT_END, "-G", "--auto-map-locations", "-o", f"{file}.spv", file


def _written(built: Built, folder: Path) -> list[str]:
    files = []
    for stage in built.stages:
        file = folder / stage.name.replace("/", "_")
        file.write_text(stage.text, encoding="utf-8")
        files.append(str(file))
    return files


def _run(*command: str) -> list[str]:
    """The lines of a tool's complaint; none where it has none."""
    code, output = _output(*command)
    lines = [line for line in output.splitlines() if re.search(r"\b(?:error|warning)\b", line, re.IGNORECASE)]
    return lines or ([_ended(command[0], code, output)] if code else [])


def _ended(tool: str, code: int, output: str) -> str:
    return f"{tool} ended with {code}: {output.strip()[-300:]}"


def _output(*command: str) -> tuple[int, str]:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, check=False, stdin=subprocess.DEVNULL
        )
    except OSError as error:
        raise UserError(f"{command[0]} cannot be run ({error.strerror or error}): run '{APT_LINE}' as root") from error
    except subprocess.TimeoutExpired as error:
        raise UserError(f"{command[0]} did not answer within {PATIENCE_S:.0f} s") from error
    return done.returncode, done.stdout + done.stderr


def _located(built: Built, line: str) -> str:
    """A complaint with the file and line that people wrote, where it names a line."""
    found = re.match(r"(ERROR|WARNING): (?:(\S+):)?(\d+):(.*)", line)
    if found is None:
        return f"{built.name}: {line.strip()}"
    kind, file, number, words = found.groups()
    # Of several stages the message says which by its file's name; linking names none.
    stage = next((s for s in built.stages if file and file.endswith(s.name.replace("/", "_"))), built.stages[0])
    at = int(number)
    place = "{}:{}".format(*stage.origin[at - 1]) if 1 <= at <= len(stage.origin) else stage.name
    return f"{place}: {kind.lower()}: {words.strip()}"
