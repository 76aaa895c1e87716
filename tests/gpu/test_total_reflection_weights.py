"""A band whose anchor is totally reflected while an end of it passes: each wavelength is reflected by its own share.

Taken whole for all of them, what such photons throw stood out as coloured spots at the rim of the lens in `lens_text`.
"""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render

SEEDS = (1, 2, 3)


@pytest.mark.slow
def test_no_photon_stands_out_at_the_onset_of_total_reflection(gl: Context) -> None:
    """With one share for the whole band, seeds 1 and 2 have pixels 187 and 76 from the median (brightest: 301)."""
    scene = load_scene(shipped_scenes()["lens_text"])
    settings = [RenderSettings(160, 90, photons=100_000, spp=1, layer="caustic", seed=seed) for seed in SEEDS]
    pictures = np.array([render(scene, each, context=gl).rgb for each in settings], float)
    middle = np.median(pictures, axis=0)
    assert np.abs(pictures - middle).max() < 0.2 * middle.max()
