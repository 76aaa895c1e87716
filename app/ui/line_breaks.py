"""Where words break into lines. imgui breaks behind every full stop and comma, and so tears '.ply' and names of files
apart."""

from __future__ import annotations

from collections.abc import Callable


def broken(text: str, width: float, measure: Callable[[str], float], at: str = " ") -> str:
    """`text` in as few lines of `width` as its parts, which `at` divides, fit; a part that is wider has a line of its
    own. `measure`: width of a text, in the same unit."""
    lines: list[str] = []
    for part in text.split(at):
        longer = f"{lines[-1]}{at}{part}" if lines else part
        if lines and measure(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(part)
    return "\n".join(lines)
