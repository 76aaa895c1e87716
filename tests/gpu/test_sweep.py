"""Sweeps: one store of photons serves all dispersions of a glass, other points are traced; here or on workers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from spectrasplat.__main__ import main

GAINS = [0.0, 1.0, 3.0]
GAIN = "objects.prism.dispersion_gain"
ASKED = ("--size", "64x36", "--photons", "50k", "--spp", "8")


@pytest.mark.slow
def test_a_dispersion_sweep_traces_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = ss.load("prism")
    points = list(ss.sweep(scene, {GAIN: GAINS}, size=(64, 36), photons=50_000, spp=8))
    assert [(point.number, point.values[GAIN]) for point in points] == list(enumerate(GAINS))
    assert [point.picture.stats.photons_traced > 0 for point in points] == [True, False, False]
    # What follows is near to what is traced anew, nearer than to another dispersion.
    scene.objects["prism"].dispersion_gain = 3.0
    traced = ss.render(scene, size=(64, 36), photons=50_000, spp=8).rgb
    near, far = (np.sqrt(((points[k].picture.rgb - traced) ** 2).mean()) / traced.mean() for k in (2, 1))
    assert near < 0.25 * far

    folder = tmp_path / "sweep"
    command = ["sweep", "prism", "--set", f"{GAIN}=0,1,3", *ASKED, "--format", "npy", "-o", str(folder)]
    assert main(command) == 0
    told = capsys.readouterr()
    assert "3 points from one store of photons" in told.err and "3 of 3 pictures" in told.out
    index = json.loads((folder / "sweep.json").read_text())
    assert [(row["file"], row[GAIN]) for row in index["pictures"]] == [
        ("0000.npy", 0),
        ("0001.npy", 1),
        ("0002.npy", 3),
    ]
    for point in points:
        assert np.array_equal(np.load(folder / f"{point.number:04}.npy"), point.picture.rgb)
    # What is there stays; another sweep is refused.
    (folder / "0001.npy").unlink()
    before = (folder / "0002.npy").stat().st_mtime_ns
    assert main(command) == 0
    assert "(2 were there)" in capsys.readouterr().out and (folder / "0002.npy").stat().st_mtime_ns == before
    assert main([*command[:3], f"{GAIN}=0,2", *command[4:]]) == 2
    assert "holds frames of another sweep" in capsys.readouterr().err


@pytest.mark.slow
def test_a_light_sweep_on_workers_is_that_of_one_process(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="pip install '.[farm]'")
    grid = {"lights.slit.rotation.z": [0.0, 4.0], "camera.orbit_deg": [0.0, 20.0]}
    wanted = {"size": (48, 27), "photons": 20_000, "spp": 2}
    here = {p.number: p for p in ss.sweep(ss.load("prism"), grid, **wanted)}
    there = {p.number: p for p in ss.sweep(ss.load("prism"), grid, workers=2, **wanted)}
    assert sorted(here) == sorted(there) == [0, 1, 2, 3]
    assert sum(point.picture.stats.photons_traced > 0 for point in here.values()) == 2
    for number, point in here.items():
        assert point.values == there[number].values
        assert np.array_equal(point.picture.rgb, there[number].picture.rgb)
    assert main(["sweep", "prism", "--set", "lights.slit.rotation.z=0,4", *ASKED, "--workers", "2",
                 "-o", str(tmp_path / "a")]) == 0  # fmt: skip
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["0000.png", "0001.png", "sweep.json"]


@pytest.mark.slow
def test_a_sweep_can_be_left(tmp_path: Path) -> None:
    points = ss.sweep(ss.load("prism"), {"objects.prism.n_d": [1.5, 1.6, 1.7]}, size=(32, 18), photons=10_000, spp=1)
    assert next(points).number == 0
    points.close()
    with pytest.raises(ss.UserError, match="gets no value"):
        ss.sweep(ss.load("prism"), {"objects.prism.n_d": []})
