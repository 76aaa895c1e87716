"""Everything that a scene's lights cast by way of flat facets, in one call."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from ..model.geometry.mesh import Mesh
from ..model.lights.light import Light
from ..model.optics.spectral_tables import SpectralAxis
from ..model.scene import Scene
from .convert import pieces_of, polygons_of
from .facets import beam_scene, in_gpu_space, shown_as
from .find import Emission, GoOn, Search, hidden_from, search
from .leaves import Leaves
from .polygons import WIDE, BeamPieces, BeamPolygons, joined
from .rays import PARALLEL
from .search import SUM_BEAMS, SUM_LEAVES, SUMS
from .sources import emissions, is_near_facets, mask_at, why_no_beams

LIGHT_PARTS = 16, 32, 64
"""Points that represent an extended light, of which one is chosen (`parts_for`); penumbrae blur each into the next."""

SURVEY_PARTS, MOVING_PARTS = 4, 1
"""Points that represent an extended light in a survey, and in motion."""

_USUAL = 6.0
"""Beams, polygons and pieces for each beam that is followed, at most, where beams are not cut into many."""


@dataclass
class LightBeams:
    """The beams of all lights that have any."""

    carried: dict[int, tuple[int, ...]]
    """By light: objects whose light beams carry; photons that meet one of them first are not needed."""
    polygons: BeamPolygons | None = None
    pieces: BeamPieces | None = None
    sums: dict[int, np.ndarray] = field(default_factory=dict)
    """By light: flux per unit of spectral power by where it went (`search.SUM_…`)."""
    plays: frozenset[int] = frozenset()
    """Lights whose weak beams play roulette."""

    def followed(self, light: int | None = None) -> float:
        """Beams followed, of one light or of all."""
        return float(sum(sums[SUM_BEAMS] for i, sums in self.sums.items() if light in (None, i)))

    def spent(self) -> float:
        """Beams of a usual scene that take as long to be found and drawn, with the polygons and pieces they leave."""
        leaves = float(sum(sums[SUM_LEAVES] for sums in self.sums.values()))
        return max(self.followed(), (self.followed() + leaves) / _USUAL)


class BeamFinder:
    """The beams of one scene, to be found at any fineness."""

    def __init__(
        self,
        scene: Scene,
        world_meshes: list[Mesh],
        frames: dict[int, tuple[np.ndarray, np.ndarray]],
        texels: dict[int, float],
        axis: SpectralAxis,
        to_gpu: Callable[[np.ndarray], np.ndarray],
        unit: float,
        bins: int | None = None,
    ) -> None:
        """`frames`: origin and axes of every flat receiver's map by number, `texels`: side of its finest texel, GPU
        units; `to_gpu`, `unit`: scene to GPU space, GPU units a scene unit; `bins`: spectral bins that are kept."""
        self.meshes = in_gpu_space(world_meshes, to_gpu, unit)
        self.scene = beam_scene(scene, self.meshes, frames, axis, unit)
        self._scene, self._axis, self._to_gpu, self._unit, self._bins = scene, axis, to_gpu, unit, bins
        lights = enumerate(scene.lights)
        self._near = frozenset(i for i, light in lights if is_near_facets(light, self.scene, to_gpu, unit))
        """Lamps too near to facets."""
        self._hidden: dict[int, frozenset[int]] = {}
        self.set_texels(texels)

    def set_texels(self, texels: dict[int, float]) -> None:
        """Other maps: sides of receivers' finest texels, GPU units. A search that is running keeps the former ones."""
        facets = self.scene.facets.copy()
        self._texel = min(texels.values(), default=1e-3)
        facets["texel"] = [_TOLERANCE * texels.get(int(r), self._texel) for r in facets["receiver"]]
        self.scene = replace(self.scene, facets=facets)

    @property
    def shown(self) -> Scene:
        """What is shown."""
        return self._scene

    def shown_as(self, scene: Scene) -> BeamFinder:
        """A finder for `scene`, which has other glass, tints and spectra, and nothing else that differs. x stays that
        of the scene it was made for."""
        other = copy.copy(self)
        other._scene = scene
        other.scene = shown_as(self.scene, scene, self._axis, self._unit)
        return other

    @property
    def lights(self) -> list[int]:
        """Lights whose beams can be followed."""
        if not self.scene.beam_objects:
            return []
        return [
            i
            for i, light in enumerate(self._scene.lights)
            if why_no_beams(light) is None and not (light.is_parallel and self._is_thin(light)) and i not in self._near
        ]

    @property
    def broadest(self) -> float:
        """Half the extent of the broadest lamp, GPU units; the glass has about unit radius."""
        lamps = (self._scene.lights[i] for i in self.lights)
        return max((max(lamp.half_extent) * self._unit for lamp in lamps if not lamp.is_parallel), default=0.0)

    def _is_thin(self, light: Light) -> bool:
        """Whether a parallel light is too thin for its beams to be distinguished from nothing: photons carry it."""
        return light.has_place and min(light.half_extent) * self._unit < _THINNEST

    def find(
        self,
        threshold: float,
        depth: int,
        seed: int,
        light_parts: int = LIGHT_PARTS[0],
        threads: int | None = None,
        go_on: GoOn = lambda steps: True,
        *,
        tails: bool = False,
    ) -> Generator[float, None, LightBeams]:
        """All beams, pausing with the share that is done.

        `threshold`: share of the light that meets facets below which a beam plays roulette, or with `tails` is left to
        photons, unless its light has both emission lines and a continuum; `depth`: most specular events; `light_parts`:
        points of an extended light."""
        beams, scene, texel = self.scene, self._scene, self._texel
        todo = [(i, parts) for i in self.lights if (parts := self._parts(i, light_parts))]
        watts = {i: _power(scene.lights[i]) for i, _ in todo}
        reach = {i: sum(_reach(part) for part in parts) * watts[i] for i, parts in todo}
        total, steps = sum(reach.values()), sum(len(parts) for _, parts in todo)
        # Pieces of a spectrum's continuum would hold what lines within their bands have, which are followed apart.
        plays = frozenset(i for i, parts in todo if not tails or (parts[0].lines and parts[0].is_continuous))
        result, done = LightBeams({}, plays=plays), 0
        polygons, pieces = [], []
        for i, parts in todo:
            sums, hidden = np.zeros(SUMS), self._hidden_from(i)
            cast: list[BeamPolygons] = []
            left: list[BeamPieces] = []
            leaves: list[Leaves] = []
            measure = self._unit**2 if scene.lights[i].is_parallel else 1.0
            sources = [
                (
                    part,
                    Search(
                        threshold,
                        seed + 7919 * number,
                        depth,
                        _TOLERANCE * texel,
                        power=total / watts[i] if watts[i] > 0.0 else None,
                        faint=0.0 if i in plays else _TAILS_PLAY * threshold,
                        hidden=hidden,
                    ),
                )
                for number, part in enumerate(parts)
            ]
            searched = (
                search(beams, sources[k : k + _AT_ONCE], threads, go_on) for k in range(0, len(parts), _AT_ONCE)
            )
            for found, part_sums in chain.from_iterable(searched):
                leaves += found
                sums += part_sums
                done += 1
                if sum(len(some.leaf) for some in leaves) > _TOGETHER:
                    cast.append(polygons_of(leaves, beams, i, self._unit))
                    left.append(pieces_of(leaves, beams, i, measure))
                    leaves = []
                yield done / steps
            cast.append(polygons_of(leaves, beams, i, self._unit))
            left.append(pieces_of(leaves, beams, i, measure))
            polygons += cast
            pieces += left
            result.carried[i] = tuple(o for o in beams.beam_objects if o not in hidden)
            result.sums[i] = sums
        result.polygons = joined(polygons) if polygons else None
        result.pieces = joined(pieces) if pieces else None
        return result

    def _parts(self, i: int, count: int) -> list[Emission]:
        """A light as sources, as about `count` where it has an extent."""
        light, beams, place = self._scene.lights[i], self.scene, 0
        if light.has_place and not light.is_parallel:
            place = mask_at(self._to_gpu(np.array(light.position)), beams, self.meshes)
        count = count if light.has_extent else 1
        return emissions(light, beams, self._to_gpu, self._unit, self._axis, count, place, self._bins)

    def _hidden_from(self, i: int) -> frozenset[int]:
        """Objects that something not flat may hide from any point of a light, however many represent it: photons carry
        all that it casts on them, whatever search is drawn."""
        if i not in self._hidden:
            counts = (MOVING_PARTS, SURVEY_PARTS, *LIGHT_PARTS) if len(self.scene.obstacles) else ()
            parts = chain.from_iterable(self._parts(i, count) for count in counts)
            self._hidden[i] = frozenset().union(*(hidden_from(self.scene, part) for part in parts))
        return self._hidden[i]


