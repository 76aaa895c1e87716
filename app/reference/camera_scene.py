"""What the camera's reference sees beyond shapes, as flat float64 arrays: spectra by wavelength cell, textures, the
environment.

A path has one wavelength, drawn from *atoms*: the nanometre cells of the visible grid and the
lines of the scene's lights. Colours given as RGB become spectra by `colorimetry.rgb_basis`, which is linear: a
surface's reflectance is basis @ rgb, what shines from infinitely far is D65 times basis @ rgb.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, daylight_per_lumen, rgb_basis
from ..model.optics.spectrum import cmf_at
from ..model.scene import Scene
from ..model.scene_checks import contains
from .camera_coat import Finishes, finishes
from .camera_lights import EnvironmentDraw, environment_draw
from .compiling import inlined
from .photon_scene import TABLE_NM, PhotonScene, reflectance_classes
from .scattering import AIR
from .vectors import dot
from .worn_textures import blend, worn_textures

_EVEN_SHARE = 0.2
"""Share of the wavelengths drawn by power; the rest by what the eye sees."""


class Spectra(NamedTuple):
    """A atoms in ascending order; L lights, K reflectance classes (`photon_scene.reflectance_classes`)."""

    cdf: np.ndarray
    """float64 (A + 1,): 0 to 1."""
    start_nm: np.ndarray
    width_nm: np.ndarray
    """float64 (A,): a line has no width."""
    response: np.ndarray
    """float64 (A, 3): K_m (x̄, ȳ, z̄) over the atom's probability, lm/W."""
    lights: np.ndarray
    """float64 (L, A): each light's quantity in the atom, W …."""
    daylight: np.ndarray
    """float64 (A,): D65 of luminance 1, W/(sr unit²)."""
    basis: np.ndarray
    """float64 (A, 3): reflectance of the RGB basis."""
    classes: np.ndarray
    """float64 (K, A): reflectance; class 0 is one."""
    bin: np.ndarray
    """int32 (A,): bin of the spectral caustic; every line has its own after those of the cells."""
    share: np.ndarray
    """float64 (A,): the atom's part of its bin's power, by the lights' summed spectra."""
    light_xyz: np.ndarray
    """float64 (L, 2 + K, 3): XYZ of a light's whole spectrum seen by the three reflectances of the basis, then by
    classes 1, 2, …."""
    bin_xyz: np.ndarray
    """float64 (bins, 2 + K, 3): likewise of one watt in a bin."""
    beyond_xyz: np.ndarray
    """float64 (1, 2 + K, 3): likewise of the daylight."""


class Pictures(NamedTuple):
    """Textures and the environment in one array of texels."""

    rgb: np.ndarray
    """float32 (N, 3), linear Rec.709."""
    size: np.ndarray
    """int64 (P, 4): first texel, width, height, 1 where it repeats; the environment comes last, and may be a single
    texel."""
    texture: np.ndarray
    """int32 (O,): picture of an object, or −1."""
    colour: np.ndarray
    """float64 (O, 3): linear Rec.709 factor of a receiver."""
    uv_row: np.ndarray
    """int32 (T,): row of `uv` of a triangle in tree order, or −1."""
    uv: np.ndarray
    """float64 (U, 6): u, v at each corner."""
    to_local: np.ndarray
    """float64 (3, 3): the environment's frame."""
    finishes: Finishes
    """Coats, and how rough bases are."""
    draw: EnvironmentDraw
    """How paths go on towards it from what it lights."""


def sees_beyond(scene: Scene) -> bool:
    """Whether a ray that meets nothing sees any light but a sun's disc."""
    return scene.environment is not None or any(v > 0.0 for v in scene.background_rgb)


def line_wavelengths(scene: Scene) -> list[float]:
    """Wavelengths of the lights' lines, nm, ascending, each once."""
    return sorted({nm for light in scene.lights for nm, power in light.spectral_power.lines if power > 0.0})


