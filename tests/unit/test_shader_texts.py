"""Rules for all shaders that no compiler here enforces; registers' worth of live state, counted by hand."""

from __future__ import annotations

import re

import pytest
from spectrasplat.base.paths import shaders_dir
from spectrasplat.gpu import strict_compilers
from spectrasplat.gpu.live_state import live_state
from spectrasplat.gpu.shader import Built, Source

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


TYPES = """
    %1 = OpTypeVoid
    %2 = OpTypeFunction %1
    %3 = OpTypeFloat 32
    %4 = OpTypeVector %3 3
    %5 = OpTypeInt 32 0
    %6 = OpConstant %5 7
    %7 = OpTypeArray %4 %6
    %8 = OpTypePointer Function %7
    %9 = OpTypePointer StorageBuffer %3
    %10 = OpTypeBool
    %90 = OpConstant %3 1.5
    %91 = OpVariable %9 StorageBuffer
"""


def function(*lines: str) -> str:
    return "\n".join((TYPES, "%20 = OpFunction %1 None %2", "%21 = OpLabel", *lines, "OpFunctionEnd"))


def test_values_live_from_where_they_are_made_to_where_they_are_last_read() -> None:
    """At the fullest, %31 (three words) and %30 are held; %32 begins as %31 ends. Constants and addresses are free."""
    text = function(
        "%30 = OpLoad %3 %91",
        "%31 = OpCompositeConstruct %4 %30 %30 %90",
        "%32 = OpDot %3 %31 %31",
        "%33 = OpFAdd %3 %32 %30",
        "OpStore %91 %33",
        "OpReturn",
    )
    state = live_state(text)
    assert state.registers == 4 and state.scratch == 0 and state.instructions == 6


def test_what_a_loop_carries_lives_all_the_way_round() -> None:
    """%40 goes round, %30 is read after the loop only and %31 in every round: all three are held inside."""
    text = function(
        "%30 = OpLoad %3 %91",
        "%31 = OpLoad %3 %91",
        "OpBranch %22",
        "%22 = OpLabel",
        "%40 = OpPhi %3 %90 %21 %41 %23",
        "OpLoopMerge %24 %23 None",
        "OpBranch %23",
        "%23 = OpLabel",
        "%41 = OpFAdd %3 %40 %31",
        "%42 = OpFOrdLessThan %10 %41 %90",
        "OpBranchConditional %42 %22 %24",
        "%24 = OpLabel",
        "%43 = OpFAdd %3 %41 %30",
        "OpStore %91 %43",
        "OpReturn",
    )
    assert live_state(text).registers == 4  # %30, %31, %41 and the condition


def test_arrays_of_its_own_are_counted_apart() -> None:
    text = function("%30 = OpVariable %8 Function", "OpReturn")
    state = live_state(text)
    assert (state.registers, state.scratch) == (0, 21)


def test_calls_left_are_refused() -> None:
    with pytest.raises(ValueError, match="calls"):
        live_state(function("%30 = OpFunctionCall %1 %20", "OpReturn"))
    with pytest.raises(ValueError, match="no function"):
        live_state(TYPES)


@pytest.mark.skipif(bool(strict_compilers.missing()), reason=strict_compilers.missing() or "all there")
def test_a_shader_that_must_hold_sixteen_numbers_does() -> None:
    """A barrier between reading and writing keeps the optimiser from moving them together."""
    lines = ["#version 430 core", "layout(local_size_x = 32) in;", "shared float box[32];"]
    lines += ["layout(std430, binding = 0) buffer Values { float values[]; };", "void main() {"]
    lines += [f"float v{n} = values[{n}];" for n in range(16)]
    lines += ["box[gl_LocalInvocationIndex] = v0; barrier(); memoryBarrierBuffer();"]
    lines += [f"values[{n}] = v{n} * box[{n}];" for n in range(16)]
    text = "\n".join([*lines, "}"]) + "\n"
    source = Source("some.comp", text, tuple(("some.comp", n) for n in range(1, text.count("\n") + 1)))
    (state,) = strict_compilers.live_states(Built((source,), 0.0))
    assert 16 <= state.registers <= 20 and state.scratch == 0
