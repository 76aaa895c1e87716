"""The prove-gpu command: everything that must be known of a device that was never seen before, within ten minutes, as
one JSON and one HTML file, and what is measured as lines of JSON too.

Each part runs in a process of its own, so that a driver which crashes or hangs ends that part alone; what is found is
kept as it is found.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import msgspec

from ..base.atomic import atomic_output, make_output_folder
from ..base.errors import UserError, plain
from ..base.interrupts import exit_code_of
from ..base.progress import ProgressReporter
from ..base.version import __version__
from ..bench.report.page import Table, render
from .measuring_table import ProveGpu
from .proof_steps import PARTS, Finding, Part

JSON, HTML, LINES = "proof.json", "proof.html", "figures.jsonl"
WHOLE_S, QUICK_S = 900.0, 540.0
"""No part is begun, and none goes on, after this; where there are only figures."""
FIRST_CODE = 10
"""Exit code where the first part is the first that is broken; the second has one more, and so on."""
_LOOK_EVERY_S = 0.2
_OF_DEVICE = ("machine ", "splats", "nvidia-smi", "limit storage_block_bytes")
"""What of the doctor's findings stands beside the figures."""

State = Literal["holds", "cut", "broken", "crashed", "too slow", "stopped", "not begun"]
"""`cut`: what is only measured was ended at its time."""


class PartResult(msgspec.Struct):
    """What one part found."""

    key: str
    title: str
    state: State = "not begun"
    seconds: float = 0.0
    findings: list[Finding] = []
    detail: str = ""
    """The end of what the process wrote to stderr, where it did not end well."""

    @property
    def is_wrong(self) -> bool:
        """Whether something is to be mended."""
        return self.state in ("broken", "crashed", "too slow")


class Proof(msgspec.Struct):
    """One run."""

    version: str
    date: str
    short: bool
    parts: list[PartResult]
    quick: bool = False
    """Figures alone."""
    seconds: float = 0.0

    @property
    def machine(self) -> dict[str, str]:
        """What the doctor reports of it."""
        found = {f.name: f.value for part in self.parts if part.key == "doctor" for f in part.findings}
        return {name.removeprefix("machine "): value for name, value in found.items() if name.startswith("machine ")}

    @property
    def is_software(self) -> bool:
        """Whether the processor draws."""
        return any(f.name == "is software" and f.value == "yes" for part in self.parts for f in part.findings)

    @property
    def exit_code(self) -> int:
        """0 where everything holds; else which part is the first that does not; 130 where it was stopped before."""
        for at, part in enumerate(self.parts):
            if part.is_wrong:
                return FIRST_CODE + at
        return 0 if all(part.state in ("holds", "cut") for part in self.parts) else 130


def prove_gpu(options: ProveGpu) -> int:
    """Run all parts, keep what they find; returns the exit code. Raises `UserError`."""
    chosen = chosen_parts(options.parts, options.quick)
    make_output_folder(options.output, JSON, HTML, LINES)
    started = time.monotonic()
    proof = Proof(
        __version__,
        datetime.now(UTC).isoformat(timespec="seconds"),
        options.short,
        [PartResult(part.key, part.title) for part in chosen],
        options.quick,
    )
    stopped = 130
    with ProgressReporter("proof") as progress, (options.output / LINES).open("wb", buffering=0) as lines:

        def say(line: object) -> None:
            text = msgspec.json.encode(line) + b"\n"
            lines.write(text)
            if options.quick:
                sys.stdout.buffer.write(text)
                sys.stdout.buffer.flush()

        try:
            _run_all(proof, chosen, options.output, progress, say, started)
        except KeyboardInterrupt as interrupt:
            stopped = exit_code_of(interrupt)
            print("spectrasplat: stopped; what was found is kept", file=sys.stderr)
    proof.seconds = time.monotonic() - started
    _keep(proof, options.output)
    if not options.quick:
        print(summary(proof))
        print((options.output / HTML).resolve())
    return stopped if proof.exit_code == 130 else proof.exit_code


def chosen_parts(names: Sequence[str] | None, quick: bool = False) -> list[Part]:
    """The parts called so, in their own order, the doctor always; None: all, or those that measure (`quick`)."""
    if names is None:
        return [part for part in PARTS if part.key == "doctor" or part.measures or not quick]
    wanted = {*names} - {""}
    known = {part.key for part in PARTS}
    if unknown := sorted(wanted - known):
        raise UserError(f"--parts '{unknown[0]}' is no part of the proof: choose among {', '.join(known)}")
    return [part for part in PARTS if part.key in wanted | {"doctor"}]


def summary(proof: Proof) -> str:
    """A line for each part, what is wrong below it."""
    lines = []
    for part in proof.parts:
        lines.append(f"{part.state:<10} {part.title} ({part.seconds:.0f} s)")
        lines += [f"           {f.name}: {plain(f.value)}" for f in part.findings if f.broken]
        lines += [f"           {plain(part.detail)[-300:]}"] if part.is_wrong and part.detail else []
    return "\n".join(lines)


# -- running ------------------------------------------------------------------------------


