"""Leaves out of a shader's text what its program cannot run, before the driver sees it.

"What a scene does not need is absent" is only worth saying of the text that is compiled. So
conditionals are resolved here by the defines at hand, comments go, and of what is left only
the macros, constants, structs and functions stay that `main` and the interface can reach. A library may
then be written without guards, and a test can look for a symbol instead of trusting an #ifdef.
(A full preprocessor, pcpp, does the first part only, expands every macro on the way, and takes 0.1 s a
program; a dozen programs have to start within a second.)

A conditional that hangs on what only the driver knows (GL_*, __VERSION__, a name that is not
defined) is kept as it is, and so is then everything else.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .glsl_conditionals import DEFINE, Line, Unit, directive_of, resolve_conditionals

_WORD = re.compile(r"[A-Za-z_]\w*")
_FUNCTION = re.compile(r"\s*(?:\w+\s+)*?\w+\s+(\w+)\s*\(([^)]*)\)\s*\{")
_STRUCT = re.compile(r"\s*struct\s+(\w+)")
_CONSTANT = re.compile(r"\s*const\s+\w+\s+(\w+)[^;]*;\s*$")


def stripped(lines: Sequence[Line]) -> list[Line]:
    """The lines of `lines` that can run, without comments, in their order."""
    kept, resolved = resolve_conditionals(list(_units(_without_comments(lines))))
    if resolved:
        kept = _reachable(kept)
    return [line for unit in kept for line in unit if line.text.strip()]


def words(text: str) -> set[str]:
    """Identifiers in GLSL text."""
    return set(_WORD.findall(text))


# -- lines --------------------------------------------------------------------------------


def _without_comments(lines: Sequence[Line]) -> Iterator[Line]:
    inside = False
    for line in lines:
        text, kept = line.text, ""
        while text:
            if inside:
                _, closed, text = text.partition("*/")
                inside = not closed
                continue
            opening = min((at for at in (text.find("//"), text.find("/*")) if at >= 0), default=len(text))
            kept += text[:opening]
            inside = text[opening : opening + 2] == "/*"
            kept += " " if inside else ""
            text = text[opening + 2 :] if inside else ""
        yield Line(kept.rstrip(), line.file, line.number)


def _units(lines: Iterator[Line]) -> Iterator[Unit]:
    held: list[Line] = []
    for line in lines:
        held.append(line)
        if not line.text.endswith("\\"):
            yield tuple(held)
            held = []
    if held:
        yield tuple(held)


# -- reachability -------------------------------------------------------------------------


@dataclass(frozen=True)
class _Definition:
    """Something that is only needed where its name is used."""

    name: str
    units: tuple[int, ...]
    words: frozenset[str]
    structs: frozenset[str]
    """Structs of a function's arguments: an overload for a struct that nobody uses is not called either."""


def _reachable(units: Sequence[Unit]) -> list[Unit]:
    """`units` without definitions that nothing uses."""
    definitions, roots = _definitions(units)
    used = {word for index in roots for line in units[index] for word in words(line.text)}
    alive = set(roots)
    waiting = definitions
    while True:
        reached = [d for d in waiting if d.name in used and d.structs <= used]
        if not reached:
            return [unit for index, unit in enumerate(units) if index in alive]
        for definition in reached:
            alive.update(definition.units)
            used |= definition.words
        waiting = [d for d in waiting if d not in reached]


def _definitions(units: Sequence[Unit]) -> tuple[list[_Definition], list[int]]:
    """Definitions, and the units that are needed in any case: the interface, directives, `main`."""
    macros: list[_Definition] = []
    roots: list[int] = []
    statements: list[tuple[tuple[int, ...], str]] = []
    held: list[int] = []
    text, depth = "", 0
    for index, unit in enumerate(units):
        name, rest = directive_of(unit)
        if name:
            found = DEFINE.match(rest) if name == "define" else None
            if found:
                macros.append(_Definition(found.group(1), (index,), frozenset(words(rest)), frozenset()))
            else:
                roots.append(index)
            continue
        line = "\n".join(part.text for part in unit)
        held.append(index)
        text += line + "\n"
        depth += sum(line.count(c) for c in "{([") - sum(line.count(c) for c in "})]")
        ending = line.rstrip()[-1:]
        if depth == 0 and (ending == ";" or (ending == "}" and _FUNCTION.match(text))):
            statements.append((tuple(held), text))
            held, text = [], ""
    roots += held
    names = {found.group(1) for _, text in statements if (found := _STRUCT.match(text))}
    definitions = macros
    for indices, text in statements:
        function = _FUNCTION.match(text)
        found = _STRUCT.match(text) or function or _CONSTANT.match(text)
        if found and found.group(1) != "main":
            needed = words(function.group(2)) & names if function else set()
            definitions.append(_Definition(found.group(1), indices, frozenset(words(text)), frozenset(needed)))
        else:
            roots += indices
    return definitions, roots
