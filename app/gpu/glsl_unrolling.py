"""Short loops of GLSL written out: `for (int c = 0; c < COLUMNS; ++c)` over a path's columns or a picture's targets.

A program that tells its driver to unroll nothing (`#pragma optionNV(unroll none)`) has these loops written out here:
arrays that only known numbers index are registers, where a loop's counter would put them into memory.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from .glsl_folding import end_of_statement

MOST_ROUNDS = 6
_LOOP = re.compile(r"\bfor \(int (\w+) = 0; \1 < (\w+); \+\+\1\)\s*")


def unrolled(text: str, count_of: Callable[[str], int | None]) -> str:
    """`text`, a function, with loops of few rounds written out, in as many lines. `count_of`: the value of a number or
    macro, where it is known."""
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
