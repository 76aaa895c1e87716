"""Light from beyond everything: which scenes it lights, and the directions to draw it from.

Directions are drawn by brightness: a Sobol sequence over the running sums of the picture's rows and columns, each with
the weight that makes their mean the environment's integral [Pharr, Jakob and Humphreys 2023, section 12.5.2].
All places of all receivers use the same directions, so a map has no grain: what few directions leave are steps in soft
shadows, and every round adds others between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.random_words import random_word
from .environment import averaged_down, direction_of, texel_solid_angles
from .optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, daylight_per_lumen, rgb_basis, xyz_to_rgb709
from .optics.spectral_tables import SpectralAxis
from .scene import Scene
from .texture import Environment

WIDTH, HEIGHT = 512, 256
"""Largest picture that light is drawn from; larger ones are averaged down."""
_DIMENSION = 64
"""First of the words that shift the sequence; after those of photons (`random_words.Dimension`)."""
_PLASTIC = np.array([0.7548776662466927, 0.5698402909980532])
"""Powers of the plastic number's reciprocal: a Kronecker sequence of two dimensions, for places within texels."""
_LEAST_HEIGHT = 128
"""Least height of the picture to draw from: smaller ones are interpolated, as the camera does."""


def lighting_environment(scene: Scene) -> Environment | None:
    """What lights the scene from beyond everything; None where nothing does."""
    environment = scene.environment
    if environment is None or not environment.lights or not environment.rgb.any():
        return None
    return environment


def why_no_environment_light(scene: Scene) -> str | None:
    """Why nothing from beyond lights a surface; None: it does."""
    if scene.environment is None:
        return "there is no environment; a background lights nothing"
    if not scene.environment.lights:
        return "environment.lights is false"
    if lighting_environment(scene) is None:
        return "the environment is black"
    if not any(o.material.receives for o in scene.objects):
        return "no surface is diffuse"
    return None


@dataclass(frozen=True)
class Directions:
    """Directions to ask, of one part of the sequence."""

    toward: np.ndarray
    """float64 (n, 3), unit, world space."""
    weight: np.ndarray
    """float64 (n, 3): radiance over probability per steradian, linear Rec.709, lm/unit²; the mean over directions of
    weight times cosine is the irradiance of what sees all of the environment."""
    within: np.ndarray
    """float64 (n, 2): place within whatever asks, 0 to 1."""


