"""One flat receiver, whose texels are GPU units, and what beam polygons deposit in it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from spectrasplat.beams.polygons import BeamPolygons
from spectrasplat.gpu.beam_tables import BeamTables
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.gpu.records import RECEIVER
from spectrasplat.gpu.tiles import pack
from spectrasplat.model.optics import spectrum
from spectrasplat.model.optics.spectral_tables import SpectralAxis
from spectrasplat.passes.beam_splat import BeamSplatter
from spectrasplat.passes.map_atlas import MapAtlas, placement_rows
from spectrasplat.passes.map_layout import MapLayout
from spectrasplat.passes.plane_frame import PlaneFrame

PLANE = PlaneFrame(np.zeros(3), np.eye(3)[:2])
ROWS = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])


def all_of(steps: Iterator[int]) -> None:
    """Everything that comes in steps, at once."""
    for _ in steps:
        pass


@dataclass
class BeamRig:
    """A map of `size` texels."""

    ctx: object
    size: tuple[int, int] = (64, 64)
    light: spectrum.Spectrum = field(default_factory=lambda: spectrum.illuminant("D65"))
    channels: MapChannels = field(default_factory=MapChannels)
    axis: SpectralAxis = field(default_factory=lambda: SpectralAxis.build([]))

    def __post_init__(self) -> None:
        self.tables = BeamTables.build(self.ctx, self.axis, [self.light], [None], self.channels)
        tiles, atlas_size = pack([self.size])
        placements = placement_rows(tiles[0], ROWS, 1.0)
        self.tile = tiles[0]
        self.layout = MapLayout(atlas_size, placements, RECEIVER.zeros(1), {0: tiles}, {}, {}, ())
        self.atlas = MapAtlas(self.ctx, atlas_size, placements, self.channels.targets)
        self.splatter = BeamSplatter(self.ctx, self.channels.targets)

    def draw(self, polygons: BeamPolygons) -> np.ndarray:
        """The map after these polygons alone, float64 (height, width, channels)."""
        self.atlas.clear()
        all_of(self.splatter.steps(polygons, {0: PLANE}, self.layout, self.tables, self.atlas))
        return self.atlas.read_tile(self.tile).astype(np.float64)
