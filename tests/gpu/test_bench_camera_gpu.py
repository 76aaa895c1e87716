"""The bench of the camera pass on the real renderer, small: rigs look again and again, and a tiny run ends in a
report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from spectrasplat.__main__ import main
from spectrasplat.bench import camera_rendering, runner, subjects
from spectrasplat.bench.camera_rendering import CameraRig, SharedLight
from spectrasplat.bench.rendering import NothingToMeasure
from spectrasplat.bench.results import BenchResult
from spectrasplat.commands.scenes import find_scene
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.reference.spectral_caustic import CausticPlan

WIDTH, HEIGHT = 48, 27
PHOTONS = 1 << 14

pytestmark = pytest.mark.usefixtures("commands_share_context")


@pytest.fixture(scope="module")
def ball() -> Scene:
    """A flint ball before its caustic, with few triangles."""
    return load_scene(find_scene("ball_caustic"))


def test_where_nothing_disperses_there_is_nothing_to_measure(gl: Any) -> None:
    plain = load_scene(find_scene("ball_plain"))
    light = SharedLight(gl, replace(plain, lights=()), WIDTH, HEIGHT, lambda _: None, PHOTONS)
    assert light.maps is None and light.seconds == 0.0
    with pytest.raises(NothingToMeasure, match="nothing to measure"):
        CameraRig(gl, plain, "srd", WIDTH, HEIGHT, light)


@pytest.mark.slow
def test_a_tiny_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Two methods against the real reference of one second, through the command line: a prism before an edge."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(runner, "POINTS", 3)
    monkeypatch.setattr(camera_rendering, "LIGHT_PHOTONS", PHOTONS)
    monkeypatch.setattr(subjects, "caustic_plan", lambda _: CausticPlan(1 << 16))
    monkeypatch.setattr("spectrasplat.bench.machine.program_hash", lambda: "as it is")  # an editor may be at work
    out = tmp_path / "out"
    options = f"--seconds 0.4 --seeds 2 --methods stochastic,srd --size {WIDTH}x{HEIGHT}"
    arguments = ["bench", "--eye", "prism_edge", "-o", str(out), *options.split()]
    assert main([*arguments, "--reference-seconds", "1"]) == 0
    shown = capsys.readouterr().out
    result = msgspec.json.decode((out / "results.json").read_bytes(), type=BenchResult)
    (scene,) = result.scenes
    assert (
        scene.complete
        and scene.measured_pass == result.settings.measured_pass == "camera"
        and [curve.method for curve in scene.curves] == ["stochastic", "srd"]
    )
    assert scene.reference is not None and scene.reference.photons >= 8 and 0.0 < scene.reference.relmse < 0.1
    for curve in scene.curves:
        assert len(curve.samples) == 2 * len(curve.budgets) == 2 * len(curve.points)
        assert all(
            sample.emitted == sample.photons and 0.97 < sample.metrics["energy_ratio"] < 1.03
            for sample in curve.samples
            if sample.photons == max(curve.budgets)
        )
    assert scene.curves[0].points[-1].relmse < scene.curves[0].points[0].relmse
    assert "samples" in shown
    assert set(scene.pictures) == {
        "reference",
        *(f"{method}{ending}" for method in ("stochastic", "srd") for ending in ("", " early", " first")),
    }
    assert (out / "report.html").stat().st_size > 10_000 and (out / "plots" / "prism_edge_error_samples.svg").exists()
    assert main(["bench", *arguments[2:]]) == 2  # the folder holds the other half
    assert "the camera pass measured instead of the light pass" in capsys.readouterr().err
