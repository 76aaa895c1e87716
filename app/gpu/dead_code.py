"""Leaves out of a shader's text what its program cannot run, before the driver sees it.

"What a scene does not need is absent" is only worth saying of the text that is compiled. So
conditionals are resolved here by the defines at hand, comments go, and of what is left only
the macros, constants, structs and functions stay that `main` and the interface can reach, without
the statements that constants decide (`glsl_folding`). A library may then be written without guards,
and a test can look for a symbol instead of trusting an #ifdef.
(A full preprocessor, pcpp, does the first part only, expands every macro on the way, and takes 0.1 s a
program; a dozen programs have to start within a second.)

A conditional that hangs on what only the driver knows (GL_*, __VERSION__, a name that is not
defined) is kept as it is, and so is then everything else.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .glsl_conditionals import DEFINE, Line, Unit, directive_of, macros_of, resolve_conditionals
from .glsl_folding import folded, places_of

_WORD = re.compile(r"[A-Za-z_]\w*")
_FUNCTION = re.compile(r"\s*(?:\w+\s+)*?\w+\s+(\w+)\s*\(([^)]*)\)\s*\{")
_STRUCT = re.compile(r"\s*struct\s+(\w+)")
_CONSTANT = re.compile(r"\s*const\s+\w+\s+(\w+)[^;]*;\s*$")


def stripped(lines: Sequence[Line], switches: frozenset[str] = frozenset()) -> list[Line]:
    """The lines of `lines` that can run, without comments, in their order; `switches` are 0 where nobody defines
    them."""
    kept, resolved = resolve_conditionals(list(_units(_without_comments(lines))), switches=switches)
    if resolved:
        kept = _reachable(kept, switches)
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
    text: str
    is_function: bool = False
    structs: frozenset[str] = frozenset()
    """Structs of a function's arguments: an overload for a struct that nobody uses is not called either."""


def _reachable(units: Sequence[Unit], switches: frozenset[str]) -> list[Unit]:
    """`units` without definitions that nothing uses; in functions what constants decide is left out."""
    definitions, roots = _definitions(units)
    constants = _Constants(units, switches, {d.name for d in definitions})
    kept = {index: units[index] for index in roots}
    used = {"main"}.union(*(words(line.text) for index in roots for line in units[index]))
    waiting = definitions
    while True:
        reached = [d for d in waiting if d.name in used and d.structs <= used]
        if not reached:
            break
        for definition in reached:
            text, own = definition.text, [units[index] for index in definition.units]
            if definition.is_function and (decided := constants.decide(text)) != text:
                text, own = decided, _with_text(own, decided)
            kept |= dict(zip(definition.units, own, strict=True))
            used |= words(text)
        waiting = [d for d in waiting if d not in reached]
    zeros = [(Line(f"#define {name} 0", "<features>", 1),) for name in sorted(constants.off & used)]
    ordered = [kept[index] for index in sorted(kept)]
    head = next((at for at, unit in enumerate(ordered) if directive_of(unit)[0] not in ("version", "extension")), 0)
    return ordered[:head] + zeros + ordered[head:]


class _Constants:
    """What is known of a text's switches and whole numbers."""

    def __init__(self, units: Sequence[Unit], switches: frozenset[str], declared: set[str]) -> None:
        defined = macros_of(units).values
        switches -= declared - defined.keys()
        self.off = switches - defined.keys()
        numbers = {name: int(body) for name, body in defined.items() if body and body.isdigit()}
        self._values = numbers | dict.fromkeys(self.off, 0)
        # A count that is also a switch (TINT_LEVELS) stands for its number.
        self._places = places_of(self._values, frozenset(s for s in switches if self._values.get(s) in (0, 1)))

    def decide(self, text: str) -> str:
        """A function without what they decide, in as many lines."""
        return folded(text, self._values, self._places)


def _with_text(units: list[Unit], text: str) -> list[Unit]:
    """`units` with the lines of `text`."""
    lines = iter(text.split("\n"))
    return [tuple(Line(next(lines), line.file, line.number) for line in unit) for unit in units]


def _definitions(units: Sequence[Unit]) -> tuple[list[_Definition], list[int]]:
    """Definitions, and the units that are needed in any case: the interface and directives."""
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
                macros.append(_Definition(found.group(1), (index,), rest))
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
        if found is None:
            roots += indices
            continue
        needed = words(function.group(2)) & names if function else set()
        definitions.append(_Definition(found.group(1), indices, text, function is not None, frozenset(needed)))
    return definitions, roots
