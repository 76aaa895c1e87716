"""The balance of power: what lights emit, what lands, what is drawn and what the maps hold, each summed up for itself.

Power is throughput times the light's power over a photon's band. Tracing sums it up where a path ends, the footprint
pass again from the spectral tables, and the maps hold what fragments have drawn: a factor that one of them forgets
shows.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render

from tests.gpu.mutants import mutate

SCENES = ("prism", "brilliant")
"""Both reflect totally inside; the brilliant cuts bands where that sets in."""


@dataclass(frozen=True)
class Balance:
    """Shares of what they are compared with, 0 where all is well."""

    unaccounted: float
    """Of what was emitted."""
    drawn: float
    """Excess of what the footprint pass draws over what landed."""
    held: float
    """Excess of the maps, and what lies outside of them, over what was drawn."""


def balance(gl, scene: str, method: str = "srd-photons") -> Balance:
    settings = RenderSettings(width=160, height=90, photons=60_000, spp=1, method=method, tally=True)
    stats = render(load_scene(assets_dir() / "scenes" / f"{scene}.toml"), settings, context=gl).stats
    light = stats.light
    return Balance(
        light.tally.imbalance,
        light.drawn_w / light.tally.ended["deposited"] - 1.0,
        (stats.map_flux_w + light.outside_map_w) / light.drawn_w - 1.0,
    )


@pytest.mark.parametrize("scene", SCENES)
def test_all_that_was_emitted_is_drawn_or_accounted_for_where_reflection_is_total(gl, scene: str) -> None:
    found = balance(gl, scene)
    assert found.unaccounted < 1e-4
    assert abs(found.drawn) < 1e-4
    assert abs(found.held) < 1e-3


def test_maps_hold_what_beams_of_a_lamp_throw(gl) -> None:
    """Through a slit and a prism, whose image is four to eight texels wide and swept over hundreds; chords of bands may
    miss by a texel, which is half a pixel (0.06 % too much)."""
    assert abs(balance(gl, "prism_case", "srd").held) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("method", ["stochastic-even", "hero", "srd-lambda"])
def test_single_wavelengths_are_drawn_with_the_power_that_landed(gl, method: str) -> None:
    found = balance(gl, "prism", method)
    # Wavelengths are drawn by brightness, and power is what they stand for on average only.
    assert abs(found.drawn) < (1e-3 if method == "srd-lambda" else 0.02)
    assert abs(found.held) < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "old", "new", "noticed"),
    [
        pytest.param("light/roulette.glsl", "ray.throughput *= boost;", "", "unaccounted", id="a survivor's boost"),
        pytest.param(
            "light/trace_scatter.glsl", "child.throughput *= share;", "child.throughput *= 0.85 * share;",
            "unaccounted", id="a share of each event",
        ),
        pytest.param(
            "light/trace.comp", "photon.throughput = ray.throughput;", "photon.throughput = 0.85 * ray.throughput;",
            "drawn", id="a share of what landed",
        ),
        pytest.param(
            "light/splat_shapes.glsl", "splat.amplitude = 1.0 / (reach", "splat.amplitude = 0.85 / (reach", "held",
            id="a share of swept splats",
        ),
        pytest.param(
            "light/splat_shapes.glsl", "        splat.amplitude *= as_drawn", "        float unused = as_drawn",
            "held", id="throughput blurred with the spectrum",
        ),
    ],
)  # fmt: skip
def test_the_balance_notices_a_picture_that_lost_power(
    gl, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, file: str, old: str, new: str, noticed: str
) -> None:
    mutate(monkeypatch, tmp_path, file, old, new)
    found = balance(gl, "prism")
    assert abs(getattr(found, noticed)) > (0.01 if "boost" in old else 1e-3), found
