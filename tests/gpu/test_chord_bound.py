"""What chords of bands miss, against rays of a ball in closed form: within the bound in every channel's own light."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.model.optics import glass
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, cmf_xyz
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import pilot
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.light_pass import LightPass

from tests.unit.scene_texts import load

SCENE = """
camera = { position = [0.0, -6.0, 6.0], target = [0.0, 0.0, -1.2], vertical_fov_deg = 12.0 }
lights = [{ kind = "collimated", position = [0, 0, 4], direction = [0, 0, -1], radius = 0.8, illuminance_lx = 1000 }]
objects = [{ shape = "sphere", radius = 1.0, material = { kind = "glass", n_d = 1.52, V_d = %g } },
    { shape = "plane", width = 20.0, height = 20.0, position = [0.0, 0.0, -1.2], material = "diffuse" }]
"""


def landing(height: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Where a ray that falls on a unit ball `height` beside its axis crosses the plane 1.2 behind the middle."""
    outside, inside = np.arcsin(height), np.arcsin(height / index)
    # It leaves half a turn less what it bends, measured about the middle, and is turned by twice the difference.
    turned = 2.0 * (outside - inside)
    leaves = outside + np.pi - 2.0 * inside
    x, depth = np.sin(leaves), np.cos(leaves)
    return x - np.tan(turned) * (1.2 + depth)


@pytest.mark.parametrize("V_d", [3.0, 8.0, 25.0, 60.0])
@pytest.mark.parametrize("photons", [10_000, 100_000, 1_000_000])
def test_chords_of_a_ball_keep_the_bound_in_each_channel(
    gl: Context, tmp_path, monkeypatch: pytest.MonkeyPatch, V_d: float, photons: int
) -> None:
    scene, settings = load(tmp_path, SCENE % V_d), RenderSettings(160, 90, method="srd-photons", layer="caustic")
    fits: list[pilot.PilotFit] = []
    counted: Callable[[pilot.PilotFit], int] = pilot.PilotFit.band_count
    monkeypatch.setattr(pilot.PilotFit, "band_count", lambda fit: (fits.append(fit), counted(fit))[1])
    buffers = scene_buffers(gl, scene, settings)
    light = LightPass(gl, scene, settings, buffers.features, buffers)
    light.prepare()
    light.begin(photons, 1)
    (plan,), fit = light.plans, fits[-1]
    texel = fit.texel[int(fit.pilot.whole["receiver"][0])] / buffers.space.scale
    index = glass.from_abbe(1.52, V_d).index(VISIBLE_NM.astype(float))
    heights = np.sqrt(np.linspace(0.0005, 0.639, 400))[:, None]
    step = 1e-5
    spacing = np.sqrt(plan.domain.measure / plan.lattice_count(photons)) / buffers.space.scale

    def relative(edges: np.ndarray, bands: int) -> np.ndarray:
        """Miss of each ray over its bound, by channel (heights, 3)."""
        x = buffers.axis.x_of_nm(VISIBLE_NM)
        band = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bands - 1)
        anchors = buffers.axis.nm_of_x(0.5 * (edges[:-1] + edges[1:]))
        n_anchor = glass.from_abbe(1.52, V_d).index(anchors)[band][None, :]
        slope = (landing(heights, n_anchor + step) - landing(heights, n_anchor - step)) / (2.0 * step)
        miss = landing(heights, n_anchor) + slope * (index - n_anchor) - landing(heights, index[None, :])
        weights = cmf_xyz() * illuminant("D65").density[:, None]
        rms = np.sqrt(miss**2 @ (weights / weights.sum(axis=0)))
        radial = (landing(heights + step, n_anchor) - landing(heights - step, n_anchor)) / (2.0 * step)
        sides = np.maximum(np.abs(radial), np.abs(landing(heights, n_anchor) / heights))
        own = (fit.smoothing * spacing / texel * (bands / len(plan.bands)) ** 0.5) * np.median(
            sides, axis=1, keepdims=True
        )
        return rms / texel / (pilot.BAND_TOLERANCE * own * np.clip(own, pilot.LEAST_BROAD, 1.0))

    edges = np.array([plan.bands[0].x_lo, *(band.x_hi for band in plan.bands)])
    beyond = (relative(edges, len(plan.bands)) > 1.0).mean(axis=0)
    assert beyond.max() < 0.03, (len(plan.bands), beyond)
    if len(plan.bands) > 2:
        fewer = len(plan.bands) // 3
        some = (relative(np.linspace(edges[0], edges[-1], fewer + 1), fewer) > 1.0).mean(axis=0)
        assert some.max() > 0.1, "a third of these bands would have done"
    light.release()
    buffers.release()
