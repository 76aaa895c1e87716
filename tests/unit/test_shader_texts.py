"""Rules for all shaders that no compiler here enforces."""

from __future__ import annotations

import re

import pytest
from spectrasplat.base.paths import shaders_dir

FILES = sorted(p for p in shaders_dir().rglob("*") if p.suffix in (".comp", ".vert", ".frag", ".glsl"))
COMMENT = re.compile(r"//.*")
GROUP = r"\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\)"
UNSAFE = {
    "isnan and isinf may be compiled away": re.compile(r"\bis(?:nan|inf)\b"),
    "a number compared with itself may be compiled away": re.compile(
        r"(?<![\w.\]])([A-Za-z_][\w.]*(?:\[[^\]]*\])?) *[!=]= *\1(?![\w.\[(])"
    ),
    "!(a < b) may be compiled to a >= b": re.compile(rf"!\s*(?=\()(?P<group>{GROUP})"),
}


def unsafe(text: str) -> list[str]:
    """Why NaN may not be noticed where this text relies on it, by the line."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        code = COMMENT.sub("", line)
        for why, pattern in UNSAFE.items():
            for match in pattern.finditer(code):
                negated = match.groupdict().get("group")
                if negated is None or re.search(r"[^<>-](?:<=?|>=?)(?![<>])", negated):
                    found.append(f"{number}: {match.group(0)}: {why}, use lib/finite.glsl")
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name)
def test_nan_is_told_by_bits(path) -> None:
    assert unsafe(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "text",
    [
        "if (isnan(v)) return;",
        "return any(isinf(colour));",
        "bool bad = a.x != a.x;",
        "if (!(largest < LIMIT * LIMIT)) {",
        "holds = !(dot(v, v) <= 1.0);",
    ],
)
def test_what_relies_on_comparisons_is_found(text: str) -> None:
    assert len(unsafe(text)) == 1


@pytest.mark.parametrize("text", ["a != a.x", "ab == b", "!(x && y)", "f(a) != f(b)", "// isnan", "!(a >> 1u == b)"])
def test_what_does_not_is_left_alone(text: str) -> None:
    assert unsafe(text) == []
