"""The part of a light pass that beams carry: found on the processor, drawn into the maps as polygons, and what is not
flat handed to photons.

Where photons are traced besides, every round of a pass has beams of its own, found as coarsely as its share of the
photons asks and with roulette's numbers of its own, so that a pass is even whenever it is left.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ..base.random_words import Dimension, random_word
from ..beams.light_beams import BeamFinder, LightBeams
from ..beams.polygons import BeamPolygons
from ..beams.search import SUM_ABSORBED, SUM_BEAMS, SUM_DEPOSITED, SUM_ENTERED, SUM_ESCAPED, SUM_HANDED
from ..gpu.beam_tables import BeamTables
from ..gpu.context import Context
from ..gpu.scene_buffers import SceneBuffers
from ..model.features import is_flat
from ..model.scene import Scene
from ..passes.beam_splat import BeamSplatter
from ..passes.map_layout import MapLayout, plane_frame
from .light_maps import LightMaps
from .shown_spectra import ShownSpectra

THRESHOLD = 4.0
"""Over the number of photons asked for: the share of the light below which a beam plays roulette."""
COARSEST, FINEST = 1e-2, 1e-8
_SURVEY = 1e-3
"""Threshold of the search that tells which objects beams carry, and what they cost."""
_DEAREST = 90.0
"""Seconds of a survey after which photons are thought cheaper."""
_SUMS = {
    "entered": SUM_ENTERED,
    "deposited": SUM_DEPOSITED,
    "handed": SUM_HANDED,
    "absorbed": SUM_ABSORBED,
    "escaped": SUM_ESCAPED,
}


@dataclass
class BeamStats:
    """What beams did in a light pass."""

    searches: int = 0
    beams: int = 0
    polygons: int = 0
    flux_w: dict[str, float] = field(default_factory=lambda: dict.fromkeys(_SUMS, 0.0))
    """W by where it went, mean over the searches."""
    find_seconds: float = 0.0
    draw_seconds: float = 0.0


class BeamLight:
    """Finds and draws the beams of one scene's lights."""

    def __init__(
        self, context: Context, scene: Scene, buffers: SceneBuffers, shown: ShownSpectra, targets: int, depth: int
    ) -> None:
        self._context, self._scene, self._buffers, self._shown = context, scene, buffers, shown
        self._depth = depth
        self.frames = {
            r: plane_frame(buffers.space.to_gpu(buffers.world_meshes[i].vertices))
            for r, i in enumerate(buffers.receivers)
            if is_flat(scene.objects[i])
        }
        self.finder = BeamFinder(
            scene,
            buffers.world_meshes,
            {r: (frame.origin, frame.axes) for r, frame in self.frames.items()},
            {},
            buffers.axis,
            buffers.space.to_gpu,
            buffers.space.scale,
        )
        self._splatter = BeamSplatter(context.ctx, targets)
        self._tables: BeamTables | None = None
        self.carried: dict[int, tuple[int, ...]] = {}
        """By light: the objects whose light beams carry."""
        self.why_not = ""
        """Why there are none after all."""
        self.stats = BeamStats()
        self.found: LightBeams | None = None
        """The last that were drawn."""

    def survey(self) -> None:
        """Find out which objects' light beams carry, and whether that pays."""
        started = time.perf_counter()

        def pays() -> bool:
            return time.perf_counter() - started < _DEAREST

        found = self._find(_SURVEY, 0, go_on=pays)
        if not pays():
            self.why_not = f"more than {_DEAREST:g} s for the strongest beams: photons are cheaper"
            return
        self.carried = {light: objects for light, objects in found.carried.items() if objects}

    def lay_out(self, layout: MapLayout) -> None:
        """Polygons will be drawn into maps that lie so."""
        texels = {}
        for r in self.frames:
            record = layout.placements[layout.receivers[r]["placement"]]
            texels[r] = float(np.sqrt(record["texel_area"])) * self._buffers.space.scale
        self.finder.set_texels(texels)

    def begin(self) -> None:
        """Spectra and glass are now what is shown."""
        if self._tables is not None:
            self._tables.release()
        shown = self._shown
        self._tables = BeamTables.build(
            self._context.ctx, self._buffers.axis, shown.spectra, shown.reflectances, shown.channels
        )
        self.stats = BeamStats()

    def steps(self, photons: float, weight: float, seed: int, number: int, maps: LightMaps) -> Iterator[float]:
        """Find beams as fine as `photons` ask and add them to `maps` times `weight`, pausing with the share done."""
        assert self._tables is not None, "begin() comes first"
        stats, started = self.stats, time.perf_counter()
        threshold = float(np.clip(THRESHOLD / max(photons, 1.0), FINEST, COARSEST))
        word = random_word(seed, 0, number, Dimension.BRANCH)
        for step in self.finder.find(threshold, self._depth, word):
            stats.find_seconds += time.perf_counter() - started
            if isinstance(step, LightBeams):
                self.found = step
            else:
                yield 0.5 * step
            started = time.perf_counter()
        assert self.found is not None
        self._count(self.found)
        if self.found.polygons is not None:
            self.draw(self.found.polygons, maps, weight)
            self._context.finish()
        stats.draw_seconds += time.perf_counter() - started
        yield 1.0

    def draw(self, polygons: BeamPolygons, maps: LightMaps, weight: float) -> None:
        """Add polygons to `maps`."""
        assert self._tables is not None
        self._splatter.run(polygons, self.frames, maps.layout, self._tables, maps.atlas, weight)

    def _find(self, threshold: float, seed: int, **options) -> LightBeams:
        found = LightBeams({})
        for step in self.finder.find(threshold, self._depth, seed, **options):
            if isinstance(step, LightBeams):
                found = step
        return found

    def _count(self, found: LightBeams) -> None:
        stats, n = self.stats, self.stats.searches
        stats.searches += 1
        stats.polygons += 0 if found.polygons is None else len(found.polygons)
        watts = dict.fromkeys(_SUMS, 0.0)
        for light, sums in found.sums.items():
            power = float(self._buffers.light_power[light].band(0.0, 1.0)[3])
            stats.beams += int(sums[SUM_BEAMS])
            for name, index in _SUMS.items():
                watts[name] += power * float(sums[index])
        for name, value in watts.items():
            stats.flux_w[name] += (value - stats.flux_w[name]) / (n + 1)

    def release(self) -> None:
        """Free everything."""
        self._splatter.release()
        if self._tables is not None:
            self._tables.release()
        self._tables = None


def carries_everything(scene: Scene, carried: tuple[int, ...]) -> bool:
    """Whether no photon of a light is needed at its first surface: all glass and mirrors are carried by beams."""
    return all(i in carried for i, item in enumerate(scene.objects) if item.material.is_specular)
