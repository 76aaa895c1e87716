"""The sun of a panorama: a small, very bright spot becomes a directional light, and the rest of the picture lights
without it.

Directions drawn by brightness would find it, but a shadow's edge would be as coarse as a map of the environment's
light, and its caustics, which are as sharp as it is small, are a matter for photons. So what renders asks for
`with_sun` first; the scene that people edit and save keeps its picture as it is.
"""

from __future__ import annotations

import math
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from .lights.directional import SUN_DIAMETER_DEG, DirectionalLight
from .optics.colorimetry import daylight_per_lumen, rgb_basis
from .optics.spectrum import Spectrum
from .scene import Scene
from .scene_checks import MAX_LIGHTS
from .texture import Environment

NAME = "sun of the panorama"
_EDGE = 0.05
"""Of the brightest texel, above which others belong to the spot."""
_LARGEST_SR = 4e-3
"""Solid angle of a spot that is a sun: 4° across, with the glow that cameras put round it."""
_LEAST_SHARE = 0.05
"""Of all light of the panorama, that a sun has at least."""
_CONTRAST = 20.0
"""Times as bright as what is round it, a sun is at least on average."""

_found: WeakKeyDictionary[Environment, tuple[DirectionalLight, Environment] | None] = WeakKeyDictionary()


_last: list[tuple[Scene, Scene]] = []
"""Scenes asked for lately, so that the same one gives the same one again."""


def with_sun(scene: Scene) -> Scene:
    """`scene` with its panorama's sun as the last of its lights and a panorama without; itself where there is none. The
    same scene gives the same one again, and the same environment the same light and panorama."""
    for asked, answer in _last:
        if asked is scene or answer is scene:
            return answer
    answer = _with_sun(scene)
    _last[:] = [(scene, answer), *_last[:3]]
    return answer


def _with_sun(scene: Scene) -> Scene:
    environment = scene.environment
    if environment is None or not environment.lights or environment.kind != "map":
        return scene
    if len(scene.lights) >= MAX_LIGHTS:  # no photon could name one more
        return scene
    if environment not in _found:
        _found[environment] = sun_of(environment)
    found = _found[environment]
    if found is None:
        return scene
    return replace(scene, lights=(*scene.lights, found[0]), environment=found[1])


def sun_of(environment: Environment) -> tuple[DirectionalLight, Environment] | None:
    """The sun's light and the panorama without it, whose sum is the panorama; None where no spot is one."""
    from scipy import ndimage

    rgb = np.asarray(environment.rgb, float)
    height, width = rgb.shape[:2]
    bright = rgb.mean(axis=2)
    row, column = np.unravel_index(int(bright.argmax()), bright.shape)
    # The seam of the columns is turned away from the spot.
    turn = width // 2 - int(column)
    rgb, bright = np.roll(rgb, turn, axis=1), np.roll(bright, turn, axis=1)
    labels, _ = ndimage.label(bright > _EDGE * bright.max())
    spot = labels == labels[row, width // 2]
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    solid = np.broadcast_to(((edges[:-1] - edges[1:]) * 2.0 * np.pi / width)[:, None], bright.shape)
    if not bright.any() or solid[spot].sum() > _LARGEST_SR:
        return None
    ring = ndimage.binary_dilation(spot, iterations=3) & ~ndimage.binary_dilation(spot, iterations=1)
    if not ring.any():
        return None
    beside = np.median(rgb[ring], axis=0)
    excess = np.maximum(rgb[spot] - beside, 0.0)
    flux = (excess * solid[spot][:, None]).sum(axis=0)
    if flux.mean() < _LEAST_SHARE * (bright * solid).sum() or excess.mean() < _CONTRAST * beside.mean():
        return None
    rest = rgb.copy()
    rest[spot] = np.minimum(rgb[spot], beside)
    rest = np.roll(rest, -turn, axis=1).astype(np.float32)
    rest.setflags(write=False)
    rows, columns = np.nonzero(spot)
    polar = np.pi * (rows + 0.5) / height
    azimuth = 2.0 * np.pi * (0.5 - (columns - turn + 0.5) / width)
    places = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    weights = excess.mean(axis=1) * solid[spot]
    toward = weights @ places
    toward = (toward / np.linalg.norm(toward)) @ environment.world_to_local
    # A disc of the brightest texel's radiance has the same light.
    size = flux.mean() / excess.mean(axis=1).max()
    diameter = max(SUN_DIAMETER_DEG, 2.0 * math.degrees(math.asin(math.sqrt(min(size / math.pi, 1.0)))))
    power = Spectrum(np.maximum(rgb_basis() @ flux, 0.0) * daylight_per_lumen())
    x, y, z = (float(-v) for v in toward)
    return DirectionalLight(NAME, power, (x, y, z), diameter), replace(environment, rgb=rest)
