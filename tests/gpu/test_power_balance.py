"""The balance of power: what lights emit, what lands, what is drawn and what the maps hold, each summed up for itself.

Power is throughput times the light's power over a photon's band. Tracing sums it up where a path ends, the footprint
pass again from the spectral tables, and the maps hold what fragments have drawn: a factor that one of them forgets
shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.lights.point import SpotLight
from spectrasplat.model.optics import glass
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import pilot
from spectrasplat.render.still import render


@dataclass(frozen=True)
class Balance:
    """Shares of what they are compared with, 0 where all is well."""

    unaccounted: float
    """Of what was emitted."""
    drawn: float
    """Excess of what the footprint pass draws over what landed."""
    held: float
    """Excess of the maps, and what lies outside of them, over what was drawn."""


def shipped(name: str) -> Scene:
    return load_scene(assets_dir() / "scenes" / f"{name}.toml")


def balance(
    gl, scene: str | Scene, method: str = "srd-photons", size: tuple[int, int] = (160, 90), photons: int = 60_000
) -> Balance:
    settings = RenderSettings(*size, photons=photons, spp=1, method=method, tally=True)
    stats = render(shipped(scene) if isinstance(scene, str) else scene, settings, context=gl).stats
    light = stats.light
    return Balance(
        light.tally.imbalance,
        light.drawn_w / light.tally.ended["deposited"] - 1.0,
        (stats.map_flux_w + light.outside_map_w) / light.drawn_w - 1.0,
    )


@pytest.mark.parametrize("scene", [pytest.param("prism", marks=pytest.mark.slow), "brilliant"])
def test_all_that_was_emitted_is_drawn_or_accounted_for_where_reflection_is_total(gl, scene: str) -> None:
    """Both reflect totally inside; the brilliant cuts bands where that sets in."""
    found = balance(gl, scene, photons=20_000)
    assert found.unaccounted < 1e-4
    assert abs(found.drawn) < 1e-4
    assert abs(found.held) < 1e-3


@pytest.mark.core
def test_maps_hold_what_beams_of_a_lamp_throw(gl) -> None:
    """Through a slit and a prism, whose image is four to eight texels wide and swept over hundreds; chords of bands may
    miss by a texel, which is half a pixel (0.06 % too much)."""
    assert abs(balance(gl, "prism_case", "srd").held) < 1e-3


def test_bands_cut_at_total_reflection_give_back_what_their_waves_take(gl, monkeypatch: pytest.MonkeyPatch) -> None:
    """A gem of n from 2.2 to 1.2, with few bands, many of which are cut: blurred by a box, whose transform may be
    negative. A wave so turned round would add light (0.3 % of all)."""
    monkeypatch.setattr(pilot.PilotFit, "band_count", lambda fit: 7)
    brilliant = shipped("brilliant")
    gem, table = brilliant.objects
    strong = gem.material.changed(dispersion=glass.cauchy([0.8888, 0.18935]))
    lamp = SpotLight("lamp", brilliant.lights[0].spectral_power, (-1.2, 0.8, 5.0), (0.2747, -0.1831, -0.9155), 8.0, 8.0)
    scene = replace(brilliant, lights=(lamp,), objects=(replace(gem, material=strong), table))
    assert abs(balance(gl, scene, size=(256, 256), photons=30_000).held) < 1.5e-3


@pytest.mark.slow
@pytest.mark.parametrize("method", ["stochastic-even", "hero", "srd-lambda"])
def test_single_wavelengths_are_drawn_with_the_power_that_landed(gl, method: str) -> None:
    found = balance(gl, "prism", method)
    # Wavelengths are drawn by brightness, and power is what they stand for on average only.
    assert abs(found.drawn) < (1e-3 if method == "srd-lambda" else 0.02)
    assert abs(found.held) < 2e-3
