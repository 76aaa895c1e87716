"""Photon records made by hand, in texel units, and the splat pass around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from ...features.features import Features
from ...gpu.map_channels import MapChannels
from ...gpu.packed_records import write_records
from ...gpu.records import NONE, RECEIVER, photon_record
from ...gpu.splat_tables import SplatTables
from ...gpu.tiles import Tile, pack
from ...model.optics import spectrum
from ...model.optics.spectral_tables import SpectralAxis
from ...passes.footprint import Photons, SpectralVariables, SplatSpectra
from ...passes.map_atlas import MapAtlas, placement_rows
from ...passes.splat import Splatter

IDENTITY_ROWS = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
"""GPU space is the tile's texels."""
WHOLE_BAND = ((0.0, 1.0),)


@dataclass
class Rig:
    """One flat receiver of `size` texels, and what is drawn into it."""

    ctx: moderngl.Context
    features: Features = field(default_factory=lambda: Features(spectral_groups=1))
    size: tuple[int, int] = (64, 64)
    light: spectrum.Spectrum = field(default_factory=lambda: spectrum.illuminant("D65"))
    bands: Sequence[tuple[float, float]] = WHOLE_BAND
    channels: MapChannels = field(default_factory=MapChannels)
    axis: SpectralAxis = field(default_factory=lambda: SpectralAxis.build([]))
    coarser: Sequence[tuple[tuple[int, int], np.ndarray, float]] = ()
    """Size, rows (2, 4) and texel area of windows, each round the one before."""
    by_compute: bool | None = None
    """Whether compute shaders add the splats; None as the device likes it."""

    def __post_init__(self) -> None:
        self.tables = SplatTables.build(self.ctx, self.axis, [self.light], [None], [self.bands], self.channels)
        windows = [(self.size, IDENTITY_ROWS, 1.0), *self.coarser]
        self.tiles, atlas_size = pack([size for size, _, _ in windows])
        placed = zip(self.tiles, windows, strict=True)
        placements = np.concatenate([placement_rows(tile, rows, area) for tile, (_, rows, area) in placed])
        placements["next"] = [*range(1, len(windows)), NONE]
        self.atlas = MapAtlas(self.ctx, atlas_size, placements, self.features.targets)
        self.receivers = self.ctx.buffer(RECEIVER.zeros(1))
        self.variable = SpectralVariables.build(self.ctx, np.linspace(0.0, 1.0, 1025)[None])
        self.spectra = SplatSpectra(self.variable, self.tables)
        self.splatter = Splatter(self.ctx, self.features, self.by_compute)

    def draw(self, photons: np.ndarray, smoothing: float = 1.0, batch: int | None = None, tile: int = 0) -> np.ndarray:
        """The tile after these photons alone, float64 (height, width, channels)."""
        self.atlas.clear()
        self.splatter.footprints.reset_counts()
        for part in np.array_split(photons, np.arange(batch, len(photons), batch)) if batch else [photons]:
            struct = self.splatter.footprints.photon
            buffer = self.ctx.buffer(reserve=len(part) * struct.stride)
            write_records(struct, buffer, part)
            self.splatter.run(Photons(buffer, len(part)), self.spectra, self.atlas, self.receivers, smoothing)
            buffer.release()
        return self.atlas.read_tile(self.tiles[tile]).astype(np.float64)

    @property
    def tile(self) -> Tile:
        return self.tiles[0]


def photons(
    features: Features,
    centre: np.ndarray,
    axis_s: ArrayLike = (0.0, 0.0),
    axis_t: ArrayLike = (0.0, 0.0),
    chord: ArrayLike = (0.0, 0.0),
    x_lo: float = 0.0,
    x_hi: float = 1.0,
    x_anchor: float | None = None,
    throughput: tuple[float, float, float] = (1.0, 1.0, 1.0),
    band: int = 0,
) -> np.ndarray:
    """Photon records about `centre` (n, 2); `chord` is what the whole of x in [0, 1] sweeps, anchored at `x_anchor`
    (the middle of the band by default), where `centre` is."""
    places = np.atleast_2d(np.asarray(centre, np.float64))
    records = photon_record(features.spectral_groups).zeros(len(places))
    records["position"][:, :2] = places
    records["dposition_ds"][:, :2] = axis_s
    records["dposition_dt"][:, :2] = axis_t
    records["x_lo"], records["x_hi"] = x_lo, x_hi
    records["x_anchor"] = 0.5 * (x_lo + x_hi) if x_anchor is None else x_anchor
    records["throughput"] = throughput
    records["flux_w"] = 1.0
    records["light_and_source"] = 0xFFFF0000 | (band << 8)
    if features.spectral_groups:
        records["dposition_dvar0"][:, :2] = chord
    return records
