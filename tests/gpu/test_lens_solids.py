"""A prescription's solids bend rays as its own exact tracer does."""

from __future__ import annotations

import numpy as np
import pytest
import spectrasplat as ss
from spectrasplat.base.paths import assets_dir
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.prescription_file import read_prescription
from spectrasplat.model.optics.lens_design import lens_table, traced


def test_rays_through_the_solids_land_where_the_tracer_says(gl: Context) -> None:
    """Triangles and float32: to a fiftieth of a millimetre where rays are bent by three."""
    path = assets_dir() / "lenses" / "cooke_triplet.csv"
    lens = read_prescription(path)
    scene = ss.load(path)
    fan = ss.fan(scene, scene.objects.names[0], rays=9)
    table = lens_table(lens)
    ends = np.take_along_axis(fan.points, fan.lengths[..., None, None] - 1, axis=2)[:, :, 0]
    start = fan.points[:, 0, 0, 1:]
    heights = np.linalg.norm(start, axis=-1) * np.sign(start @ start[0])
    y, slope = traced(lens, heights, fan.wavelengths_nm)
    length = sum(surface.thickness for surface in lens.surfaces)
    assert np.ptp(heights) > table.beam_radius
    passed = np.isfinite(y) & (np.abs(ends[..., 0] - length - table.back_focus) < 1e-3)
    assert passed.mean() > 0.7
    across = (ends[..., 1:] @ start[0]) / np.linalg.norm(start[0])
    np.testing.assert_allclose(across[passed], (y + slope * table.back_focus)[passed], atol=0.02)
    assert np.abs(y + slope * table.back_focus)[passed].max() == pytest.approx(0.05, abs=0.05)
