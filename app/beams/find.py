"""Beams of a scene's lights: what they cast on flat receivers, and what photons have to carry on."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .current import FIRST, START
from .facets import DIELECTRIC, MIRROR, BeamScene
from .leaves import Leaves, Store
from .nodes import HALF, NODE, STATIC
from .rays import PARALLEL, intensities
from .search import SUM_ENTERED, SUMS, WORK, flux_in, may_touch, power_of
from .steps import run

_STACK = 1800
_STEPS = 20_000
"""Beams followed between two calls of `go_on`."""
GoOn = Callable[[int], bool]
"""Gets the number of steps since its last call; False ends a search."""
_FINE = 16
"""Steps along a side in which the mean intensity over a facet is taken."""


@dataclass(frozen=True)
class Emission:
    """One source, as the search takes it."""

    source: np.ndarray
    """SOURCE (1,)."""
    limits: np.ndarray
    """(n, 3): half-planes l0 + l1 q_u + l2 q_v >= 0 that its light keeps to."""
    room: np.ndarray
    """(3,): centre and half side of a square in q that holds all facets."""
    power: np.ndarray
    """(SAMPLES,): share of its importance below x, lines left out."""
    watts: np.ndarray
    """(SAMPLES,): share of its radiant power below x, lines left out."""
    lines: tuple[float, ...]
    """x of its emission lines."""
    line_shares: tuple[float, ...]
    """Share of its power that each of them holds."""
    is_continuous: bool
    """Whether it has a spectrum besides them."""
    edges: tuple[float, ...]
    """x at which that is cut before any beam is followed, both ends included."""
    density: float
    """Flux per unit of q (parallel: GPU unit²; point: sr) and of spectral power."""
    mask: int = 0
    """Mask of the solids that it is inside of."""
    shifted: tuple[np.ndarray, ...] = ()
    """SOURCE (1,) each: two that are shifted by a part of an extended light along its two axes."""


@dataclass(frozen=True)
class Search:
    """How finely beams are followed."""

    threshold: float
    """Share of what enters below which beams play roulette."""
    seed: int
    depth: int
    tolerance: float
    drift: float = 1.0
    power: float | None = None
    """Power of all lights, per unit of this one's spectral power: a dim light is followed less far."""
    faint: float = 0.0
    """Above 0: beams below the threshold end as `search.LEAF_TAIL`, and roulette is played below this share only."""
    most: int = 1 << 40
    """Leaves of one facet that the source sees: with more, a search is given up."""
    hidden: frozenset[int] = frozenset()
    """Objects that photons carry: what the source casts on them first is left out."""


_Args = tuple[np.ndarray, ...]
_Job = tuple[np.ndarray, np.ndarray]
"""NODE (1,) and WORK (1,)."""
Found = tuple[list[Leaves], np.ndarray]


def search(
    scene: BeamScene,
    sources: Sequence[tuple[Emission, Search]],
    threads: int | None = None,
    go_on: GoOn = lambda steps: True,
) -> list[Found]:
    """Follow beams of `sources`. Returns of each the leaves, in an order that depends on the scene alone, and sums over
    all of them (`search.SUM_…`). `go_on` may end it early, where the result is not needed: every step is reported to it
    once, in any order."""
    begun = [_begin(scene, emission, how) for emission, how in sources]

    def one(job: tuple[_Args, int, _Job]) -> Leaves:
        args, most, (root, work) = job
        store = Store()
        stack = take_stack()
        stack[FIRST : FIRST + 1] = root
        work["top"] = FIRST + 1
        while work["top"][0] > FIRST and work["count"][0, 0] < most:
            work["steps"] = _STEPS
            run(stack, *args, scene.obstacles, work, store.leaf, store.edge, store.corner)
            if not go_on(_STEPS - int(work["steps"][0])):
                break
            if work["steps"][0] > 0 and work["top"][0] > FIRST:
                store.grow()
        _stacks.append(stack)
        return store.leaves(work["count"][0])

    # Threads have little to do in Python, where they would wait for each other.
    jobs = [(args, how.most, job) for (args, own, *_), (_, how) in zip(begun, sources, strict=True) for job in own]
    if len(jobs) < 2:
        done = [one(job) for job in jobs]
    else:
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
            done = list(pool.map(one, jobs))
    leaves = iter(done)
    return [([next(leaves) for _ in own], sums + sum(work["sums"][0] for _, work in own)) for _, own, sums in begun]


def hidden_from(scene: BeamScene, emission: Emission) -> set[int]:
    """Objects that something not flat may hide from a source."""
    hidden: set[int] = set()
    stack, args = take_stack(), _arguments(scene, emission)
    work = _work(scene, emission, Search(1.0, 0, 0, 1.0), 1.0, 1)
    for root in _roots(stack, (0.0, 1.0), emission, work.copy(), args):
        facet = root["facet"][0]
        owner = int(scene.facets["owner"][facet])
        away = scene.facets["centre"][facet] - root["position"][0, 1, 0]
        reach = float(scene.solids["radius"][owner] + np.linalg.norm(away))
        if may_touch(root, 0, reach, scene.obstacles, work):
            hidden.add(owner)
    _stacks.append(stack)
    return hidden


def _arguments(scene: BeamScene, emission: Emission) -> _Args:
    tables = np.vstack([scene.tables, emission.power, emission.watts])
    sources = np.concatenate([emission.source, *emission.shifted])
    sources["polarised"] = scene.polarised
    return scene.facets, scene.solids, tables, sources


