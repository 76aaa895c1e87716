"""One picture as a job: its parts are traced, kept in a folder next to it and added as they come, and seen once all are
there; now and then what there is is shown."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import UserError
from ..base.image_io import write_image
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..render.part_file import SUFFIX, part_bytes, read_header, read_sums, write_part_bytes
from ..render.parts import (
    PartHeader,
    Share,
    check_maps,
    merged_light,
    parts_at_most,
    rendering_key,
    trace_part,
)
from ..render.still import RenderResult, render
from .desk import Desk, Report
from .jobs import Task

PREVIEW = "preview.png"
PARTS_A_WORKER = 4
"""Few enough that each one's preparations count little, enough that the last ones end together."""
FIRST_PREVIEW_S = 10.0
PREVIEW_SHARE = 0.05
"""Share of all time that previews may take."""
_COUNT, _PART, _PREVIEW, _PICTURE = "the count of parts", "part", "preview", "the picture"


@dataclass(frozen=True)
class _Rendering:
    """What all tasks share."""

    scene: Scene
    settings: RenderSettings
    scene_file: str


def _count_parts(desk: Desk, of: _Rendering, report: Report) -> int:
    return parts_at_most(desk.context, of.scene, of.settings)


def _trace(desk: Desk, of: _Rendering, report: Report, share: Share) -> bytes:
    """One part, as its file; empty where it is no longer wanted."""
    part = trace_part(desk.context, of.scene, of.settings, share, of.scene_file, report, report.unwanted)
    return b"" if part is None else part_bytes(part)


def _see(
    desk: Desk, of: _Rendering, report: Report, headers: list[PartHeader], sums: list[np.ndarray], spp: int | None
) -> RenderResult:
    """The picture of some parts or all, from the sums of their maps; `spp`: camera samples a pixel where not the
    settings' own."""
    settings = of.settings if spp is None else replace(of.settings, spp=spp)
    fill = merged_light(headers, sums, lambda light: check_maps(light, headers[0], "a part"))
    return render(of.scene, settings, report, report.unwanted, desk.context, fill=fill)


