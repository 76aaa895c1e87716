"""Whether a frame's camera sees flat-faceted glass and mirrors by beams or by paths.

Strong beams are followed and looked up as polygons; weak ones are handed to paths of single wavelengths, each of which
stands for a small share of a sample (`beams.drawn_starts`). A coarse search tells first what that takes; where it is
not surely cheaper than following paths from the pixels on, or would be of no use, they are followed. Counts decide, not
clocks, so that the same frame is always seen in the same way. Costs are those of a software renderer: elsewhere paths
are kept.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..beams.camera_view import CameraView
from ..beams.drawn_starts import drawn_starts
from ..beams.screen_pairs import count_pixel_parts
from ..beams.screen_polygons import ScreenPolygons
from ..beams.screen_starts import ScreenStarts
from ..model.scene import Camera
from ..model.scene_checks import contains
from ..passes.camera import CameraPass
from ..passes.pixel_lattice import shared_places
from ..passes.sample_spread import PRIMARY_SAMPLES, PRIMARY_SAMPLES_UNTIL
from ..passes.screen_beams import parts_of, sees_edges, strength_of
from ..passes.spectrum_choice import Spectrum

THRESHOLD = 1.6
"""Samples' power (pixels times throughput and share of the spectrum, over the samples a pixel) below which a beam is
handed to paths, …"""
STARTS = 16
"""… of which so many stand for one sample's power. Beams weaker than …"""
_FAINT = 0.25
"""… this share of one of these paths play roulette first."""
_COARSE = 8.0
"""Threshold of the search that tells, in those that the picture needs."""
_MOST_LOOKING = 0.1
"""Of what paths are predicted to cost, that the coarse search may take: the next is dearer."""
_BEAM_S, _ENTRY_S, _START_S = 25e-6, 2.5e-6, 30e-6
"""Seconds of a processor: a beam followed or ended, a part of a pixel looked at, a path that carries on a beam."""
_SAMPLE_S, _DEEP_S = 25e-6, 770e-6
"""The same of a sample of a pixel by paths alone, and what is added by the share of the light that beams hand over:
the more of it, the longer light goes to and fro (35 µs in `prism`, 100 in `default`, 130 in `brilliant_studio`)."""
_SURE = 0.9
"""Of what paths are predicted to cost: beams must cost less."""


@dataclass
class CameraBeamStats:
    """How the camera saw flat facets."""

    by_beams: bool = False
    reason: str = ""
    beams: int = 0
    polygons: int = 0
    starts: int = 0
    """Paths that carry on beams."""
    covered: float = 0.0
    """Pixels."""
    entries: int = 0
    """Parts of pixels looked at, of all polygons."""
    seconds: float = 0.0
    """Of all searches."""

    @property
    def words(self) -> str:
        """For `--stats`."""
        if not self.by_beams:
            return f"by paths: {self.reason}; looked for {self.seconds:.2f} s"
        return (
            f"by beams: {self.beams} followed, {self.polygons} polygons, {self.starts} paths for what they left, "
            f"found in {self.seconds:.2f} s"
        )

    def predicted_seconds(self, samples: int) -> tuple[float, float]:
        """Of a processor: by beams, by paths."""
        by_beams = self.beams * _BEAM_S + self.entries * _ENTRY_S + self.starts * _START_S
        return by_beams, self.covered * samples * _SAMPLE_S + self.starts / STARTS * _DEEP_S


@dataclass(frozen=True)
class _Found:
    """One search's result."""

    polygons: ScreenPolygons
    handed: ScreenPolygons
    shown: np.ndarray
    starts: ScreenStarts


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
        self.stats.reason = self._why_never(camera)
        if self.stats.reason:
            return
        view = camera, (width, height), samples, seed
        self.find(*view, times=_COARSE)
        yield 0.0
        by_paths = self.stats.predicted_seconds(samples)[1]
        if self._view.gave_up:
            self.stats.reason = f"more than {self.stats.beams} beams {_COARSE:g} times too coarse"
        elif not self.stats.covered:
            self.stats.reason = "what is in view hands its light on to something not flat"
        elif self.stats.beams * _BEAM_S > _MOST_LOOKING * by_paths:
            self.stats.reason = f"{self.stats.beams} beams {_COARSE:g} times too coarse"
        if self.stats.reason:
            return
        found = self.find(*view)
        if self._view.gave_up:
            self.stats.reason = f"more than {self.stats.beams} beams"
            return
        by_beams, by_paths = self.stats.predicted_seconds(samples)
        if by_beams > _SURE * by_paths:
            self.stats.reason = f"{by_paths:.2g} s predicted, {by_beams:.2g} s by beams"
            return
        self.show(found, width)

    def find(self, camera: Camera, size: tuple[int, int], samples: int, seed: int, times: float = 1.0) -> _Found:
        """Search with `times` the threshold that so many samples a pixel need; counts are in `stats`."""
        started = time.perf_counter()
        share = 1.0 / (STARTS * samples)
        polygons, shown = self._view.find_screen_polygons(
            camera, size, times * THRESHOLD / samples, seed, faint=_FAINT * share
        )
        handed = polygons.where(polygons.is_handed)
        polygons = polygons.where(~polygons.is_handed)
        brightness = self._pass.brightness
        assert brightness is not None
        starts = drawn_starts(handed, size, brightness, share, seed)
        places = shared_places(samples, PRIMARY_SAMPLES if samples <= PRIMARY_SAMPLES_UNTIL else 1)
        parts = parts_of(strength_of(polygons, brightness), len(places), sees_edges(self._pass.scene.scene))
        self.stats.beams, self.stats.polygons, self.stats.starts = self._view.beams, len(polygons), len(starts)
        self.stats.entries = count_pixel_parts(polygons, size, 0.5, parts)
        self.stats.covered = self._view.covered if shown.any() else 0.0
        self.stats.seconds += time.perf_counter() - started
        return _Found(polygons, handed, shown, starts)

    def show(self, found: _Found, width: int) -> None:
        """Give the pass what was found, of a picture so wide."""
        self.stats.by_beams = True
        self._pass.take_beams(found.polygons, found.shown, (found.starts, found.handed), width)
        # What nothing chooses now (`CameraPass.chooses`) must not be left from another frame.
        self._pass.spectrum = Spectrum(self._pass.fixed_bands or 1)

    def _why_never(self, camera: Camera) -> str:
        if not self._is_software:
            return "costs are known of software renderers only"
        objects, place = self._pass.scene.scene.objects, np.array(camera.position)
        if any(item.material.transmits and contains(item, place) for item in objects):
            return "the camera is inside glass"
        if self._view.sees_all_angles(camera):
            return "a wide facet is seen from straight ahead to grazing"
        return "" if self._pass.disperses else "nothing in view disperses"
