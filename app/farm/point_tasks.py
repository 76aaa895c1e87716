"""What workers, or this process alone, do for the points of a sweep. Runs on a `Desk`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..base.errors import UserError
from ..base.image_io import check_finite
from ..edit.parameters import Stage
from ..model.settings import RenderSettings
from ..render.frame_fit import inputs_of
from ..render.frames import FrameRenderer
from ..render.notices import frame_notices
from ..render.viewer.engine import LiveEngine
from ..render.viewer.still_engine import finish, picture_of, still_engine
from .desk import Desk


class Told(Protocol):
    """Hears how far a job is."""

    def __call__(self, share: float, text: str = "") -> None:
        """Share of the job that is done."""

    def unwanted(self) -> bool:
        """Whether the job is to be left."""


@dataclass(frozen=True)
class Sweep:
    """What all jobs share."""

    stages: tuple[Stage, ...]
    """Of the points, by their numbers."""
    anchors: tuple[Stage, ...]
    """Of the groups: what photons are traced through."""
    settings: RenderSettings


@dataclass(frozen=True)
class Drawn:
    """A point's picture."""

    number: int
    rgb: np.ndarray
    """Float32 (H, W, 3), linear Rec.709."""
    spectral: np.ndarray | None
    bin_edges_nm: np.ndarray | None
    photons: int
    traced: bool
    """Whether photons were traced for it, and not kept from a point before."""
    samples: int
    renderer: str
    is_software: bool
    notices: tuple[str, ...] = ()


def draw_traced(desk: Desk, of: Sweep, report: Told, numbers: tuple[int, ...]) -> list[Drawn]:
    """Points as frames of one animation: photons are traced wherever light differs from the point before. Fewer than
    asked for where they are no longer wanted."""
    renderer = desk.kept.get("renderer")
    if renderer is None:
        renderer = desk.kept["renderer"] = FrameRenderer(desk.context, of.settings, of.stages)
    found: list[Drawn] = []
    for place, number in enumerate(numbers):
        stage, traces = of.stages[number], renderer.traces
        for share in renderer.steps(stage):
            report((place + share) / len(numbers), renderer.phase)
            if report.unwanted():
                renderer.release()  # half of its light is no light for another
                return found
        picture = renderer.picture
        check_finite(f"picture {number}", picture.rgb)
        found.append(
            Drawn(
                number,
                picture.rgb,
                picture.spectral,
                picture.bin_edges_nm,
                renderer.light.stats.photons,
                renderer.traces > traces,
                renderer.camera_pass.samples_taken if renderer.camera_pass is not None else 0,
                desk.context.renderer,
                desk.context.is_software,
                tuple(frame_notices(renderer.light, stage.camera, of.settings, picture.rgb)),
            )
        )
    return found


@dataclass
class _Kept:
    """An engine and the group whose photons it keeps."""

    engine: LiveEngine
    group: int = -1

    def release(self) -> None:
        """Free everything."""
        self.engine.release()


def draw_kept(desk: Desk, of: Sweep, report: Told, group: int, numbers: tuple[int, ...]) -> list[Drawn]:
    """Points of one group, from photons that are traced once and kept on the desk. Fewer than asked for where they are
    no longer wanted."""
    kept: _Kept | None = desk.kept.get("engine")
    if kept is None:
        kept = desk.kept["engine"] = _Kept(still_engine(desk.context, of.settings, exact=False))
    engine, samples = kept.engine, kept.engine.camera_samples
    is_new = kept.group != group
    work, done = len(numbers) + is_new, 0
    found: list[Drawn] = []

    def show(stage: Stage, samples: int) -> None:
        engine.camera_samples = samples

        def told(share: float, text: str) -> None:
            report((done + share) / work, text)

        engine.set(inputs_of(stage, of.settings))
        finish(engine, of.settings.photons or 1, told, report.unwanted)

    if is_new:
        try:
            show(of.anchors[group], 1)
        finally:
            engine.camera_samples = samples
        if report.unwanted():
            return found
        kept.group, done = group, 1
    for number in numbers:
        show(of.stages[number], samples)
        if report.unwanted():
            return found
        rgb, stats = picture_of(engine), engine.stats
        if rgb is None:
            raise UserError("there is no picture of this point: does it have any light?")
        check_finite(f"picture {number}", rgb)
        done += 1
        found.append(
            Drawn(
                number,
                rgb,
                None,
                None,
                stats.photons,
                is_new and number == numbers[0],
                int(stats.camera_samples),
                stats.renderer,
                stats.is_software,
            )
        )
    return found
