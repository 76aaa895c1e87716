"""What splatting asks of a GPU: how many dispatches, of how many rounds, and that nothing waits for a number."""

from __future__ import annotations

import numpy as np
import pytest
from gl_counts import counted
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.passes.footprint import Photons
from spectrasplat.stress.rigs.splat_rig import Rig, photons

FEATURES = Features(spectral_groups=1)


@pytest.mark.parametrize("by_compute", [False, True])
@pytest.mark.parametrize(("start", "stride", "held"), [(0, 1, 700), (5, 3, 601), (0, 1, 0), (900, 1, 700)])
def test_photons_of_which_only_the_device_knows_how_many(
    gl: Context, by_compute: bool, start: int, stride: int, held: int
) -> None:
    """The bound may be larger: what lies behind the last record is left alone, and nothing is read back."""
    rig = Rig(gl.ctx, FEATURES, by_compute=by_compute)
    rng = np.random.default_rng(1)
    records = photons(FEATURES, rng.uniform(0.0, 64.0, (1000, 2)), (2.0, 0.0), (0.0, 1.0), (3.0, 1.0))
    buffer, state = gl.ctx.buffer(records), gl.ctx.buffer(np.array([7, held, 7], np.uint32))
    there = len(range(start, held, stride))
    given = Photons(buffer, there, start, stride), Photons(buffer, (1000 - start) // stride, start, stride, (state, 4))
    pictures = []
    for some in given:
        rig.atlas.clear()
        with counted() as counts:
            rig.splatter.run(some, rig.spectra, rig.atlas, rig.receivers, 1.0)
        assert counts.waits == 0
        pictures.append(rig.atlas.read_tile(rig.tile))
    want, got = pictures
    assert (want.max() > 0.0) == (there > 0)
    np.testing.assert_allclose(got, want, rtol=1e-5, atol=1e-6 * want.max())
