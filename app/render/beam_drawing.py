"""Polygons of beams into maps, with the spectra and colours that are shown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ..beams.polygons import BeamPolygons
from ..gpu import shader
from ..gpu.beam_tables import BeamTables
from ..gpu.context import Context
from ..gpu.map_channels import MapChannels
from ..gpu.scene_buffers import SceneBuffers
from ..passes.beam_splat import BeamSplatter
from ..passes.plane_frame import PlaneFrame
from .light_maps import LightMaps
from .shown_spectra import ShownSpectra


class BeamDrawing:
    """Owns what draws polygons into maps of any number of textures: a preview has fewer."""

    def __init__(
        self, context: Context, buffers: SceneBuffers, shown: ShownSpectra, frames: Mapping[int, PlaneFrame]
    ) -> None:
        """`frames`: planes of the receivers that polygons are on."""
        self._context, self._buffers, self._shown, self._frames = context, buffers, shown, frames
        self.splatters: dict[int, BeamSplatter] = {}
        """By the number of textures."""
        self._tables: dict[int, BeamTables] = {}

    def steps(self, polygons: BeamPolygons, maps: LightMaps, weight: float) -> Iterator[int]:
        """Add polygons to `maps` times `weight`, pausing with the number that was added."""
        targets = maps.atlas.targets
        if targets not in self.splatters:
            traits = self._context.traits
            self.splatters[targets] = BeamSplatter(
                self._context.ctx, targets, traits.work_is_queued, self._context.timers
            )
        yield from self.splatters[targets].steps(
            polygons, self._frames, maps.layout, self._tables_for(targets), maps.atlas, weight
        )

    def _tables_for(self, targets: int) -> BeamTables:
        if targets not in self._tables:
            shown, channels = self._shown, self._shown.channels
            if targets != channels.targets:
                # A preview's: in colour only.
                channels = MapChannels(channels.edges_nm)
            self._tables[targets] = BeamTables.build(
                self._context.ctx, self._buffers.axis, shown.spectra, shown.reflectances, channels
            )
        return self._tables[targets]

    def forget_tables(self) -> None:
        """Other spectra are shown."""
        shader.release(*self._tables.values())
        self._tables.clear()

    def release(self) -> None:
        """Free everything."""
        self.forget_tables()
        shader.release(*self.splatters.values())
