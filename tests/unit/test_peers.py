"""Scenes for other renderers (integrations/peers): what is written is what SpectraSplat reads; none is needed here."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.model.io.scene_file import load_scene

PEERS = Path(__file__).resolve().parents[2] / "integrations" / "peers"
sys.path.insert(0, str(PEERS))

import compare  # noqa: E402
import neutral  # noqa: E402
import pbrt_peer  # noqa: E402


@pytest.mark.parametrize("name", neutral.SCENES)
def test_a_scene_is_translated(name: str, tmp_path: Path) -> None:
    """Camera, lamp and glass agree with the program's reading of the file, and pbrt's file names them."""
    neutral.export(name, tmp_path)
    scene, ours = neutral.load(tmp_path), load_scene(PEERS / "scenes" / f"{name}.toml")
    assert not [note for note in ours.notes if "unknown" in note]
    assert scene["camera"]["position"] == list(ours.camera.position)
    assert scene["camera"]["vertical_fov_deg"] == ours.camera.vertical_fov_deg
    glass, receiver = ours.objects
    for nm in (400.0, 550.0, 700.0):
        assert neutral.index(scene, nm) == pytest.approx(float(glass.material.dispersion.index(nm)), abs=1e-9)
    low, high = glass.mesh.transformed(glass.object_to_world).bounds()
    np.testing.assert_allclose(scene["corners"].reshape(-1, 3).min(axis=0), low, atol=1e-6)
    np.testing.assert_allclose(scene["corners"].reshape(-1, 3).max(axis=0), high, atol=1e-6)
    assert low[2] > 0.0, "the glass stands free of the receiver"
    np.testing.assert_allclose(neutral.receiver_corners(scene)[[0, 2]], receiver.mesh.vertices[[0, 2]], atol=1e-12)
    normals = np.cross(*np.moveaxis(np.diff(scene["corners"], axis=1), 1, 0))
    assert ((normals[:, None] * scene["normals"]).sum(axis=2) > 0).mean() > 0.999
    text = pbrt_peer.scene_text(scene, tmp_path, tmp_path / "out.pfm", "sppm", 4, 1000)
    assert ('"sphere"' in text) == (name == "ball")
    assert ("AreaLightSource" in text) == scene["lamp"]["is_area"]


def test_wavelengths_keep_white_white(tmp_path: Path) -> None:
    """Whatever their number, the parts of the spectrum add up to all of it."""
    scene = neutral.export("prism", tmp_path)
    white = 683.002 * np.sum(scene["cmf"], axis=0)
    for count in (1, 7, 32):
        chosen, xyz = neutral.wavelengths(scene, count)
        assert np.all(np.diff(chosen) > 0)
        np.testing.assert_allclose(xyz.sum(axis=0), white, rtol=1e-12)


def test_every_row_has_words_to_run(tmp_path: Path) -> None:
    """Each budget of each row becomes a command that names the scene's files."""
    for peer, ladders in compare.LADDERS.items():
        for scene in neutral.SCENES:
            for rung in ladders.get(scene, ladders[""]):
                words = compare.command(peer, scene, rung, tmp_path, tmp_path / "o.npy", Path("python"), Path("tracer"))
                assert any(scene in word or str(tmp_path) in word for word in words)
                assert all(Path(word).is_file() for word in words if word.endswith((".py", ".toml")))


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")
def test_the_tracer_lights_a_receiver_as_the_formula_says(tmp_path: Path) -> None:
    """Direct light at the brightest pixel is that of the inverse square law; light through the glass comes on top."""
    scene = neutral.export("goblet", tmp_path)
    program = compare.compiled(tmp_path)
    subprocess.run([program, tmp_path / "scene.bin", tmp_path / "out.bin", "20000", "4", "1"], check=True)
    picture = compare.read(tmp_path / "out.bin")
    camera, lamp, (width, height) = scene["camera"], scene["lamp"], scene["size"]
    subprocess.run([program, tmp_path / "scene.bin", tmp_path / "no_photons.bin", "0", "4", "1"], check=True)
    direct = compare.read(tmp_path / "no_photons.bin")
    row, column = np.unravel_index(np.argmax(direct[..., 1]), direct.shape[:2])
    tangent = np.tan(np.radians(camera["vertical_fov_deg"]) / 2)
    x, y = (2 * column + 1 - width) / height * tangent, (1 - (2 * row + 1) / height) * tangent
    d = camera["forward"] + x * np.array(camera["right"]) + y * np.array(camera["up"])
    place = camera["position"] - d * camera["position"][2] / d[2]
    way = place - lamp["position"]
    length = np.linalg.norm(way)
    radiance = lamp["strength"] * -way[2] / length**3 * scene["albedo"] / np.pi
    np.testing.assert_allclose(direct[row, column, :3], 683.002 * np.sum(scene["cmf"], axis=0) * radiance, rtol=0.01)
    assert picture[..., 1].sum() > 1.2 * direct[..., 1].sum()
