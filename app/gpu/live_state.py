"""How much a shader holds at once: the registers' worth of state that is live at its fullest point.

A GPU runs the fewer invocations side by side the more registers each needs, so this number bounds how well a program
hides its waiting for memory. No driver tells it through OpenGL; so the text is translated to SPIR-V, optimised as a
driver would (everything inlined, variables turned into values) and analysed here. Compilers reorder and
recompute, so theirs differs; it is for comparing programs, and for finding those that cannot fit (255 registers for an
invocation on NVIDIA, 256 on AMD) from those that do.

Liveness is the textbook's (Aho, Lam, Sethi, Ullman, *Compilers*, 2nd ed., section 9.2.5) on static single assignment.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

_LINE = re.compile(r"^\s*(?:(%\d+)\s*=\s*)?(Op\w+)\s*(.*)$")
_STRING = re.compile(r'"(?:[^"\\]|\\.)*"')
_BOUNDS = frozenset(("OpFunction", "OpFunctionEnd"))
_MERGES = frozenset(("OpLoopMerge", "OpSelectionMerge"))
_ENDS = frozenset(
    ("OpBranch", "OpBranchConditional", "OpSwitch", "OpReturn", "OpReturnValue", "OpKill", "OpUnreachable")
)
_ADDRESSES = frozenset(("OpAccessChain", "OpInBoundsAccessChain", "OpFunctionParameter"))


@dataclass(frozen=True)
class LiveState:
    """What one shader holds, per invocation, in words of 32 bits."""

    registers: int
    """Values that are live at the fullest point."""
    scratch: int
    """Arrays of its own that are indexed by numbers not known to the compiler: they are in memory on most GPUs."""
    instructions: int


@dataclass
class _Block:
    defined: list[tuple[str, tuple[str, ...]]] = field(default_factory=list)
    """(result or "", what it reads) of each instruction but phi's, in order."""
    phis: list[tuple[str, tuple[tuple[str, str], ...]]] = field(default_factory=list)
    """(result, (value, the block that it comes from)…)."""
    follows: tuple[str, ...] = ()


def live_state(assembly: str) -> LiveState:
    """Live state of the entry function in a disassembly with raw identifiers (`spirv-dis --raw-id`), all calls inlined.

    Raises `ValueError` where there is a call left or no function at all."""
    sizes = _Sizes()
    blocks: dict[str, _Block] = {}
    block: _Block | None = None
    scratch = instructions = functions = 0
    for result, code, operands in _instructions(assembly):
        if code == "OpFunction":
            functions += 1
        if functions == 0:
            sizes.learn(result, code, operands)
            continue
        if functions > 1 or code == "OpFunctionCall":
            raise ValueError("calls are left in the program")
        if code == "OpLabel":
            block = blocks[result] = _Block()
            continue
        if block is None or code in _BOUNDS:
            continue
        instructions += 1
        if code in _MERGES:
            continue
        if code == "OpVariable":
            scratch += sizes.pointed(operands[0])
        elif code == "OpPhi":
            block.phis.append((result, tuple(zip(operands[1::2], operands[2::2], strict=True))))
            sizes.give(result, operands[0])
        else:
            if code in _ENDS:
                labels = set(operands[1:] if code in ("OpBranchConditional", "OpSwitch") else operands)
                block.follows = tuple(labels) if code.startswith(("OpBranch", "OpSwitch")) else ()
                reads = operands[:1] if code in ("OpBranchConditional", "OpSwitch") else ()
            else:
                reads = operands[1:] if result else operands
                if result and code not in _ADDRESSES:
                    sizes.give(result, operands[0])
            block.defined.append((result, reads))
    if not blocks:
        raise ValueError("there is no function")
    return LiveState(_fullest(blocks, sizes), scratch, instructions)


def _instructions(assembly: str) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """(result or "", opcode, identifiers and literals) of each line."""
    for line in assembly.splitlines():
        found = _LINE.match(_STRING.sub("", line.partition(";")[0]))
        if found:
            yield found[1] or "", found[2], tuple(found[3].split())


class _Sizes:
    """Words of 32 bits that values take; only values made inside the function have any."""

    def __init__(self) -> None:
        self._types: dict[str, int] = {}
        self._pointed: dict[str, int] = {}
        self._constants: dict[str, int] = {}
        self._values: dict[str, int] = {}

    def learn(self, result: str, code: str, operands: tuple[str, ...]) -> None:
        """Take note of a type or a constant."""
        types = self._types
        if code in ("OpTypeBool", "OpTypeInt", "OpTypeFloat"):
            types[result] = max(int(operands[0]) // 32, 1) if operands else 1
        elif code in ("OpTypeVector", "OpTypeMatrix"):
            types[result] = types[operands[0]] * int(operands[1])
        elif code == "OpTypeArray":
            types[result] = types.get(operands[0], 0) * self._constants.get(operands[1], 1)
        elif code == "OpTypeStruct":
            types[result] = sum(types.get(member, 0) for member in operands)
        elif code == "OpTypePointer" and operands[0] == "Function":
            self._pointed[result] = types.get(operands[1], 0)
        elif code == "OpConstant" and operands[1].isdigit():
            self._constants[result] = int(operands[1])

    def pointed(self, pointer: str) -> int:
        """Words of a variable of this type of pointer."""
        return self._pointed.get(pointer, 0)

    def give(self, result: str, kind: str) -> None:
        """Make `result` a value of this type."""
        self._values[result] = self._types.get(kind, 0)

    def __call__(self, values: Iterable[str]) -> int:
        return sum(self._values.get(value, 0) for value in values)

    def counts(self, value: str) -> bool:
        return self._values.get(value, 0) > 0


def _fullest(blocks: Mapping[str, _Block], sizes: _Sizes) -> int:
    """Words live at the fullest point of all blocks."""
    live_in: dict[str, frozenset[str]] = dict.fromkeys(blocks, frozenset())
    live_out: dict[str, frozenset[str]] = dict.fromkeys(blocks, frozenset())
    before: dict[str, list[str]] = {name: [] for name in blocks}
    for name, block in blocks.items():
        for follower in block.follows:
            if follower in before:
                before[follower].append(name)
    waiting = list(blocks)
    while waiting:
        name = waiting.pop()
        block = blocks[name]
        out: set[str] = set()
        for follower in block.follows:
            if follower in blocks:
                out |= live_in[follower] - {phi for phi, _ in blocks[follower].phis}
                out |= {value for _, pairs in blocks[follower].phis for value, source in pairs if source == name}
        live_out[name] = frozenset(value for value in out if sizes.counts(value))
        entering = _through(block, live_out[name], sizes)[0]
        if entering != live_in[name]:
            live_in[name] = entering
            waiting += before[name]
    return max(_through(block, live_out[name], sizes)[1] for name, block in blocks.items())


def _through(block: _Block, leaving: frozenset[str], sizes: _Sizes) -> tuple[frozenset[str], int]:
    """What is live on entering a block from what is live on leaving it, and the most words in between."""
    live = set(leaving)
    words = most = sizes(live)
    for result, reads in reversed(block.defined):
        if result in live:
            live.discard(result)
            words -= sizes((result,))
        for value in reads:
            if value not in live and sizes.counts(value):
                live.add(value)
                words += sizes((value,))
        most = max(most, words)
    return frozenset(live), most
