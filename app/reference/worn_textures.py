"""The textures of receivers, for all references: texels, texture coordinates of each triangle, and lookups."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..model.scene import Scene
from ..model.texture import Texture
from .compiling import inlined
from .photon_scene import PhotonScene


class WornTextures(NamedTuple):
    """Textures in one array of texels."""

    rgb: np.ndarray
    """float32 (N, 3), linear Rec.709."""
    size: np.ndarray
    """int64 (P, 4): first texel, width, height, 1 where it repeats."""
    texture: np.ndarray
    """int32 (O,): picture of an object, or −1."""
    uv_row: np.ndarray
    """int32 (T,): row of `uv` of a triangle in tree order, or −1."""
    uv: np.ndarray
    """float64 (U, 6): u, v at each corner."""


def worn_textures(scene: Scene, photons: PhotonScene) -> WornTextures:
    """Texels and texture coordinates; `photons`: what `photon_scene` made of the scene. What has a spectral
    reflectance wears none."""
    textures: list[Texture] = []
    texture = np.full(len(scene.objects), -1, np.int32)
    for index, item in enumerate(scene.objects):
        if not item.material.receives or item.material.reflectance is not None or item.material.texture is None:
            continue
        if not any(t is item.material.texture for t in textures):
            textures.append(item.material.texture)
        texture[index] = next(i for i, t in enumerate(textures) if t is item.material.texture)
    arrays = [np.asarray(t.rgb, np.float32) for t in textures]
    first = np.cumsum([0, *(a.shape[0] * a.shape[1] for a in arrays)])
    size = [(f, a.shape[1], a.shape[0], t.wrap == "repeat") for f, a, t in zip(first, arrays, textures, strict=False)]
    return WornTextures(
        np.concatenate([np.zeros((0, 3), np.float32), *(a.reshape(-1, 3) for a in arrays)]),
        np.array(size, np.int64).reshape(-1, 4),
        texture,
        *_coordinates(scene, photons, texture),
    )


def _coordinates(scene: Scene, photons: PhotonScene, texture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
def blend(rgb, a, b, c, d, fx, fy):
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
    return blend(pictures.rgb, a, b, c, d, x - x0, y - y0)


@inlined
def worn_at(pictures, thing, triangle, u, v):
    """What an object's texture makes of its colour at a point of a triangle, linear Rec.709; 1 where it wears none.
    `pictures`: `WornTextures`, or what has its fields."""
    r, g, b = 1.0, 1.0, 1.0
    if pictures.texture[thing] >= 0 and pictures.uv_row[triangle] >= 0:
        uv, w = pictures.uv[pictures.uv_row[triangle]], 1.0 - u - v
        r, g, b = picture_at(
            pictures, pictures.texture[thing], w * uv[0] + u * uv[2] + v * uv[4], w * uv[1] + u * uv[3] + v * uv[5]
        )
    return r, g, b