def _begin(scene: BeamScene, emission: Emission, how: Search) -> tuple[_Args, list[_Job], np.ndarray]:
    """What is followed from the facets that a source sees, with `sums` as `search` returns them."""
    sums, args = np.zeros(SUMS), _arguments(scene, emission)
    bands = [(x, x, share) for x, share in zip(emission.lines, emission.line_shares, strict=True)]
    if emission.is_continuous:
        # In one piece where nothing is coloured.
        bands += [(lo, hi, 1.0) for lo, hi in pairwise(emission.edges)]
    jobs: list[_Job] = []
    stack = take_stack()
    for lo, hi, share in bands:
        work = _work(scene, emission, how, share, 1 + len(emission.shifted))
        for root in _roots(stack, (lo, hi), emission, work.copy(), args):
            facet = scene.facets[root["facet"][0]]
            if facet["kind"] not in (DIELECTRIC, MIRROR) or int(facet["owner"]) in how.hidden:
                continue
            if emission.source["kind"][0] != PARALLEL:
                root["weight"] = _mean_weight(root[0], emission.source)
            jobs.append((root, work.copy()))
    _stacks.append(stack)
    tables = args[2]
    sums[SUM_ENTERED] = sum(flux_in(root, 0, tables, work) for root, work in jobs)
    entered = sum(power_of(root, 0, tables, work) for root, work in jobs)
    if not jobs or entered <= 0.0:
        return args, [], sums
    relative = entered if how.power is None else math.sqrt(entered * how.power)
    for _, work in jobs:
        work["threshold"] = threshold = _rounded(how.threshold * relative)
        work["faint"] = how.faint / how.threshold * threshold
    return args, jobs, sums


def _rounded(threshold: float) -> float:
    """A power of two: roulette falls out the same while something changes a little from frame to frame."""
    return 2.0 ** round(math.log2(threshold)) if threshold > 0.0 else 0.0


_stacks: list[np.ndarray] = []


def take_stack() -> np.ndarray:
    """Rows for beams to be followed; what they hold is anything."""
    try:
        return _stacks.pop()
    except IndexError:  # also where another thread took the last one
        return np.zeros(_STACK, NODE)


def _work(scene: BeamScene, emission: Emission, how: Search, share: float, sources: int) -> np.ndarray:
    work = np.zeros(1, WORK)
    work["power"], work["seed"], work["depth"] = len(scene.tables), how.seed, how.depth
    work["density"], work["tolerance"], work["drift"] = emission.density, how.tolerance, how.drift
    # A room's own sides are lines, which must cut: it may have neighbours.
    work["room"] = emission.room * (1.0, 1.0, 1.5)
    work["line_share"], work["absorbing"] = share, scene.absorbs
    work["disperses"], work["coloured"] = scene.disperses, scene.absorbs or scene.coloured
    work["objects"], work["sources"] = len(scene.solids), sources
    return work


def _mean_weight(root: np.ndarray, source: np.ndarray) -> float:
    """Mean of a diverging source's intensity (SOURCE (1,)) over the outline of what it casts on one facet."""
    place = int(np.argmax(root["corners"] > 0))
    corners = root["corner"][place, : root["corners"][place]]
    middles = (np.arange(_FINE) + 0.5) / _FINE
    s, t = (grid.ravel() for grid in np.meshgrid(middles, middles))
    total = area = 0.0
    intensity = np.empty(len(s))
    for one, other in pairwise(corners[1:] - corners[0]):
        # A triangle as the square s, t: the farther from its tip, the wider.
        q = corners[0] + s[:, None] * (one + t[:, None] * (other - one))
        share = abs(one[0] * other[1] - one[1] * other[0]) * s / len(s)
        intensities(source, q, intensity, *np.empty((2, 3, 3)))
        total += float(share @ intensity)
        area += float(share.sum())
    return total / area if area > 0.0 else 0.0


def _roots(
    stack: np.ndarray, band: tuple[float, float], emission: Emission, work: np.ndarray, args: tuple[np.ndarray, ...]
) -> list[np.ndarray]:
    """NODE (1,) each: fragments of a source's whole light, by the facet that they meet first."""
    root = stack[FIRST]
    u, v, half = emission.room
    root["x"] = band[0], 0.5 * (band[0] + band[1]), band[1]
    root["centre"] = u, v
    root["flight"] = root["depth"] = 0
    root["facet"], root["ends"], root["total"], root["mask"] = -1, -1, START, emission.mask
    root["key"], root["boost"], root["bend"] = np.uint64(hash(band) & 0xFFFFFFFF), 1.0, 0.0
    square = np.array([[half - u, 1, 0], [half + u, -1, 0], [half - v, 0, 1], [half + v, 0, -1]])
    limits = np.concatenate([square, emission.limits.reshape(-1, 3)])
    root["lines"] = len(limits)
    root["line"][: len(limits)] = limits[:, None, :]
    root["made"][: len(square)] = 0, 0, HALF, 1
    root["made"][len(square) : len(limits)] = 0, 0, STATIC, 1
    store, whole = Store(), [stack[FIRST : FIRST + 1].copy()]
    found: list[np.ndarray] = []
    while whole:
        # Too many facets ahead leave two halves instead of fragments.
        stack[FIRST : FIRST + 1] = whole.pop()
        work["top"], work["steps"] = FIRST + 1, 1
        run(stack, *args, np.zeros((0, 2, 3)), work, store.leaf, store.edge, store.corner)
        for row in range(FIRST, int(work["top"][0])):
            (found if stack[row]["facet"] >= 0 else whole).append(stack[row : row + 1].copy())
    return found
