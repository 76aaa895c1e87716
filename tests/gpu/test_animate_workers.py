"""Several processes fill one folder with the frames of one animation: none is made twice, none is lost, all share one
exposure."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.movie import Frames

COUNT = 6
ASKED = ("prism", "--set", "objects.prism.dispersion_gain=0:3", "--size", "48x27", "--photons", "20k", "--spp", "2")
"""Every frame is traced, and the last ones are dimmer than the first: an exposure of their own would show."""
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks are those of POSIX")


def arguments(folder: Path, frames: str) -> list[str]:
    """Of the command."""
    return ["animate", *ASKED, "--frames", frames, "-o", str(folder)]


def worker(folder: Path, frames: str) -> subprocess.Popen[str]:
    """One more process."""
    command = [sys.executable, "-m", "spectrasplat", *arguments(folder, frames)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def frames_of(folder: Path) -> dict[str, bytes]:
    """What is in the folder, but for its description."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != ".json"}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """By one process."""
    folder = tmp_path_factory.mktemp("whole") / "frames"
    assert main(arguments(folder, str(COUNT))) == 0
    return frames_of(folder)


@pytest.mark.slow
def test_ranges_are_the_frames_of_the_whole(whole: dict[str, bytes], tmp_path: Path) -> None:
    """The last first: its exposure is still the first frame's."""
    assert main(arguments(tmp_path / "a", f"4-5/{COUNT}")) == 0
    assert sorted(frames_of(tmp_path / "a")) == ["0004.png", "0005.png"]
    assert main(arguments(tmp_path / "a", f"0-3/{COUNT}")) == 0
    assert frames_of(tmp_path / "a") == whole


@pytest.mark.slow
def test_workers_that_meet_make_every_frame_once(whole: dict[str, bytes], tmp_path: Path) -> None:
    workers = [worker(tmp_path / "a", str(COUNT)) for _ in range(3)]
    told = [process.communicate(timeout=300) for process in workers]
    assert [process.returncode for process in workers] == [0, 0, 0], told
    assert frames_of(tmp_path / "a") == whole


@pytest.mark.slow
def test_a_killed_workers_frame_is_made_by_another(whole: dict[str, bytes], tmp_path: Path) -> None:
    folder = tmp_path / "a"
    killed = worker(folder, str(COUNT))
    while not list(folder.glob(".*.claim")) and killed.poll() is None:
        time.sleep(0.02)
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    assert len(list(folder.glob("*.png"))) < COUNT
    assert main(arguments(folder, str(COUNT))) == 0
    assert frames_of(folder) == whole


def test_a_frame_in_other_hands_is_left_alone(tmp_path: Path) -> None:
    mine, other = (Frames(tmp_path, {"fps": 24.0}) for _ in range(2))
    assert mine.fix_exposure(0.5) == 0.5
    assert other.fix_exposure(0.7) == 0.5, "the first to say so decides"
    with mine.claimed(0) as is_mine:
        assert is_mine
        with other.claimed(0) as is_others:
            assert not is_others
        other.close()  # which removes what the dead left, and no living claim
        with other.claimed(0) as is_others:
            assert not is_others
        mine.write(0, np.zeros((2, 2, 3), np.uint8))
    with other.claimed(0) as is_others:
        assert not is_others and other.has(0)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0000.png", "animation.json"]


@pytest.mark.parametrize(
    ("frames", "sentence"),
    [
        ("5-2", "runs backwards"),
        ("5-", "is no range"),
        ("0-9/5", "goes beyond the animation, whose 5 frames are 0 to 4"),
        ("100-200", "as in 100-200/201"),
        ("a-b", "is not a whole number"),
    ],
)
def test_what_is_asked_wrongly_is_a_sentence(
    frames: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments(tmp_path / "a", frames)) == 2
    assert sentence in capsys.readouterr().err
