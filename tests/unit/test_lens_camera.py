"""A camera's lens in files, on the command line, in animations and among a scene's features."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.commands.inspect_report import camera_line
from spectrasplat.commands.opened import open_scene
from spectrasplat.commands.options import read
from spectrasplat.commands.table import Render
from spectrasplat.edit.parameters import Stage, apply_all
from spectrasplat.features.facts import in_view
from spectrasplat.features.features import Features
from spectrasplat.model.io.gltf_write import save_gltf
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.scene import Camera, Scene
from spectrasplat.model.scene_key import scene_key
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.photon_reference import render_reference

from tests.unit.scene_texts import load

SCENE = """
name = "lens"
[camera]
position = [0.0, -6.0, 0.0]
target = [0.0, 0.0, 0.0]
LENS
[[lights]]
name = "sun"
kind = "directional"
direction = [0.0, 0.5, -0.8]
illuminance_lx = 100
[[objects]]
name = "prism"
shape = "box"
size = [1.0, 1.0, 1.0]
glass = "N-BK7"
[[objects]]
name = "floor"
shape = "plane"
width = 9.0
height = 9.0
position = [0.0, 0.0, -1.0]
material = { kind = "diffuse", colour = 0.5 }
"""


def scene_of(folder: Path, lens: str = "") -> Scene:
    return load(folder, SCENE.replace("LENS", lens))


@pytest.mark.parametrize("suffix", ["toml", "glb"])
@pytest.mark.parametrize("lens", ["", "lens_radius = 0.25", "lens_radius = 0.25\nfocus_distance = 4.5"])
def test_what_is_saved_is_opened(tmp_path: Path, suffix: str, lens: str) -> None:
    scene = scene_of(tmp_path, lens)
    saved = tmp_path / f"saved.{suffix}"
    (save_gltf if suffix == "glb" else save_scene)(scene, saved)
    again = load_scene(saved).camera
    assert again.lens_radius == scene.camera.lens_radius == (0.25 if lens else 0.0)
    assert again.focus_distance == scene.camera.focus_distance
    assert again.plane_of_focus == pytest.approx(4.5 if "focus" in lens else 6.0)
    if suffix == "toml" and not lens:
        assert "lens" not in saved.read_text(encoding="utf-8").split("[camera]")[1]


@pytest.mark.parametrize(
    ("lens", "words"), [("lens_radius = -1.0", "lens_radius"), ("focus_distance = 0.0", "focus_distance")]
)
def test_what_no_lens_can_be_is_refused(tmp_path: Path, lens: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        scene_of(tmp_path, lens)


def test_a_lens_is_a_feature(tmp_path: Path) -> None:
    pinhole, lens = scene_of(tmp_path), scene_of(tmp_path, "lens_radius = 0.25")
    settings = RenderSettings()
    assert Features.of(lens, settings).lens and not Features.of(pinhole, settings).lens
    assert "lens of radius 0.25 focused at 6" in camera_line(lens) and "lens" not in camera_line(pinhole)


def test_a_picture_without_a_lens_has_no_plane_of_focus(tmp_path: Path) -> None:
    """Its key, by which references are kept, is what it was before there were lenses."""
    pinhole = scene_of(tmp_path)
    assert scene_key(scene_of(tmp_path, "focus_distance = 3.0")) == scene_key(pinhole)
    assert scene_key(scene_of(tmp_path, "lens_radius = 0.1")) != scene_key(pinhole)


def test_the_command_line_opens_the_lens(tmp_path: Path) -> None:
    scene = scene_of(tmp_path)

    def camera(radius: str | None, distance: str | None) -> Camera:
        given = {"scene": str(tmp_path / "scene.toml"), "output": "", "lens_radius": radius, "focus_distance": distance}
        return open_scene(read(Render, given)).camera

    assert camera(None, None) == scene.camera
    assert (camera("0.1", "3").lens_radius, camera("0.1", "3").plane_of_focus) == (0.1, 3.0)
    assert camera("0.1", None).plane_of_focus == pytest.approx(6.0)
    for radius, distance in (("-1", None), ("x", None), ("0.1", "0"), (None, "3")):
        with pytest.raises(UserError, match="--lens-radius|--focus-distance"):
            camera(radius, distance)


def test_focus_is_animated(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, "lens_radius = 0.25")
    stage = apply_all(Stage(scene, scene.camera), {"camera.focus_distance": 2.0, "camera.lens_radius": 0.5})
    assert (stage.camera.lens_radius, stage.camera.plane_of_focus) == (0.5, 2.0)


@pytest.mark.parametrize("kind", ["pinhole", "orthographic"])
def test_a_lens_sees_what_a_pinhole_does_not(tmp_path: Path, kind: str) -> None:
    """Beside the view, far behind the plane of focus; in the plane of focus it sees what a pinhole sees."""
    scene = scene_of(tmp_path)
    camera = Camera((0.0, -6.0, 0.0), (0.0, 0.0, 0.0), kind=kind, vertical_fov_deg=20.0, vertical_extent=2.0)  # type: ignore[arg-type]
    beside = replace(
        scene.objects[0], object_to_world=np.array([[1, 0, 0, 2.0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    )
    assert not in_view(beside, camera, 1.0)
    assert in_view(beside, replace(camera, lens_radius=0.5, focus_distance=2.0), 1.0)
    assert not in_view(beside, replace(camera, lens_radius=0.5, focus_distance=6.0), 1.0)


def test_the_caustic_layers_reference_has_none(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="lens_radius"):
        render_reference(scene_of(tmp_path, "lens_radius = 0.1"), 8, 8, photons=1000)


def test_a_scene_that_was_used_has_the_same_key() -> None:
    """Lights keep what they have worked out."""
    scene = load_scene(shipped_scenes()["prism"])
    before = scene_key(scene)
    assert all(light.axes().size for light in scene.lights) and scene_key(scene) == before
