"""Bad input of `animate` and `bake`: one sentence, exit code 2, nothing left behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.movie import MANIFEST, Frames

GAIN = "objects.prism.dispersion_gain"
CASES = {
    "no frames": (["--frames", "0"], ("--frames 0", "between 1")),
    "frames text": (["--frames", "many"], ("--frames 'many'", "whole number")),
    "no rate": (["--fps", "0"], ("--fps 0 ", "between 0.1 and 240")),
    "rate text": (["--fps", "fast"], ("--fps 'fast'",)),
    "size": (["--size", "9x"], ("--size '9x'", "960x540")),
    "parameter": (["--set", "objects.prism.dispersoin_gain=0:3"], ("--set", GAIN)),
    "range": (["--set", f"{GAIN}=-1:3"], (f"{GAIN} = -1", "between 0 and 100")),
    "not a range": (["--set", f"{GAIN}=3"], ("FROM:TO",)),
    "twice": (["--set", f"{GAIN}=0:1", "--set", f"{GAIN}=0:2"], (GAIN, "given twice")),
    "turns twice": (["--turntable", "--set", "camera.orbit_deg=0:90"], ("--turntable", "camera.orbit_deg")),
    "keys missing": (["--keys", "gone.toml"], ("gone.toml", "check the path")),
}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_bytes(b"mine")
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "cat.png").write_bytes(b"mine")
    return tmp_path


def refused(arguments: list[str], told: tuple[str, ...], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = [line for line in captured.err.splitlines() if not line.startswith("note: ")]
    assert line.startswith("spectrasplat: ")
    assert [part for part in told if part not in line] == []
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("name", CASES)
def test_options(name: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options, told = CASES[name]
    refused(["animate", "prism", "-o", "out.mp4", *options], told, here, capsys)


@pytest.mark.parametrize(
    ("output", "told"),
    [
        ("out.avi", ("'.avi'", "use .mp4, .gif, .webp, or a folder")),
        ("gone/out.mp4", ("does not exist",)),
        ("gone/out.webp", ("does not exist",)),
        ("file", ("it is a file",)),
        ("pictures", ("pictures of something else", "--overwrite")),
    ],
)
def test_outputs(output: str, told: tuple[str, ...], here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(["animate", "prism", "-o", output, "--size", "16x16"], told, here, capsys)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["prism", "tabel", "-o", "m.exr"], ("'tabel'", "did you mean 'table'")),
        (["prism", "prism", "-o", "m.exr"], ("no receiver", "'table'")),
        (["prism", "table", "-o", "m.tif"], ("'.tif'", ".exr")),
        (["prism", "table", "-o", "gone/m.exr"], ("does not exist",)),
        (["prism", "table", "-o", "m.exr", "--size", "0x4"], ("--size 0x4",)),
        (["prizm", "table", "-o", "m.exr"], ("'prizm'", "'prism'")),
    ],
)
def test_bake(arguments: list[str], told: tuple[str, ...], here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(["bake", *arguments], told, here, capsys)


@pytest.mark.parametrize("base_ev", ["NaN", "Infinity", '"0.5"', "[1]", "true"])
def test_a_manifest_whose_exposure_is_none_draws_all_frames_again(tmp_path: Path, base_ev: str) -> None:
    told = {"fps": 24.0}
    frames = Frames(tmp_path, told)
    frames.fix_exposure(0.5)
    frames.write(0, np.zeros((2, 3, 3), np.uint8))
    assert Frames(tmp_path, told).has(0)
    (tmp_path / MANIFEST).write_text(f'{{"fps": 24.0, "base_ev": {base_ev}}}')
    again = Frames(tmp_path, told)
    assert again.base_ev is None and not again.has(0)
