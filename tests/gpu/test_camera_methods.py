"""Different ways to the same picture: sampling methods, spectral bins, spectral maps, and the light pass looked at in
reverse.

Tolerances are those of chance, measured from runs with other seeds, and beside each stands a mutant that exceeds it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import CollimatedLight
from spectrasplat.model.optics.glass import from_abbe
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import (
    Camera,
    Dielectric,
    Diffuse,
    Scene,
    SceneObject,
)
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.texture import Environment
from spectrasplat.passes.spectrum_choice import Spectrum
from spectrasplat.render.still import render as render_scene
from spectrasplat.stress.rigs.gpu_paths import extruded, glass

from tests.gpu.camera_rig import at, horizontal, opened_camera_pass, released

FLAT = illuminant("E").scaled_to_luminous(1000.0)
SIZE = (24, 24)


@cache
def stripes() -> np.ndarray:
    """A sky of soft white stripes about the vertical, 24 around, (32, 192, 3)."""
    u = (np.arange(192) + 0.5) / 192 * 2 * np.pi
    return np.broadcast_to((1.0 + np.cos(24 * u))[None, :, None], (32, 192, 3)).astype(np.float32).copy()


UPRIGHT = extruded(
    "prism",
    0.9 * np.column_stack([np.cos(np.radians([90.0, 210.0, 330.0])), np.sin(np.radians([90.0, 210.0, 330.0]))]),
    1.0,
)
BEFORE = Camera((-2.6, -2.2, 0.1), (0.0, 0.0, 0.0), vertical_fov_deg=17.0)
"""Sees nothing but the prism's two faces, and through them far apart parts of the sky in red and in blue."""


def seen(
    gl, method: str, samples: int, bands: int | None = None, seed: int = 1, channels: MapChannels = MapChannels()
) -> np.ndarray:
    """Means over 3×3 pixels (8, 8, 3) of the sky through a flint prism."""
    prism = SceneObject("prism", UPRIGHT, glass("N-SF11"))
    camera_pass = opened_camera_pass(
        gl, [prism], camera=BEFORE, environment=Environment(stripes()), method=method, channels=channels
    )
    if bands is not None:
        camera_pass.spectrum = Spectrum(bands)
    camera_pass.run(BEFORE, *SIZE, samples, seed=seed)
    rgb = camera_pass.read_rgb().astype(float)
    released(camera_pass)
    return rgb.reshape(8, 3, 8, 3, 3).mean(axis=(1, 3))


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Relative root mean square."""
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))


@pytest.fixture(scope="module")
def drawn(gl) -> tuple[np.ndarray, float]:
    """The picture by evenly drawn random wavelengths, and its standard error, relative: from the scatter of eight
    seeds."""
    runs = np.array([seen(gl, "stochastic-even", 64, seed=seed) for seed in range(1, 9)])
    mean = runs.mean(axis=0)
    return mean, float(np.sqrt(np.mean(runs.var(axis=0, ddof=1) / len(runs)) / np.mean(mean**2)))


WAYS = [
    ("srd", 8, 64, 0.01),
    ("srd", 32, 64, 0.01),
    ("srd-lambda", 16, 64, 0.01),
    ("regular-16", None, 64, 0.01),
    ("stochastic", None, 512, 0.03),
]
"""Method, bands, samples, and the error it has itself: of grain that so many samples leave, and of sixteen fixed
wavelengths."""


@pytest.mark.slow
@pytest.mark.parametrize(("method", "bands", "samples", "own"), WAYS, ids=[f"{way[0]}-{way[1]}" for way in WAYS])
def test_methods_agree_with_random_wavelengths(
    gl, drawn, method: str, bands: int | None, samples: int, own: float
) -> None:
    """To three standard errors and the method's own error. One band is 3.2 % off for its third derivatives: that would
    be found."""
    mean, error = drawn
    assert error < 0.006
    colour = float(np.sqrt(np.mean((mean - mean.mean(axis=-1, keepdims=True)) ** 2) / np.mean(mean**2)))
    assert colour > 0.2  # the scene disperses enough that a mistake would show
    assert difference(seen(gl, method, samples, bands), mean) < 3.0 * error + own
    assert 3.0 * error + 0.01 < 0.028


def test_bins_add_up_to_the_picture_in_colour(gl) -> None:
    """Thirty-two bins, weighed with the observer, against the picture whose table holds the observer: to 1 %."""
    bins = MapChannels(tuple(np.linspace(380.0, 780.0, 33).tolist()))
    assert difference(seen(gl, "srd", 32, 4, channels=bins), seen(gl, "srd", 32, 4)) < 0.01


# ---- with the light pass -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def behind_panes(gl) -> tuple[np.ndarray, np.ndarray]:
    """A prism's spectrum on the floor, seen through a pane that bends nothing: one that by law disperses, so that the
    camera looks up single wavelengths in maps with spectra, and one that does not, so that it looks up XYZ whole. Means
    over 2×2 pixels, (12, 16, 3)."""
    section = 0.35 * np.column_stack(
        [np.cos(np.radians([90.0, 210.0, 330.0])), np.sin(np.radians([90.0, 210.0, 330.0]))]
    )
    upright = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 1.2], [0, 0, 0, 1]], float)
    prism = SceneObject("prism", extruded("prism", section, 0.4), glass("N-SF11"), upright)
    # From below at the angle of least deviation, 33° up; it leaves 33° down.
    beam = CollimatedLight("beam", FLAT, position=(-1.2, 0.0, 0.42), direction=(1.2, 0.0, 0.78), radius=0.12)
    pane = primitives.box((3.0, 0.05, 1.8))
    floor = horizontal(-2, 6, -3, 3, 0.0, Diffuse((0.8, 0.8, 0.8)), "floor")
    camera = Camera((1.9, -4.0, 2.2), (1.9, 0.0, 0.0), vertical_fov_deg=14.0)
    pictures = []
    for abbe in (15.0, np.inf):
        objects = (prism, SceneObject("pane", pane, Dielectric(from_abbe(1.0005, abbe)), at(1.9, -1.6, 0.95)), floor)
        result = render_scene(
            Scene("matched", camera, (beam,), objects),
            RenderSettings(width=32, height=24, photons=60_000, spp=16),
            context=gl,
        )
        pictures.append(result.rgb.astype(float).reshape(12, 2, 16, 2, 3).mean(axis=(1, 3)))
    return pictures[0], pictures[1]


@pytest.mark.slow
def test_a_caustic_behind_matched_glass_keeps_its_light(behind_panes) -> None:
    through, plain = behind_panes
    lit = plain.sum(axis=-1) > 0.05 * plain.sum(axis=-1).max()
    colour = plain[lit] / plain[lit].sum(axis=-1, keepdims=True)
    assert lit.sum() > 6 and np.ptp(colour, axis=0).max() > 0.5
    assert through.mean(axis=(0, 1)) == pytest.approx(plain.mean(axis=(0, 1)), rel=0.01)
    # The spectrum stays where it is: the same columns are red, green and blue.
    for channel in range(3):
        assert abs(int(through[..., channel].sum(axis=0).argmax()) - int(plain[..., channel].sum(axis=0).argmax())) <= 1


@pytest.mark.slow
def test_a_caustic_behind_matched_glass_has_its_colours(behind_panes) -> None:
    """What coarse spectra lack of XYZ is given back: without it they were 20 % off here."""
    assert difference(*behind_panes) < 0.02
