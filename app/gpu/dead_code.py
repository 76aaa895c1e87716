"""Leaves out of a shader's text what its program cannot run, before the driver sees it.

"What a scene does not need is absent" is only worth saying of the text that is compiled. So
conditionals are resolved here by the defines at hand, comments go, and of what is left only
the macros, constants, structs, functions, global variables, bindings and blocks stay that `main` can reach, without
the statements that constants decide (`glsl_folding`), and of a struct its first member and those that are mentioned. A
library may then be written without guards, and a test can search for a symbol instead of trusting an #ifdef.
(A full preprocessor, pcpp, does the first part only, expands every macro on the way, and takes 0.1 s a
program; a dozen programs have to start within a second.)

A conditional that hangs on what only the driver knows (GL_*, __VERSION__, a name that is not
defined) is kept as it is, and so is then everything else.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from .glsl_conditionals import DEFINE, Line, Unit, directive_of, macros_of, resolve_conditionals, value_of
from .glsl_folding import end_of_statement, folded, places_of

_UNROLLS_NOTHING = "optionNV(unroll none)"
_WORD = re.compile(r"[A-Za-z_]\w*")
_USE = re.compile(r"(?<![.\w])[A-Za-z_]\w*|\.[A-Za-z_]\w*")
_FUNCTION = re.compile(r"\s*(?:\w+\s+)*?\w+\s+(\w+)\s*\(([^)]*)\)\s*\{")
_STRUCT = re.compile(r"\s*struct\s+(\w+)")
_LAYOUT = re.compile(r"layout\s*\([^)]*\)")
_BLOCK = re.compile(r"(?:\w+\s+)*(?:buffer|uniform)\s+\w+\s*\{(.*)\}\s*(\w*)[^}]*;$", re.DOTALL)
_MEMBER = re.compile(r"\b(\w+)\s*(?:\[[^\]]*\])*\s*[;,]")
_MEMBER_NAME = re.compile(r"\b\w+(?=\s*(?:\[[^\]]*\])*\s*[;,])")
_BRACKETED = re.compile(r"\([^()]*\)|\{[^{}]*\}|\[[^\[\]]*\]")
_MADE = re.compile(r"\b([A-Z]\w*)\s*(?:\[\w*\])?\(")
MOST_ROUNDS = 6
"""Loops of more rounds stay loops."""
_LOOP = re.compile(r"\bfor \(int (\w+) = 0; \1 < (\w+); \+\+\1\)\s*")


def stripped(lines: Sequence[Line], switches: frozenset[str] = frozenset()) -> list[Line]:
    """The lines of `lines` that can run, without comments, in their order; `switches` are 0 where they are not
    defined."""
    kept, resolved = resolve_conditionals(list(_units(_without_comments(lines))), switches=switches)
    if resolved:
        kept = _reachable(kept, switches)
    return [line for unit in kept for line in unit if line.text.strip()]


def words(text: str) -> set[str]:
    """Identifiers in GLSL text."""
    return set(_WORD.findall(text))


def _uses(text: str) -> set[str]:
    """Identifiers, and `.name` for what is read or written of structs."""
    return set(_USE.findall(text))


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
    """Something that is only needed where one of its names is used."""

    names: frozenset[str]
    units: tuple[int, ...]
    text: str
    is_folded: bool = False
    structs: frozenset[str] = frozenset()
    """Structs of a function's arguments: an overload for a struct that is not used is not called either."""


def _reachable(units: Sequence[Unit], switches: frozenset[str]) -> list[Unit]:
    """`units` without definitions that nothing uses; what constants decide is left out."""
    definitions, roots = _definitions(units)
    constants = _Constants(units, switches, {name for d in definitions for name in d.names})
    kept = {index: units[index] for index in roots}
    used = {"main"}.union(*(_uses(line.text) for index in roots for line in units[index]))
    waiting = definitions
    while True:
        reached = [d for d in waiting if not d.names.isdisjoint(used) and d.structs <= used]
        if not reached:
            break
        for definition in reached:
            text, own = definition.text, [units[index] for index in definition.units]
            if definition.is_folded and (decided := constants.decide(text)) != text:
                text, own = decided, _with_text(own, decided)
            kept |= dict(zip(definition.units, own, strict=True))
            used |= _uses(text)
        waiting = [d for d in waiting if d not in reached]
    zeros = [(Line(f"#define {name} 0", "<features>", 1),) for name in sorted(constants.off & used)]
    ordered = [kept[index] for index in sorted(kept)]
    head = next((at for at, unit in enumerate(ordered) if directive_of(unit)[0] not in ("version", "extension")), 0)
    return ordered[:head] + zeros + ordered[head:]


class _Constants:
    """What is known of a text's switches and whole numbers."""

    def __init__(self, units: Sequence[Unit], switches: frozenset[str], declared: set[str]) -> None:
        macros = macros_of(units)
        macros.switches = switches - (declared - macros.values.keys())
        self.off = macros.switches - macros.values.keys()
        values = dict.fromkeys(self.off, 0)
        ours = set(macros.switches)
        for name, body in macros.values.items():
            if body and body.isdigit():
                values[name] = int(body)
            elif body and words(body) and words(body) <= macros.switches:  # made of switches, and so one itself
                value = value_of(body, macros)
                values |= {} if value is None else {name: value}
                ours.add(name)
        self._values = values
        self._macros = macros
        self._unrolls = any(_UNROLLS_NOTHING in unit[0].text for unit in units)
        # A count that is also a switch (TINT_LEVELS) denotes its number.
        self._places = places_of(values, frozenset(name for name in ours if values.get(name) in (0, 1)))

    def decide(self, text: str) -> str:
        """A function without what they decide, and without the short loops that no driver is to unroll, in as many
        lines."""
        text = folded(text, self._values, self._places)
        return unrolled(text, lambda name: value_of(name, self._macros)) if self._unrolls else text