@dataclass(frozen=True, eq=False)
class EnvironmentLight:
    """An environment to be drawn from."""

    environment: Environment
    seed: int = 1

    @cached_property
    def rgb(self) -> np.ndarray:
        """float64 (H, W, 3): the picture, averaged down to at most WIDTH × HEIGHT."""
        rgb = np.asarray(self.environment.rgb, np.float32)
        if rgb.shape[0] < _LEAST_HEIGHT or rgb.shape[1] < 2 * _LEAST_HEIGHT:
            rgb = _interpolated(rgb, max(rgb.shape[0], _LEAST_HEIGHT), max(rgb.shape[1], 2 * _LEAST_HEIGHT))
        return np.asarray(averaged_down(rgb, HEIGHT, WIDTH), float)

    @cached_property
    def _solid_angles(self) -> np.ndarray:
        return texel_solid_angles(*self.rgb.shape[:2])

    @cached_property
    def _tables(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Running sums over rows (H + 1,) and within each row (H, W + 1), both from 0 to 1; brightness (H, W)."""
        brightness = np.abs(self.rgb).mean(axis=2)  # colours outside of Rec.709 have negative channels
        power = brightness * self._solid_angles
        rows = power.sum(axis=1)
        of_row = np.where(rows[:, None] > 0.0, power, 1.0)
        return _running(rows), np.stack([_running(row) for row in of_row]), brightness

    def directions(self, first: int, count: int) -> Directions:
        """Numbers `first` to `first + count` of the sequence."""
        a, b, c, d = even_points(np.arange(first, first + count), self.seed, _DIMENSION).T
        by_row, by_column, brightness = self._tables
        height, width = brightness.shape
        row = np.clip(np.searchsorted(by_row, a, side="right") - 1, 0, height - 1)
        down = (a - by_row[row]) / np.maximum(by_row[row + 1] - by_row[row], 1e-300)
        column = np.array([np.searchsorted(by_column[r], v, side="right") - 1 for r, v in zip(row, b, strict=True)])
        column = np.clip(column, 0, width - 1)
        along = (b - by_column[row, column]) / np.maximum(by_column[row, column + 1] - by_column[row, column], 1e-300)
        # Even over the solid angle within a texel's row.
        top, bottom = np.cos(np.pi * row / height), np.cos(np.pi * (row + 1) / height)
        cosine = top + np.clip(down, 0.0, 1.0) * (bottom - top)
        azimuth = 2.0 * np.pi * (0.5 - (column + np.clip(along, 0.0, 1.0)) / width)
        sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
        local = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=-1)
        total = float((brightness * self._solid_angles).sum())
        weight = self.rgb[row, column] * (total / np.maximum(brightness[row, column], 1e-300))[:, None]
        return Directions(local @ self.environment.world_to_local, weight, np.stack([c, d], axis=-1))

    def unshadowed(self, normals: np.ndarray) -> np.ndarray:
        """Irradiance, float64 (n, 3), lm/unit², of surfaces with these unit world `normals` (n, 3) that see all of
        their half of the environment."""
        rgb, solid = self.rgb, np.broadcast_to(self._solid_angles, self.rgb.shape[:2])
        step = max(1, rgb.shape[0] // 64)
        if step > 1 and rgb.shape[0] % step == 0 and rgb.shape[1] % step == 0:
            power = _blocks(rgb * solid[..., None], step)
            solid = _blocks(np.array(solid)[..., None], step)[..., 0]
            rgb = power / solid[..., None]
        height, width = solid.shape
        u, v = (np.arange(width) + 0.5) / width, (np.arange(height)[:, None] + 0.5) / height
        world = direction_of(self.environment, u, v).reshape(-1, 3)
        power = (rgb * solid[..., None]).reshape(-1, 3)
        distinct, which = np.unique(np.round(normals, 6), axis=0, return_inverse=True)
        found = np.empty((len(distinct), 3))
        for at in range(0, len(distinct), 512):
            found[at : at + 512] = np.maximum(distinct[at : at + 512] @ world.T, 0.0) @ power
        return found[which.reshape(-1)]

    def levels(self) -> tuple[np.ndarray, list[tuple[int, int, int]]]:
        """The picture and coarser and coarser ones below it: float32 (rows, W, 3), and of each (first row, width,
        height)."""
        pictures, solid = [self.rgb], np.broadcast_to(self._solid_angles, self.rgb.shape[:2])[..., None]
        while min(pictures[-1].shape[:2]) > 2 and not any(s % 2 for s in pictures[-1].shape[:2]):
            power, solid_before = pictures[-1] * solid, solid
            solid = _blocks(np.array(solid_before), 2)
            pictures.append(_blocks(power, 2) / solid)
        width = pictures[0].shape[1]
        places, rows = [], 0
        packed = np.zeros((sum(p.shape[0] for p in pictures), width, 3), np.float32)
        for picture in pictures:
            packed[rows : rows + picture.shape[0], : picture.shape[1]] = picture
            places.append((rows, picture.shape[1], picture.shape[0]))
            rows += picture.shape[0]
        return packed, places


def even_points(numbers: np.ndarray, seed: int, dimension: int) -> np.ndarray:
    """Points `numbers` (n,) of a sequence in four dimensions, float64 (n, 4): the first two are Sobol's, whose first
    2ᵏ lie one in each of 2ᵏ equal boxes however these are cut, scrambled by `seed`; `dimension` names the first of the
    words."""
    words = [random_word(seed, 0, 0, dimension + d) for d in range(4)]
    digits = np.zeros((2, len(numbers)), np.uint64)
    steps = [np.uint64(1 << 31), np.uint64(1 << 31)]
    for bit in range(32):
        taken = (numbers.astype(np.uint64) >> np.uint64(bit)) & np.uint64(1) != 0
        for d in range(2):
            digits[d, taken] ^= steps[d]
        steps = [steps[0] >> np.uint64(1), steps[1] ^ (steps[1] >> np.uint64(1))]
    sobol = [((d ^ np.uint64(word)).astype(float) + 0.5) * 2.0**-32 for d, word in zip(digits, words, strict=False)]
    within = (numbers[:, None] * _PLASTIC + np.array(words[2:]) * 2.0**-32) % 1.0
    return np.stack([*sobol, *within.T], axis=-1)


def spectral_taps(axis: SpectralAxis, count: int) -> tuple[np.ndarray, np.ndarray]:
    """`count` bands of the spectrum: their ends as spectral coordinates, float64 (count + 1,), and what of an
    environment's red, green and blue lies in each, linear Rec.709, float64 (count, 3, 3), which add up to those. Bands
    are even half by brightness, half by the spectral coordinate."""
    response = cmf_xyz() * daylight_per_lumen()[:, None]
    bright = np.cumsum(response.sum(axis=1))
    x = np.linspace(0.0, 1.0, 4096)
    nm = axis.nm_of_x(x)
    spread = np.interp(nm, VISIBLE_NM + 0.5, bright / bright[-1], left=0.0) + x
    edges_x = np.interp(np.linspace(0.0, spread[-1], count + 1), spread, x)
    until = np.cumsum(rgb_basis()[:, :, None] * K_M * xyz_to_rgb709(response)[:, None, :], axis=0).reshape(-1, 9)
    edges_nm = np.concatenate([[0.0], axis.nm_of_x(edges_x[1:-1]), [1e4]])
    sums = np.stack([np.interp(edges_nm, VISIBLE_NM + 0.5, column, left=0.0) for column in until.T], axis=1)
    return edges_x, np.diff(sums, axis=0).reshape(count, 3, 3)


def _interpolated(rgb: np.ndarray, height: int, width: int) -> np.ndarray:
    """Between texels, columns joined and rows ended as `Environment` has them."""
    for axis, size in ((0, height), (1, width)):
        old = rgb.shape[axis]
        at = (np.arange(size) + 0.5) * old / size - 0.5
        low, share = np.floor(at).astype(int), (at - np.floor(at)).astype(np.float32)
        ends = [low % old, (low + 1) % old] if axis else [np.clip(low + i, 0, old - 1) for i in range(2)]
        share = share.reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        rgb = (1.0 - share) * rgb.take(ends[0], axis) + share * rgb.take(ends[1], axis)
    return rgb


def _running(values: np.ndarray) -> np.ndarray:
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return sums / sums[-1]


def _blocks(values: np.ndarray, side: int) -> np.ndarray:
    """Sums over blocks of side × side, (H / side, W / side, channels)."""
    height, width = values.shape[:2]
    return values.reshape(height // side, side, width // side, side, -1).sum(axis=(1, 3))


_FLAT = 1e-5
"""Height over a plane, of a scene's size, up to which a surface lies in it."""


def why_no_bounces(scene: Scene) -> str | None:
    """Why no light that one diffuse surface sends back reaches another, or the same again; None: some may."""
    if scene.render.bounces == 0:
        return "[render] bounces is 0"
    receivers = [o for o in scene.objects if o.material.receives]
    if not receivers:
        return "no surface is diffuse"
    if not scene.lights and lighting_environment(scene) is None:
        return "nothing shines"
    if any(o.material.is_specular for o in scene.objects):
        return None  # a floor sees itself in glass that stands on it
    points = np.concatenate([o.world_vertices for o in receivers])
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if singular[-1] <= _FLAT * max(singular[0], np.finfo(float).tiny):
        return "all diffuse surfaces lie in one plane: none sees another"
    return None