def spectra(scene: Scene, bins: int) -> Spectra:
    """The scene's wavelengths, most where its light is seen; `bins` of the caustic over the 401 cells (at least 1)."""
    lines = line_wavelengths(scene)
    line_nm = np.array(lines, float)
    start = np.concatenate([np.maximum(VISIBLE_NM - 0.5, VISIBLE_NM[0]), line_nm])
    width = np.concatenate([np.minimum(VISIBLE_NM + 0.5, VISIBLE_NM[-1]) - start[:401], np.zeros(len(lines))])
    power = np.zeros((len(scene.lights), len(start)))
    for row, light in zip(power, scene.lights, strict=True):
        row[:401] = light.spectral_power.density
        for nm, line_power in light.spectral_power.lines:
            if line_power > 0.0:
                row[401 + lines.index(nm)] += line_power
    daylight = np.concatenate([daylight_per_lumen(), np.zeros(len(lines))])
    seen = np.concatenate([cmf_xyz(), cmf_at(line_nm).reshape(-1, 3)])
    basis = np.concatenate([rgb_basis(), np.stack([np.interp(line_nm, VISIBLE_NM, c) for c in rgb_basis().T], axis=-1)])
    classes = [np.ones(401) if c is None else c for c in reflectance_classes(scene)[0]]
    reflectance = np.array([np.concatenate([c, np.interp(line_nm, VISIBLE_NM, c)]) for c in classes])
    share = _probability([*power, *([daylight] if sees_beyond(scene) else [])], seen)
    bin_of = np.concatenate([np.arange(401) * bins // 401, bins + np.arange(len(lines))]).astype(np.int32)
    total = power.sum(axis=0)
    in_bin = np.bincount(bin_of, total)
    part = np.divide(total, in_bin[bin_of], out=np.zeros_like(total), where=in_bin[bin_of] > 0.0)
    surfaces = np.concatenate([basis.T, reflectance[1:]])
    in_bins = part * (np.arange(bins + len(lines))[:, None] == bin_of)
    by_surface = [
        K_M * np.einsum("la,sa,ac->lsc", rows, surfaces, seen, optimize=True)
        for rows in (power, in_bins, daylight[None])
    ]
    order = np.argsort(start, kind="stable")
    order = order[share[order] > 0.0]  # what no source emits is never drawn
    cdf = np.concatenate([[0.0], np.cumsum(share[order])])
    cdf[-1] = 1.0
    return Spectra(
        cdf,
        start[order],
        width[order],
        K_M * seen[order] / share[order, None],
        np.ascontiguousarray(power[:, order]),
        daylight[order],
        basis[order],
        np.ascontiguousarray(reflectance[:, order]),
        bin_of[order],
        part[order],
        *(np.ascontiguousarray(table) for table in by_surface),
    )


def _probability(sources: list[np.ndarray], seen: np.ndarray) -> np.ndarray:
    """Probability of each atom (A,): every source counts alike, mostly by what the camera (A, 3) sees of it."""
    share = np.zeros(len(seen))
    for power in sources:
        bright = power * seen.sum(axis=1)
        if bright.sum() > 0.0:
            share += (1.0 - _EVEN_SHARE) * bright / bright.sum() + _EVEN_SHARE * power / power.sum()
    return share / share.sum() if share.any() else np.full(len(seen), 1.0 / len(seen))


def with_upsampled_mirrors(photons: PhotonScene, scene: Scene) -> PhotonScene:
    """The same arrays with every mirror's reflectance as basis @ rgb, as the camera's RGB colours are meant."""
    rows, weight = [photons.weights], photons.weight.copy()
    for index, item in enumerate(scene.objects):
        if item.material.is_mirror:
            weight[index] = sum(len(r) for r in rows)
            rows.append(
                np.interp(TABLE_NM, VISIBLE_NM, rgb_basis() @ np.asarray(item.material.reflectance_rgb, float))[None]
            )
    return photons._replace(weights=np.concatenate(rows), weight=weight)


def pictures(scene: Scene, photons: PhotonScene) -> Pictures:
    """Texels and texture coordinates; `photons`: what `photon_scene` made of the scene."""
    beyond = scene.environment
    far = np.asarray(scene.background_rgb if beyond is None else beyond.rgb, np.float32).reshape(
        *(beyond.rgb.shape if beyond else (1, 1, 3))
    )
    colour = np.ones((len(scene.objects), 3))
    for index, item in enumerate(scene.objects):
        if item.material.receives and item.material.reflectance is None:
            colour[index] = item.material.reflectance_rgb
    worn = worn_textures(scene, photons)
    last = (len(worn.rgb), far.shape[1], far.shape[0], 0)
    return Pictures(
        np.concatenate([worn.rgb, far.reshape(-1, 3)]),
        np.concatenate([worn.size, np.array([last], np.int64)]),
        worn.texture,
        colour,
        worn.uv_row,
        worn.uv,
        np.array(beyond.world_to_local, float) if beyond else np.eye(3),
        finishes(scene),
        environment_draw(scene),
    )


class Start(NamedTuple):
    """What solids the camera is in; a path begins with that."""

    mask: np.uint64
    alone: int


def camera_start(scene: Scene, photons: PhotonScene) -> Start:
    """The medium at the camera's position (of an orthographic camera too: its rays all begin as the middle one
    does)."""
    mask, alone = 0, int(AIR)
    for index, item in enumerate(scene.objects):
        if item.material.is_solid and contains(item, np.array(scene.camera.position)):
            if photons.bit[index] >= 0:
                mask |= 1 << int(photons.bit[index])
            else:
                alone = index
    return Start(np.uint64(mask), alone)


@inlined
def beyond(pictures, d):
    """Linear Rec.709 radiance from infinitely far along a unit direction, lm/(sr unit²): columns join, the poles end
    the picture."""
    which = pictures.size.shape[0] - 1
    first, width, height = pictures.size[which, 0], pictures.size[which, 1], pictures.size[which, 2]
    if width == 1 and height == 1:
        return float(pictures.rgb[first, 0]), float(pictures.rgb[first, 1]), float(pictures.rgb[first, 2])
    m = pictures.to_local
    lx, ly, lz = dot(m[0], d), dot(m[1], d), dot(m[2], d)
    x = (0.5 - math.atan2(ly, lx) / (2.0 * math.pi)) * width - 0.5
    # The angle from both of its sides: acos alone loses the directions near the poles.
    y = math.atan2(math.sqrt(lx * lx + ly * ly), lz) / math.pi * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    left, right = int(x0) % width, (int(x0) + 1) % width
    top, bottom = max(int(y0), 0), min(int(y0) + 1, height - 1)
    above, below = first + top * width, first + bottom * width
    return blend(pictures.rgb, above + left, above + right, below + left, below + right, x - x0, y - y0)
