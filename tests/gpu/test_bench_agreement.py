"""bench-agreement through the command line: beams agree with the reference, a broken method does not."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from spectrasplat.__main__ import main
from spectrasplat.bench.agreement import SceneAgreement
from spectrasplat.render import pass_rounds

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("commands_share_context")]


def found(folder: Path, *more: str) -> SceneAgreement:
    arguments = ["bench-agreement", "two_stones", "-o", str(folder), "--size", "80x45", "--seeds", "4"]
    assert main([*arguments, "--photons", "50k", "--reference-seconds", "20", *more]) == 0
    (scene,) = msgspec.json.decode((folder / "agreement.json").read_bytes(), type=list[SceneAgreement])
    return scene


def test_beams_agree_and_beams_without_their_tail_do_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    whole = found(tmp_path / "whole")
    assert whole.energy == pytest.approx(1.0, abs=0.01) and whole.blocks.deviation < 0.02
    assert "two_stones" in capsys.readouterr().out
    monkeypatch.setattr(pass_rounds, "_TAIL_SHARE", 0.0)
    less = found(tmp_path / "less")
    assert less.energy < whole.energy and less.blocks.chi2 > 2.0 * whole.blocks.chi2


def test_what_cannot_be_compared_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench-agreement", "prism", "--seeds", "1"]) == 2
    assert main(["bench-agreement", "prism", "--method", "srdd"]) == 2
    said = capsys.readouterr().err
    assert "--seeds 1 is out of range" in said and "--method 'srdd'" in said


def test_scenes_drawn_by_chance_have_their_rows_and_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    options = ["--size", "48x27", "--photons", "10k", "--seeds", "2", "--reference-seconds", "2", "-o", str(tmp_path)]
    assert main(["bench-agreement", "--random", "2", "--random-seed", "4", *options]) == 0
    scenes = msgspec.json.decode((tmp_path / "agreement.json").read_bytes(), type=list[SceneAgreement])
    printed = capsys.readouterr()
    for number in range(2):
        name = f"random_4_{number}"
        assert (tmp_path / f"{name}.toml").is_file()
        # A scene whose caustic nobody sees is a note.
        assert (name in printed.out) != (name in printed.err and "note" in printed.err)
    assert {scene.scene for scene in scenes} <= {"random_4_0", "random_4_1"}
