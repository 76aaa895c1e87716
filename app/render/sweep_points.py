"""Points of a sweep, drawn one after the other in one context: what the next one needs is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import UserError
from ..base.image_io import check_finite
from ..edit.parameters import Stage
from ..gpu import shader
from ..gpu.context import Context
from .frame_fit import inputs_of
from .frames import FrameRenderer
from .notices import frame_notices
from .sweep import SweepPlan
from .viewer.engine import LiveEngine
from .viewer.still_engine import finish, picture_of, still_engine

Report = Callable[[float, str], None]
"""Gets the share that is done, and what is being done."""


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


class SweepPainter:
    """Draws points of `plan`: from photons that are kept for a whole group, or as frames of an animation, for which
    photons are traced wherever light differs from the point before."""

    def __init__(self, context: Context, plan: SweepPlan) -> None:
        self._context, self._plan = context, plan
        self._group_of = {point.number: group for group in plan.groups for point in group.points}
        self._group: object = None
        """The one whose photons the engine keeps."""
        self._engine: LiveEngine | None = None
        self._renderer: FrameRenderer | None = None

    def draw_all(self, numbers: Sequence[int], report: Report, unwanted: Callable[[], bool]) -> Iterator[Drawn]:
        """Points in turn, as long as they are wanted; those of a group share photons where they follow each other.
        Raises `UserError`."""
        for place, number in enumerate(numbers):

            def of_all(share: float, text: str, place: int = place) -> None:
                report((place + share) / len(numbers), f"picture {place + 1} of {len(numbers)}")

            drawn = self.draw(number, of_all, unwanted)
            if drawn is None:
                return
            yield drawn

    def draw(self, number: int, report: Report, unwanted: Callable[[], bool]) -> Drawn | None:
        """One point; None where it is no longer wanted. Raises `UserError`."""
        return (self._from_kept if self._plan.keeps_photons else self._traced)(number, report, unwanted)

    def release(self) -> None:
        """Free everything."""
        shader.release(self._engine, self._renderer)

    def _traced(self, number: int, report: Report, unwanted: Callable[[], bool]) -> Drawn | None:
        plan, context = self._plan, self._context
        if self._renderer is None:
            stages = tuple(point.stage for point in plan.points)
            self._renderer = FrameRenderer(context, plan.settings, stages)
        renderer, stage = self._renderer, plan.points[number].stage
        traces = renderer.traces
        for share in renderer.steps(stage):
            report(share, renderer.phase)
            if unwanted():
                renderer.release()  # half of its light is no light for another
                return None
        picture = renderer.picture
        check_finite(f"picture {number}", picture.rgb)
        return Drawn(
            number,
            picture.rgb,
            picture.spectral,
            picture.bin_edges_nm,
            renderer.light.stats.photons,
            renderer.traces > traces,
            renderer.camera_pass.samples_taken if renderer.camera_pass is not None else 0,
            context.renderer,
            context.is_software,
            tuple(frame_notices(renderer.light, stage.camera, plan.settings, picture.rgb)),
        )

    def _from_kept(self, number: int, report: Report, unwanted: Callable[[], bool]) -> Drawn | None:
        if self._engine is None:
            self._engine = still_engine(self._context, self._plan.settings, exact=False)
        engine, group = self._engine, self._group_of[number]
        is_new, samples = group is not self._group, engine.camera_samples
        if is_new:
            engine.camera_samples = 1
            try:
                self._show(group.anchor, lambda share, text: report(0.5 * share, text), unwanted)
            finally:
                engine.camera_samples = samples
            if unwanted():
                return None
            self._group = group
        begin = 0.5 * is_new
        self._show(
            self._plan.points[number].stage, lambda share, text: report(begin + (1.0 - begin) * share, text), unwanted
        )
        if unwanted():
            return None
        rgb, stats = picture_of(engine), engine.stats
        if rgb is None:
            raise UserError("there is no picture of this point: does it have any light?")
        check_finite(f"picture {number}", rgb)
        return Drawn(
            number, rgb, None, None, stats.photons, is_new, int(stats.camera_samples), stats.renderer, stats.is_software
        )

    def _show(self, stage: Stage, report: Report, unwanted: Callable[[], bool]) -> None:
        assert self._engine is not None
        self._engine.set(inputs_of(stage, self._plan.settings))
        finish(self._engine, self._plan.settings.photons or 1, report, unwanted)
