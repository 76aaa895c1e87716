"""The part of a light pass that beams carry: found on the processor and drawn into the maps as polygons. What meets
something that is not flat, and what is too weak, is left to photons.

Where photons are traced besides, every round of a pass has beams of its own, found as coarsely as its share of the
photons asks and with roulette's numbers of its own, so that a pass is even whenever it is left.
"""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base.generators import finished, mapped, timed
from ..beams.light_beams import LIGHT_PARTS, MOVING_PARTS, SURVEY_PARTS, BeamFinder, LightBeams, parts_for
from ..beams.polygons import BeamPolygons
from ..beams.search import (
    SUM_ABSORBED,
    SUM_DEPOSITED,
    SUM_DEPTH,
    SUM_ENTERED,
    SUM_ESCAPED,
    SUM_LEFT,
    SUM_NUMERIC,
    SUM_ROULETTE,
)
from ..gpu.context import Context
from ..gpu.scene_buffers import SceneBuffers
from ..model.scene import Scene
from ..passes.landings import Landings, is_back
from ..passes.map_atlas import KIND_PICTURE
from ..passes.map_layout import MapLayout
from ..passes.plane_frame import plane_frame
from ..passes.trace import FluxTally
from .beam_drawing import BeamDrawing
from .beam_worker import BeamWorker
from .light_maps import LightMaps
from .sampling import SURVEY, MovingBeams
from .shown_spectra import ShownSpectra

PHOTONS_A_BEAM = 2.0
"""Photons that a beam counts as in a scene of few facets, half of them for what it leaves."""
_FACETS_A_BEAM = 350.0
"""Facets of the scene with which a beam counts as twice as many photons."""
_FINER = 32.0
"""A search that followed n beams says how many there are at thresholds down to this times root n finer."""
COARSEST, FINEST = 1e-2, 1e-9
"""Thresholds: the share of the light below which a beam is left to photons, or plays roulette."""
_GROWTH, _GROWTH_WITH_TAILS = 0.8, 1.0
"""The number of beams is about proportional to this power of one over the threshold, in a cut stone; where
weak beams play roulette, and where they are left to photons."""
_FEWEST = 200.0
"""Beams: a survey that followed fewer says too little of weak ones, and is done again `_AGAIN` times as finely."""
_AGAIN = 0.1
_ENOUGH = 4.0
"""A search that followed this many times fewer beams than there is time for is done again."""
_DEAREST = 3e7
"""Steps of a survey, each times `_STEP_FACETS` and the scene's facets, after which photons are taken to be cheaper.
Counted, not timed: a scene is rendered alike on every machine."""
MANY = 800.0
"""Beams of a survey above which photons carry all where weak beams play roulette, which is noisier: the tail of a cut
stone holds much of its picture."""
_UNCOUNTED = 0.1
"""Share of its light whose end a survey may not know: where rays are that far from parallel behind wide facets, what
beams draw is wrong as well."""
_STEP_FACETS = 60
"""A step costs as much as it takes to test so many facets, besides those of the scene."""
_PICTURE_SHARE = 0.125
"""Share of a texel that is half a pixel to which the sweep's chord keeps, for up to `_SHARE_PHOTONS`: with more photons
it falls as their number rises, down to `_LEAST_SHARE`. What the chord misses is all that is left in such maps."""
_SHARE_PHOTONS = 1e5
_LEAST_SHARE = 1.0 / 64.0
_ENDS = {
    "deposited": SUM_DEPOSITED,
    "absorbed": SUM_ABSORBED,
    "escaped": SUM_ESCAPED,
    "lost_depth": SUM_DEPTH,
    "lost_numeric": SUM_NUMERIC,
}
"""Where beams end, by the names of `FluxTally.ended`."""


