"""`spectrasplat stress` from the command line: bad input, exit codes, files; no case of the real sweep is run."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from spectrasplat.__main__ import main
from spectrasplat.stress import runner
from spectrasplat.stress.case import Case, Measurement


def made_up(*measurements: Measurement, fails: BaseException | None = None) -> tuple[Case, ...]:
    def measured(_: object, sweep: range) -> Iterator[Measurement]:
        yield from measurements
        if fails is not None:
            raise fails

    sweep = range(len(measurements) + (fails is not None))
    return (Case("made-up", "a made-up case", "to see what comes of it", "severity", measured, sweep),)


GOOD = Measurement(1.0, "one", 0, {"energy": 1e-4}, {"energy": 1e-3})
BAD = Measurement(2.0, "two", 0, {"energy": 1e-2}, {"energy": 1e-3})


@pytest.mark.parametrize(
    ("cases", "code", "partial", "said"),
    [
        (made_up(GOOD), 0, False, "every promise holds"),
        (made_up(GOOD, BAD), 1, False, "1 promise broken"),
        (made_up(GOOD, fails=RuntimeError("oh")), 1, False, "1 promise broken"),
        (made_up(GOOD, fails=KeyboardInterrupt()), 130, True, "every promise measured so far holds"),
        (made_up(BAD, fails=KeyboardInterrupt()), 1, True, "1 promise broken"),
    ],
)
def test_the_exit_code_is_the_verdict(
    monkeypatch, capsys, tmp_path: Path, cases: tuple[Case, ...], code: int, partial: bool, said: str
) -> None:
    monkeypatch.setattr(runner, "all_cases", lambda: cases)
    assert main(["stress", "-o", str(tmp_path / "new" / "folder")]) == code
    assert said in capsys.readouterr().out
    held = json.loads((tmp_path / "new" / "folder" / "stress.json").read_text(encoding="utf-8"))
    assert held["partial"] is partial
    assert held["command"] == "spectrasplat stress -o folder"
    assert (tmp_path / "new" / "folder" / "stress.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert sorted(p.name for p in (tmp_path / "new" / "folder").iterdir()) == ["stress.html", "stress.json"]


def test_without_a_folder_nothing_is_written(monkeypatch, capsys, tmp_path: Path) -> None:
    monkeypatch.setattr(runner, "all_cases", lambda: made_up(GOOD))
    monkeypatch.chdir(tmp_path)
    assert main(["stress"]) == 0
    assert "energy 1.0e−4 / 1.0e−3" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_list_names_every_case(capsys) -> None:
    assert main(["stress", "--list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in ("tir-margin", "contacts", "shipped", "prism/scale"))


def test_scenes_are_swept_alone(capsys) -> None:
    assert main(["stress", "prism", "water", "--list"]) == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert {name.split("/")[0] for name in names} == {"prism", "water"} and len(names) == 22


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["prims"], "did you mean 'prism'"),
        (["missing.toml"], "scene file missing.toml does not exist"),
        (["prism", "--cases", "prism/scales"], "did you mean 'prism/scale'"),
        (["prism", "prism"], "another scene of this run is called 'prism' too"),
        (["--cases", ""], "names no case"),
        (["-o", "/dev/null/folder"], "cannot make the folder"),
        (["--speed"], "no such option"),
    ],
)
def test_bad_input_is_one_sentence(capsys, arguments: list[str], said: str) -> None:
    assert main(["stress", *arguments]) == 2
    told = capsys.readouterr().err
    assert said.lower() in told.lower() and told.count("\n") == 1 and "Traceback" not in told
