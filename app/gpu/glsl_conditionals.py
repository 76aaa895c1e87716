"""Preprocessor conditionals of GLSL, resolved by the given defines.

Only #if … #endif are dealt with; macros are evaluated, not expanded, so that the text stays the author's.
Where only the driver knows (GL_*, __VERSION__, names that are not defined) nothing is touched.
"""

from __future__ import annotations

import operator as op
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

_DIRECTIVE = re.compile(r"\s*#\s*(\w+)\s*(.*)", re.DOTALL)
DEFINE = re.compile(r"(\w+)(\([^)]*\))?\s*(.*)", re.DOTALL)
"""Name, arguments and body of what follows #define."""
_CONDITION_TOKEN = re.compile(r"\s*(0[xX][0-9a-fA-F]+|\d+|\w+|&&|\|\||[=!<>]=|<<|>>|[-+*/%<>!()])[uU]?")
_LEVELS: tuple[dict[str, Callable[[int, int], int]], ...] = (
    {"||": lambda a, b: bool(a or b)},
    {"&&": lambda a, b: bool(a and b)},
    {"==": op.eq, "!=": op.ne},
    {"<=": op.le, ">=": op.ge, "<": op.lt, ">": op.gt},
    {"<<": op.lshift, ">>": op.rshift},
    {"+": op.add, "-": op.sub},
    {"*": op.mul, "/": op.floordiv, "%": op.mod},
)
"""Operations of two operands, those first that bind least."""
COMPARISONS = _LEVELS[2] | _LEVELS[3]
_DEEPEST = 8
"""Macros in macros that a condition may go through."""


class _UnknownError(Exception):
    """Only the driver knows."""


class Line(NamedTuple):
    """A line of GLSL and where it came from."""

    text: str
    file: str
    number: int


Unit = tuple[Line, ...]
"""Lines that belong together: one, or several joined by backslashes."""


def directive_of(unit: Unit) -> tuple[str, str]:
    """(name, the rest) of a directive, or ("", "")."""
    found = _DIRECTIVE.match("\n".join(line.text for line in unit).replace("\\\n", " "))
    return (found.group(1), found.group(2)) if found else ("", "")


@dataclass
class _Macros:
    """What is known of the preprocessor's names at a place of the text."""

    values: dict[str, str | None] = field(default_factory=dict)
    """None: a macro with arguments, which no condition here uses."""
    doubtful: set[str] = field(default_factory=set)
    """Defined or not under a condition that only the driver can evaluate."""
    switches: frozenset[str] = frozenset()
    """Names that are 0 where they are not defined."""

    def note(self, unit: Unit, certain: bool) -> None:
        """Take in a #define or #undef."""
        name, rest = directive_of(unit)
        found = DEFINE.match(rest)
        if found is None or name not in ("define", "undef"):
            return
        macro, arguments, body = found.groups()
        if not certain:
            self.doubtful.add(macro)
            return
        self.doubtful.discard(macro)
        self.values.pop(macro, None)
        if name == "define":
            self.values[macro] = None if arguments else body.strip()

    def is_defined(self, name: str) -> bool:
        if name in self.doubtful or (name not in self.values and name.startswith(("GL_", "__"))):
            raise _UnknownError
        return name in self.values

    def body(self, name: str) -> str:
        body = None if name in self.doubtful else self.values.get(name, "0" if name in self.switches else None)
        if not body:
            raise _UnknownError
        return body


def macros_of(units: Sequence[Unit]) -> _Macros:
    """What is defined at the end of a text without conditionals."""
    macros = _Macros()
    for unit in units:
        macros.note(unit, certain=True)
    return macros


def value_of(expression: str, macros: _Macros) -> int | None:
    """An integer expression's value; None where only the driver knows."""
    try:
        return _expression([found.group(1) for found in _CONDITION_TOKEN.finditer(expression)], macros, 0)
    except _UnknownError:
        return None


