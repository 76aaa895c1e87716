"""One picture by many workers: parts are handed out, kept and added as they come, and seen once all are there; now and
then what there is is shown."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..base.errors import UserError
from ..base.image_io import write_image
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..render.parts import Share, rendering_key
from ..render.still import RenderResult
from . import part_tasks
from .cluster import DaskCrew
from .jobs import Foreman, Job, Tally
from .part_folder import PREVIEW, PartFolder
from .weighing import Weighing

PARTS_A_WORKER = 4
"""Few enough that each one's preparations count little, enough that the last ones end together."""
FIRST_PREVIEW_S = 10.0
PREVIEW_SHARE = 0.05
"""Of all the time there is, at most, for previews."""
_GUESSES = {"the count of parts": 0.2, "part": 1.0, "preview": 0.5, "the picture": 1.0}


@dataclass(frozen=True)
class FarmResult:
    """A picture and how it came about."""

    picture: RenderResult
    parts: int
    taken_up: int
    """Of those, from an earlier farm."""
    part_bytes: int
    merge_seconds: float
    """Spent on keeping parts and adding them, by the process that hands them out."""
    tally: Tally


class FarmRender:
    """Drives one; `run` returns None where `stop()` turned true before there was a picture."""

    def __init__(
        self,
        crew: DaskCrew,
        scene: Scene,
        settings: RenderSettings,
        scene_file: Path,
        folder: Path,
        parts: int | None = None,
        note: Callable[[str], None] = lambda sentence: None,
        first_preview_s: float = FIRST_PREVIEW_S,
    ) -> None:
        """`parts` None: `PARTS_A_WORKER` for each worker there is, or as many as an earlier farm began."""
        self._crew, self._settings, self._parts, self._note = crew, settings, parts, note
        self.kept = PartFolder(folder, rendering_key(scene, settings))
        self._picture = part_tasks.Picture(scene, settings, str(scene_file.resolve()))
        self._next_preview_s = time.monotonic() + first_preview_s
        self._previews = 0
        self._preview_began_s = 0.0
        self._result: RenderResult | None = None

    def run(self, tell: Callable[[float, str], None], stop: Callable[[], bool]) -> FarmResult | None:
        """Raises `UserError`; what is done is kept in the folder whatever happens."""
        kept = self.kept
        kept.take_up(self._note)
        taken_up = len(kept.indices)
        if taken_up and self._parts not in (None, kept.count):
            raise UserError(
                f"{kept.folder} holds parts of {kept.count}, not of {self._parts}: leave --parts out, or remove the "
                "folder"
            )
        self._crew.share(self._picture)
        self._foreman = Foreman(self._crew, Weighing(_GUESSES), stop)
        self._foreman.weighing.add("the picture")
        self._wait_for_workers(stop)
        if kept.count or self._parts:
            self._hand_out(kept.count or self._parts or 1)
        else:
            self._foreman.add([Job("the count of parts", 1, (part_tasks.count_parts,))])
        if not self._foreman.run(self._take, tell) or self._result is None:
            return None
        count = kept.count or 1
        return FarmResult(self._result, count, taken_up, kept.size_bytes, kept.seconds, self._foreman.tally)

    def _wait_for_workers(self, stop: Callable[[], bool]) -> None:
        told = False
        while not self._crew.size() and not stop():
            if not told and self._crew.workers is None:
                self._note(f"the scheduler at {self._crew.address} has no workers yet: waiting for some")
                told = True
            self._crew.news(0.1)

    def _hand_out(self, count: int) -> None:
        due = [index for index in range(1, count + 1) if index not in self.kept.indices]
        self._foreman.add(Job("part", index, (part_tasks.trace, Share(index, count))) for index in due)
        if not due:
            self._see()

    def _see(self) -> None:
        self._foreman.add([Job("the picture", 1, (part_tasks.see, *self.kept.merged(), None))], expected=True)

    def _take(self, job: Job, result: Any) -> None:
        match job.kind:
            case "the count of parts":
                self._hand_out(min(PARTS_A_WORKER * max(self._crew.size(), 1), result))
            case "part":
                self.kept.put(job.call[1], result)
                if len(self.kept.indices) == self.kept.count:
                    self._see()
                elif time.monotonic() >= self._next_preview_s:
                    self._begin_preview()
            case "preview":
                took = time.monotonic() - self._preview_began_s
                self._next_preview_s = time.monotonic() + max(FIRST_PREVIEW_S, took / PREVIEW_SHARE)
                with suppress(UserError):  # parts will tell of a disk that is full
                    write_image(self.kept.folder / PREVIEW, result.rgb, exposure_ev=self._settings.exposure_ev)
            case _:
                self._result = result

    def _begin_preview(self) -> None:
        self._previews += 1
        self._preview_began_s, self._next_preview_s = time.monotonic(), float("inf")
        call = (part_tasks.see, *self.kept.merged(), 1)
        self._foreman.add([Job("preview", self._previews, call, optional=True, urgent=True)])
