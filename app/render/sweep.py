"""A sweep: a picture for every combination of parameters' values, and which of them one set of photons serves.

The viewer knows what an edit costs (`render/viewer/invalidation.py`): photons that were traced through one glass follow
another of the same n_d to first order in the change of index. Points that do are made by one process from one store of
photons; all others are traced, and spread over workers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import UserError
from ..edit.parameters import Stage, apply_all, check_value
from ..model.optics.glass import Dispersion
from ..model.settings import RenderSettings
from .frame_fit import inputs_of, share_light
from .viewer.dirty_level import DirtyLevel
from .viewer.invalidation import dirty_level

MAX_POINTS = 100_000
_BLUE_NM, _RED_NM = 486.13, 656.27
Grid = Mapping[str, Sequence[float]]
"""Values of each parameter, by its path."""


def check_values(path: str, values: Sequence[float], stage: Stage, where: str = "") -> None:
    """Raise `UserError` where a parameter is none, or cannot take one of its values, or gets one twice."""
    if not values:
        raise UserError(f"{where}{path} gets no value: give one or more")
    # The extremes show whether all of them can be taken.
    for value in [value for value in values if not math.isfinite(value)] or (min(values), max(values)):
        check_value(stage, path, value, where)
    if len(set(values)) < len(values):
        raise UserError(f"{where}{path} gets a value twice: give each once")


@dataclass(frozen=True)
class Point:
    """One picture of a sweep."""

    number: int
    values: Mapping[str, float]
    stage: Stage


def points_of(start: Stage, grid: Grid) -> tuple[Point, ...]:
    """All combinations, the last parameter running fastest. Raises `UserError` where one cannot be drawn."""
    if not grid:
        raise UserError("a sweep needs a parameter with its values, for example objects.prism.dispersion_gain")
    count = int(np.prod([len(values) for values in grid.values()], dtype=float))
    if count > MAX_POINTS:
        raise UserError(f"this sweep has {count} pictures: give at most {MAX_POINTS}")
    found = []
    for number, values in enumerate(itertools.product(*grid.values())):
        named = dict(zip(grid, values, strict=True))
        found.append(Point(number, named, apply_all(start, named)))
    return tuple(found)


@dataclass(frozen=True)
class Group:
    """Points that one set of photons serves."""

    anchor: Stage
    """What photons are traced through: of these the one with about half of the strongest dispersion, from which the
    change of index is never more than that half. Without any, photons would carry no columns."""
    points: tuple[Point, ...]


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep comes to."""

    points: tuple[Point, ...]
    groups: tuple[Group, ...]
    settings: RenderSettings
    keeps_photons: bool
    """Whether photons are kept for the points of a group."""
    first_order: bool = False
    """Whether some points' glass is another than that of their photons, which follow to first order."""

    @property
    def can_spread(self) -> bool:
        """Whether several processes have something to do."""
        return len(self.groups) > 1 or not self.keeps_photons

    @staticmethod
    def of(points: Sequence[Point], settings: RenderSettings, exact: bool) -> SweepPlan:
        """`exact`: every point is traced, but for those that differ by the camera alone."""
        is_exact = exact or settings.bins is not None
        groups: list[tuple[Stage, list[Point]]] = []
        keeps = False
        spreads = {point.number: _dispersion(point.stage) for point in points}
        middle = 0.5 * max(spreads.values())
        for point in sorted(points, key=lambda p: (not spreads[p.number], abs(spreads[p.number] - middle))):
            new = inputs_of(point.stage, settings)
            for anchor, members in groups:
                old = inputs_of(anchor, settings)
                same_light = share_light(old, new)
                if same_light or (not is_exact and dirty_level(old, old, new) <= DirtyLevel.SPLAT):
                    members.append(point)
                    keeps = keeps or not same_light
                    break
            else:
                groups.append((point.stage, [point]))
        made = (Group(anchor, tuple(sorted(found, key=lambda point: point.number))) for anchor, found in groups)
        found = tuple(sorted(made, key=lambda group: group.points[0].number))
        follows = any(_glasses(group.anchor) != _glasses(p.stage) for group in found for p in group.points)
        return SweepPlan(tuple(points), found, settings, keeps, keeps and follows)


def _dispersion(stage: Stage) -> float:
    """How much its glasses disperse, all together."""
    return sum(abs(float(g.index(_BLUE_NM) - g.index(_RED_NM))) for g in _glasses(stage))


def _glasses(stage: Stage) -> list[Dispersion]:
    glass = (item.material for item in stage.scene.objects if item.material.transmits)
    return [dispersion for material in glass for dispersion in material.dispersions]