@dataclass
class BeamStats:
    """What beams did in a light pass."""

    searches: int = 0
    beams: int = 0
    polygons: int = 0
    entered_w: float = 0.0
    """W of lights that met flat facets first; mean over the searches."""
    deposited_w: float = 0.0
    left_w: float = 0.0
    """W that photons carry on."""
    find_seconds: float = 0.0
    draw_seconds: float = 0.0

    def count(self, name: str, seconds: float) -> None:
        """Finding or drawing took so much more time."""
        setattr(self, name, getattr(self, name) + seconds)


_MOVING_WORD = 1
"""Roulette's seed in motion: the same beams from frame to frame."""


COMPILING = "readying the search for beams, up to a minute the first time"
SEARCHING = "searching for beams"
_compiled: list[bool] = []
"""Holds something once a search has run in this process."""


class BeamLight:
    """Finds and draws the beams of one scene's lights."""

    def __init__(
        self,
        context: Context,
        scene: Scene,
        buffers: SceneBuffers,
        shown: ShownSpectra,
        depth: int,
        *,
        in_thread: bool = False,
    ) -> None:
        """`in_thread`: search in a thread of its own, with pauses in which others may draw."""
        self._context, self._buffers = context, buffers
        self._depth = depth
        self._worker = BeamWorker(in_thread=in_thread)
        self.frames = {
            r: plane_frame(buffers.space.to_gpu(buffers.world_meshes[i].vertices))
            for r, i in enumerate(buffers.receivers)
            if scene.objects[i].mesh.is_flat
        }
        self._traced = BeamFinder(
            scene,
            list(buffers.world_meshes),
            {r: (frame.origin, frame.axes) for r, frame in self.frames.items()},
            {},
            buffers.axis,
            buffers.space.to_gpu,
            buffers.space.scale,
            shown.channels.bins,
        )
        self._finder: BeamFinder | None = self._traced
        self._scene = scene
        self._coarse: tuple[MapLayout, BeamFinder] | None = None
        self.drawing = BeamDrawing(context, buffers, shown, self.frames)
        self.carried: dict[int, tuple[int, ...]] = {}
        """By light: the objects whose light beams carry."""
        self.why_not = ""
        """Why there are none after all."""
        self.stats = BeamStats()
        self._surveyed = self._with_tails = 1.0
        """Beams that are followed at `SURVEY`: where weak ones play roulette, and where they are left to photons."""
        self._light_parts, self._beams_a_point = LIGHT_PARTS[0], 1.0
        self._survey_polygons: BeamPolygons | None = None
        """What maps are fitted to."""
        self.found: LightBeams | None = None
        """The last that were drawn, or found by the survey."""

    def surveying(self, moving: MovingBeams | None = None) -> Iterator[str | None]:
        """Find out which objects' light beams carry, and whether that pays, pausing with the name of what is done now
        (None: as before); afterwards `found` holds the strongest beams, or those of `moving`."""
        light_parts = SURVEY_PARTS if moving is None else MOVING_PARTS
        if not _compiled:
            # The first search of a process may have to be compiled, which says nothing about the scene.
            search = partial(self.finder.find, 1.0, self._depth, _MOVING_WORD, 1)
            yield from mapped(self._worker.searched(search, threads=None), lambda share: COMPILING)
            _compiled.append(True)
            yield SEARCHING
        each, work = _STEP_FACETS + len(self.finder.scene.facets), 0

        def pays(steps: int) -> bool:
            nonlocal work
            work += each * steps
            return work < _DEAREST

        def surveyed(at: float, *, tails: bool) -> Generator[None, None, LightBeams]:
            search = partial(self.finder.find, at, self._depth, _MOVING_WORD, light_parts, tails=tails)
            return (yield from mapped(self._worker.searched(search, pays, None), lambda share: None))

        at = SURVEY
        strongest = yield from surveyed(at, tails=True)
        if strongest.followed() < _FEWEST and pays(0):
            at *= _AGAIN
            strongest = yield from surveyed(at, tails=True)
        # In motion weak beams play roulette, and none is left to photons.
        found = strongest if moving is None else (yield from surveyed(moving.threshold, tails=False))
        if not pays(0):
            self.why_not = "the strongest beams alone are so many that photons are cheaper"
            return
        # As many as there would be at the survey's own threshold.
        to_survey = ((at if moving is None else moving.threshold) / SURVEY) ** _GROWTH
        if sum(found.followed(light) for light in strongest.plays) * to_survey > MANY:
            self.why_not = (
                "weak beams of lights with emission lines over a continuum are so many that photons leave less noise"
            )
            return
        lands = sum(float(sums[SUM_DEPOSITED]) for sums in strongest.sums.values())
        if _left(strongest) > lands:
            self.why_not = "most of their light lands on what is not flat, which photons draw"
            return
        if _uncounted(strongest) > _UNCOUNTED:
            self.why_not = "rays behind wide facets are too far from parallel to be followed together"
            return
        self.found, self._survey_polygons = found, found.polygons
        self.carried = {light: objects for light, objects in found.carried.items() if objects}
        with_tails = strongest.spent() * (at / SURVEY) ** _GROWTH_WITH_TAILS
        self._surveyed, self._with_tails = max(1.0, found.spent() * to_survey), max(1.0, with_tails)
        self._beams_a_point = self._with_tails / light_parts
        if strongest.polygons is not None:
            watts = self._watts(strongest.polygons)
            self._light_parts = parts_for(strongest.polygons, watts, light_parts, self.finder.broadest)

    @property
    def leaves_strong(self) -> bool:
        """Photons carry on more of what was found last than weak beams."""
        pieces = self.found.pieces if self.found is not None else None
        return pieces is not None and not pieces.is_tail.all()

    @property
    def finder(self) -> BeamFinder:
        """For what is shown; made when it is needed."""
        if self._finder is None:
            self._finder = self._traced.shown_as(self._scene)
        return self._finder

    def show(self, scene: Scene) -> None:
        """Follow `scene` from now on: other glass and spectra, which `shown` has too."""
        traced = self._traced.shown
        same = all(a.material is b.material for a, b in zip(traced.objects, scene.objects, strict=True)) and all(
            a.spectral_power is b.spectral_power for a, b in zip(traced.lights, scene.lights, strict=True)
        )
        self._finder, self._scene = self._traced if same else None, scene
        self._coarse = None
        self.drawing.forget_tables()

    def lay_out(self, layout: MapLayout) -> None:
        """Polygons will be drawn into maps laid out so."""
        texels = self._texels(layout)
        self.finder.set_texels(texels)
        self._traced.set_texels(texels)
        self._coarse = None

    def _texels(self, layout: MapLayout, photons: float = 0.0) -> dict[int, float]:
        """Sides of texels by receiver's front, scene units, as bands are to be narrow for a pass of so many photons."""
        texels: dict[int, float] = {}
        share = max(_PICTURE_SHARE * min(1.0, _SHARE_PHOTONS / max(photons, 1.0)), _LEAST_SHARE)
        for r in self.frames:
            record = layout.placements[layout.receivers[r]["placement"]]
            finer = share if record["kind"] == KIND_PICTURE else 1.0
            front, side = r - is_back(r), finer * layout.resolved_width(r) * self._buffers.space.scale
            texels[front] = min(texels.get(front, side), side)
        return texels

    def begin(self) -> None:
        """Spectra and glass are now what is shown."""
        self.drawing.forget_tables()
        self.stats = BeamStats()

    def steps(
        self, photons: float, weight: float, word: int, maps: LightMaps, *, tails: bool = True
    ) -> Iterator[float]:
        """Find beams as fine as `photons` allow and add them to `maps` times `weight`, pausing with the share done.
        `word`: roulette's seed; without `tails` all weak beams play it, and none is left to photons, which would follow
        the glass that is traced even where another is shown."""
        stats = self.stats
        tails = tails and self.finder is self._traced
        self.finder.set_texels(self._texels(maps.layout, photons))
        surveyed = self._with_tails if tails else self._surveyed
        growth = _GROWTH_WITH_TAILS if tails else _GROWTH
        finest = _finest(SURVEY, surveyed)
        # Even the strongest beams of all points may be more than there is time for.
        affordable = _ENOUGH * photons / self._photons_a_beam / self._beams_a_point
        light_parts = max(count for count in LIGHT_PARTS if count <= max(affordable, LIGHT_PARTS[0]))
        light_parts = min(light_parts, self._light_parts)
        while True:
            threshold = max(self._threshold(photons, surveyed, growth), finest)
            find = partial(self.finder.find, threshold, self._depth, word, light_parts, tails=tails)
            search = self._worker.searched(find)
            found = yield from mapped(timed(search, partial(stats.count, "find_seconds")), lambda share: 0.5 * share)
            # Where light leaves the scene soon, fewer weak beams follow than expected: the search is done again, finer.
            # No later pass uses what is learnt here: a pass must not depend on those before it.
            spent = found.spent()
            surveyed, finest = max(spent, 1.0) * (threshold / SURVEY) ** growth, _finest(threshold, spent)
            enough = _ENOUGH * spent * self._photons_a_beam >= photons
            if enough or self._threshold(photons, surveyed, growth) >= threshold:
                break
        self.found = found
        self._count(found)
        if found.polygons is not None:
            yield from timed(self._drawn(found.polygons, maps, weight), partial(stats.count, "draw_seconds"))
        yield 1.0

    def _drawn(self, polygons: BeamPolygons, maps: LightMaps, weight: float) -> Generator[float]:
        drawn = 0
        for more in self.drawing.steps(polygons, maps, weight):
            drawn += more
            yield 0.5 + 0.5 * drawn / max(drawn, len(polygons))
        self._context.finish()

    @property
    def _photons_a_beam(self) -> float:
        return PHOTONS_A_BEAM * (1.0 + len(self.finder.scene.facets) / _FACETS_A_BEAM)

    def _threshold(self, photons: float, surveyed: float, growth: float) -> float:
        """Threshold at which beams take about as long as so many photons; `surveyed` are followed at `SURVEY`."""
        beams = max(photons, 1.0) / self._photons_a_beam
        return float(np.clip(SURVEY * (surveyed / beams) ** (1.0 / growth), FINEST, COARSEST))

    def draw_moving(self, maps: LightMaps, weight: float, moving: MovingBeams, seconds: float) -> None:
        """Find beams at once, as fine as `seconds` allow, and add them to `maps` of any layout times `weight`. Weak
        ones play roulette: none of their light is missing."""
        self.pause()
        if self._coarse is None or self._coarse[0] is not maps.layout:
            finder = self.finder.shown_as(self.finder.shown)
            finder.set_texels(self._texels(maps.layout))
            self._coarse = maps.layout, finder
        started = time.perf_counter()
        self.found = _found(self._coarse[1], moving.threshold, self._depth)
        if self.found.polygons is not None:
            self.draw(self.found.polygons, maps, weight)
            self._context.finish()
        moving.learn(time.perf_counter() - started, seconds)

    @property
    def counts(self) -> tuple[int, int]:
        """Beams and polygons of the last search that was finished."""
        if self.found is None:
            return 0, 0
        return int(self.found.followed()), 0 if self.found.polygons is None else len(self.found.polygons)

    def draw(self, polygons: BeamPolygons, maps: LightMaps, weight: float) -> None:
        """Add polygons to `maps`."""
        for _ in self.drawing.steps(polygons, maps, weight):
            pass

    def draw_found(self, maps: LightMaps, threshold: float) -> None:
        """Draw what the survey found, with the weight that photons for such a `threshold` would have."""
        beams = self._surveyed * (SURVEY / threshold) ** _GROWTH
        maps.photon_weight = self._photons_a_beam * beams
        if self.found is not None:
            self._count(self.found)
            if self.found.polygons is not None:
                self.draw(self.found.polygons, maps, maps.photon_weight)

    def landings(self) -> dict[int, Landings]:
        """Where beams land, by receiver, for maps to be fitted to: corners of their hulls, weighted by their flux (W),
        and the receiver's own with weight 0, since weak beams may land anywhere."""
        polygons = self._survey_polygons
        result = {}
        for r, frame in self.frames.items():
            own = self._buffers.world_meshes[self._buffers.receivers[r]].vertices
            places, flux = [self._buffers.space.to_gpu(own)], [np.zeros(len(own))]
            if polygons is not None and (polygons.receiver == r).any():
                corners = np.diff(polygons.hull_start)
                each = np.repeat(self._watts(polygons) / np.maximum(corners, 1), corners)
                mine = np.repeat(polygons.receiver, corners) == r
                places.append(frame.origin + polygons.hulls[mine] @ frame.axes)
                flux.append(each[mine])
                result[r] = Landings(np.concatenate(places), np.concatenate(flux))
        return result

    def _watts(self, polygons: BeamPolygons) -> np.ndarray:
        """W of each."""
        power = np.array([float(p.band(0.0, 1.0)[3]) for p in self._buffers.light_power])
        return polygons.flux * power[polygons.light]

    def survey_again(self) -> None:
        """Find anew where light lands: with the glass that is shown, and as finely as for a still."""
        self._survey_polygons = _found(self.finder, SURVEY, self._depth).polygons

    def pause(self) -> None:
        """See `BeamWorker.pause`."""
        self._worker.pause()

    def _count(self, found: LightBeams) -> None:
        stats = self.stats
        stats.searches += 1
        stats.polygons += 0 if found.polygons is None else len(found.polygons)
        stats.beams += int(found.followed())
        tally = self.tally(1.0)
        stats.entered_w += (tally.emitted - stats.entered_w) / stats.searches
        stats.deposited_w += (tally.ended["deposited"] - stats.deposited_w) / stats.searches
        stats.left_w += (-tally.carried_on - stats.left_w) / stats.searches

    def tally(self, weight: float) -> FluxTally:
        """Where the light of the last search went, W times `weight`."""
        tally = FluxTally()
        for light, sums in self.found.sums.items() if self.found is not None else ():
            watts = weight * float(self._buffers.light_power[light].band(0.0, 1.0)[3])
            tally.emitted += watts * float(sums[SUM_ENTERED])
            tally.carried_on -= watts * float(sums[SUM_LEFT])
            tally.roulette += watts * float(sums[SUM_ROULETTE])
            for name, index in _ENDS.items():
                tally.ended[name] += watts * float(sums[index])
        return tally

    def release(self) -> None:
        """Free everything; a search that runs ends soon."""
        self._worker.release()
        self.drawing.release()


def _found(finder: BeamFinder, threshold: float, depth: int) -> LightBeams:
    """The beams of a search in motion."""
    return finished(finder.find(threshold, depth, _MOVING_WORD, MOVING_PARTS))


def _left(found: LightBeams) -> float:
    """Flux that photons carry on though it is not weak, as of `LightBeams.sums`."""
    return 0.0 if found.pieces is None else float(found.pieces.flux[~found.pieces.is_tail].sum())


def _uncounted(found: LightBeams) -> float:
    """Share of the light that entered whose end is not known, by the sums at three places of each band."""
    ends = (*_ENDS.values(), SUM_LEFT, SUM_ROULETTE)
    entered = sum(float(sums[SUM_ENTERED]) for sums in found.sums.values())
    ended = sum(float(sums[list(ends)].sum()) for sums in found.sums.values())
    return abs(entered - ended) / max(entered, 1e-300)


def _finest(threshold: float, followed: float) -> float:
    return threshold / (_FINER * max(followed, 1.0) ** 0.5)
