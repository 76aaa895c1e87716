"""Keys of what a picture depends on: equal content gives equal keys, whatever objects hold it."""

from __future__ import annotations

import hashlib
from dataclasses import astuple, fields

import numpy as np
from numpy.typing import ArrayLike

from .scene import Scene


class ContentKey:
    """SHA-256 over labelled values, in the order in which they are added."""

    def __init__(self, start: str = "") -> None:
        """`start`: a key that this one goes on from."""
        self._digest = hashlib.sha256(start.encode())

    def add(self, label: str, *values: object) -> None:
        """Arrays count by type, shape and content, everything else by its `repr`."""
        self._digest.update(f"\n{label}:".encode())
        for value in values:
            if isinstance(value, np.ndarray):
                self._digest.update(f"{value.dtype.str}{value.shape}".encode())
                self._digest.update(np.ascontiguousarray(value).data)
            else:
                self._digest.update(f"{value!r};".encode())

    def hexdigest(self) -> str:
        """The key so far, 64 hexadecimal digits."""
        return self._digest.hexdigest()


def scene_key(scene: Scene, *more: object) -> str:
    """SHA-256 over everything that light and the caustic layer depend on, and over `more` (plain values).

    Names, notes, textures and the background do not count.
    """
    key = ContentKey()
    rules = (("polarised", scene.polarised), (f"bounces {scene.render.bounces}", scene.render.bounces))
    key.add("scene", *more, *(name for name, holds in rules if holds))
    camera = astuple(scene.camera)
    # Without a lens there is no plane of focus.
    key.add(
        "camera", *(camera if scene.camera.lens_radius > 0.0 else camera[: -len(("lens_radius", "focus_distance"))])
    )
    for light in scene.lights:
        spectrum = light.spectral_power
        names = sorted({field.name for field in fields(light)} - {"name", "spectral_power"})
        key.add("light", spectrum.density, spectrum.lines, *(_plain(getattr(light, name)) for name in names))
    for item in scene.objects:
        mesh = item.mesh
        key.add("mesh", mesh.vertices, mesh.triangles, np.asarray(item.object_to_world, float))
        key.add("normals", mesh.corner_normals if mesh.corner_normals is not None else None)
        key.add("material", type(item.material).__name__, *item.material.content())
    return key.hexdigest()


def picture_key(scene: Scene, *more: object) -> str:
    """The same over everything that a camera sees: textures and what lies beyond count as well."""
    key = ContentKey(scene_key(scene, *more))
    if scene.environment is None:
        key.add("background", *(float(v) for v in scene.background_rgb))
    else:
        lights = ("lights",) if scene.environment.lights else ()
        key.add("environment", scene.environment.rgb, np.asarray(scene.environment.world_to_local, float), *lights)
    if scene.render.haze:
        key.add("haze", float(scene.render.haze), float(scene.render.haze_anisotropy))
    for index, item in enumerate(scene.objects):
        if item.material.texture is not None:
            key.add("texture", index, item.material.texture.rgb, item.material.texture.wrap, item.mesh.uv)
    return key.hexdigest()


def _plain(value: ArrayLike | None) -> object:
    """A light's field so that equal values print alike (1 and 1.0, tuples of numpy numbers)."""
    if isinstance(value, str | bool) or value is None:
        return value
    return tuple(float(v) for v in np.ravel(value))
