"""Beams in stills: the same picture as by paths, and when they are chosen at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.__main__ import main
from spectrasplat.beams import camera_view
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import variants
from spectrasplat.render import camera_beams
from spectrasplat.render.camera_beams import CameraBeamStats
from spectrasplat.render.still import RenderResult, render

pytestmark = pytest.mark.slow  # camera beams are off unless asked for

SCENES = Path(__file__).parents[2] / "assets" / "scenes"


def seen(gl, name: str, **settings) -> RenderResult:
    chosen = {"camera_beams": True, "photons": 20_000, "width": 96, "height": 54} | settings
    return render(load_scene(SCENES / f"{name}.toml"), RenderSettings(**chosen), context=gl)


@pytest.fixture
def beams_at_all_costs(monkeypatch):
    monkeypatch.setattr(CameraBeamStats, "predicted_seconds", lambda *_: (0.0, 1.0))
    monkeypatch.setattr(camera_beams, "_MOST_LOOKING", 1e9)


@pytest.mark.parametrize("name", ["default", "prism"])
def test_beams_show_what_paths_show(gl, beams_at_all_costs, monkeypatch, name):
    paths, beams = seen(gl, name, camera_beams=False, spp=64), seen(gl, name)
    assert beams.stats.camera_pass.beams.by_beams and beams.stats.camera_pass.beams.polygons > 100
    assert any("by beams" in line for line in beams.stats.lines())
    np.testing.assert_allclose(beams.rgb.mean((0, 1)), paths.rgb.mean((0, 1)), rtol=0.01)
    find = camera_view.search
    monkeypatch.setattr(camera_view, "search", lambda *args, **more: find(*args[:3], 1, *args[4:], **more))
    assert np.array_equal(beams.rgb, seen(gl, name).rgb)


def test_other_methods_follow_paths(gl, beams_at_all_costs):
    for settings in ({"camera_method": "srd-lambda"}, {"method": "srd-lambda"}, {"camera_beams": False}):
        assert seen(gl, "prism", spp=1, **settings).stats.camera_pass.beams is None


def test_where_in_doubt_paths(gl, monkeypatch):
    """A prism that fills the picture: paths through it are short, and beams cost hardly less."""
    assert seen(gl, "prism_edge").stats.camera_pass.beams.by_beams
    monkeypatch.setattr(camera_beams, "_SURE", 0.5)
    stats = seen(gl, "prism_edge").stats.camera_pass.beams
    assert not stats.by_beams and "s predicted" in stats.reason


def test_costs_are_told_by_counts():
    stats = CameraBeamStats(beams=1000, entries=500, starts=100, covered=50.0)
    beams, paths = stats.predicted_seconds(16)
    costs = camera_beams._BEAM_S, camera_beams._ENTRY_S, camera_beams._START_S
    assert beams == pytest.approx(np.dot((1000, 500, 100), costs))
    handed = 100 / (50 * 16 * camera_beams.STARTS)
    assert paths == pytest.approx(50 * 16 * (camera_beams._SAMPLE_S + handed * camera_beams._DEEP_S))


def test_beams_are_followed_as_far_as_paths():
    assert camera_view.MAX_DEPTH == variants.MAX_DEPTH


POOL = """
lights = []
[camera]
position = [{x}, 0.0, {z}]
target = [{x}, 0.001, 0.0]
up = [0.0, 1.0, 0.0]
vertical_fov_deg = 120.0
[environment]
kind = "constant"
radiance = 1.0
[[objects]]
name = "water"
shape = "box"
size = [{width}, {width}, 10.0]
position = [0.0, 0.0, -5.0]
glass = "water"
[[objects]]
name = "bottom"
shape = "plane"
width = 59.0
height = 59.0
position = [0.0, 0.0, -9.9]
material = "black"
"""
SIZE = 128, 72


@pytest.mark.parametrize("width", [30.0, 60.0])
def test_snells_window_is_seen_by_paths_and_forced_beams_say_why(tmp_path: Path, capsys, width: float) -> None:
    """From inside glass its total reflection was lost: light from everywhere."""
    scene, out = tmp_path / "pool.toml", tmp_path / "pool.npy"
    scene.write_text(POOL.format(x=0.0, z=-2.0, width=width))
    command = ["render", str(scene), "-o", str(out), "--size", "{}x{}".format(*SIZE), "--spp", "4"]
    assert main([*command, "--camera", "beams"]) == 0
    assert "--camera beams is not followed: the camera is inside glass" in capsys.readouterr().err
    rows, columns = (np.arange(side) + 0.5 - 0.5 * side for side in SIZE[::-1])
    off_axis = np.hypot(rows[:, None], columns) * np.tan(np.radians(60.0)) / (0.5 * SIZE[1])
    rim = np.tan(np.arcsin(1.0 / 1.3334))
    window, beyond = np.load(out)[off_axis < 0.85 * rim], np.load(out)[(off_axis > 1.1 * rim) & (off_axis < 1.9)]
    assert window.min() > 0.85 and window.max() < 1.0 and beyond.max() < 1e-3


def test_a_wide_pane_close_below_the_camera_is_seen_by_paths(gl, tmp_path: Path) -> None:
    """Fresnel's reflectance was that of straight ahead all over it, and a fifth of what it transmits was missing."""
    reasons = {}
    for name, z, width in (("pane", 0.5, 600.0), ("tile", 0.5, 0.5)):
        (tmp_path / "pool.toml").write_text(POOL.format(x=0.2, z=z, width=width))
        settings = RenderSettings(*SIZE, spp=1, camera_beams=True)
        reasons[name] = render(load_scene(tmp_path / "pool.toml"), settings, context=gl).stats.camera_pass.beams.reason
    assert "straight ahead to grazing" in reasons["pane"] and "grazing" not in reasons["tile"]
