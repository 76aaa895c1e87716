"""An animation by many workers, frame by frame into a folder; all share the exposure of the first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..base.movie import Frames
from ..base.tone_map import auto_exposure
from ..edit.animation import Animation
from ..model.settings import RenderSettings
from ..render.animate import developed
from ..render.notices import FrameNotices
from . import frame_tasks
from .cluster import DaskCrew
from .jobs import Foreman, Job, Tally
from .weighing import Weighing

_FIRST = "the first frame"


class FarmFrames:
    """Fills `sink` with the frames `only` that it lacks."""

    def __init__(
        self, crew: DaskCrew, animation: Animation, settings: RenderSettings, sink: Frames, only: range
    ) -> None:
        self._crew, self._sink, self._only = crew, sink, only
        self._stages = tuple(animation.frame(index) for index in range(len(animation.times_s)))
        self._settings = settings
        self.notices = FrameNotices()

    def run(self, tell: Callable[[float, str], None], stop: Callable[[], bool]) -> Tally | None:
        """None where `stop()` turned true before all was there. Raises `UserError`."""
        self._crew.share(frame_tasks.Frames(self._stages, self._settings))
        self._foreman = Foreman(self._crew, Weighing({_FIRST: 1.0, "frame": 1.0}), stop)
        if self._sink.exposure() is None:
            self._foreman.add([Job(_FIRST, 0, (frame_tasks.draw, 0, None))])
            self._foreman.weighing.add("frame", len(self._due()) - (0 in self._only))
        else:
            self._hand_out()
        return self._foreman.tally if self._foreman.run(self._take, tell) else None

    def _hand_out(self) -> None:
        base_ev = self._sink.exposure()
        jobs = [Job("frame", index, (frame_tasks.draw, index, base_ev)) for index in self._due()]
        self._foreman.add(jobs, expected=self._foreman.tally.done > 0)

    def _due(self) -> list[int]:
        return [index for index in self._only if not self._sink.has(index)]

    def _take(self, job: Job, result: Any) -> None:
        self.notices.take(list(result.notices), job.number + 1)
        if job.kind != _FIRST:
            self._sink.write_png(job.number, result.png)
            return
        base_ev = self._sink.fix_exposure(auto_exposure(result.rgb))
        if 0 in self._only:
            first = self._stages[0]
            self._sink.write(0, developed(result.rgb, base_ev + first.exposure_ev, first.scene.render))
        self._hand_out()
