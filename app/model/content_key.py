"""Hashes of what a picture depends on: equal content gives equal keys, whatever objects hold it."""

from __future__ import annotations

import hashlib
from dataclasses import astuple

import numpy as np

from .optics.colorimetry import VISIBLE_NM
from .scene import Dielectric, Diffuse, Mirror, Scene


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
                self._digest.update(np.ascontiguousarray(value))
            else:
                self._digest.update(f"{value!r};".encode())

    def hexdigest(self) -> str:
        """The key so far, 64 hexadecimal digits."""
        return self._digest.hexdigest()


def scene_key(scene: Scene, *also: object) -> str:
    """SHA-256 over what light meets in `scene`, and `also`: names, notes, textures and the background do not count."""
    key = ContentKey()
    key.add("version", *also)
    key.add("camera", *astuple(scene.camera))
    for light in scene.lights:
        spectrum = light.spectral_power
        fields = {name: value for name, value in vars(light).items() if name not in ("name", "spectral_power")}
        key.add("light", spectrum.density, spectrum.lines, *(_plain(fields[name]) for name in sorted(fields)))
    for item in scene.objects:
        mesh = item.mesh
        key.add("mesh", mesh.vertices, mesh.triangles, np.asarray(item.object_to_world, float))
        key.add("normals", mesh.corner_normals if mesh.corner_normals is not None else None)
        key.add("material", type(item.material).__name__)
        match item.material:
            case Dielectric(dispersion=dispersion, absorption=absorption, priority=priority):
                key.add(
                    "glass",
                    dispersion.index(VISIBLE_NM),
                    priority,
                    None if absorption is None else absorption.coefficient,
                )
            case Mirror(reflectance_rgb=rgb):
                key.add("mirror", *(float(v) for v in rgb))
            case Diffuse(reflectance_rgb=rgb, reflectance=reflectance):
                key.add("diffuse", *(float(v) for v in rgb), reflectance)
    return key.hexdigest()


def _plain(value: object) -> object:
    """A light's field so that equal values print alike (1 and 1.0, tuples of numpy numbers)."""
    if isinstance(value, str | bool) or value is None:
        return value
    return tuple(float(v) for v in np.ravel(value))