def parts_for(polygons: BeamPolygons, watts: np.ndarray, parts: int, broadest: float) -> int:
    """The fewest of `LIGHT_PARTS` points of extended lights with which nearly all polygons that can be wider than their
    penumbrae are so: a narrower one is blurred alike in all directions. Where few can, the most for a lamp broader than
    the glass (`broadest`), which is then a pinhole. `polygons` are of lights of `parts` points, with `watts` (N,)."""
    otherwise = LIGHT_PARTS[-1 if broadest > 1.0 else 0]
    if not len(polygons):
        return otherwise
    soft = np.maximum.reduceat(polygons.edges[:, [3, 7]].max(axis=1), polygons.edge_start[:-1])
    low, high = (f.reduceat(polygons.hulls, polygons.hull_start[:-1]) for f in (np.minimum, np.maximum))
    longest = np.linalg.norm(high - low, axis=1) - 2.0 * math.sqrt(2.0) * soft
    width = polygons.area / np.maximum(longest, np.sqrt(polygons.area) + 1e-12)
    needed = parts * (_ROOM * WIDE * 2.0 * soft / np.maximum(width, 1e-12)) ** 2
    held = [watts[needed <= count].sum() for count in LIGHT_PARTS]
    enough = _MOST_WIDE * max(held[-1], 0.5 * watts.sum())
    return next((count for count, w in zip(LIGHT_PARTS, held, strict=True) if w >= enough), otherwise)


_MOST_WIDE, _ROOM = 0.99, 1.5
"""Share of their light, and how many times as wide as they must be: narrower bands change them."""
_TAILS_PLAY = 1.0 / 16.0
"""Share of the threshold below which what is left to photons plays roulette."""
_TOGETHER = 10_000
"""Leaves, about, of an extended light's points that are converted at once."""
_AT_ONCE = 16
"""Points of an extended light that are followed together."""
_TOLERANCE = 0.25
"""Texels."""
_THINNEST = 1e-6
"""GPU units."""


def _power(light) -> float:
    return float(light.spectral_power.xyz()[1] + light.spectral_power.power_w())


def _reach(emission: Emission) -> float:
    """Flux per unit of spectral power that may meet facets, roughly."""
    side = 2.0 * emission.room[2]
    if len(emission.limits) > 3:
        side = min(side, 2.0 * math.sqrt(abs(float(np.median(emission.limits[:, 0]))) + 1e-12))
    away = 0.0 if emission.source["kind"][0] == PARALLEL else float(np.hypot(*emission.room[:2]))
    return emission.density * side * side / (1.0 + away**2) ** 1.5