def _run_all(
    proof: Proof,
    parts: Sequence[Part],
    folder: Path,
    progress: Callable[[float, str], None],
    say: Callable[[object], None],
    started: float,
) -> None:
    """`say` gets the time that there is, every figure when it is found, and how each part ended."""
    whole_s = QUICK_S if proof.quick else WHOLE_S
    say({"part": "all", "limit_s": whole_s} | {f"{part.key}_limit_s": part.limit_s[proof.short] for part in parts})
    for at, (part, result) in enumerate(zip(parts, proof.parts, strict=True)):
        left = whole_s - (time.monotonic() - started)
        if left <= 0.0:
            say({"part": part.key, "ended": result.state, "why": "the proof's time was over"})
            continue

        def tell(share: float, at: int = at, name: str = part.title) -> None:
            progress((at + share) / len(parts), name)

        def note(finding: Finding, part: Part = part) -> None:
            if part.measures or finding.name.startswith(_OF_DEVICE):
                found: dict[str, object] = {"part": part.key, "name": finding.name}
                say({**found, **(finding.figures or {"value": finding.value})})

        tell(0.0)
        try:
            _run(part, result, _Run(proof.short, folder, part.limit_s[proof.short], part.measures, left, tell, note))
        finally:
            why = {"why": plain(result.detail)[-500:]} if result.detail else {}
            say({"part": part.key, "ended": result.state, "s": round(result.seconds, 1), **why})
            _keep(proof, folder)
        if part.key == "doctor":
            if not proof.machine:  # there is no OpenGL
                return
            proof.short |= proof.is_software


@dataclass(frozen=True)
class _Run:
    """How a part is run."""

    short: bool
    folder: Path
    limit_s: float
    """The part's own; beyond it something is wrong, unless it only measures."""
    measures: bool
    left_s: float
    """Time left for the whole."""
    tell: Callable[[float], None]
    """Gets the share done."""
    note: Callable[[Finding], None]
    """Gets what is found."""


def command_of(part: Part, short: bool, findings: Path, folder: Path) -> list[str]:
    """The command line that runs a part alone."""
    command = [sys.executable, "-P", "-m", "spectrasplat.commands.proof_steps", part.key]
    return [*command, "short" if short else "full", str(findings), str(folder)]


def _run(part: Part, result: PartResult, how: _Run) -> None:
    """Run one part in a process of its own and take in what it finds. Ctrl-C ends the process and is raised again."""
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        file, errors = Path(scratch) / "findings", Path(scratch) / "stderr"
        with errors.open("wb") as stderr:
            process = subprocess.Popen(
                command_of(part, how.short, file, how.folder),
                stdin=subprocess.DEVNULL,
                stdout=stderr,
                stderr=stderr,
                start_new_session=True,
            )
            try:
                result.state = _watched(process, file, result, how, started)
            except BaseException:
                result.state = "stopped"
                raise
            finally:
                _end(process)
                _take_in(file, result, how.note)
                result.seconds = time.monotonic() - started
                if result.state in ("crashed", "too slow"):
                    result.detail += " " + errors.read_text(encoding="utf-8", errors="replace")[-3000:].strip()


def _watched(process: subprocess.Popen, file: Path, result: PartResult, how: _Run, started: float) -> State:
    while (code := process.poll()) is None:
        if time.monotonic() - started > how.limit_s:
            result.detail = f"not done after {how.limit_s:.0f} s."
            return "cut" if how.measures else "too slow"
        if time.monotonic() - started > how.left_s:
            result.detail = "the proof's time was over."
            return "stopped"
        time.sleep(_LOOK_EVERY_S)
        how.tell(_take_in(file, result, how.note))
    _take_in(file, result, how.note)
    if code < 0:
        result.detail = f"ended by {signal.Signals(-code).name}."
    elif code:
        result.detail = f"ended with {code}."
    if code:
        return "crashed"
    return "broken" if any(finding.broken for finding in result.findings) else "holds"


def _take_in(file: Path, result: PartResult, note: Callable[[Finding], None]) -> float:
    """What the process has written so far, what is new of it for `note` too; returns the share done."""
    try:
        written = file.read_bytes()
    except OSError:
        return 0.0
    whole = written[: written.rfind(b"\n") + 1].splitlines()
    found = [msgspec.json.decode(line, type=Finding) for line in whole]
    known, result.findings = len(result.findings), [finding for finding in found if finding.done is None]
    for finding in result.findings[known:]:
        note(finding)
    return max((finding.done for finding in found if finding.done is not None), default=0.0)


def _end(process: subprocess.Popen) -> None:
    """End a process that we started, and what it started."""
    if process.poll() is not None:
        return
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            continue
        except ProcessLookupError:
            pass
        return


# -- what is kept -------------------------------------------------------------------------


def _keep(proof: Proof, folder: Path) -> None:
    """Both files, each whole or not at all."""
    with atomic_output(folder / JSON) as temporary:
        temporary.write_bytes(msgspec.json.format(msgspec.json.encode(proof), indent=1))
    tables = {
        (part.key, at): Table(finding.rows[0], finding.rows[1:])
        for part in proof.parts
        for at, finding in enumerate(part.findings)
        if finding.rows
    }
    page = render("proof.html", proof=proof, tables=tables, wrong=[p.title for p in proof.parts if p.is_wrong])
    with atomic_output(folder / HTML) as temporary:
        temporary.write_text(page, encoding="utf-8")
