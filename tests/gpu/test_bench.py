"""The bench on the real renderer, small: rigs render again and again, and a tiny run ends in a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.base.errors import UserError
from spectrasplat.bench import runner
from spectrasplat.bench.measured_passes import LIGHT
from spectrasplat.bench.rendering import MethodRig
from spectrasplat.bench.results import BenchResult, Trial
from spectrasplat.bench.tuning import Tuning
from spectrasplat.commands.scenes import find_scene
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.colorimetry import rgb709_to_xyz
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render

WIDTH, HEIGHT = 64, 36

pytestmark = pytest.mark.usefixtures("commands_share_context")


@pytest.fixture(scope="module")
def prism() -> Scene:
    return load_scene(find_scene("prism"))


def test_a_rig_renders_what_render_does_again_and_again(gl: Any, prism: Scene) -> None:
    rig = MethodRig(gl, prism, "srd-photons", WIDTH, HEIGHT)
    try:
        first, other, again = rig.render(3000, 5), rig.render(700, 6), rig.render(3000, 5)
        budgets = rig.budgets(0.02, 4)
    finally:
        rig.release()
    settings = RenderSettings(
        width=WIDTH,
        height=HEIGHT,
        photons=3000,
        seed=5,
        layer="caustic",
        method="srd-photons",
        max_depth=prism.render.max_depth,
        spp=64,
    )
    picture = rgb709_to_xyz(render(prism, settings, context=gl).rgb.astype(float))
    assert np.allclose(first.xyz, picture, rtol=1e-4, atol=1e-5 * picture.max())
    assert np.allclose(
        again.xyz, first.xyz, rtol=1e-5, atol=1e-6 * picture.max()
    )  # nothing is left of the rendering between
    assert not np.allclose(other.xyz, first.xyz, rtol=0.05, atol=1e-3 * picture.max())
    assert set(first.seconds) == {"plan", *LIGHT.stages, "camera"} and all(
        seconds > 0.0 for seconds in first.seconds.values()
    )
    assert 0.5 * 3000 < first.emitted < 2 * 3000 and other.emitted < first.emitted and first.splats > 0
    assert set(rig.setup_seconds) == {"buffers", "compile", "pilot", "first run"} and rig.buffers_mib > 1.0
    assert budgets == sorted(set(budgets)) and 1 <= len(budgets) <= 4 and budgets[-1] >= 64


def test_a_rig_renders_all_passes_of_a_method_that_has_several(gl: Any, prism: Scene) -> None:
    rig = MethodRig(gl, prism, "progressive-stochastic", WIDTH, HEIGHT)
    try:
        one, three = rig.render(16_384, 2), rig.render(49_152, 2)
    finally:
        rig.release()
    assert three.emitted == pytest.approx(3 * one.emitted, rel=0.02)
    assert three.xyz.sum() == pytest.approx(one.xyz.sum(), rel=0.05)


def test_a_scene_that_throws_no_light_is_said(gl: Any, prism: Scene) -> None:
    dark = replace(prism, objects=tuple(o for o in prism.objects if type(o.material).__name__ != "Dielectric"))
    with pytest.raises(UserError, match="nothing to measure"):
        MethodRig(gl, dark, "srd", WIDTH, HEIGHT)
    with pytest.raises(UserError, match="nothing to measure"):
        MethodRig(gl, replace(prism, lights=()), "srd", WIDTH, HEIGHT)


def test_a_tiny_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Two methods against the real reference of a third of a second, through the command line."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(runner, "POINTS", 3)
    # On a loaded machine the smallest budget alone may take the time asked for; what a rig proposes is tested above,
    # what is made of it in test_bench_tuning.
    budgets = [256, 2048, 16_384]
    trials = [Trial(256, kernel, 0.01, 0.5 * kernel) for kernel in (0.45, 0.9)]
    monkeypatch.setattr(
        runner, "tune", lambda rig, *_: Tuning(budgets, [0.45] * 3, trials) if rig.kernels else Tuning(budgets, [], [])
    )
    monkeypatch.setattr("spectrasplat.bench.machine.program_hash", lambda: "as it is")  # an editor may be at work
    out = tmp_path / "out"
    options = f"--seconds 0.2 --seeds 2 --methods stochastic,srd --size {WIDTH}x{HEIGHT}"
    arguments = ["bench", "prism", "-o", str(out), *options.split()]
    assert main([*arguments, "--reference-seconds", "0.3"]) == 0
    shown = capsys.readouterr().out
    result = msgspec.json.decode((out / "results.json").read_bytes(), type=BenchResult)
    (scene,) = result.scenes
    assert scene.complete and [curve.method for curve in scene.curves] == ["stochastic", "srd"]
    assert scene.reference is not None and scene.reference.photons > 1000 and 0.0 < scene.reference.relmse < 1.0
    for curve in scene.curves:
        assert len(curve.samples) == 2 * len(curve.budgets) == 2 * len(curve.points)
        assert all(
            0.8 < sample.metrics["energy_ratio"] < 1.2
            for sample in curve.samples
            if sample.photons == max(curve.budgets)
        )  # 0.3 s of reference: its energy is known to a few %
        assert curve.points[-1].relmse <= curve.points[0].relmse
    assert "tail slope" in shown
    assert (out / "report.html").stat().st_size > 10_000 and (out / "plots" / "scenes.svg").exists()
    before = (out / "results.json").read_bytes()
    monkeypatch.setattr("spectrasplat.bench.report.report.write_report", lambda *_: None)
    assert main([*arguments, "--reference-seconds", "0.3"]) == 0  # all is there already
    assert (out / "results.json").read_bytes() == before
