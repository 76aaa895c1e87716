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


BLOCK = re.compile(r"\bbuffer\s+\w+\s*\{\s*(\w+)\s+(\w+)\s*\[[^\]]*\]\s*;\s*\}")
PLAIN = {"uint", "int", "float", "vec2", "vec3", "vec4", "uvec2", "uvec3", "uvec4", "ivec2", "ivec3", "ivec4"}
INDEX = r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]"
RECORDS = sorted(
    {name for path in FILES for kind, name in BLOCK.findall(path.read_text(encoding="utf-8")) if kind not in PLAIN}
)


def handed_records(text: str) -> list[str]:
    """Where a whole record of a storage block is handed to a function, by the line."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        code = COMMENT.sub("", line)
        found += [
            f"{number}: {name} is handed on where it lies, which NVIDIA refuses (C1317): copy it first"
            for name in RECORDS
            if re.search(rf"[(,]\s*{name}{INDEX}\s*[,)]", code)
        ]
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name)
def test_records_of_storage_blocks_are_copied_before_they_are_handed_on(path) -> None:
    """NVIDIA 580.159 took `f(blocks[i])` for a loss of `readonly restrict` where f takes the struct by value."""
    assert handed_records(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "text",
    [
        "vec2 side = texels_along(placements[placement], at, way);",
        "near = near || light_seen(lights[i], path.position) > 0.0;",
        "held = held_size(placements[placements[i].next], photon);",
    ],
)
def test_handed_records_are_found(text: str) -> None:
    assert len(handed_records(text)) == 1


@pytest.mark.parametrize("text", ["Placement place = placements[i];", "f(placements[i].rect)", "g(lights.length())"])
def test_copied_records_are_left_alone(text: str) -> None:
    assert handed_records(text) == []
