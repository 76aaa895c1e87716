"""From a scene to the first picture of its light: programs, buffers, pilots, maps and a first coarse pass, in
pauses."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain

from ...edit.live_inputs import LiveInputs
from ...gpu.context import Context
from ...gpu.device_traits import Budget
from ...gpu.scene_buffers import SceneBuffers
from ...gpu.shader import compiled_by
from ...model.settings import RenderSettings
from ..device_scene import scene_buffers
from ..map_fit import preview_size
from ..sampling import MovingBeams
from .accumulation import Accumulation
from .live_light import LiveLight

_ENVIRONMENT_S = 0.006
"""Seconds that one dispatch for the environment's light should take."""
COMPILING = "compiling a program, once for scenes of its kind"
PATIENCE_S = 1.0
"""Seconds of building after which every step is shown."""


@dataclass
class Shown:
    """A light pass and how far it has come."""

    traced: LiveInputs
    light: LiveLight
    accumulation: Accumulation
    steps: Iterator[None] = field(default_factory=lambda: iter(()))
    """What is left of the accumulation."""


BuildSteps = Generator[str | None, None, Shown]


class Building:
    """What is being built, if anything is, and how it comes on."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._steps: BuildSteps | None = None
        self._since = 0.0
        self.at = ""
        """What it is at, or was last."""

    @property
    def seconds(self) -> float:
        """Since anything was begun."""
        return time.perf_counter() - self._since

    def begin(self, steps: BuildSteps) -> None:
        """Build this (`build`), and nothing else any more."""
        self.at, self._since, self._steps = "setting the scene up", time.perf_counter(), steps

    def drop(self) -> None:
        """Build no further."""
        self._steps = None

    def advance(self, deadline: float) -> Shown | None:
        """Go on until about `deadline` (`time.perf_counter`); what was built, once it is."""
        assert self._steps is not None
        while time.perf_counter() < deadline:
            if not compiled_by(self._context.ctx, deadline):
                self.at = COMPILING
                break
            try:
                at = next(self._steps)
            except StopIteration as end:
                return end.value
            if self._context.traits.work_is_queued:
                # What is only queued keeps no deadline.
                self._context.finish()
            if at is not None:
                self.at = at
                if self.seconds > PATIENCE_S:
                    break  # what comes may hold the frame up for long: its name is shown before
        return None


def build(
    context: Context,
    budget: Budget,
    wanted: LiveInputs,
    largest: int,
    target: int,
    publish: Callable[[], None],
    moving: MovingBeams,
    as_fine: int = 0,
) -> BuildSteps:
    """Everything for a scene that photons must be traced for, up to its first picture; while it is not done, what it is
    at (None: as before).

    `largest`: photons of the finest pass, `target`: after which nothing more is traced. `publish` is called for every
    later picture, `moving`: how fine the first beams are, `as_fine`: photons of a pass as fine as which the first
    picture must be, in proper maps, since another of the same light is shown meanwhile. What was made is freed when
    the generator is closed before its end.
    """
    width, height = preview_size(wanted.width, wanted.height)
    settings = RenderSettings(
        width=width,
        height=height,
        method=wanted.method,
        seed=wanted.seed,
        smoothing=wanted.smoothing,
        max_depth=wanted.scene.render.max_depth,
        batch=budget.batch,
        local_gain=wanted.local_gain,
        editable=True,
        any_view=True,
    )
    scene = replace(wanted.scene, camera=wanted.camera)
    made: SceneBuffers | LiveLight = (buffers := scene_buffers(context, scene, settings))
    try:
        yield None
        made = light = LiveLight(context, scene, settings, budget.store_bytes, moving, buffers)
        yield "following the first photons"
        yield from light.light_pass.preparing()
        light.light_pass.batches.portion = budget.portion
        light.show(wanted)
        if as_fine:
            light.fit_to(wanted)
        if light.environment is not None:
            # The first picture is not a dark one.
            yield "gathering the environment's light"
            for _ in light.environment.steps(_ENVIRONMENT_S):
                yield None
                if light.environment.is_worth_showing:
                    break
            light.show_gathered()
        published = [-1]
        first = min(budget.first_photons, largest)
        accumulation = Accumulation(
            light, first, largest, target, wanted.seed, lambda: published.append(accumulation.finest)
        )
        steps = chain(accumulation.survey(), accumulation.steps())
        yield "tracing its first light"
        while published[-1] < as_fine and next(steps, published) is not published:
            yield None
        accumulation.publish = publish
    except BaseException:  # also when the generator is closed because this scene is no longer wanted
        made.release()
        raise
    yield "compiling the programs that see it, once for scenes of its kind"
    return Shown(wanted, light, accumulation, steps)
