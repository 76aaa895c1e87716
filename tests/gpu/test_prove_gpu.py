"""prove-gpu keeps what it finds, whatever a driver does to the process that finds it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.bench.frame_speed import FrameCost, photons_within
from spectrasplat.bench.stored_pictures import LARGEST_ERROR, SCENES, block_error, stored
from spectrasplat.commands import prove_gpu
from spectrasplat.commands.measuring_table import MEASURED_PARTS
from spectrasplat.commands.proof_steps import PARTS, Finding
from spectrasplat.gpu.context import create_context

SOFTWARE = '{"name": "machine renderer", "value": "some"}\n{"name": "is software", "value": "yes"}\n'


def proved(folder: Path, *options: str) -> tuple[int, dict]:
    code = main(["prove-gpu", "-o", str(folder), *options])
    assert "<h1>" in (folder / "proof.html").read_text()
    return code, json.loads((folder / "proof.json").read_text())


def told(monkeypatch: pytest.MonkeyPatch, **scripts: str) -> None:
    """Parts run these lines of Python instead, with the name of their file of findings as `out`."""

    def command(part, short, findings, folder) -> list[str]:
        lines = f"import os, signal, sys, time; out = open({str(findings)!r}, 'a', buffering=1)\n"
        if part.key == "doctor" and "doctor" not in scripts:
            return [sys.executable, "-c", lines + f"out.write({SOFTWARE!r})"]
        return [sys.executable, "-c", lines + scripts.get(part.key.replace("-", "_"), "")]

    monkeypatch.setattr(prove_gpu, "command_of", command)


@pytest.mark.slow
def test_the_whole_short_form_on_this_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, proof = proved(tmp_path, "--short")
    assert code == 0, capsys.readouterr().out
    assert [part["key"] for part in proof["parts"]] == [part.key for part in PARTS]
    lines = [json.loads(line) for line in (tmp_path / "figures.jsonl").read_text().splitlines()]
    assert {line["part"] for line in lines if "ended" not in line} == {"doctor", *MEASURED_PARTS}


@pytest.mark.hardware
def test_everything_holds_on_this_machines_gpu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with create_context() as context:
        if context.is_software:
            pytest.skip("no GPU draws here")
    assert proved(tmp_path)[0] == 0, capsys.readouterr().out


def test_a_driver_that_crashes_ends_one_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    crash = (
        'out.write(\'{"name": "first", "value": "fine"}\\n\'); print(\'mesa: error\', file=sys.stderr, flush=True)\n'
    )
    told(monkeypatch, programs=crash + "os.kill(os.getpid(), signal.SIGSEGV)", answers="sys.exit(2)")
    code, proof = proved(tmp_path)
    assert code == prove_gpu.FIRST_CODE + 1
    states = [part["state"] for part in proof["parts"]]
    assert states == ["holds", "crashed", "crashed", *["holds"] * (len(PARTS) - 3)]
    programs = proof["parts"][1]
    assert programs["findings"][0]["value"] == "fine"
    assert "SIGSEGV" in programs["detail"] and "mesa: error" in programs["detail"]
    assert proof["short"]  # since the processor draws
    assert "SIGSEGV" in capsys.readouterr().out


def test_figures_are_lines_of_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = '{"name": "prism, cold", "value": "first picture s 1.5", "figures": {"first_picture_s": 1.5}}\n'
    told(monkeypatch, start=f"out.write({found!r})")
    code, proof = proved(tmp_path, "--quick", "--short", "--parts", "camera,start")
    out = capsys.readouterr().out
    lines = [json.loads(line) for line in out.splitlines()]
    assert code == 0 and out == (tmp_path / "figures.jsonl").read_text()
    assert [line["part"] for line in lines if "ended" in line] == ["doctor", "camera", "start"]
    figures = [line for line in lines if line["part"] == "start" and "ended" not in line]
    assert figures == [{"part": "start", "name": "prism, cold", "first_picture_s": 1.5}]
    assert proof["quick"] and proof["short"]


def test_photons_of_a_frame_lie_on_the_line_through_what_was_measured() -> None:
    costs = [FrameCost(n, 0, 2e-9 * n, 1e-3 + 3e-9 * n, 2e-3) for n in (1 << 20, 1 << 17, 1 << 18)]
    assert photons_within(costs, 4e-3, with_camera=False) == pytest.approx(1e6, rel=1e-3)
    assert photons_within(costs, 4e-3, with_camera=True) == pytest.approx(1e6 / 3, rel=1e-3)
    assert photons_within(costs, 0.5e-3, with_camera=False) == 0


def test_what_does_not_hold_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told(monkeypatch, answers='out.write(\'{"name": "gap", "value": "off by a lot", "broken": true}\\n\')')
    code, proof = proved(tmp_path, "--parts", "answers,stress")
    assert code == prove_gpu.FIRST_CODE + 1
    assert [part["state"] for part in proof["parts"]] == ["holds", "broken", "holds"]
    assert "gap: off by a lot" in capsys.readouterr().out


def test_a_part_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told(monkeypatch, answers="time.sleep(60)")
    impatient = [replace(part, limit_s=(1.0, 1.0) if part.key == "answers" else part.limit_s) for part in PARTS]
    monkeypatch.setattr(prove_gpu, "PARTS", impatient)
    started = time.monotonic()
    code, proof = proved(tmp_path, "--parts", "answers,stress")
    assert time.monotonic() - started < 20.0
    assert code == prove_gpu.FIRST_CODE + 1
    assert [part["state"] for part in proof["parts"]] == ["holds", "too slow", "holds"]


def test_without_a_device_nothing_else_is_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told(monkeypatch, doctor='print("no OpenGL", file=sys.stderr); sys.exit(2)')
    code, proof = proved(tmp_path)
    assert code == prove_gpu.FIRST_CODE
    assert {part["state"] for part in proof["parts"][1:]} == {"not begun"}
    assert "no OpenGL" in proof["parts"][0]["detail"]


def test_a_device_that_lacks_something_is_measured_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacking = '{"name": "limit of something", "value": "missing", "broken": true}\n'
    told(monkeypatch, doctor=f"out.write({lacking + SOFTWARE!r})")
    code, proof = proved(tmp_path, "--parts", "answers")
    assert code == prove_gpu.FIRST_CODE
    assert [part["state"] for part in proof["parts"]] == ["broken", "holds"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_leaves_whole_lines(tmp_path: Path, number: signal.Signals) -> None:
    command = [sys.executable, "-P", "-m", "spectrasplat", "prove-gpu", "--quick", "--short", "-o", str(tmp_path)]
    heeding = partial(signal.signal, number, signal.SIG_DFL)  # which shells' background jobs do not
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, preexec_fn=heeding) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(0.5)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    lines = [json.loads(line) for line in (first + out).splitlines()]
    assert process.returncode == 128 + number and "what was found is kept" in err and "Traceback" not in err
    assert lines[-1]["ended"] == "stopped" and (tmp_path / "figures.jsonl").read_text() == first + out
    assert json.loads((tmp_path / "proof.json").read_text())["quick"]


def test_ctrl_c_keeps_what_was_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told(monkeypatch, answers='out.write(\'{"name": "gap", "value": "holds"}\\n\'); time.sleep(60)')
    real = prove_gpu._take_in

    def interrupted(file: Path, result: prove_gpu.PartResult, note: Callable[[Finding], None]) -> float:
        share = real(file, result, note)
        if result.state == "not begun" and any(finding.name == "gap" for finding in result.findings):
            raise KeyboardInterrupt
        return share

    monkeypatch.setattr(prove_gpu, "_take_in", interrupted)
    code, proof = proved(tmp_path, "--parts", "answers,stress")
    assert code == 130
    assert [part["state"] for part in proof["parts"]] == ["holds", "stopped", "not begun"]
    assert proof["parts"][1]["findings"][0]["name"] == "gap"


def test_bad_input_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove-gpu", "-o", str(tmp_path), "--parts", "answer"]) == 2
    assert "'answer' is no part" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    assert main(["prove-gpu", "-o", str(tmp_path / "file" / "x")]) == 2


def test_stored_pictures_tell_a_wrong_one() -> None:
    for name in SCENES:
        picture = stored()[name]
        assert np.all(np.isfinite(picture)) and picture.max() > 0.0
        assert block_error(picture, picture) == 0.0
        assert block_error(1.1 * picture, picture) > LARGEST_ERROR
        assert block_error(picture[:, ::-1], picture) > LARGEST_ERROR, name
        assert not block_error(np.where(picture == picture.max(), np.nan, picture), picture) <= LARGEST_ERROR
    for name in ("prism", "prism_case", "spectrometer"):
        assert block_error(stored()[name][..., ::-1], stored()[name]) > LARGEST_ERROR, name  # red for blue
