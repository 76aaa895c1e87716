"""Derivatives of caustic maps against central differences of renderings by other random numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from scipy.ndimage import gaussian_filter
from spectrasplat.base.errors import UserError
from spectrasplat.base.generators import finished
from spectrasplat.edit.glass import bent
from spectrasplat.edit.parameters import Stage
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.glass import with_gain
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.frames import FrameRenderer
from spectrasplat.render.gradient import Gradient, gradient, sides

from tests.unit.scene_texts import load

BALL = """
[[lights]]
kind = "directional"
direction = [0.1, 0.0, -1.0]
illuminance_lx = 1000.0
[[objects]]
name = "ball"
shape = "sphere"
radius = 0.5
triangles = 20_000
glass = "N-SF11"
position = [0.0, 0.0, 0.8]
[[objects]]
name = "table"
shape = "plane"
width = 6.0
height = 6.0
material = { kind = "diffuse", colour = 0.8 }
"""


def settings(photons: int, receiver: str = "table", seed: int = 1, bins: int | None = None) -> RenderSettings:
    return RenderSettings(width=48, height=48, photons=photons, seed=seed, bins=bins, layer=f"map:{receiver}")


def gradient_of(gl, scene: Scene, path: str, its: RenderSettings, *, noise: bool = False) -> Gradient:
    return finished(gradient(gl, Stage(scene, scene.camera), its, [path], noise=noise))


def difference(gl, scene: Scene, path: str, found: Gradient, its: RenderSettings) -> np.ndarray:
    """The central difference of two renderings on the texels of `found`."""
    stage, step = Stage(scene, scene.camera), found.derivatives[0].step
    corners = found.placement["corners_world"]
    window = np.array([corners["bottom_left"], corners["top_right"]])
    either = sides(stage, path, step)
    frames = FrameRenderer(gl, replace(its, least_bands=16), either, window=window)
    try:
        low, high = [frames.run(each).astype(float) for each in either]
    finally:
        frames.release()
    return (high - low) / (2.0 * step)


def relative(found: np.ndarray, expected: np.ndarray, blur: float) -> float:
    """Norm of what two pictures differ by, over the second one's, both blurred by so many texels."""
    a, b = (gaussian_filter(picture.astype(float), (blur, blur, 0.0)) for picture in (found, expected))
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def loaded(tmp_path: Path) -> Scene:
    return load(tmp_path, BALL)


@pytest.mark.parametrize("path", ["objects.ball.n_d", pytest.param("objects.ball.position.x", marks=pytest.mark.slow)])
def test_of_a_ball(gl, tmp_path: Path, path: str) -> None:
    """Within 4 % of the norm by 40,000 photons, most of which is chance of both."""
    scene = loaded(tmp_path)
    found = gradient_of(gl, scene, path, settings(40_000))
    expected = difference(gl, scene, path, found, settings(80_000, seed=7))
    assert relative(found.derivatives[0].picture.rgb, expected, 1.0) < 0.04


@pytest.mark.slow
def test_by_dispersion_no_band_is_too_wide(gl, tmp_path: Path) -> None:
    """Against wavelengths at random, which know no bands: within 0.15, of which both have some 0.05 by chance; with the
    bands of a picture it is 0.3. Another seed differs by as much as is said."""
    scene, path = loaded(tmp_path), "objects.ball.V_d"
    found, other = (gradient_of(gl, scene, path, settings(120_000, seed=seed), noise=True) for seed in (1, 2))
    at_random = replace(settings(400_000, seed=7), method="stochastic-even")
    mine, theirs = (each.derivatives[0] for each in (found, other))
    assert relative(mine.picture.rgb, difference(gl, scene, path, found, at_random), 1.0) < 0.15
    apart = relative(mine.picture.rgb, theirs.picture.rgb, 0.0) / 2.0**0.5
    assert 0.5 * apart < mine.noise < 2.0 * apart
    with pytest.raises(UserError, match="cannot change by"):
        sides(Stage(scene, scene.camera), path, 100.0)


def test_what_photons_weigh_changes_too(gl, tmp_path: Path) -> None:
    """A ball of higher index passes less light, in colours and in each bin: two thirds of a third per unit, and nothing
    leaves the map."""
    found = gradient_of(gl, loaded(tmp_path), "objects.ball.index", settings(20_000, bins=8))
    changed, base = found.derivatives[0].picture, found.base
    assert changed.spectral is not None and base.spectral is not None and changed.spectral.shape == (48, 48, 8)
    bins = changed.spectral.sum(axis=(0, 1)) / base.spectral.sum(axis=(0, 1))
    lost = np.append(bins, changed.rgb.sum() / base.rgb.sum())
    assert lost.max() < -0.1 and lost.min() > -0.5, lost


def test_from_python(tmp_path: Path) -> None:
    """Arrays, a picture of red and blue, and sentences for what has no derivative."""
    (tmp_path / "ball.toml").write_text(BALL)
    scene = ss.load(tmp_path / "ball.toml")
    found = ss.gradient(scene, "objects.ball.n_d", "table", size=(32, 32), photons=8192)
    assert np.from_dlpack(found.rgb).shape == found.base.shape == (32, 32, 3)
    target = found.to_png(tmp_path / "gradient.png")
    brighter, darker = found.rgb[..., 1] > 0.0, found.rgb[..., 1] < 0.0
    assert target.exists() and brighter.any() and darker.any()
    codes = found.codes.astype(int)
    assert (codes[..., 0] >= codes[..., 2])[brighter & (found.rgb > 0.0).all(axis=-1)].all()
    with pytest.raises(ss.UserError, match="did you mean 'objects.ball.n_d'"):
        ss.gradient(scene, "objects.ball.n_e", "table")
    with pytest.raises(ss.UserError, match="changes no light"):
        ss.gradient(scene, "camera.position.x", "table")
    with pytest.raises(ss.UserError, match="no receiver"):
        ss.gradient(scene, "objects.ball.n_d", "ball")


def test_a_bent_glass_has_the_numbers_it_was_bent_to() -> None:
    """n_d and V_d change apart, under a gain as well, and the rest of the curve stays."""
    for gain in (1.0, 2.0):
        dispersion = with_gain(find("N-SF11"), gain)
        higher, flatter = bent(dispersion, "n_d", 1e-3), bent(dispersion, "V_d", 0.5)
        assert higher.n_d - dispersion.n_d == pytest.approx(1e-3, abs=2e-6)
        assert gain * higher.V_d == pytest.approx(gain * dispersion.V_d, abs=0.02)
        assert flatter.n_d == pytest.approx(dispersion.n_d, abs=2e-6)
        assert gain * flatter.V_d == pytest.approx(gain * dispersion.V_d + 0.5, abs=0.02)
        raised = bent(dispersion, "index", 1e-3)
        nm = np.array([400.0, 550.0, 700.0])
        assert raised.index(nm) - dispersion.index(nm) == pytest.approx(1e-3, abs=2e-6)
