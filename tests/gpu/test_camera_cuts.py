"""Where the colours of a band part: each part goes its own way, weak ones by chance, and the picture is that of single
wavelengths."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.features.features import Features
from spectrasplat.gpu import shader
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.colorimetry import rgb709_to_xyz
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import camera_programs
from spectrasplat.passes.camera import CameraPass
from spectrasplat.passes.spectrum_choice import Spectrum
from spectrasplat.render.device_scene import spectral_axis

from tests.gpu.camera_rig import released
from tests.gpu.mutants import mutate

SIZE = (81, 45)


@pytest.fixture(scope="module")
def edge() -> Scene:
    """At its left face some colours of a column of pixels are reflected totally, and others meet another face
    behind."""
    return load_scene(assets_dir() / "scenes" / "prism_edge.toml")


def picture(
    gl, scene: Scene, samples: int, method: str = "srd", seed: int = 1, primary_samples: int | None = None
) -> np.ndarray:
    """Linear Rec.709 (45, 81, 3), direct light only."""
    features = Features.of(scene, RenderSettings(method=method, any_view=True))
    camera_pass = CameraPass(gl, SceneBuffers(gl.ctx, scene, features, spectral_axis(scene, features)))
    camera_pass.primary_samples = primary_samples or camera_pass.primary_samples
    camera_pass.run(scene.camera, *SIZE, samples, seed=seed)
    rgb = camera_pass.read_rgb().astype(float)
    released(camera_pass)
    return rgb


def error(a: np.ndarray, b: np.ndarray) -> float:
    """relMSE in XYZ."""
    a, b = rgb709_to_xyz(a), rgb709_to_xyz(b)
    return float(np.mean((a - b) ** 2 / (b**2 + 0.01 * b.mean() ** 2)))


@pytest.fixture(scope="module")
def drawn(gl, edge: Scene) -> np.ndarray:
    """By evenly drawn random wavelengths: 1024 samples leave 6e-4."""
    return picture(gl, edge, 1024, "stochastic-even")


@pytest.mark.slow
def test_parted_colours_go_their_own_ways(gl, edge: Scene, drawn, monkeypatch, tmp_path) -> None:
    """One band, cut, has what single wavelengths have. A band that is never cut does not, however many samples it
    gets."""
    cut = error(picture(gl, edge, 32), drawn)
    mutate(
        monkeypatch,
        tmp_path,
        "camera/cuts.glsl",
        "return parts && path.walk.planar_so_far != 0u",
        "return false && parts && path.walk.planar_so_far != 0u",
    )
    whole = error(picture(gl, edge, 32), drawn)
    assert cut < 1.2e-3 and whole > 1.5 * cut, (cut, whole)


@pytest.mark.slow
def test_a_part_chosen_by_chance_stands_for_both(gl, edge: Scene, monkeypatch) -> None:
    both = picture(gl, edge, 64)
    monkeypatch.setattr(camera_programs, "CUT_THRESHOLD", 2.0)
    chosen = np.mean([picture(gl, edge, 64, seed=seed) for seed in (1, 2)], axis=0)
    one = picture(gl, edge, 64, seed=3)
    assert error(one, chosen) > 0.0, "nothing was left to chance"
    assert np.allclose(chosen.mean(axis=(0, 1)), both.mean(axis=(0, 1)), rtol=1e-3)
    assert error(chosen, both) < 5e-4


@pytest.mark.slow
def test_a_part_that_is_lost_is_noticed(gl, edge: Scene, monkeypatch, tmp_path) -> None:
    """Seeds and all else same_hit: what differs is the lost light."""
    right = picture(gl, edge, 32)
    mutate(monkeypatch, tmp_path, "camera/cuts.glsl", "if (part == 0) push(path);", "")
    lost = picture(gl, edge, 32)
    assert error(lost, right) > 2e-4 and lost.sum() < right.sum()


@pytest.fixture
def single_wavelengths(gl, edge: Scene) -> Iterator[CameraPass]:
    features = Features.of(edge, RenderSettings(any_view=True))
    camera_pass = CameraPass(gl, SceneBuffers(gl.ctx, edge, features, spectral_axis(edge, features)))
    camera_pass.may_be_single, camera_pass.spectrum = True, Spectrum(single=True)
    yield camera_pass
    released(camera_pass)


@pytest.mark.slow
def test_single_wavelengths_of_a_pass_of_bands_are_those_of_their_own_method(
    gl, edge: Scene, drawn, single_wavelengths: CameraPass
) -> None:
    """The same program but for the layout of its tables: agrees to the noise of both."""
    single_wavelengths.run(edge.camera, *SIZE, 1024, seed=2)
    assert error(single_wavelengths.read_rgb().astype(float), drawn) < 2.5e-3
    assert single_wavelengths.fallbacks["band_uncut"] == 0


@pytest.mark.slow
def test_looks_round_a_sample_smooth_outlines_and_change_nothing_else(gl, edge: Scene) -> None:
    many = picture(gl, edge, 256, primary_samples=1)
    one, four = (error(picture(gl, edge, 1, primary_samples=looks), many) for looks in (1, 4))
    assert four < 0.6 * one, (one, four)
    # Of all samples together the mean is the same: looks that meet glass go on with their share.
    several = picture(gl, edge, 16, primary_samples=4)
    assert np.allclose(several.mean(axis=(0, 1)), many.mean(axis=(0, 1)), rtol=2e-3)
    assert error(several, many) < 5e-4


def test_every_program_is_let_go(gl, single_wavelengths: CameraPass, monkeypatch) -> None:
    gone: list[object] = []

    def release(*owned) -> None:
        for each in owned:
            gone.append(each)
            if hasattr(each, "release") and not isinstance(each, moderngl.ComputeShader):
                each.release()

    monkeypatch.setattr(shader, "release", release)
    single_wavelengths.run(single_wavelengths.scene.scene.camera, 9, 5, 1)
    single_wavelengths.release()
    assert sum(isinstance(owned, moderngl.ComputeShader) for owned in gone) == 3
    monkeypatch.undo()
    shader.release(*(owned for owned in gone if isinstance(owned, moderngl.ComputeShader)))
    monkeypatch.setattr(single_wavelengths, "release", lambda: None)
