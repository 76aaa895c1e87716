"""Beams of a scene's lights: what they throw on flat receivers, and what photons have to carry on."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .facets import DIELECTRIC, MIRROR, SAMPLES, BeamScene
from .grow import FIRST, fly, run
from .leaves import Leaves, empty_leaves
from .nodes import NODE, STATIC, lay_out
from .rays import PARALLEL
from .search import SUM_ENTERED, SUMS, TASK, near_boxes, power_of, spread_of

_STACK = 1200
_ROOT_BANDS = 4
"""Into which the spectrum is cut from the beginning, so that threads have something to share."""


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
    """(SAMPLES,): share of its power below x, for importance."""
    lines: tuple[float, ...]
    """x of its emission lines."""
    line_shares: tuple[float, ...]
    """Share of its power that each of them holds."""
    is_continuous: bool
    """Whether it has a spectrum besides them."""
    density: float
    """Flux per unit of q (parallel: GPU unit²; point: sr) and of spectral power."""
    mask: int = 0
    """Solids that it stands in."""
    beside: tuple[np.ndarray, ...] = ()
    """SOURCE (1,) each: two that lie a part of an extended light away, along its two axes."""


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
    sees: bool = False


def search(
    scene: BeamScene,
    emission: Emission,
    how: Search,
    threads: int | None = None,
    go_on: Callable[[], bool] = lambda: True,
) -> tuple[list[Leaves], np.ndarray, set[int]]:
    """Follow one source's beams. Returns the leaves, in an order that depends on the scene alone, sums over all of
    them (`search.SUM_…`), and objects that something not flat may stand before, so that photons carry what this source
    throws on them. `go_on` False ends it early, for what is thrown away."""
    nodes = _rows(_STACK)
    sums = np.zeros(SUMS)
    tables = np.vstack([scene.tables, emission.power])
    bands = [(x, x, share) for x, share in zip(emission.lines, emission.line_shares, strict=True)]
    if emission.is_continuous:
        edges = np.linspace(0.0, 1.0, _ROOT_BANDS + 1).tolist()
        bands += [(lo, hi, 1.0) for lo, hi in pairwise(edges)]
    starts: list[tuple[int, np.ndarray, np.ndarray]] = []
    blocked: set[int] = set()
    for lo, hi, share in bands:
        task = _task(scene, emission, how, 0.0, share)
        top = _roots(nodes, (lo, hi), scene, tables, emission, task)
        spread = np.empty(2)
        spread_of(nodes, 0, spread)
        for row in range(FIRST, top):
            facet = nodes[row]["facet"]
            if scene.facets["kind"][facet] not in (DIELECTRIC, MIRROR):
                continue
            owner = int(scene.facets["owner"][facet])
            nodes[1] = nodes[row]
            spread_of(nodes, 1, spread)
            reach = float(scene.solids["radius"][owner] + np.linalg.norm(scene.facets["centre"][facet] - nodes[row]["position"][1, 0]))
            if near_boxes(nodes, 1, reach, scene.obstacles, spread):
                blocked.add(owner)
            own = _rows(FIRST + 1)
            own[FIRST] = nodes[row]
            starts.append((owner, own, task))
    jobs = [(own, task) for owner, own, task in starts if owner not in blocked]
    sums[SUM_ENTERED] = entered = sum(power_of(own, FIRST, tables, task[0]) for own, task in jobs)
    if not jobs or entered <= 0.0:
        return [], sums, blocked
    for _, task in jobs:
        task["threshold"] = how.threshold * entered if how.power is None else how.threshold * math.sqrt(entered * how.power)

    sources = np.concatenate([emission.source, *emission.beside])

    def one(job: tuple[np.ndarray, np.ndarray]) -> tuple[Leaves, np.ndarray]:
        own, task = job
        stack = _stacks.pop() if _stacks else _rows(_STACK)
        stack[FIRST] = own[FIRST]
        mine = np.zeros(SUMS)
        leaves = empty_leaves(256)
        if go_on():
            leaves = run(
                stack, FIRST + 1, scene.facets, scene.solids, tables, sources, scene.obstacles, task[0],
                leaves, mine,
            )
        _stacks.append(stack)
        return leaves, mine

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        done = list(pool.map(one, jobs))
    for _, mine in done:
        sums += mine
    return [leaves for leaves, _ in done], sums, blocked


_stacks: list[np.ndarray] = []


def _task(scene: BeamScene, emission: Emission, how: Search, threshold: float, share: float) -> np.ndarray:
    task = np.zeros(1, TASK)
    task["power"], task["threshold"], task["seed"], task["depth"] = len(scene.tables), threshold, how.seed, how.depth
    task["density"], task["tolerance"], task["drift"] = emission.density, how.tolerance, how.drift
    task["line_share"], task["room"], task["sees"], task["absorbing"] = share, emission.room, how.sees, scene.absorbs
    return task


def _roots(
    nodes: np.ndarray, band: tuple[float, float], scene: BeamScene, tables: np.ndarray, emission: Emission, task: np.ndarray
) -> int:
    """Put the fragments of a source's whole light that meet a facet first on the stack; returns its top."""
    spare_corner, spare_side = np.empty((128, 2)), np.empty(128, np.int64)
    i = 0
    nodes[i]["x"] = band[0], 0.5 * (band[0] + band[1]), band[1]
    nodes[i]["centre"] = emission.room[:2]
    nodes[i]["flight"] = nodes[i]["depth"] = 0
    nodes[i]["facet"], nodes[i]["total"], nodes[i]["mask"] = -1, -1, emission.mask
    nodes[i]["key"], nodes[i]["boost"], nodes[i]["bend"] = np.uint64(hash(band) & 0xFFFFFFFF), 1.0, 0.0
    room = emission.room
    square = np.array([[room[2] - room[0], 1, 0], [room[2] + room[0], -1, 0], [room[2] - room[1], 0, 1], [room[2] + room[1], 0, -1]])
    limits = np.concatenate([square, emission.limits.reshape(-1, 3)])
    nodes[i]["lines"] = len(limits)
    nodes[i]["line"][: len(limits)] = limits[:, None, :]
    nodes[i]["made"][: len(limits)] = 0, 0, STATIC, 1
    args = scene.facets, scene.solids, tables
    larger = room * np.array([1.0, 1.0, 1.5])
    if not lay_out(nodes, i, *args, emission.source[0], larger, spare_corner, spare_side):
        return FIRST
    s = emission.source[0]
    if s["kind"] != PARALLEL:
        nodes[i]["direction"][:] = s["forward"] + room[0] * s["right"] + room[1] * s["up"], s["right"], s["up"]
    lines, made = np.zeros((3, 3)), np.zeros(4, np.int64)
    nothing = np.zeros((0, 2, 3))
    top, _ = fly(
        nodes, FIRST, *args, emission.source, nothing, task[0], empty_leaves(8), np.zeros(SUMS), lines, made, spare_corner, spare_side
    )
    if s["kind"] != PARALLEL:
        # Their weights are still those of the plane's middle.
        for row in range(FIRST, top):
            lay_out(nodes, row, *args, s, larger, spare_corner, spare_side)
    return top


def _rows(count: int) -> np.ndarray:
    return np.zeros(count, NODE)
