"""`hero`: four wavelengths on one path, against the reference renderer and against one wavelength a photon.

Companions share a path at mirrors, at whatever reflects, and in glass that does not disperse; roulette asks all four
at once. In each scene the total of X, Y and Z is known to 2 to 5 %. Where companions stay to the end the picture is
quieter in colour than with one wavelength a photon; behind glass that disperses it is not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.primitives_round import sphere
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics.colorimetry import rgb709_to_xyz
from spectrasplat.model.optics.glass import constant
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Absorption, Camera, Dielectric, Diffuse, Mirror, Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.reference.photon_reference import cached_reference
from spectrasplat.render.still import render

from tests.statistical.test_reference_against_gpu import (
    FLINT,
    FLOOR,
    HEIGHT,
    LAMP,
    TOTAL_TOLERANCE,
    VIEW,
    WIDTH,
    blocks,
    mirrored,
    place,
    prism_case,
)

SEEDS, PHOTONS, REFERENCE_PHOTONS = 4, 100_000, 250_000
RED_AWAY = Absorption(np.linspace(0.2, 3.0, 401))


def tinted_without_dispersion() -> Scene:
    """A pane that absorbs red and disperses nothing: companions go through it, each with its own absorption."""
    pane = place(primitives.box((1.2, 1.2, 0.3)), Dielectric(constant(1.6), RED_AWAY), (-0.9, 0.0, 1.4))
    return Scene("tinted", VIEW, (LAMP,), (pane, FLOOR))


def dispersing() -> Scene:
    """A flint ball and a copper one beside it: paths that part, that stay, and that were thrown back by flint first."""
    return Scene(
        "both",
        VIEW,
        (LAMP,),
        (
            place(sphere(0.4, 1280), Dielectric(FLINT), (-0.6, -0.5, 1.0)),
            place(sphere(0.35, 1280), Mirror((0.95, 0.6, 0.3)), (-0.2, 0.5, 0.8)),
            place(primitives.plane(12.0, 12.0), Diffuse((0.7, 0.5, 0.4))),
        ),
    )


def twice_mirrored() -> Scene:
    """Sunlight by way of two dark copper mirrors: all that lands has survived roulette."""
    copper = Mirror((0.5, 0.3, 0.15))
    sun = DirectionalLight("sun", illuminant("D65").scaled_to_luminous(1000.0), direction=(0.6, 0.0, -0.8))
    return Scene(
        "mirrors",
        Camera((2.8, -4.0, 4.0), (2.8, 0.0, 0.0), vertical_fov_deg=24.0),
        (sun,),
        (
            place(primitives.plane(1.0, 1.0), copper, (0.0, 0.0, 0.3)),
            place(primitives.plane(1.2, 1.2), copper, (1.3, 0.0, 2.0)),
            place(primitives.plane(12.0, 12.0), Diffuse((0.7, 0.5, 0.4))),
        ),
    )


def pictures(gl, scene: Scene, method: str, **settings: object) -> np.ndarray:
    """XYZ (seeds, H, W, 3)."""
    asked = RenderSettings(
        width=WIDTH, height=HEIGHT, photons=PHOTONS, method=method, layer="caustic", spp=4, **settings
    )
    return np.array(
        [
            rgb709_to_xyz(render(scene, replace(asked, seed=seed), context=gl).rgb.astype(float))
            for seed in range(1, SEEDS + 1)
        ]
    )


def chroma_noise(shown: np.ndarray) -> float:
    """Variance between seeds of X/Y and Z/Y over lit blocks."""
    seen = np.array([blocks(picture, 4) for picture in shown])
    lit = seen[..., 1].mean(axis=0) > 0.05 * seen[..., 1].mean(axis=0).max()
    ratios = seen[:, lit][..., [0, 2]] / np.maximum(seen[:, lit][..., [1]], 1e-9)
    return float(ratios.var(axis=0, ddof=1).mean())


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene",
    [mirrored, dispersing, twice_mirrored, tinted_without_dispersion, prism_case],
    ids=lambda s: s.__name__,
)
def test_hero_shows_the_reference(gl, scene) -> None:
    made = scene()
    shown = pictures(gl, made, "hero")
    reference = cached_reference(made, WIDTH, HEIGHT, photons=REFERENCE_PHOTONS)
    ours, theirs = blocks(shown.mean(axis=0)), blocks(reference.xyz)
    error = ours.sum(axis=(0, 1)) / theirs.sum(axis=(0, 1)) - 1.0
    totals = np.array([blocks(p).sum(axis=(0, 1)) for p in shown]) / theirs.sum(axis=(0, 1))
    doubt = 2.0 * totals.std(axis=0, ddof=1) / np.sqrt(SEEDS)
    assert doubt.max() < 0.03 and (np.abs(error) < TOTAL_TOLERANCE + doubt).all(), (error, doubt)
    # Block by block: within 4 % of the brightest and three standard errors.
    scatter = np.sqrt(np.var([blocks(p) for p in shown], axis=0, ddof=1) / SEEDS)
    noise = 3.0 * np.hypot(scatter, np.sqrt(np.maximum(blocks(reference.variance), 0.0) / 64.0))
    excess = np.abs(ours - theirs) - noise - 0.04 * theirs.max(axis=(0, 1))
    assert (excess > 0.0).mean() < 0.01, float(excess.max())


@pytest.mark.slow
def test_companions_take_colour_noise_away_where_they_stay(gl) -> None:
    one, four = (chroma_noise(pictures(gl, mirrored(), method)) for method in ("stochastic", "hero"))
    assert four < 0.4 * one, (one, four)


@pytest.mark.slow
def test_spectral_bins_hold_the_same_light(gl) -> None:
    """All four wavelengths land in their own bins: the bins' shares are those of photons with the whole spectrum."""
    sums = {}
    for method in ("srd", "hero"):
        asked = RenderSettings(
            width=WIDTH, height=HEIGHT, photons=4 * PHOTONS, method=method, layer="caustic", spp=4, bins=8
        )
        spectral = render(mirrored(), asked, context=gl).spectral
        assert spectral is not None
        sums[method] = spectral.astype(float).sum(axis=(0, 1))
    np.testing.assert_allclose(sums["hero"], sums["srd"], rtol=0.02)
