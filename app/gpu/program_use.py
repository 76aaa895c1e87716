"""What a program needs of the device: storage and uniform blocks, texture and image units, shared memory, size.

Read from the text that is compiled, so that no driver is needed. Drivers count what is declared *and*
used; so does this.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from .dead_code import words
from .glsl_conditionals import Line, macros_of, value_of
from .limits import Limits
from .shader import Built, Source

Stage = Literal["compute", "vertex", "fragment"]
_STAGES: dict[str, Stage] = {"comp": "compute", "vert": "vertex", "frag": "fragment"}
_BLOCK = re.compile(r"layout\s*\(([^)]*)\)\s*((?:\w+\s+)*?)(buffer|uniform)\s+(\w+)\s*\{([^}]*)\}\s*(\w*)\s*;")
_UNIFORM = re.compile(r"(?:layout\s*\(([^)]*)\)\s*)?\buniform\s+((?:\w+\s+)*?)(\w+)\s+(\w+)\s*(?:\[([^\]]*)\])?\s*;")
_SHARED = re.compile(r"\bshared\s+(\w+)\s+(\w+)\s*(?:\[([^\]]*)\])?\s*;")
_MEMBER = re.compile(r"(\w+)\s*(?:\[[^\]]*\])?\s*;")
_CONSTANT = re.compile(r"\bconst\s+u?int\s+(\w+)\s*=\s*(\d+)u?\s*;")
_BINDING = re.compile(r"\bbinding\s*=\s*([^,]+)")
_WORDS = {"float": 1, "uint": 1, "int": 1, "vec2": 2, "uvec2": 2, "vec3": 3, "vec4": 4, "uvec4": 4}


PROMISED_IMAGES = 8
"""Image units of a compute shader that OpenGL 4.3 promises (core specification, table 23.66); moderngl does not report
how many there are."""
PROMISED_SHARED_BYTES = 32768
"""Shared memory, likewise (table 23.65)."""


@dataclass(frozen=True)
class StageUse:
    """One shader of a program."""

    name: str
    stage: Stage
    lines: int
    bytes: int
    """Size of the text."""
    storage: tuple[str, ...]
    """Names of the storage blocks."""
    uniform: tuple[str, ...]
    """Names of the uniform blocks."""
    textures: int
    """Texture units; an array takes one for each element."""
    images: int
    """Image units, likewise."""
    shared_bytes: int
    storage_bindings: int
    """Binding points of storage blocks it needs: the highest number and one."""

    def over(self, limits: Limits) -> list[str]:
        """A sentence for each limit that it exceeds."""
        prefix = "" if self.stage == "compute" else f"{self.stage}_"
        rows = (
            ("storage blocks", len(self.storage), getattr(limits, f"{prefix}storage_blocks")),
            ("binding points of storage blocks", self.storage_bindings, limits.storage_bindings),
            ("uniform blocks", len(self.uniform), limits.uniform_blocks),
            ("texture units", self.textures, getattr(limits, f"{self.stage}_textures")),
            ("image units", self.images, PROMISED_IMAGES),
            ("bytes of shared memory", self.shared_bytes, PROMISED_SHARED_BYTES),
        )
        return [f"{self.name} needs {needed} {what} and has {had}" for what, needed, had in rows if needed > had]


def use_of(source: Source) -> StageUse:
    """What one shader needs."""
    text = source.text
    defined = [line for line in text.splitlines() if line.lstrip().startswith("#")]
    defined += [f"#define {name} {value}" for name, value in _CONSTANT.findall(text)]
    macros = macros_of([(Line(line, source.name, 0),) for line in defined])

    def count(expression: str | None) -> int:
        """Elements of an array; 1 for none."""
        return 1 if expression is None else value_of(expression, macros) or 1

    storage: list[str] = []
    uniform: list[str] = []
    bindings = 0
    for layout, kind, name in _blocks_in_use(text):
        (storage if kind == "buffer" else uniform).append(name)
        binding = _BINDING.search(layout)
        if kind == "buffer" and binding:
            bindings = max(bindings, 1 + (value_of(binding.group(1), macros) or 0))
    textures = images = 0
    for _, _, kind, name, length in _UNIFORM.findall(text):
        if _is_used(name, text):
            textures += count(length or None) if "sampler" in kind else 0
            images += count(length or None) if "image" in kind else 0
    shared = sum(4 * _WORDS[kind] * count(length or None) for kind, _, length in _SHARED.findall(text))
    stage = _STAGES[source.name.rpartition(".")[2]]
    return StageUse(
        source.name,
        stage,
        len(text.splitlines()),
        len(text.encode()),
        tuple(storage),
        tuple(uniform),
        textures,
        images,
        shared,
        bindings,
    )


def uses(built: Built) -> tuple[StageUse, ...]:
    """What a program's stages need."""
    return tuple(use_of(stage) for stage in built.stages)


def _blocks_in_use(text: str) -> Iterator[tuple[str, str, str]]:
    """(layout, "buffer" or "uniform", name) of each block of which something is used."""
    for layout, _, kind, name, members, instance in _BLOCK.findall(text):
        if any(_is_used(member, text) for member in ([instance] if instance else _MEMBER.findall(members))):
            yield layout, kind, name


def _is_used(name: str, text: str) -> bool:
    """Whether a name occurs anywhere but where it is declared."""
    return name in words(text) and len(re.findall(rf"\b{name}\b", text)) > 1
