"""The prism case: our picture against a converged one by an independent program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.features.features import Features
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.spectrum import laser
from spectrasplat.model.scene import Dielectric
from spectrasplat.model.scene_camera import camera_frame
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import RenderResult, render

from tests.image.metrics import LUMINANCE, normalised_rmse, relative_mse

SCENE = assets_dir() / "scenes" / "prism_case.toml"
FLOOR_X_CM = {
    400: 14.507781,
    450: 18.587992,
    500: 20.922858,
    550: 22.456213,
    600: 23.542016,
    650: 24.350626,
    700: 24.975810,
}
"""Where the beam's axis meets the floor, in double precision, by the reference's author."""


@pytest.fixture(scope="module")
def reference() -> np.ndarray:
    stored = np.load(Path(__file__).parent / "data" / "prism_case_reference.npz")
    picture = np.zeros(stored["shape"])
    picture[slice(*stored["rows"]), slice(*stored["columns"])] = stored["crop"].astype(float) * stored["scale"]
    return picture


@pytest.fixture(scope="module")
def rendered(gl) -> RenderResult:
    return render(load_scene(SCENE), RenderSettings(width=512, height=512, photons=1_000_000), context=gl)


def test_matches_the_reference(rendered: RenderResult, reference: np.ndarray) -> None:
    assert rendered.stats.photons <= 1_000_000
    picture = rendered.rgb.astype(float)
    assert relative_mse(picture, reference) <= 0.01
    assert normalised_rmse(picture, reference) <= 0.05
    assert np.sum(picture @ LUMINANCE) == pytest.approx(np.sum(reference @ LUMINANCE), rel=0.01)


def test_metrics_tell_a_wrong_picture(rendered: RenderResult, reference: np.ndarray) -> None:
    """Two pixels of shift, or a red 1.6 times as strong, must fail the bounds above."""
    shifted = np.roll(rendered.rgb.astype(float), 2, axis=1)
    assert normalised_rmse(shifted, reference) > 0.05
    assert relative_mse(rendered.rgb * np.array([1.6, 1.0, 1.0]), reference) > 0.009


def test_flux_closes(rendered: RenderResult) -> None:
    assert rendered.stats.light.tally.imbalance < 0.01  # beams are counted at three places of each band


@pytest.mark.parametrize(
    "wavelength_nm", [nm if nm in (400, 550, 700) else pytest.param(nm, marks=pytest.mark.slow) for nm in FLOOR_X_CM]
)
def test_wavelengths_arrive_within_a_pixel(gl, wavelength_nm: int) -> None:
    """One laser line at a time, its picture's centre against the double-precision landing point."""
    scene = load_scene(SCENE)
    light = scene.lights[0]
    line = laser(float(wavelength_nm)).scaled_to_power(1e9)
    mono = type(scene)(**{**vars(scene), "lights": (type(light)(**{**vars(light), "spectral_power": line}),)})
    result = render(mono, RenderSettings(width=512, height=512, photons=60_000, spp=4), context=gl)
    brightness = np.abs(result.rgb).sum(axis=2)
    rows, columns = np.indices(brightness.shape)
    keep = brightness > 0.05 * brightness.max()
    centre = (
        np.array(
            [np.average(columns[keep], weights=brightness[keep]), np.average(rows[keep], weights=brightness[keep])]
        )
        + 0.5
    )
    expected = _pixel_of(scene, np.array([FLOOR_X_CM[wavelength_nm], 0.0, 0.0]))
    # Along the slit's image the light is spread; across it the line must fall within a pixel.

    along_spectrum = (centre - expected) @ _across_slit(scene, wavelength_nm)
    assert abs(along_spectrum) < 1.0, (centre, expected)


def _pixel_of(scene, point: np.ndarray, size: int = 512) -> np.ndarray:
    right, up, forward = camera_frame(scene.camera)
    offset = point - np.asarray(scene.camera.position)
    half = np.tan(np.radians(0.5 * scene.camera.vertical_fov_deg))
    ndc = np.array([offset @ right, offset @ up]) / (offset @ forward) / half
    return np.array([0.5 * size * (1.0 + ndc[0]), 0.5 * size * (1.0 - ndc[1])])


def _across_slit(scene, wavelength_nm: int) -> np.ndarray:
    """Unit vector in the picture across the slit's image (which runs along the floor's y)."""
    x = FLOOR_X_CM[wavelength_nm]
    along = _pixel_of(scene, np.array([x, 0.5, 0.0])) - _pixel_of(scene, np.array([x, -0.5, 0.0]))
    across = np.array([-along[1], along[0]])
    return across / np.linalg.norm(across)


def test_programs_leave_out_what_the_scene_does_not_need() -> None:
    scene = load_scene(SCENE)
    features = Features.of(scene, RenderSettings())
    assert features.spectral_groups == 1
    assert features.convex_solids and not features.tree
    assert not (
        features.smooth_normals or features.medium_stack or features.absorption or features.mirrors or features.charts
    )
    assert sum(isinstance(o.material, Dielectric) for o in scene.objects) == 1
