"""Which wavelengths belong to which paths after an edit of n(λ): intervals of the index stay, bands keep meeting, no
light is lost."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from spectrasplat.gpu.reindex import Reindexing
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.glass import LINE_D_NM, Dispersion, constant, from_abbe, with_gain
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.model.optics.spectrum import illuminant, laser

D65 = illuminant("D65")
FLINT = find("N-SF11")


def axis_and_spans(glass: Dispersion, bands: int = 7) -> tuple[SpectralAxis, list[list[tuple[float, float]]]]:
    edges = np.linspace(0.0, 1.0, bands + 1)
    return SpectralAxis.build([glass]), [list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))]


def shown(traced: Dispersion, glass: Dispersion, bands: int = 7) -> tuple[Reindexing, list[tuple[float, float]]]:
    found = Reindexing.of(traced, glass)
    assert found is not None
    axis, spans = axis_and_spans(traced, bands)
    return found, found.spans(spans, axis, found.supports([D65]))[0]


def test_the_same_glass_keeps_every_band() -> None:
    _, spans = shown(FLINT, FLINT)
    assert np.allclose(spans, axis_and_spans(FLINT)[1][0], atol=1e-9)


@pytest.mark.parametrize("gain", [0.05, 0.5, 1.0, 1.7, 6.0])
def test_bands_meet_and_hold_the_whole_spectrum(gain: float) -> None:
    _, spans = shown(FLINT, with_gain(FLINT, gain))
    lit = [(lo, hi) for lo, hi in spans if lo < 1.0 and hi > 0.0 and hi > lo]
    assert lit[0][0] == pytest.approx(0.0, abs=1e-9) and lit[-1][1] == pytest.approx(1.0, abs=1e-9)
    for (_, hi), (lo, _) in itertools.pairwise(lit):
        assert hi == pytest.approx(lo, abs=1e-9)


@pytest.mark.parametrize("gain", [0.3, 2.5])
def test_a_band_keeps_its_indices(gain: float) -> None:
    glass = with_gain(FLINT, gain)
    found, spans = shown(FLINT, glass)
    axis, traced = axis_and_spans(FLINT)
    nm = np.linspace(380.0, 780.0, 40_001)
    for k in range(1, 6):
        lo, hi = spans[k]
        if not (0.0 < lo < hi < 1.0):
            continue
        # Wavelengths at the interval's ends under the edited glass have the index that the band's ends had when it was
        # traced.
        now = glass.index(np.interp([lo, hi], found.axis.x_of_nm(nm), nm))
        then = FLINT.index(axis.nm_of_x(np.array(traced[0][k])))
        assert np.allclose(now, then, atol=1e-7)


def test_no_dispersion_is_one_index_at_the_d_line() -> None:
    found, spans = shown(FLINT, with_gain(FLINT, 0.0))
    (lit,) = [(lo, hi) for lo, hi in spans if lo < 1.0 and hi > 0.0 and hi > lo]
    assert lit == pytest.approx((0.0, 1.0))
    at_d = (found.y_reference - found.offset) / found.scale
    assert at_d == pytest.approx(float(FLINT.index(LINE_D_NM)), abs=1e-7)


def test_a_laser_keeps_its_wavelength() -> None:
    found = Reindexing.of(FLINT, with_gain(FLINT, 2.0))
    assert found is not None
    axis = SpectralAxis.build([FLINT])
    x = float(axis.x_of_nm(532.0))
    [(lo, hi)] = found.spans([[(x, x)]], axis, found.supports([laser(532.0)]))[0]
    assert lo == hi == pytest.approx(float(found.axis.x_of_nm(532.0)))


def test_a_glass_that_turns_the_other_way_cannot_be_followed() -> None:
    assert Reindexing.of(FLINT, from_abbe(1.78, -25.0)) is None
    assert Reindexing.of(FLINT, constant(FLINT.n_d)) is not None
