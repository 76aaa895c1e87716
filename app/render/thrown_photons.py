"""Photons that are traced beside a light pass's own and belong to no map of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import moderngl

from ..passes.trace import TracePass
from .light_plan import LightPlan
from .photon_records import RoundOf

Keep = Callable[[moderngl.Buffer, int, int, RoundOf], None]
"""Takes records: (their buffer, how many, bytes of one, where they belong)."""


def thrown(
    trace: TracePass, seed: int, plans: Sequence[LightPlan], photons: int, keep: Keep, max_depth: int | None = None
) -> Iterator[None]:
    """Trace about `photons` by `plans` and hand them to `keep`, pausing after every batch; `max_depth`: specular
    events, by default those of `trace`."""
    counts = [plan.lattice_count(photons) for plan in plans]
    rounds = max((-(-n // (trace.batch // plan.lattices)) for n, plan in zip(counts, plans, strict=True)), default=0)
    for j in range(rounds):
        for i, (plan, lattice) in enumerate(zip(plans, counts, strict=True)):
            points = len(range(j, lattice, rounds))
            if points:
                waiting = [plan.slice(seed, 0, lattice, j, rounds, points, float(photons))]
                while waiting:
                    part = waiting.pop()
                    batch = yield from trace.steps(part, plan.domain, max_depth)
                    if batch.overflow and part.points > 1:
                        waiting += part.halves
                        continue
                    of = RoundOf(0, j, rounds, i + 1 == len(plans) and not waiting)
                    keep(trace.photons, batch.photons, trace.photon.stride, of)
            yield
