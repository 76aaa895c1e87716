"""Programs of edits, compiled before one is made: a small engine is taken through a drag of dispersion, a move of
glass or a mirror, and a stroke of the brush. The driver's cache, or ours (`gpu/linker`), has them then for every
context."""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable, Iterator
from concurrent.futures import Future
from dataclasses import replace

import numpy as np

from ...edit.glass import set_dispersion_gain
from ...edit.live_inputs import LiveInputs
from ...edit.objects import add_dabs, set_transform
from ...features.features import Features
from ...gpu.context import Context
from ...gpu.context_thread import ContextThread
from ...model.scene import Dab, Scene
from ...model.settings import RenderSettings
from .engine import LiveEngine

PHOTONS, WIDTH, HEIGHT = 1 << 12, 97, 55
STEP_S = 0.5
MOST_TRIANGLES = 1_000_000
"""Largest scene that is rehearsed, since it is on the device twice meanwhile."""


def rehearse(context: Context, inputs: LiveInputs) -> Generator[bool]:
    """Compile in `context` what edits of `inputs` need, True after every step."""
    engine = LiveEngine(context, replace(context.traits.viewer, first_photons=PHOTONS, largest_photons=PHOTONS))
    try:
        engine.target_photons = PHOTONS
        for scene in _edited(inputs.scene):
            version = engine.picture_version
            engine.set(replace(inputs, scene=scene, width=WIDTH, height=HEIGHT))
            while (engine.picture_version == version or engine.differs not in ("", "moved")) and not engine.is_idle:
                engine.advance(STEP_S, interacting=version > 0)
                if engine.problem:
                    break
                yield True
    finally:  # its search for beams has a thread, which must not outlive the program
        engine.release()


def _edited(scene: Scene) -> Iterator[Scene]:
    yield scene
    materials = dict(enumerate(item.material for item in scene.objects))
    for i in [i for i, m in materials.items() if m.transmits and m.dispersion.is_dispersive][:1]:
        yield set_dispersion_gain(scene, i, 0.99 * materials[i].dispersion.gain)
    for i in [i for i, m in materials.items() if m.is_specular][:1]:
        yield set_transform(scene, i, scene.objects[i].object_to_world @ np.diag((0.99, 0.99, 0.99, 1.0)))
    for i in [i for i, m in materials.items() if m.receives][:1]:
        x, y, z = scene.objects[i].mesh.vertices[0].tolist()
        yield add_dabs(scene, i, [Dab((x, y, z), 1.0, 1.0)])


class Rehearsals:
    """Those of a session, of each kind of scene once, on a thread of their own where `thread` opens one."""

    def __init__(self, thread: Callable[[], ContextThread | None]) -> None:
        self._thread = thread
        self._known: set[Hashable] = set()
        self._scene: object = None
        self._steps: Generator[bool] | None = None
        self._step: Future[bool] | None = None

    def follow(self, inputs: LiveInputs) -> None:
        """Take another step, once the last is done; `inputs` are shown, and nothing else needs the processor."""
        if (thread := self._thread()) is None or (self._step is not None and not self._step.done()):
            return
        if self._step is None or self._step.exception() or not self._step.result():
            self._step = None
            if inputs.scene is self._scene:
                return
            self._scene = inputs.scene
            settings = RenderSettings(method=inputs.method, local_gain=False, editable=True)
            kind = Features.of(inputs.scene, settings), frozenset(light.variant for light in inputs.scene.lights)
            if kind in self._known or sum(len(o.mesh.triangles) for o in inputs.scene.objects) > MOST_TRIANGLES:
                return
            self._known.add(kind)
            self._steps = rehearse(thread.context, inputs)
        steps = self._steps
        assert steps is not None
        self._step = thread.submit(lambda: next(steps, False))

    def release(self) -> None:
        """End the one that is under way, on its thread."""
        if self._steps is not None and (thread := self._thread()) is not None:
            thread.submit(self._steps.close).exception()
        self._steps = None
