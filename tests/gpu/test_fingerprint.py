"""The net that changes of shaders are held against: it is the same twice, and a mistake in a shader is named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from spectrasplat.__main__ import main
from spectrasplat.bench.fingerprint import CASES, differences, scene_files

from tests.gpu.mutants import mutate

CASES_HERE = "srd-photons,caustic,viewer"


@pytest.mark.slow
def test_fingerprints_are_the_same_twice_and_name_a_mutant(tmp_path: Path, monkeypatch, capsys) -> None:
    """A mutant of Fresnel's law changes the programs that reflect and all that they draw, and no others."""
    file = tmp_path / "before.json"
    arguments = ["fingerprint", "prism", "ball", "--cases", CASES_HERE]
    assert main([*arguments, "-o", str(file)]) == 0
    found = json.loads(file.read_text())["scenes"]
    assert [(scene, ",".join(cases)) for scene, cases in found.items()] == [("prism", CASES_HERE), ("ball", CASES_HERE)]
    assert found["prism"]["srd-photons"]["photon records"] != found["ball"]["srd-photons"]["photon records"] != []
    capsys.readouterr()
    assert main([*arguments, "--against", str(file)]) == 0
    assert capsys.readouterr().out.count("\n") == 1

    mutate(monkeypatch, tmp_path, "lib/optics.glsl", "0.5 * (", "0.51 * (")
    assert main([*arguments, "--against", str(file)]) == 1
    told = capsys.readouterr().out.splitlines()
    for what in ("program light/trace.comp", "photon records", "caustic maps", "camera samples"):
        assert f"prism, srd-photons: {what}" in told
    assert not any("light/queue_scan.comp" in line for line in told)


def test_a_case_and_a_scene_must_be_there(capsys) -> None:
    assert main(["fingerprint", "prism", "--cases", "srdd", "--against", "x"]) == 2
    assert "did you mean 'srd'" in capsys.readouterr().err
    assert main(["fingerprint", "prism"]) == 2
    assert "-o FILE" in capsys.readouterr().err


def test_white_space_aside_everything_counts() -> None:
    assert set(scene_files()) >= {"prism", "lessons/newton"} and {"srd", "viewer"} <= set(CASES)
    before = {"program a": ["1"], "caustic maps": ["2"]}
    after = {"program a": ["1"], "program b": ["4"], "caustic maps": ["3"]}
    assert differences(before, after, texts_only=False) == ["caustic maps", "program b"]
    assert differences(before, after, texts_only=True) == ["program b"]