def resolve_conditionals(
    units: Sequence[Unit], macros: _Macros | None = None, switches: frozenset[str] = frozenset()
) -> tuple[list[Unit], bool]:
    """The units whose conditions hold, and whether every condition could be evaluated. `switches` are 0 where they are
    not defined.

    A chain with a condition that cannot be evaluated stays whole; what it defines is then not known either.
    """
    macros = macros or _Macros(switches=switches)
    kept: list[Unit] = []
    at, resolved = 0, True
    while at < len(units):
        name, _ = directive_of(units[at])
        if name in ("if", "ifdef", "ifndef"):
            branches, end = _branches(units, at)
            try:
                body = next((body for directive, body in branches if _holds(directive, macros)), [])
                part, settled = resolve_conditionals(body, macros)
            except _UnknownError:
                part, settled = list(units[at:end]), False
                for unit in part:
                    macros.note(unit, certain=False)
        else:
            end, part, settled = at + 1, [units[at]], name not in ("elif", "else", "endif")
            macros.note(units[at], certain=True)
        kept += part
        at, resolved = end, resolved and settled
    return kept, resolved


def _branches(units: Sequence[Unit], at: int) -> tuple[list[tuple[Unit, Sequence[Unit]]], int]:
    """((directive, body) …, place after #endif) of the chain that starts at `at`; without #endif it ends with the
    text."""
    branches: list[tuple[Unit, list[Unit]]] = [(units[at], [])]
    depth = 0
    for place in range(at + 1, len(units)):
        name, _ = directive_of(units[place])
        if depth == 0 and name == "endif":
            return list(branches), place + 1
        if depth == 0 and name in ("elif", "else"):
            branches.append((units[place], []))
            continue
        depth += (name in ("if", "ifdef", "ifndef")) - (name == "endif")
        branches[-1][1].append(units[place])
    return list(branches), len(units)


def _holds(directive: Unit, macros: _Macros) -> bool:
    name, rest = directive_of(directive)
    if name == "else":
        return True
    if name in ("ifdef", "ifndef"):
        return macros.is_defined(rest.strip()) == (name == "ifdef")
    tokens = []
    rest = rest.rstrip()
    while rest:
        found = _CONDITION_TOKEN.match(rest)
        if found is None:
            raise _UnknownError
        tokens.append(found.group(1))
        rest = rest[found.end() :]
    value = _expression(tokens, macros, 0)
    if tokens:
        raise _UnknownError
    return value != 0


def _expression(tokens: list[str], macros: _Macros, level: int, depth: int = 0) -> int:
    """Integer value of `tokens`, which are used up as far as they go; `depth`: macros gone through."""
    if level == len(_LEVELS):
        return _operand(tokens, macros, depth)
    value = _expression(tokens, macros, level + 1, depth)
    while tokens and tokens[0] in _LEVELS[level]:
        operation = _LEVELS[level][tokens.pop(0)]
        right = _expression(tokens, macros, level + 1, depth)
        try:
            value = int(operation(value, right))
        except (ZeroDivisionError, ValueError) as error:
            raise _UnknownError from error
    return value


def _operand(tokens: list[str], macros: _Macros, depth: int) -> int:
    if not tokens:
        raise _UnknownError
    token = tokens.pop(0)
    if token in ("!", "-", "+"):
        value = _operand(tokens, macros, depth)
        return int(not value) if token == "!" else -value if token == "-" else value
    if token == "(":
        value = _expression(tokens, macros, 0, depth)
        if not tokens or tokens.pop(0) != ")":
            raise _UnknownError
        return value
    if token == "defined":
        bracketed = tokens[:1] == ["("]
        name = tokens[1] if bracketed and len(tokens) > 2 else tokens[0] if tokens else ""
        del tokens[: 3 if bracketed else 1]
        return int(macros.is_defined(name))
    if token[0].isdigit():
        return int(token, 16 if token[1:2] in "xX" and len(token) > 2 else 10)
    if depth > _DEEPEST:
        raise _UnknownError
    inner = [found.group(1) for found in _CONDITION_TOKEN.finditer(macros.body(token))]
    value = _expression(inner, macros, 0, depth + 1)
    if inner:
        raise _UnknownError
    return value
