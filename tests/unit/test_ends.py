"""How the program ends: by signals, with nothing to print to, and with full disks at each of its outputs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.interrupts import Interruption, Terminated, exit_code_of, interrupt_flag, signals_raise

from tests.fuzz.kills import SCENE

TINY = ["render", "scene.toml", "-o", "out.npy", "--size", "16x9", "--photons", "1k", "--spp", "1"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path


def test_signals_become_exit_codes() -> None:
    assert [exit_code_of(e) for e in (KeyboardInterrupt(), Terminated(15), Terminated(1))] == [130, 143, 129]
    assert Interruption().exit_code == 0
    with signals_raise(), pytest.raises(Terminated, match="SIGTERM"):
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


@pytest.fixture
def minded() -> Iterator[None]:
    """Under nohup SIGHUP is ignored from the start, and the program leaves it so."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("minded")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_signal_asks_and_the_second_insists(number: int, capsys: pytest.CaptureFixture[str]) -> None:
    with interrupt_flag() as interrupted:
        assert not interrupted()
        os.kill(os.getpid(), number)
        assert interrupted() and interrupted.exit_code == 128 + number
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert "what is done will be written" in capsys.readouterr().err


def test_a_signal_while_something_is_imported_ends_the_process_at_once(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGTERM)\n")
    script = (
        "from spectrasplat.base.atomic import atomic_output\n"
        "from spectrasplat.base.interrupts import signals_raise\n"
        "with signals_raise(), atomic_output('a.png'):\n"
        "    import slow\n"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 143 and done.stderr == "spectrasplat: interrupted\n"
    assert not [path for path in tmp_path.iterdir() if "part" in path.name]


def test_what_nohup_ignores_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with signals_raise(), interrupt_flag() as interrupted:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not interrupted()
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize(
    ("redirected", "code"),
    [(">/dev/full", 1), ("2>/dev/full", 0), (">&- 2>&- <&-", 0)],
)
def test_the_picture_is_there_whatever_becomes_of_what_is_printed(folder: Path, redirected: str, code: int) -> None:
    command = f'"{sys.executable}" -m spectrasplat {" ".join(TINY)} {redirected}'
    done = subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == code and "Traceback" not in done.stderr
    assert np.load(folder / "out.npy").shape == (9, 16, 3)
    if redirected == ">/dev/full":
        assert done.stderr.splitlines()[-1].startswith("spectrasplat: what was to be printed is lost: No space left")


def test_an_error_of_the_disk_elsewhere_is_still_a_bug(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_arguments: object) -> int:
        raise OSError(5, "Input/output error", "somewhere")

    monkeypatch.setattr("spectrasplat.commands.program.run", fail)
    with pytest.raises(OSError, match="somewhere"):
        main(["doctor"])
