"""Jobs whose tasks each bring whole results: frames of an animation, points of a sweep."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.image_io import check_finite, png_bytes
from ..base.movie import Frames
from ..base.tone_map import auto_exposure
from ..edit.animation import Animation
from ..edit.parameters import Stage
from ..model.settings import RenderSettings
from ..render.animate import developed
from ..render.frames import FrameRenderer
from ..render.notices import FrameNotices, frame_notices
from ..render.sweep import SweepPlan
from ..render.sweep_points import Drawn, SweepPainter
from .desk import Desk, Report
from .jobs import Task

_FIRST, _FRAME = "the first frame", "frame"
_POINT, _POINTS = "point", "points"
_RESULT_BYTES = 256 << 20
"""Pictures that one task brings back together, at most about."""

# ---- frames -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Frames:
    stages: tuple[Stage, ...]
    settings: RenderSettings


@dataclass(frozen=True)
class _Frame:
    """One that is done: its linear picture, or the file of the developed one."""

    rgb: np.ndarray | None
    png: bytes
    notices: tuple[str, ...]


def _draw_frame(desk: Desk, of: _Frames, report: Report, index: int, base_ev: float | None) -> _Frame | None:
    """A frame, developed with the exposure that all share; linear where that is not known yet. None where it is no
    longer wanted. Each worker keeps a renderer, so that light which frames share is traced once a worker."""
    renderer = desk.keep(lambda: FrameRenderer(desk.context, of.settings, of.stages))
    stage = of.stages[index]
    for share in renderer.steps(stage):
        report(share)
        if report.unwanted():
            renderer.release()  # half of its light is no light for another
            return None
    rgb = renderer.picture.rgb
    check_finite(f"frame {index + 1} of {len(of.stages)}", rgb)
    notices = tuple(frame_notices(renderer.light, stage.camera, of.settings, rgb))
    if base_ev is None:
        return _Frame(rgb, b"", notices)
    return _Frame(None, png_bytes(developed(rgb, base_ev + stage.exposure_ev, stage.scene.render)), notices)


class FramesJob:
    """Fills `sink` with the frames `only` that it lacks; all share the exposure of the first. See `Job`."""

    guesses: Mapping[str, float] = {_FIRST: 1.0, _FRAME: 1.0}

    def __init__(self, animation: Animation, settings: RenderSettings, sink: Frames, only: range) -> None:
        stages = tuple(animation.frame(index) for index in range(len(animation.times_s)))
        self.shared = _Frames(stages, settings)
        self.notices = FrameNotices()
        self._sink, self._only = sink, only

    def begin(self) -> Iterable[Task]:
        """See `Job`."""
        base_ev = self._sink.exposure()
        if base_ev is None:
            return [Task(_FIRST, 0, (_draw_frame, 0, None))]
        due = [index for index in self._only if not self._sink.has(index)]
        return [Task(_FRAME, index, (_draw_frame, index, base_ev)) for index in due]

    def ahead(self) -> Mapping[str, int]:
        """See `Job`."""
        return {_FRAME: len(self._only) - (0 in self._only)} if self._sink.exposure() is None else {}

    def take(self, task: Task, result: Any, workers: int) -> Iterable[Task]:
        """See `Job`."""
        self.notices.take(list(result.notices), task.number + 1)
        if task.kind == _FRAME:
            self._sink.write_png(task.number, result.png)
            return ()
        base_ev = self._sink.fix_exposure(auto_exposure(result.rgb))
        if 0 in self._only:
            first = self.shared.stages[0]
            self._sink.write(0, developed(result.rgb, base_ev + first.exposure_ev, first.scene.render))
        return self.begin()


# ---- points -------------------------------------------------------------------------------------


def _draw_points(desk: Desk, plan: SweepPlan, report: Report, numbers: tuple[int, ...]) -> list[Drawn]:
    """Points, as many as are still wanted."""
    painter = desk.keep(lambda: SweepPainter(desk.context, plan))
    return list(painter.draw_all(numbers, report, report.unwanted))


class PointsJob:
    """Draws points of a sweep; `keep` gets each once, `first` before all others. See `Job`."""

    guesses: Mapping[str, float] = {_POINT: 1.0, _POINTS: 4.0}

    def __init__(
        self,
        plan: SweepPlan,
        keep: Callable[[Drawn], None],
        due: Callable[[int], bool] = lambda number: True,
        first: int | None = None,
    ) -> None:
        """`due`: whether a point is to be drawn."""
        self.shared, self._keep = plan, keep
        tasks = self._tasks(due)
        lead = [task for task in tasks if first in task.call[1]]
        self._begins, self._rest = (lead, [task for task in tasks if task not in lead]) if lead else (tasks, [])

    def _tasks(self, due: Callable[[int], bool]) -> list[Task]:
        plan = self.shared
        groups = [[point.number for point in group.points if due(point.number)] for group in plan.groups]
        if not plan.keeps_photons:
            return [Task(_POINT, number, (_draw_points, (number,))) for numbers in groups for number in numbers]
        most = max(_RESULT_BYTES // (12 * plan.settings.width * plan.settings.height), 1)
        chosen = [tuple(each[at : at + most]) for each in groups for at in range(0, len(each), most)]
        return [Task(_POINTS, number, (_draw_points, numbers)) for number, numbers in enumerate(chosen, 1)]

    def begin(self) -> Iterable[Task]:
        """See `Job`."""
        return self._begins

    def ahead(self) -> Mapping[str, int]:
        """See `Job`."""
        return {self._rest[0].kind: len(self._rest)} if self._rest else {}

    def take(self, task: Task, result: Any, workers: int) -> Iterable[Task]:
        """See `Job`."""
        for drawn in result:
            self._keep(drawn)
        rest, self._rest = self._rest, []
        return rest
