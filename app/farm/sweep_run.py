"""Points of a sweep, drawn here one by one or by a crew, and handed on as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ..model.settings import RenderSettings
from . import point_tasks
from .cluster import DaskCrew
from .desk import Desk
from .jobs import Foreman, Job, Tally
from .point_tasks import Drawn, Told
from .sweep import Group, SweepPlan
from .weighing import Weighing

_RESULT_BYTES = 256 << 20
"""Pictures that one job brings back together, at most about."""
_POINT, _POINTS = "point", "points"


def shared_of(plan: SweepPlan, settings: RenderSettings) -> point_tasks.Sweep:
    """What all points share."""
    stages = tuple(point.stage for point in plan.points)
    return point_tasks.Sweep(stages, tuple(group.anchor for group in plan.groups), settings)


def draw_point(
    desk: Desk, plan: SweepPlan, shared: point_tasks.Sweep, group: int, number: int, told: Told
) -> Drawn | None:
    """One point, in this process; None where it is no longer wanted. The desk keeps what the next one of its group
    needs."""
    if plan.keeps_photons:
        found = point_tasks.draw_kept(desk, shared, told, group, (number,))
    else:
        found = point_tasks.draw_traced(desk, shared, told, (number,))
    return found[0] if found else None


def by_group(groups: Sequence[Group], wanted: Callable[[int], bool]) -> Iterator[tuple[int, int]]:
    """(group, number) of all points that are wanted."""
    for place, group in enumerate(groups):
        for point in group.points:
            if wanted(point.number):
                yield place, point.number


class FarmSweep:
    """Has a crew draw what is wanted; `take` gets each point once, `first` before all others where wanted."""

    def __init__(
        self,
        crew: DaskCrew,
        plan: SweepPlan,
        settings: RenderSettings,
        take: Callable[[Drawn], None],
        wanted: Callable[[int], bool] = lambda number: True,
        first: int | None = None,
    ) -> None:
        self._crew, self._plan, self._settings, self._take_point = crew, plan, settings, take
        self._due = list(by_group(plan.groups, wanted))
        self._first = first

    def run(self, tell: Callable[[float, str], None], stop: Callable[[], bool]) -> Tally | None:
        """None where `stop()` turned true before all was drawn. Raises `UserError`."""
        self._crew.share(shared_of(self._plan, self._settings))
        self._foreman = Foreman(self._crew, Weighing({_POINT: 1.0, _POINTS: 4.0}), stop)
        jobs = self._jobs()
        lead = [job for job in jobs if self._first in job.call[-1]]
        self._rest = [job for job in jobs if job not in lead]
        self._foreman.add(lead or self._rest)
        self._rest = self._rest if lead else []
        for job in self._rest:
            self._foreman.weighing.add(job.kind)
        return self._foreman.tally if self._foreman.run(self._take, tell) else None

    def _jobs(self) -> list[Job]:
        if not self._plan.keeps_photons:
            return [Job(_POINT, number, (point_tasks.draw_traced, (number,))) for _, number in self._due]
        a_point = 12 * self._settings.width * self._settings.height
        most = max(_RESULT_BYTES // a_point, 1)
        jobs: list[Job] = []
        for place in range(len(self._plan.groups)):
            numbers = [number for group, number in self._due if group == place]
            for begin in range(0, len(numbers), most):
                chosen = tuple(numbers[begin : begin + most])
                jobs.append(Job(_POINTS, len(jobs) + 1, (point_tasks.draw_kept, place, chosen)))
        return jobs

    def _take(self, job: Job, result: Any) -> None:
        for drawn in result:
            self._take_point(drawn)
        rest, self._rest = self._rest, []
        self._foreman.add(rest, expected=True)
