"""The fan of rays of the overlay, traced anew only when something that it depends on changed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..edit.state import State
from ..passes.ray_line import RayLine
from .ray_readings import RayReading, readings

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..gpu.scene_buffers import SceneBuffers
    from ..model.scene import Scene
    from ..passes.ray_fan import RayFan

FIRST_NM, LAST_NM = 400.0, 700.0
BUNDLE_SHARE = 0.02
"""Width of the thin bundle that focal points are measured with, share of the object's extent."""
DENSE_RAYS = 401
"""Rays of the fan in which the one that turns least is found."""


class RayOverlay:
    """Owns a tracer of the scene as it is edited: rays follow a dragged dispersion before photons are traced again."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._scene: Scene | None = None
        self._buffers: SceneBuffers | None = None
        self._fan: RayFan | None = None
        self._key: tuple[object, ...] = ()
        self.rays: tuple[RayLine, ...] = ()
        self.readings: tuple[RayReading, ...] = ()

    def update(self, state: State) -> None:
        """Trace what `state` asks for. Raises `UserError` for a scene that does not fit on the device."""
        index = self._object(state) if state.display.ray_overlay else None
        if index is None:
            self.rays, self.readings, self._key = (), (), ()
            return
        display, reflections = state.display, state.display.ray_reflections
        key = (index, state.selection, display.ray_count, display.ray_wavelengths, reflections, state.solo_nm)
        if key == self._key and state.scene is self._scene:
            return
        self._key = key
        light = state.selection.index if state.selection.kind == "light" else None
        fan, wanted = self._fan_of(state.scene), wavelengths_of(state)
        light = fan.brightest_light(index) if light is None else light
        self.rays = tuple(fan.trace(light, index, display.ray_count, wanted, reflections=reflections))
        bundle_of = (DENSE_RAYS, wanted, 1.0, reflections) if reflections else (3, wanted, BUNDLE_SHARE)
        bundle = fan.trace(light, index, *bundle_of)
        glass = state.scene.objects[index].material
        indices = (
            {nm: float(glass.dispersion.index(nm)) for nm in wanted}
            if glass.transmits and glass.dispersion is not None
            else {}
        )
        is_parallel = light is not None and state.scene.lights[light].is_parallel
        self.readings = readings(self.rays, bundle, indices, is_parallel, reflections)
        if reflections:  # those that the readings are of are seen too
            self.rays += tuple(RayLine(reading.wavelength_nm, reading.path) for reading in self.readings)

    def release(self) -> None:
        """Free the tracer and its scene."""
        if self._fan is not None:
            self._fan.release()
        if self._buffers is not None:
            self._buffers.release()
        self._fan = self._buffers = self._scene = None

    def _fan_of(self, scene: Scene) -> RayFan:
        from ..model.settings import RenderSettings
        from ..passes.ray_fan import RayFan
        from ..passes.ray_paths import RayPaths
        from ..render.device_scene import scene_buffers

        if self._fan is None or scene is not self._scene:
            self.release()
            self._scene, self._buffers = scene, scene_buffers(self._context, scene, RenderSettings())
            self._fan = RayFan(RayPaths(self._context, self._buffers))
        return self._fan

    @staticmethod
    def _object(state: State) -> int | None:
        """The selected glass or grating; with a light or nothing selected, the first there is."""
        selection, objects = state.selection, state.scene.objects
        if selection.kind == "object" and objects[selection.index].material.dispersion is not None:
            return selection.index
        return next((i for i, o in enumerate(objects) if o.material.dispersion is not None), None)


def wavelengths_of(state: State) -> list[float]:
    """Evenly over the spectrum, or the one that is shown alone."""
    if state.solo_nm is not None:
        return [state.solo_nm]
    count = max(state.display.ray_wavelengths, 1)
    return [float(nm) for nm in np.linspace(FIRST_NM, LAST_NM, count)] if count > 1 else [550.0]
