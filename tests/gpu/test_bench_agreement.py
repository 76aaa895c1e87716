"""bench-agreement through the command line: beams agree with the reference, a broken method does not."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from spectrasplat.__main__ import main
from spectrasplat.bench.agreement import SceneAgreement
from spectrasplat.render import handed_rays

pytestmark = pytest.mark.slow


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
    monkeypatch.setattr(handed_rays, "_TAIL_SHARE", 0.0)
    less = found(tmp_path / "less")
    assert less.energy < whole.energy and less.blocks.chi2 > 2.0 * whole.blocks.chi2


def test_what_cannot_be_compared_is_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench-agreement", "prism", "--seeds", "1"]) == 2
    assert main(["bench-agreement", "prism", "--method", "srdd"]) == 2
    said = capsys.readouterr().err
    assert "--seeds 1 is out of range" in said and "--method 'srdd'" in said