def _with_text(units: list[Unit], text: str) -> list[Unit]:
    """`units` with the lines of `text`."""
    lines = iter(text.split("\n"))
    return [tuple(Line(next(lines), line.file, line.number) for line in unit) for unit in units]


def _definitions(units: Sequence[Unit]) -> tuple[list[_Definition], list[int]]:
    """Definitions, and the units that are needed in any case: directives, and what names nothing."""
    definitions: list[_Definition] = []
    roots: list[int] = []
    statements: list[tuple[tuple[int, ...], str]] = []
    held: list[int] = []
    text, depth = "", 0
    for index, unit in enumerate(units):
        name, rest = directive_of(unit)
        if name:
            found = DEFINE.match(rest) if name == "define" else None
            if found:
                # (A macro that is a statement is not folded: none of it may end in the macro.)
                is_one_line = len(unit) == 1 and "if" not in words(rest)
                names = frozenset({found.group(1), f".{found.group(1)}"})
                text_of_it = unit[0].text if is_one_line else rest
                definitions.append(_Definition(names, (index,), text_of_it, is_one_line))
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
    structs = {found.group(1) for _, text in statements if (found := _STRUCT.match(text))}
    whole = _whole_structs(structs, units, [text for _, text in statements])
    for indices, text in statements:
        if found := _STRUCT.match(text):
            definitions += _struct_parts(found.group(1), indices, units, is_whole=found.group(1) in whole)
        elif found := _FUNCTION.match(text):
            needed = frozenset(words(found.group(2)) & structs)
            definitions.append(_Definition(frozenset({found.group(1)}), indices, text, True, needed))
        elif names := _declared(text):
            definitions.append(_Definition(names, indices, text, is_folded="=" in text))
        else:
            roots += indices
    return definitions, roots


def _declared(statement: str) -> frozenset[str]:
    """What a declaration outside of functions is used by: names of variables, of a block its members or its own."""
    statement = _LAYOUT.sub(" ", statement).strip()
    if block := _BLOCK.match(statement):
        members, instance = block.groups()
        return frozenset({instance}) if instance else frozenset(_MEMBER.findall(members))
    if "(" in statement.partition("=")[0] or len(_WORD.findall(statement)) < 2:
        return frozenset()
    while (bare := _BRACKETED.sub("", statement)) != statement:
        statement = bare
    return frozenset(part.partition("=")[0].split()[-1] for part in statement.rstrip("; ").split(","))


def _whole_structs(structs: set[str], units: Sequence[Unit], statements: Sequence[str]) -> set[str]:
    """Structs that keep all their members: what is in buffers, and what is made by listing all members."""
    generated = {
        found.group(1) for unit in units if unit[0].file.startswith("<") and (found := _STRUCT.match(unit[0].text))
    }
    in_blocks = {word for text in statements if _BLOCK.match(_LAYOUT.sub(" ", text).strip()) for word in words(text)}
    made = {word for text in statements for word in _MADE.findall(text)}
    made |= {word for unit in units if directive_of(unit)[0] for line in unit for word in _MADE.findall(line.text)}
    return generated | structs & (in_blocks | made)


def _struct_parts(name: str, indices: tuple[int, ...], units: Sequence[Unit], *, is_whole: bool) -> list[_Definition]:
    """A struct with its first member, and apart from it the others (one a line), which stay where their names are
    used."""
    lines = {index: "\n".join(line.text for line in units[index]) for index in indices}
    members = {i: frozenset(f".{m}" for m in _MEMBER.findall(lines[i])) for i in indices[1:-1] if not is_whole}
    members = dict([(i, names) for i, names in members.items() if names][1:])
    shell = [i for i in indices if i not in members]
    itself = _Definition(frozenset({name}), tuple(shell), _MEMBER_NAME.sub("", "\n".join(lines[i] for i in shell)))
    needed = frozenset({name})
    return [
        itself,
        *(_Definition(names, (i,), _MEMBER_NAME.sub("", lines[i]), structs=needed) for i, names in members.items()),
    ]


def unrolled(text: str, count_of: Callable[[str], int | None]) -> str:
    """`text`, a function, with loops of few rounds (over a path's columns, a picture's targets) written out, in as many
    lines: arrays that only known numbers index are registers, where a loop's counter would put them into memory.
    `count_of`: the value of a number or macro, where it is known."""
    at = 0
    while loop := _LOOP.search(text, at):
        end = end_of_statement(text, loop.end())
        name, rounds, body = loop.group(1), count_of(loop.group(2)), text[loop.end() : end]
        if rounds is None or rounds > MOST_ROUNDS or re.search(rf"\b(?:break|continue|int {name})\b", body):
            at = loop.end()
            continue
        use = re.compile(rf"(?<![.\w]){name}\b")
        copies = [use.sub(str(index), body) for index in range(rounds)]
        # One copy keeps its lines, for the compiler's messages.
        written = " ".join((*(" ".join(copy.split()) for copy in copies[1:]), "}"))
        lines = "\n" * (0 if copies else body.count("\n"))
        head = "\n" * text[loop.start() : loop.end()].count("\n")
        text = text[: loop.start()] + head + "{ " + "".join(copies[:1]) + lines + " " + written + text[end:]
        at = loop.start()
    return text
