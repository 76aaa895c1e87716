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
from ..model.texture import Texture
from .camera_coat import Finishes, finishes
from .compiling import inlined
from .environment_draw import EnvironmentDraw, environment_draw
from .photon_scene import TABLE_NM, PhotonScene, reflectance_classes

_EVEN_SHARE = 0.2
"""Of the wavelengths: drawn by power, the rest by what the eye sees."""


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
    """Of the lights' lines, nm, ascending, each once."""
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
    """Of each atom (A,): every source counts alike, mostly by what the camera (A, 3) sees of it."""
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


def pictures(scene: Scene, photons: PhotonScene, centre: np.ndarray) -> Pictures:
    """Texels and texture coordinates; `photons`, `centre`: what `photon_scene` made of the scene."""
    beyond = scene.environment
    far = np.asarray(scene.background_rgb if beyond is None else beyond.rgb, np.float32).reshape(
        *(beyond.rgb.shape if beyond else (1, 1, 3))
    )
    textures: list[Texture] = []
    texture = np.full(len(scene.objects), -1, np.int32)
    colour = np.ones((len(scene.objects), 3))
    for index, item in enumerate(scene.objects):
        if not item.material.receives or item.material.reflectance is not None:
            continue
        colour[index] = item.material.reflectance_rgb
        if item.material.texture is not None:
            if not any(t is item.material.texture for t in textures):
                textures.append(item.material.texture)
            texture[index] = next(i for i, t in enumerate(textures) if t is item.material.texture)
    arrays = [*(np.asarray(t.rgb, np.float32) for t in textures), far]
    first = np.concatenate([[0], np.cumsum([a.shape[0] * a.shape[1] for a in arrays])])
    repeats = [*(t.wrap == "repeat" for t in textures), False]
    size = np.array([[f, a.shape[1], a.shape[0], r] for f, a, r in zip(first, arrays, repeats, strict=False)], np.int64)
    uv_row, uv = _coordinates(scene, photons, centre, texture)
    return Pictures(
        np.concatenate([a.reshape(-1, 3) for a in arrays]),
        size,
        texture,
        colour,
        uv_row,
        uv,
        np.array(beyond.world_to_local, float) if beyond else np.eye(3),
        finishes(scene),
        environment_draw(scene),
    )


def _coordinates(
    scene: Scene, photons: PhotonScene, centre: np.ndarray, texture: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Each triangle's row of texture coordinates (−1: none), in the order of the tree, and the rows (U, 6)."""
    row = np.full(len(photons.owner), -1, np.int32)
    if not (texture >= 0).any():
        return row, np.zeros((1, 6))
    uv = np.zeros((len(photons.owner), 6))
    for index, item in enumerate(scene.objects):
        coordinates = item.mesh.transformed(item.object_to_world).uv
        if texture[index] >= 0 and coordinates is not None:
            own = photons.owner == index
            uv[own] = coordinates.reshape(-1, 6)[photons.facet[own]]
    worn = np.flatnonzero(texture[photons.owner] >= 0)
    row[worn] = np.arange(len(worn))
    return row, np.ascontiguousarray(uv[worn])


@inlined
def _texel(first, width, height, repeats, x, y):
    """Number of the texel in column x and row y, wherever these lie."""
    if repeats:
        return first + (y % height) * width + x % width
    return first + min(max(y, 0), height - 1) * width + min(max(x, 0), width - 1)


@inlined
def _blend(rgb, a, b, c, d, fx, fy):
    """Between four texels: a and b above, c and d below."""
    wa, wb, wc, wd = (1.0 - fx) * (1.0 - fy), fx * (1.0 - fy), (1.0 - fx) * fy, fx * fy
    return (
        wa * rgb[a, 0] + wb * rgb[b, 0] + wc * rgb[c, 0] + wd * rgb[d, 0],
        wa * rgb[a, 1] + wb * rgb[b, 1] + wc * rgb[c, 1] + wd * rgb[d, 1],
        wa * rgb[a, 2] + wb * rgb[b, 2] + wc * rgb[c, 2] + wd * rgb[d, 2],
    )


@inlined
def picture_at(pictures, which, u, v):
    """Linear Rec.709 of a texture at (u, v), v upwards, between the four nearest texels."""
    first, width, height, repeats = (
        pictures.size[which, 0],
        pictures.size[which, 1],
        pictures.size[which, 2],
        pictures.size[which, 3] != 0,
    )
    x, y = u * width - 0.5, (1.0 - v) * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    column, row = int(x0), int(y0)
    a = _texel(first, width, height, repeats, column, row)
    b = _texel(first, width, height, repeats, column + 1, row)
    c = _texel(first, width, height, repeats, column, row + 1)
    d = _texel(first, width, height, repeats, column + 1, row + 1)
    return _blend(pictures.rgb, a, b, c, d, x - x0, y - y0)


@inlined
def beyond(pictures, dx, dy, dz):
    """Linear Rec.709 radiance from infinitely far along a unit direction, lm/(sr unit²): columns join, the poles end
    the picture."""
    which = pictures.size.shape[0] - 1
    first, width, height = pictures.size[which, 0], pictures.size[which, 1], pictures.size[which, 2]
    if width == 1 and height == 1:
        return float(pictures.rgb[first, 0]), float(pictures.rgb[first, 1]), float(pictures.rgb[first, 2])
    m = pictures.to_local
    lx = m[0, 0] * dx + m[0, 1] * dy + m[0, 2] * dz
    ly = m[1, 0] * dx + m[1, 1] * dy + m[1, 2] * dz
    lz = m[2, 0] * dx + m[2, 1] * dy + m[2, 2] * dz
    x = (0.5 - math.atan2(ly, lx) / (2.0 * math.pi)) * width - 0.5
    # The angle from both of its sides: acos alone loses the directions near the poles.
    y = math.atan2(math.sqrt(lx * lx + ly * ly), lz) / math.pi * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    left, right = int(x0) % width, (int(x0) + 1) % width
    top, bottom = max(int(y0), 0), min(int(y0) + 1, height - 1)
    above, below = first + top * width, first + bottom * width
    return _blend(pictures.rgb, above + left, above + right, below + left, below + right, x - x0, y - y0)
