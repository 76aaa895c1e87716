"""Programs of edits, compiled before anybody makes one.

A small engine is taken through a drag of dispersion, a move of what is made of glass or mirrors, and a stroke of the
dispersion brush. Where it works in a context of its own, the driver's cache has the programs then for every other.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Hashable, Iterator
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...edit.live_inputs import LiveInputs
from ...model.features import Features
from ...model.scene import Dab, Material, SceneObject
from ...model.settings import RenderSettings
from .building import Budget
from .dirty_level import DirtyLevel
from .engine import LiveEngine

if TYPE_CHECKING:
    from ...gpu.context import Context
    from ...gpu.context_thread import ContextThread

PHOTONS = 1 << 12
SHRINKS = 4
"""Side of the wanted picture over that of the small engine's."""
STEP_S, REST_S = 0.02, 0.05
MOST_TRIANGLES = 1_000_000
"""Of a scene, which is on the device twice meanwhile."""
_GAIN = 0.99


def rehearse(context: Context, inputs: LiveInputs) -> Generator[None, None, None]:
    """Compile in `context` what edits of `inputs` need; pauses after every step. Whatever such an edit cannot show is
    for whoever makes it: it ends the rehearsal without a word."""
    if sum(len(item.mesh.triangles) for item in inputs.scene.objects) > MOST_TRIANGLES:
        return
    width, height = inputs.width // SHRINKS | 1, inputs.height // SHRINKS | 1
    engine = LiveEngine(context, replace(Budget.of(context), first_photons=PHOTONS, largest_photons=PHOTONS))
    engine.target_photons = PHOTONS
    try:
        for objects in _edits(inputs.scene.objects):
            version, scene = engine.picture_version, replace(inputs.scene, objects=objects)
            if engine.set(replace(inputs, scene=scene, width=width, height=height)) == DirtyLevel.NOTHING:
                continue
            shows = False
            while not (shows or engine.is_idle):
                engine.advance(STEP_S, interacting=version > 0)
                if engine.problem is not None:
                    return
                shows = engine.picture_version != version and engine.differs in ("", "moved")
                yield
    finally:
        engine.release()


class Rehearsals:
    """Those of a session, each kind of scene once, on a thread of their own where one can be had."""

    def __init__(self, thread: Callable[[], ContextThread | None]) -> None:
        """`thread` is called when it is first wanted."""
        self._thread = thread
        self._scene: object = None
        self._kind: Hashable = None
        """That is being rehearsed, or was last."""
        self._done: set[Hashable] = set()
        self._rests = False

    def follow(self, inputs: LiveInputs | None) -> None:
        """Rehearse edits of `inputs`, whose picture there is; None: rest, others need the processor."""
        self._rests = inputs is None
        if inputs is None or inputs.scene is self._scene:
            return
        self._scene, kind = inputs.scene, _kind_of(inputs)
        if kind in self._done or kind == self._kind or (thread := self._thread()) is None:
            return
        self._kind = kind
        thread.submit(lambda: self._rehearse(thread.context, inputs, kind))

    def _rehearse(self, context: Context, inputs: LiveInputs, kind: Hashable) -> None:
        with closing(rehearse(context, inputs)) as steps:
            for _ in steps:
                while self._rests and self._kind == kind:
                    time.sleep(REST_S)
                if self._kind != kind:
                    return
        self._done.add(kind)

    def end(self) -> None:
        """Compile nothing more than what is being compiled."""
        self._kind = None


def _kind_of(inputs: LiveInputs) -> Hashable:
    """What programs are compiled for."""
    features = Features.of(inputs.scene, RenderSettings(method=inputs.method, local_gain=False, anchor_weights=True))
    return features, frozenset(light.variant for light in inputs.scene.lights)


def _edits(objects: tuple[SceneObject, ...]) -> Iterator[tuple[SceneObject, ...]]:
    yield objects
    yield tuple(replace(item, material=_dispersed(item.material)) for item in objects)
    yield tuple(replace(item, object_to_world=_moved(item)) if item.material.is_specular else item for item in objects)
    yield tuple(replace(item, local_dispersion=_painted(item)) if item.material.receives else item for item in objects)


def _dispersed(material: Material) -> Material:
    if not (material.transmits and material.dispersion.is_dispersive):
        return material
    return material.changed(dispersion=replace(material.dispersion, gain=_GAIN * material.dispersion.gain))


def _moved(item: SceneObject) -> np.ndarray:
    matrix = np.array(item.object_to_world, float)
    matrix[:3, 3] += 1e-3 * np.abs(matrix[:3, :3] @ np.ptp(item.mesh.vertices, axis=0))
    return matrix


def _painted(item: SceneObject) -> tuple[Dab, ...]:
    low, high = item.mesh.vertices.min(axis=0), item.mesh.vertices.max(axis=0)
    x, y, z = (float(v) for v in 0.5 * (low + high))
    return (*item.local_dispersion, Dab((x, y, z), max(0.1 * float(np.linalg.norm(high - low)), 1e-6), 1.0))
