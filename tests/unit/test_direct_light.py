"""What lights give straight on, against closed forms; spectra cut into bins."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.edit.chromaticity import colour_info
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.optics.spectrum import Spectrum, illuminant, laser
from spectrasplat.reference.direct_light import DirectLight

SCENE = """
lights = [
  { kind = "directional", direction = [0.6, 0, -0.8], illuminance_lx = 1000 },
  { kind = "point", position = [0, 0, 2], intensity_cd = 40 },
  { kind = "area", position = [0, 0, 3], direction = [0, 0, -1], radius = 1.0, luminance_nt = 10 },
]
[[objects]]
shape = "plane"
width = 40
height = 40
material = "diffuse"
[[objects]]
shape = "sphere"
radius = 0.5
position = [8, 0, 1]
"""


@pytest.fixture
def scene(tmp_path: Path):
    path = tmp_path / "lit.toml"
    path.write_text(SCENE)
    return load_scene(path)


def luxes(scene, place, normal=(0.0, 0.0, 1.0)) -> np.ndarray:
    gains = DirectLight.of(scene).gains(np.array(place), np.array(normal))
    return gains * [light.spectral_power.luminous() for light in scene.lights]


def test_sun_point_and_disc_by_their_closed_forms(scene) -> None:
    sun, point, disc = luxes(scene, (0.0, 0.0, 0.0))
    assert sun == pytest.approx(800.0, rel=1e-9)  # E cos θ
    assert point == pytest.approx(40.0 / 4.0, rel=1e-6)  # I / d²
    assert disc == pytest.approx(np.pi * 10.0 * 1.0 / (1.0 + 9.0), rel=1e-3)  # π L r² / (r² + h²) on the axis
    assert luxes(scene, (1.0, 0.0, 0.0))[1] == pytest.approx(40.0 * 2.0 / 5.0**1.5, rel=1e-6)


def test_glass_and_the_surface_itself_are_in_the_way(scene) -> None:
    # Behind the ball as the sun sees it; its middle is at height 1, the sun's slope 0.6 to 0.8.
    assert luxes(scene, (8.75, 0.0, 0.0))[0] == 0.0
    assert luxes(scene, (7.0, 0.0, 0.0))[0] == pytest.approx(800.0)
    assert not luxes(scene, (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)).any()


def test_nothing_is_there_where_nothing_is(scene) -> None:
    assert not luxes(scene, (0.0, 0.0, 1.0)).any()


@pytest.mark.parametrize("bins", [10, 20, 40])
@pytest.mark.parametrize("spectrum", [illuminant("D65"), illuminant("F11"), laser(532.0, 1.0), laser(780.0, 1.0)])
def test_bins_hold_the_power_and_the_lumens(spectrum: Spectrum, bins: int) -> None:
    scaled = spectrum.scaled_to_luminous(1000.0)
    edges = np.linspace(380.0, 780.0, bins + 1)
    binned = scaled.binned(edges)
    assert binned.sum() * 400.0 / bins == pytest.approx(scaled.power_w(), rel=1e-12)
    if not spectrum.lines and bins == 40:
        found = colour_info(0.5 * (edges[:-1] + edges[1:]), binned)
        assert found is not None and found.illuminance == pytest.approx(1000.0, rel=0.02)
    if spectrum == illuminant("D65"):  # however wide the bins are
        found = colour_info(0.5 * (edges[:-1] + edges[1:]), binned, spectrum.density)
        assert found is not None and found.temperature_k == pytest.approx(6504.0, abs=0.6)
