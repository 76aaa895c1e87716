"""What the farm commands and sweep refuse, in a sentence, before anything is rendered; and what a sweep comes to."""

from __future__ import annotations

import builtins
import os
from pathlib import Path
from typing import Any

import pytest
import spectrasplat as ss
from spectrasplat.__main__ import main
from spectrasplat.commands.scenes import find_scene
from spectrasplat.commands.sweep import parse_set, plan_words
from spectrasplat.edit.parameters import Stage
from spectrasplat.farm import cluster
from spectrasplat.farm.cluster import PIP_LINE
from spectrasplat.farm.jobs import held
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.sweep import SweepPlan, points_of

GAIN = "objects.prism.dispersion_gain=0:3:31"


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The sentence of a command that must fail."""
    assert main([str(argument) for argument in arguments]) == 2
    told = capsys.readouterr().err
    assert "Traceback" not in told
    return told


def test_without_dask_there_is_the_line_that_installs_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def without(name: str, *more: Any, **named: Any) -> Any:
        if name.split(".")[0] in ("dask", "distributed"):
            raise ImportError(f"No module named '{name}'")
        return real(name, *more, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    out = tmp_path / "a.exr"
    for arguments in (
        ("farm", "render", "lens", "-o", out),
        ("farm", "animate", "lens", "-o", tmp_path / "frames"),
        ("sweep", "prism", "--set", "objects.prism.n_d=1.5,1.6", "--workers", "2", "-o", tmp_path / "sweep"),
    ):
        assert PIP_LINE in refusal(capsys, *arguments)
    with pytest.raises(ss.UserError, match="farms need Dask"):
        ss.sweep(ss.load("prism"), {"objects.prism.n_d": [1.5, 1.6]}, workers=2)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--workers", "0"), "--workers 0 is out of range"),
        (("--workers", "2", "--scheduler", "tcp://a:1"), "--workers and --scheduler exclude each other"),
        (("--scheduler", "nonsense"), "is no address: check the address, which looks like tcp://10.0.0.1:8786"),
        (("--scheduler", "tcp://127.0.0.1:1"), "no scheduler answers at 'tcp://127.0.0.1:1'"),
        (("--parts", "0"), "--parts 0 is out of range"),
        (("-o", "a.bmp"), "is not a picture format"),
    ],
)
def test_a_farm_that_cannot_be_is_a_sentence(
    arguments: tuple[str, ...],
    sentence: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    assert sentence in refusal(capsys, "farm", "render", "prism", "-o", "a.exr", *arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="locks are those of POSIX")
def test_two_farms_on_one_folder_is_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.exr"
    with held(tmp_path / "a.exr.parts", out):
        told = refusal(capsys, "farm", "render", "prism", "--workers", "1", "-o", out)
        assert f"another farm is at work on {out} (process {os.getpid()} on " in told
    with held(tmp_path / "frames", tmp_path / "frames"):
        for command in (("farm", "animate", "prism", "--workers", "1"), ("sweep", "prism", "--set", GAIN)):
            assert "another farm is at work on" in refusal(capsys, *command, "-o", tmp_path / "frames")
    assert list(tmp_path.iterdir()) == [], "and what is empty is not left"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("objects.prism.dispersion_gain", "is no sweep: give PARAMETER=FROM:TO:COUNT"),
        ("objects.prism.dispersion_gain=0:3", "is no sweep"),
        ("objects.prism.dispersion_gain=0:3:1", "asks for 1 values"),
        ("objects.prism.dispersion_gain=a,b", "is no sweep"),
        ("objects.prism.dispersion_gain=1,1", "gets a value twice"),
        ("objects.prism.dispersion_gain=-1,1", "is out of range"),
        ("objects.prism.gain=0:3:4", "is no parameter of scene 'prism'"),
        ("camera.orbit_deg=0:90:100000", "give at most 100000"),
    ],
)
def test_a_sweep_that_cannot_be_is_a_sentence(
    text: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = ("--set", "lights.slit.power=1,2")
    assert sentence in refusal(capsys, "sweep", "prism", "--set", text, *more, "-o", tmp_path / "a")
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize(
    ("sets", "exact", "groups", "keeps", "told"),
    [
        (
            (GAIN,),
            False,
            1,
            True,
            "31 points from one store of photons: light is traced once, so that there is nothing",
        ),
        ((GAIN,), True, 31, False, "31 points, each traced anew, spread over 4 workers"),
        (("objects.prism.n_d=1.5:1.8:4",), False, 4, False, "4 points, each traced anew, spread over 4 workers"),
        (("objects.prism.position.x=0,1",), False, 2, False, "2 points, each traced anew"),
        (("lights.slit.power=1,2",), False, 1, True, "2 points from one store of photons"),
        (("lights.slit.rotation.z=0:9:5", GAIN), False, 5, True, "155 points from 5 stores of photons, spread over 4"),
        (("camera.orbit_deg=0:90:4",), False, 1, False, "4 points that differ by the camera alone"),
    ],
)
def test_a_sweep_knows_what_one_store_of_photons_serves(
    sets: tuple[str, ...], exact: bool, groups: int, keeps: bool, told: str
) -> None:
    scene = load_scene(find_scene("prism"))
    start = Stage(scene, scene.camera)
    points = points_of(start, dict(parse_set(text, start) for text in sets))
    plan = SweepPlan.of(points, RenderSettings(), exact)
    assert (len(plan.groups), plan.keeps_photons) == (groups, keeps)
    assert plan_words(plan, 4).startswith(told)
    assert sorted(point.number for group in plan.groups for point in group.points) == list(range(len(points)))
    follows = "first order" in plan_words(plan, 4)
    assert follows == (GAIN in sets and not exact)


def test_photons_are_traced_through_the_middle_of_the_dispersion() -> None:
    """Never through a glass that has none: its photons would carry no column to follow."""
    scene = load_scene(find_scene("prism"))
    start = Stage(scene, scene.camera)
    (group,) = SweepPlan.of(points_of(start, dict([parse_set(GAIN, start)])), RenderSettings(), False).groups
    gains = [item.material.dispersion.gain for item in group.anchor.scene.objects if item.material.transmits]
    assert gains == [pytest.approx(1.5)]