class StillJob:
    """A picture; see `Job`."""

    guesses: Mapping[str, float] = {_COUNT: 0.2, _PART: 1.0, _PREVIEW: 0.5, _PICTURE: 1.0}

    def __init__(
        self,
        scene: Scene,
        settings: RenderSettings,
        scene_file: Path,
        folder: Path,
        parts: int | None = None,
        note: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        """`parts` None: `PARTS_A_WORKER` for each worker there is, or as many as an earlier farm began."""
        self.shared = _Rendering(scene, settings, str(scene_file.resolve()))
        self.kept = PartFolder(folder, rendering_key(scene, settings))
        self.picture: RenderResult | None = None
        self.taken_up = 0
        """Parts that an earlier farm left."""
        self._parts, self._note = parts, note
        self._next_preview_s = time.monotonic() + FIRST_PREVIEW_S
        self._preview_began_s = 0.0
        self._sees = False

    def begin(self) -> Iterable[Task]:
        """See `Job`."""
        self.kept.take_up(self._note)
        self.taken_up = len(self.kept.indices)
        if self.taken_up and self._parts not in (None, self.kept.count):
            raise UserError(
                f"{self.kept.folder} holds parts of {self.kept.count}, not of {self._parts}: leave --parts out, or "
                "remove the folder"
            )
        count = self.kept.count or self._parts
        return [Task(_COUNT, 1, (_count_parts,))] if count is None else self._tasks(count)

    def ahead(self) -> Mapping[str, int]:
        """See `Job`."""
        return {} if self._sees else {_PICTURE: 1}

    def take(self, task: Task, result: Any, workers: int) -> Iterable[Task]:
        """See `Job`."""
        if task.kind == _COUNT:
            return self._tasks(min(PARTS_A_WORKER * max(workers, 1), result))
        if task.kind == _PICTURE:
            self.picture = result
        if task.kind == _PREVIEW:
            took = time.monotonic() - self._preview_began_s
            self._next_preview_s = time.monotonic() + max(FIRST_PREVIEW_S, took / PREVIEW_SHARE)
            with suppress(UserError):  # parts will report a disk that is full
                write_image(self.kept.folder / PREVIEW, result.rgb, exposure_ev=self.shared.settings.exposure_ev)
        if task.kind != _PART:
            return ()
        self.kept.put(task.call[1], result)
        if len(self.kept.indices) == self.kept.count:
            return self._last()
        if time.monotonic() < self._next_preview_s:
            return ()
        self._preview_began_s, self._next_preview_s = time.monotonic(), float("inf")
        return [Task(_PREVIEW, 1, (_see, *self.kept.merged(), 1), optional=True, urgent=True)]

    def _tasks(self, count: int) -> Iterable[Task]:
        due = [index for index in range(1, count + 1) if index not in self.kept.indices]
        return [Task(_PART, index, (_trace, Share(index, count))) for index in due] or self._last()

    def _last(self) -> list[Task]:
        self._sees = True
        return [Task(_PICTURE, 1, (_see, *self.kept.merged(), None))]


@dataclass
class PartFolder:
    """Parts of one rendering in a folder, and the sum of them all."""

    folder: Path
    key: str
    """Key of the rendering."""
    headers: list[PartHeader] = field(default_factory=list)
    """Headers of what is summed up."""
    sums: list[np.ndarray] = field(default_factory=list)
    """Float64 (height, width, 4) for every texture."""
    size_bytes: int = 0
    """Bytes of all files."""
    seconds: float = 0.0
    """Spent on writing, reading and adding."""

    @property
    def indices(self) -> set[int]:
        """Numbers of all parts that are there."""
        return {index for header in self.headers for index in header.indices}

    @property
    def count(self) -> int | None:
        """Parts in all, where that is settled; None before the first."""
        return self.headers[0].share.count if self.headers else None

    def take_up(self, note: Callable[[str], None]) -> None:
        """Add what an earlier farm left. Parts that are not whole are noted and traced again. Raises `UserError` where
        the folder holds parts of another rendering."""
        for path in sorted(self.folder.glob(f"*{SUFFIX}")):
            try:
                self._add(path)
            except _NotWhole as error:
                note(f"{error}; that is done now")
                path.unlink(missing_ok=True)

    def put(self, share: Share, data: bytes) -> None:
        """Keep a part that a worker has traced, and add it. Raises `UserError`, also where the disk is full."""
        started = time.perf_counter()
        path = self.folder / f"part{share.index:0{len(str(share.count))}}of{share.count}{SUFFIX}"
        write_part_bytes(path, data)
        header = read_header(path)
        if (header.key, header.indices, header.share) != (self.key, (share.index,), share):
            path.unlink()
            raise UserError("a worker traced something else than was requested: install one version everywhere")
        self._add(path)
        self.seconds += time.perf_counter() - started

    def _add(self, path: Path) -> None:
        try:
            header = read_header(path)
            found = [read_sums(path, header, number) for number in range(header.targets)]
        except UserError as error:
            raise _NotWhole(str(error)) from error
        if header.key != self.key:
            raise UserError(
                f"{self.folder} holds parts of another rendering, of '{header.name}' or with other settings: "
                "remove it, or choose another -o"
            )
        if not self.indices.isdisjoint(header.indices):
            return
        first = next(iter(self.headers), header)
        if _shape(header) != _shape(first):
            raise UserError(
                f"{path} was traced by '{header.renderer}' and does not fit to what '{first.renderer}' traced: give "
                "workers of one kind, and the same --batch as before"
            )
        self.sums = self.sums or [np.zeros(texels.shape) for texels in found]
        for total, texels in zip(self.sums, found, strict=True):
            total += texels
        self.headers.append(header)
        self.size_bytes += path.stat().st_size

    def merged(self) -> tuple[list[PartHeader], list[np.ndarray]]:
        """What a picture is made of: headers and float32 sums."""
        return list(self.headers), [total.astype(np.float32) for total in self.sums]

    def remove(self) -> None:
        """The picture is written: nothing of this is needed any more."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def leave(self) -> str:
        """What is kept, in words."""
        if self.headers:
            return f"{len(self.indices)} of {self.count} parts are kept in {self.folder}"
        with suppress(OSError):
            (self.folder / PREVIEW).unlink(missing_ok=True)
        return "no part was done yet"


class _NotWhole(UserError):
    """A part that cannot be read."""


def _shape(header: PartHeader) -> tuple[object, ...]:
    """What parts of one rendering have in common."""
    return header.share.count, header.rounds, header.layout, header.size, header.targets
