"""What a splat has of a throughput that changes over its band, channel by channel: whatever its width beside its sweep,
a channel has what its own light lets it have. lib/swept.glsl against float64."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.features.features import Features
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate
from spectrasplat.stress.rigs.splat_rig import Rig, photons

from tests.gpu.test_splat import frame, spectrum_samples

SPECTRAL, ONE_COLOUR = Features(spectral_groups=1), Features(spectral_groups=0)
STRAIGHT, BENT = (0.2, 0.5, 0.8), (0.9, 0.5, 0.4)
SPLATS = {
    "a focus": (SPECTRAL, 0.05, 0.0),
    "broad": (SPECTRAL, 3.0, 0.3),
    "as broad as its sweep": (SPECTRAL, 2.0, 4.0),
    "a spectrum": (SPECTRAL, 1.0, 24.0),
    "one colour": (ONE_COLOUR, 2.0, 0.0),
    "a focus of one colour": (ONE_COLOUR, 0.05, 0.0),
}


def drawn(gl, name: str, throughput: tuple[float, float, float]) -> np.ndarray:
    """Energies of the channels, over those of the light itself."""
    features, width, sweep = SPLATS[name]
    rig = Rig(gl.ctx, features)
    record = photons(features, np.array([32.2, 31.7]), *frame(0.3, width, width), (sweep, 0.0), throughput=throughput)
    return rig.draw(record).sum(axis=(0, 1)) / np.append(rig.light.xyz(), rig.light.power_w())


def by_wavelength(throughput: tuple[float, float, float]) -> np.ndarray:
    places, energies = spectrum_samples(200)
    return np.interp(places, (-0.5, 0.0, 0.5), throughput) @ energies / energies.sum(axis=0)


@pytest.mark.parametrize("throughput", [STRAIGHT, BENT])
@pytest.mark.parametrize("name", SPLATS)
def test_channels_have_what_their_wavelengths_have(gl, name: str, throughput: tuple[float, float, float]) -> None:
    wanted = by_wavelength(throughput)
    assert np.ptp(wanted) > 0.08
    np.testing.assert_allclose(drawn(gl, name, throughput), wanted, rtol=0.012 if throughput == STRAIGHT else 0.025)


@pytest.mark.parametrize("name", SPLATS)
def test_power_is_what_the_photon_carries(gl, name: str) -> None:
    assert drawn(gl, name, BENT)[3] == pytest.approx(by_wavelength(BENT)[3], rel=3e-3)


def test_a_bend_adds_its_mean_excess(gl) -> None:
    rng = np.random.default_rng(8)
    middle, spread = as_f32(rng.uniform(-1.0, 1.0, (40, 4))), as_f32(rng.uniform(0.05, 0.6, (40, 4)))
    throughput = as_f32(rng.uniform(-1.0, 1.0, (40, 4)))
    body = "bend = mean_bend(middle, spread, throughput);"
    inputs = {"middle": middle, "spread": spread, "throughput": throughput}
    got = evaluate(gl.ctx, ["lib/swept.glsl"], body, inputs, {"bend": "vec4"})["bend"]
    at, _, below, above = (part[:, None, None] for part in throughput.astype(float).T)
    normal = np.linspace(-8.0, 8.0, 4001)
    weight = np.exp(-0.5 * normal**2)
    aside = middle[..., None] + spread[..., None] * normal - at
    mean = (np.where(aside < 0.0, below, above) * aside) @ (weight / weight.sum())
    alone = middle - at[..., 0]
    np.testing.assert_allclose(
        got, mean - np.where(alone < 0.0, below[..., 0], above[..., 0]) * alone, rtol=1e-3, atol=2e-5
    )


def test_functions(gl) -> None:
    rng = np.random.default_rng(7)
    half, sharpness = as_f32(rng.uniform(0.0, 1.0, 500)), as_f32(10.0 ** rng.uniform(-2.0, 3.0, 500))
    place, throughput = as_f32(rng.uniform(-1.0, 1.0, (500, 4))), as_f32(rng.uniform(-1.0, 1.0, (500, 4)))
    body = "part = sweeps_part(half_band, sharpness); over = throughput_over(place, throughput);"
    inputs = {"half_band": half, "sharpness": sharpness, "place": place, "throughput": throughput}
    got = evaluate(gl.ctx, ["lib/swept.glsl"], body, inputs, {"part": "float", "over": "vec4"})
    own, blur = half.astype(float) ** 2 / 3.0, 0.5 / sharpness.astype(float) ** 2
    np.testing.assert_allclose(got["part"], own / (own + blur), rtol=1e-5)
    at, level, below, above = (part[:, None] for part in throughput.astype(float).T)
    np.testing.assert_allclose(
        got["over"], level + np.where(place < at, below, above) * (place - at), rtol=1e-5, atol=1e-6
    )
