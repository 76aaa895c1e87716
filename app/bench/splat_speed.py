"""How fast splats of one size are drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..features.features import Features
from ..gpu import shader
from ..gpu.packed_records import write_records
from ..gpu.records import RECEIVER, photon_record
from ..gpu.splat_tables import SplatTables
from ..gpu.tiles import pack
from ..model.optics import spectrum
from ..model.optics.spectral_tables import SpectralAxis
from ..passes.footprint import Photons, SpectralVariables, SplatSpectra
from ..passes.map_atlas import MapAtlas, placement_rows
from ..passes.splat import Splatter
from .device_costs import median_s

if TYPE_CHECKING:
    import moderngl

_FEATURES = Features(spectral_groups=1, band_cuts=True)
_SIDE = 768
_REACH = 3.0
"""Standard deviations from the middle of a splat to its edge."""


def measure(ctx: moderngl.Context, pixels: float, count: int) -> dict[str, float]:
    """Rates for `count` splats that cover `pixels` texels each, swept, twice as long as wide: the median of a few
    rounds by wall clock, M splats/s with their footprints and without (`draw`), G texels/s of the latter."""
    tiles, size = pack([(_SIDE, _SIDE)])
    rows = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
    atlas = MapAtlas(ctx, size, placement_rows(tiles[0], rows, 1.0))
    tables = SplatTables.build(ctx, SpectralAxis.build([]), [spectrum.illuminant("D65")], [None], [[(0.0, 1.0)]])
    splatter = Splatter(ctx, _FEATURES)
    receivers = ctx.buffer(RECEIVER.zeros(1))
    variable = SpectralVariables.build(ctx, np.linspace(0.0, 1.0, 1025)[None])
    photons = ctx.buffer(reserve=count * splatter.footprints.photon.stride)
    write_records(splatter.footprints.photon, photons, _photons(pixels, count))

    def splat() -> None:
        splatter.run(Photons(photons, count), SplatSpectra(variable, tables), atlas, receivers, 1.0)

    def draw() -> None:
        for _ in range(-(-count // splatter.group)):
            splatter.draw(tables, atlas)

    splat_s, draw_s = median_s(ctx, splat), median_s(ctx, draw)
    shader.release(atlas, tables, splatter, receivers, variable, photons)
    drawn = -(-count // splatter.group) * min(count, splatter.group)
    rates = {"splat_m_per_s": count / splat_s / 1e6, "draw_m_per_s": drawn / draw_s / 1e6}
    return rates | {"texels_g_per_s": 1e-3 * pixels * rates["draw_m_per_s"]}


def _photons(pixels: float, count: int) -> np.ndarray:
    """Splats of one size at random places and angles."""
    rng = np.random.default_rng(1)
    sigma = np.sqrt(pixels / 2.0) / (2.0 * _REACH)
    margin = 2.0 * np.sqrt(pixels)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    records = photon_record(_FEATURES.spectral_groups).zeros(count)
    records["position"][:, :2] = rng.uniform(margin, _SIDE - margin, (count, 2))
    records["dposition_ds"][:, :2] = along * sigma
    records["dposition_dt"][:, :2] = np.stack([-along[:, 1], along[:, 0]], axis=1) * sigma
    records["dposition_dvar0"][:, :2] = along * (2.0 * _REACH * sigma)
    records["x_hi"], records["x_anchor"] = 1.0, 0.5
    records["throughput"], records["flux_w"] = 1.0, 1.0
    return records
