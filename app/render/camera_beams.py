"""Whether a frame's camera sees flat-faceted glass and mirrors by beams or by paths.

Beams are searched coarsely first. What that took predicts what beams as fine as the picture's samples cost; where they
are not surely cheaper, or much of their light plays Russian roulette, paths are followed. Counts decide, not clocks, so
that the same frame is always seen in the same way. Costs are those of a software renderer: elsewhere paths are kept.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..beams.camera_view import CameraView
from ..beams.screen_pairs import PIXEL_BITS, pixel_parts
from ..beams.screen_polygons import ScreenPolygons
from ..model.scene import Camera
from ..passes.camera import CameraPass
from ..passes.spectrum_choice import Spectrum

_COARSE = 16.0, 4.0
"""Thresholds of the searches that tell, in those that the picture needs."""
_BEAM_S, _ENTRY_S, _PATH_S = 15e-6, 8e-6, 30e-6
"""Seconds of a processor: a beam followed, a pixel of a polygon looked at, a path of one sample (llvmpipe; `default`,
`prism` and `brilliant_studio`)."""
_SURE = 0.7
"""Of what paths are predicted to cost: beams must cost less."""
_MOST_LOOKING = 0.1
"""Of the same, that a coarse search may take, for the next is dearer."""
_MOST_TAIL = 0.01
"""Share of the light that roulette may decide on. Kept beams count up to one over their chance, and one that happens to
see a lamp is a bright pixel, …"""
_MOST_TAIL_WITH_LAMPS = 1e-4
"""… so where lamps can be seen hardly any."""


@dataclass
class CameraBeamStats:
    """How the camera saw flat facets."""

    by_beams: bool = False
    reason: str = ""
    beams: int = 0
    polygons: int = 0
    seconds: float = 0.0
    """Of all searches."""

    @property
    def words(self) -> str:
        """For `--stats`."""
        if not self.by_beams:
            return f"by paths: {self.reason}; looked for {self.seconds:.2f} s"
        return f"by beams: {self.beams} followed, {self.polygons} polygons, found in {self.seconds:.2f} s"


class CameraBeams:
    """Searches a scene's facets for its camera pass's frames."""

    def __init__(self, camera_pass: CameraPass, is_software: bool) -> None:
        """`camera_pass`: with `features.camera_beams`."""
        scene = camera_pass.scene
        self._pass, self._is_software = camera_pass, is_software
        self._view = CameraView(scene.scene, scene.world_meshes, scene.axis, scene.space.to_gpu, scene.space.scale)
        self.stats = CameraBeamStats()
        """Of the last frame."""

    def choosing(self, camera: Camera, width: int, height: int, samples: int, seed: int) -> Iterator[float]:
        """Give the pass this frame's polygons, or none where paths serve it better; pauses between searches."""
        self._pass.take_beams(None)
        self.stats = CameraBeamStats()
        if not self._is_software:
            self.stats.reason = "costs are known of software renderers only"
            return
        size, needed = (width, height), needed_threshold(samples)
        costs: list[tuple[int, int]] = []
        covered = 0
        for times in _COARSE:
            polygons, shown = self._find(camera, size, needed * times, seed)
            yield 0.0
            if not shown.any() or not len(polygons):
                self.stats.reason = "what is in view hands its light on to something not flat"
                return
            entries = pixel_parts(polygons, size, 0.5, np.ones(len(polygons), np.int64))[:, 1]
            costs.append((self._view.beams, len(entries)))
            covered = len(np.unique(entries & ((1 << PIXEL_BITS) - 1)))
            if self._view.beams * _BEAM_S > _MOST_LOOKING * covered * samples * _PATH_S:
                self.stats.reason = f"{self._view.beams} beams {times:g} times too coarse"
                return
        by_beams, by_paths = predicted_seconds(costs, covered, samples)
        if by_beams > _SURE * by_paths:
            self.stats.reason = f"{by_paths:.2g} s predicted, {by_beams:.2g} s by beams"
            return
        polygons, shown = self._find(camera, size, needed, seed)
        most = _MOST_TAIL_WITH_LAMPS if self._sees_lamps else _MOST_TAIL
        if self._view.tail > most:
            self.stats.reason = f"{self._view.tail:.1%} of the light would play roulette"
            return
        self.stats.by_beams, self.stats.beams, self.stats.polygons = True, self._view.beams, len(polygons)
        self._pass.take_beams(polygons, shown)
        # What nothing chooses now (`CameraPass.chooses`) must not be left from another frame.
        self._pass.spectrum = Spectrum(self._pass.fixed_bands or 1)

    @property
    def _sees_lamps(self) -> bool:
        return any(light.has_extent for light in self._pass.scene.scene.lights)

    def _find(
        self, camera: Camera, size: tuple[int, int], threshold: float, seed: int
    ) -> tuple[ScreenPolygons, np.ndarray]:
        started = time.perf_counter()
        found = self._view.find_screen_polygons(camera, size, threshold, seed)
        self.stats.seconds += time.perf_counter() - started
        return found


def needed_threshold(samples: int) -> float:
    """Pixels times throughput and share of the spectrum, for pictures of so many samples: half of what one counts."""
    return 0.5 / samples


def predicted_seconds(costs: list[tuple[int, int]], covered: int, samples: int) -> tuple[float, float]:
    """By beams at the threshold needed, from (beams, entries) of both coarse searches, each growing on as between them;
    by paths through so many pixels."""
    step = np.log(_COARSE[0] / _COARSE[1])
    beams, entries = (
        last * (last / max(first, 1)) ** (np.log(_COARSE[1]) / step) for first, last in zip(*costs, strict=True)
    )
    return float(beams * _BEAM_S + entries * _ENTRY_S), covered * samples * _PATH_S
