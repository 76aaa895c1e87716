"""Registers' worth of live state, on programs small enough to count by hand."""

from __future__ import annotations

import pytest
from spectrasplat.gpu import strict_compilers
from spectrasplat.gpu.live_state import live_state
from spectrasplat.gpu.shader import Built, Source

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
    source = Source("some.comp", text, tuple(("some.comp", n) for n in range(1, text.count("\n") + 1)), 0)
    (state,) = strict_compilers.live_states(Built((source,), 0.0))
    assert 16 <= state.registers <= 20 and state.scratch == 0
