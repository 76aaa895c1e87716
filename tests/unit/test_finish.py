"""Tables of a coat's albedo against plain sums over the hemisphere."""

from __future__ import annotations

import numpy as np
import pytest
from reference import finish
from spectrasplat.model.optics.rough_surfaces import coat_tables, directional_albedo


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_the_albedo_of_a_coat_is_its_lobe_summed_up(alpha: float) -> None:
    """Against a plain sum over the hemisphere, which draws nothing."""
    directions, weights = finish.hemisphere(1200, 700)
    for cosine in (0.95, 0.5, 0.2):
        o = np.broadcast_to(finish.toward(cosine), directions.shape)
        summed = (weights * finish.lobe(np.array(alpha), np.array(1.5), o, directions)).sum()
        assert directional_albedo(alpha, 1.5, np.array([cosine]))[0] == pytest.approx(summed, rel=3e-3)


def test_base_and_coat_return_all_light_from_every_side() -> None:
    """Over a base that absorbs nothing: E + ∫ (1 − E)(1 − E) / (1 − mean) cos / π = 1."""
    cosine = np.linspace(0.0, 1.0, 1025)
    for alpha, index in ((0.0, 1.5), (0.0625, 1.5), (1.0, 2.5)):
        albedo, under = coat_tables(alpha, index, 1025)
        returned = albedo + (1.0 - albedo) * 2.0 * np.trapezoid(under * cosine, cosine)
        np.testing.assert_allclose(returned, 1.0, atol=1e-12)
        assert (albedo >= 0.0).all() and (albedo <= 1.0).all()


def test_single_scattering_alone_would_lose_much_of_a_rough_lobe() -> None:
    """How large the loss is that the base gets back: nothing when polished, seven tenths of a lossless lobe at 1."""
    seen = np.array([1.0])
    for alpha, lost in ((0.0, 0.0), (0.0625, 0.005), (0.25, 0.084), (1.0, 0.693)):
        assert 1.0 - directional_albedo(alpha, np.inf, seen)[0] == pytest.approx(lost, abs=2e-3)
