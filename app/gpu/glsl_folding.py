"""Statements and expressions of GLSL that a known constant decides: `if (HAS_X) { … } else { … }`, `HAS_X && cut`,
`HAS_X ? a : b`.

A switch is 1 or 0 in the text, which no driver would take for a condition: what is decided is folded here, so that a
shader can say with plain statements what a scene leaves out. Only characters are left out, no line moves.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from .glsl_conditionals import COMPARISONS

_BRACKET = re.compile(r"[(){}\[\]]")
_DECLARED = re.compile(r"(?:const\s+)?([A-Za-z_]\w*)\s+([A-Za-z_]\w*)\s*(?:[=;,]|\[)")
_DECLARATION_OF_MORE = re.compile(r",\s*([A-Za-z_]\w*)\s*(?==|,|;|\[)")
_KEYWORDS = frozenset({"return", "else", "case"})
_SIGN = "|".join(COMPARISONS)
_COMPARISON = rf"\s*(?:{_SIGN})\s*\d+[uU]?"
_NUMBER = re.compile(r"\d+[uU]?")
_CONSTANT = re.compile(rf"(!?)\s*(\w+)\s*(?:({_SIGN})\s*(\w+))?")


def places_of(values: Mapping[str, int], switches: frozenset[str]) -> re.Pattern[str] | None:
    """Where an expression may be decided: at a switch, and at another constant that is compared with a number. None:
    nowhere."""
    names = "|".join(name for name in values if name in switches)
    others = "|".join(name for name in values if name not in switches)
    places = [rf"(?:{names})\b"] * bool(names) + [rf"(?:{others}){_COMPARISON}"] * bool(others)
    return re.compile(rf"\b(?:{'|'.join(places)})") if places else None


def folded(text: str, values: Mapping[str, int], places: re.Pattern[str] | None) -> str:
    """`text`, a function, without what `values` decide, in as many lines; `places`: see `places_of`."""
    if places is None:
        return text
    at = 0
    while found := places.search(text, at):
        start, end = _expression_about(text, found.start())
        decided = _decided(text[start:end], values)
        if decided == text[start:end].strip():  # nothing that is known
            at = found.end()
        elif isinstance(decided, str):
            text = text[:start] + _in_lines(decided, text[start:end]) + text[end:]
            at = start
        else:
            text, at = _with_decided(text, start, end, decided)
    return text


# -- expressions ----------------------------------------------------------------------------


def _expression_about(text: str, at: int) -> tuple[int, int]:
    """Where the whole boolean expression about a place begins and ends, as far out as brackets only group."""
    start, end = _within(text, at)
    while (
        start
        and text[start - 1] == "("
        and text[end : end + 1] == ")"
        and re.search(r"(?:[(!=?:,;{}]|&&|\|\||\breturn)\s*$", text[: start - 1][-80:])
    ):
        start, end = _within(text, start - 1)
    while text[start].isspace():
        start += 1
    return start, start + len(text[start:end].rstrip())


def _within(text: str, at: int) -> tuple[int, int]:
    start, depth = at, 0
    while start:
        sign = text[start - 1]
        if sign in ")]":
            depth += 1
        elif depth and sign in "([":
            depth -= 1
        elif not depth and (
            sign in ";{}(,[?:"
            or (sign == "=" and text[start : start + 1] != "=" and text[start - 2] not in "=!<>")
            or (sign == "n" and re.search(r"\breturn$", text[max(start - 7, 0) : start]) and not text[start].isalnum())
        ):
            break
        start -= 1
    end, depth = at, 0
    while end < len(text):
        sign = text[end]
        if sign in "([":
            depth += 1
        elif depth and sign in ")]":
            depth -= 1
        elif not depth and sign in ";{}),]?:":
            break
        end += 1
    return start, end


def _split(text: str, sign: str) -> list[str]:
    """Operands of && or || outside of brackets."""
    parts, depth, begun, at = [], 0, 0, 0
    while at < len(text):
        depth += (text[at] in "([") - (text[at] in ")]")
        if not depth and text.startswith(sign, at):
            parts.append(text[begun:at])
            at += len(sign)
            begun = at
        else:
            at += 1
    return [*parts, text[begun:]]


def _decided(text: str, values: Mapping[str, int]) -> bool | str:
    """Whether the expression holds, or what is left of it."""
    text = text.strip()
    for sign, absorbing in (("||", True), ("&&", False)):
        operands = _split(text, sign)
        if len(operands) > 1:
            found = [_decided(operand, values) for operand in operands]
            left: list[str] = []
            for operand in found:
                if operand is absorbing and not any("(" in before for before in left):
                    return absorbing
                if operand is absorbing:
                    # What is called before it may do something.
                    return f" {sign} ".join([*left, str(absorbing).lower()])
                if isinstance(operand, str):
                    left.append(operand)
            if left == [operand.strip() for operand in operands]:
                return text
            return f" {sign} ".join(left) if left else not absorbing
    if text.startswith("(") and _match(text, 0) == len(text) - 1:
        inner = _decided(text[1:-1], values)
        if not isinstance(inner, str) or inner == text[1:-1].strip():
            return text if isinstance(inner, str) else inner
        return inner if re.fullmatch(r"!?[\w.]+(?:\(.*\)|\[.*\])?", inner, re.DOTALL) else f"({inner})"
    if text.startswith("!"):
        inner = _decided(text[1:], values)
        return f"!{inner}" if isinstance(inner, str) else not inner
    constant = _CONSTANT.fullmatch(text)
    if constant is None:
        return text
    _, name, comparison, other = constant.groups()
    left_value, right_value = _value(name, values), _value(other, values) if other else 0
    if left_value is None or right_value is None or _NUMBER.fullmatch(text):
        return text
    return bool(COMPARISONS[comparison or "!="](left_value, right_value))


def _value(word: str, values: Mapping[str, int]) -> int | None:
    return int(word.rstrip("uU")) if _NUMBER.fullmatch(word) else values.get(word)


# -- statements -----------------------------------------------------------------------------


def _with_decided(text: str, start: int, end: int, holds: bool) -> tuple[str, int]:
    """The text where the expression from `start` to `end` is decided, and from where on more may be."""
    after = _skip(text, end)
    if text[after : after + 1] == "?":
        middle = _end_of_choice(text, after + 1)
        last = _within(text, middle + 1)[1]
        while text[last : last + 1] == "?":  # a ? b : c ? d : e
            last = _within(text, _end_of_choice(text, last + 1) + 1)[1]
        kept = text[after + 1 : middle] if holds else text[middle + 1 : last]
        return text[:start] + _in_lines(kept.strip(), text[start:last]) + text[last:], start
    head = re.search(r"\bif\s*\(\s*$", text[max(start - 80, 0) : start])
    if head is None or text[after : after + 1] != ")":
        word = "true" if holds else "false"
        return text[:start] + _in_lines(word, text[start:end]) + text[end:], start + len(word)
    return _statement_decided(text, max(start - 80, 0) + head.start(), after + 1, holds)


def _statement_decided(text: str, start: int, end: int, holds: bool) -> tuple[str, int]:
    """`_with_decided` for `if (…)` from `start` to `end`."""
    first = _skip(text, end)
    first_end = end_of_statement(text, first)
    second = _skip(text, first_end)
    if re.match(r"else\b", text[second : second + 5]):
        second = _skip(text, second + 4)
        last = end_of_statement(text, second)
    else:
        second = last = first_end
    kept, kept_end = (first, first_end) if holds else (second, last)
    before = text[:start].rstrip()
    follows_else = re.search(r"\belse$", before) is not None
    if kept == kept_end:
        if follows_else:
            return before[:-4] + _lines(text[len(before) : last]) + text[last:], len(before) - 4
        empty = ";" if before.endswith(")") else ""
        return text[:start] + empty + _lines(text[start:last]) + text[last:], start
    inner, inner_end = kept, kept_end
    if text[kept] == "{" and not follows_else and not before.endswith(")"):
        around = text[_opening(text, start) : start] + text[last : _closing(text, last)]
        if not _clashes(text[kept + 1 : kept_end - 1], around):
            inner, inner_end = kept + 1, kept_end - 1
    left_out = _lines(text[start:inner])
    return text[:start] + left_out + text[inner:inner_end] + _lines(text[inner_end:last]) + text[last:], start


def _clashes(body: str, around: str) -> bool:
    """Whether a block declares a name that the statements about it use."""
    names: set[str] = set()
    depth = 0
    for statement in re.split(r"([;{}])", body):
        depth += (statement == "{") - (statement == "}")
        found = None if depth else _DECLARED.match(statement.strip() + ";")
        if found and not _KEYWORDS & {*found.groups()}:
            names |= {found.group(2), *_DECLARATION_OF_MORE.findall(statement + ";")}
    return bool(names) and bool(names & set(re.findall(r"[A-Za-z_]\w*", around)))


def end_of_statement(text: str, at: int) -> int:
    """Where the statement that begins at `at` ends."""
    if text[at] == "{":
        return _match(text, at) + 1
    if head := re.match(r"(if|for|while|switch)\s*\(", text[at : at + 20]):
        end = end_of_statement(text, _skip(text, _match(text, at + head.end() - 1) + 1))
        after = _skip(text, end)
        if head.group(1) == "if" and re.match(r"else\b", text[after : after + 5]):
            return end_of_statement(text, _skip(text, after + 4))
        return end
    depth = 0
    while text[at] != ";" or depth:
        depth += (text[at] in "([{") - (text[at] in ")]}")
        at += 1
    return at + 1


def _end_of_choice(text: str, at: int) -> int:
    """Where the colon is that belongs to the question mark before `at`."""
    depth = 0
    while depth or text[at] != ":":
        depth += (text[at] in "([?") - (text[at] in ")]:")
        at += 1
    return at


def _match(text: str, at: int) -> int:
    """Where the bracket at `at` is closed."""
    depth = 0
    for found in _BRACKET.finditer(text, at):
        depth += 1 if found.group() in "([{" else -1
        if not depth:
            return found.start()
    return len(text)


def _opening(text: str, at: int) -> int:
    """Where the block about `at` begins; a function's begins with its arguments."""
    depth = 0
    for place in range(at - 1, -1, -1):
        depth += (text[place] == "}") - (text[place] == "{")
        if depth < 0:
            return place if text.rfind("{", 0, place) >= 0 else 0
    return 0


def _closing(text: str, at: int) -> int:
    depth = 0
    for place in range(at, len(text)):
        depth += (text[place] == "{") - (text[place] == "}")
        if depth < 0:
            return place
    return len(text)


def _skip(text: str, at: int) -> int:
    while at < len(text) and text[at].isspace():
        at += 1
    return at


def _lines(text: str) -> str:
    return "\n" * text.count("\n")


def _in_lines(kept: str, replaced: str) -> str:
    """`kept` with as many line breaks as what it replaces."""
    return kept + "\n" * (replaced.count("\n") - kept.count("\n"))
