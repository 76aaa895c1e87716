"""What rays look up at scattered places, as textures: tree, triangles, normals, objects, spectra.

A texel is four words and one fetch. llvmpipe (Mesa 22.3) gathers a texel for eight rays at once
but reads a storage buffer ray by ray and word by word, under a mask test each. It works out a mip
level per ray for every `texelFetch`, so there the texture is bound as an image. Words are kept as unsigned
integers, so that no driver flushes or quiets a bit pattern that is not a float.
"""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from ..base.errors import UserError
from . import bindings
from .device_traits import DeviceTraits

ROW_TEXELS = 4096
"""Texels a row of the scene's texture (shaders/lib/scene.glsl knows it as shift and mask)."""
_LEAF_BIT = 0x80000000
_LEAF_COUNT_SHIFT = 28
_EMPTY_BOX = np.array([np.inf] * 3 + [-np.inf] * 3, np.float32)
SECTIONS = ("TREE", "TRIANGLES", "NORMALS", "PIECES", "OBJECTS", "GRATINGS", "CRYSTALS", "WEDGES")


class SceneTexels:
    """One RGBA32UI texture of sections that follow one another; `defines` holds each one's first texel."""

    def __init__(self, ctx: moderngl.Context, sections: Mapping[str, np.ndarray], as_image: bool | None = None) -> None:
        """`sections`: name (of SECTIONS; those not given are empty) → array of whole texels, 16 bytes each, of any
        dtype.
        `as_image` chooses how shaders read them (None: what suits the renderer).

        Raises `UserError` when the scene does not fit a texture of this device.
        """
        words = {name: _words(sections.get(name)) for name in SECTIONS}
        starts = np.cumsum([0] + [len(part) for part in words.values()]).tolist()
        self.defines = {f"{name}_AT": start for name, start in zip(words, starts[:-1], strict=True)}
        self.as_image = DeviceTraits.of(ctx.info["GL_RENDERER"]).texels_as_images if as_image is None else as_image
        """Whether shaders read images instead of textures."""
        if self.as_image:
            self.defines["SCENE_IMAGE"] = 1
        rows = max(1, -(-starts[-1] // ROW_TEXELS))
        limit = ctx.info["GL_MAX_TEXTURE_SIZE"]
        if rows > limit:
            raise UserError(
                f"the scene's triangles take {rows * ROW_TEXELS * 16 / 2**20:.0f} MiB and this device allows "
                f"{limit * ROW_TEXELS * 16 / 2**20:.0f} MiB; simplify its meshes"
            )
        image = np.zeros((rows * ROW_TEXELS, 4), "<u4")
        for start, part in zip(starts[:-1], words.values(), strict=True):
            image[start : start + len(part)] = part
        self.texture = ctx.texture((ROW_TEXELS, rows), 4, image, dtype="u4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

    def write(self, name: str, first: int, part: np.ndarray) -> None:
        """Replace texels of section `name` from its `first` on by `part`."""
        texels, at = _words(part), self.defines[f"{name}_AT"] + first
        while len(texels):
            row, column = divmod(at, ROW_TEXELS)
            some = texels[: ROW_TEXELS - column]
            self.texture.write(np.ascontiguousarray(some), (column, row, len(some), 1))
            texels, at = texels[len(some) :], at + len(some)

    def bind(self) -> None:
        """Bind the texture to its unit."""
        if self.as_image:
            self.texture.bind_to_image(bindings.IMAGE_SCENE, read=True, write=False)
        else:
            self.texture.use(bindings.UNIT_SCENE)

    def bind_spectra(self, spectra: moderngl.Texture) -> None:
        """Bind tables made by `spectra_texture` as these shaders read them."""
        if self.as_image:
            spectra.bind_to_image(bindings.IMAGE_SPECTRA, read=True, write=False)
        else:
            spectra.use(bindings.UNIT_SPECTRA)

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()


def tree_texels(nodes: np.ndarray) -> np.ndarray:
    """uint32 (4 per inner node, 4) from `bvh.NODE` records: both children's boxes, then their links.

    A tree that is a single leaf becomes an inner node whose second child is empty.
    """
    leaf = nodes["count"] > 0
    inner = np.flatnonzero(~leaf)
    number = np.cumsum(~leaf) - 1
    link = np.where(
        leaf, _LEAF_BIT | (nodes["count"].astype(np.int64) << _LEAF_COUNT_SHIFT) | nodes["left_or_first"], number
    ).astype("<u4")
    box = np.concatenate([nodes["bounds_min"], nodes["bounds_max"]], axis=1).astype("<f4")
    if len(inner) == 0:
        boxes, links = np.concatenate([box[0], _EMPTY_BOX])[None], np.array([[link[0], link[0]]], "<u4")
    else:
        left = nodes["left_or_first"][inner].astype(np.int64)
        boxes, links = (
            np.concatenate([box[left], box[left + 1]], axis=1),
            np.stack([link[left], link[left + 1]], axis=1),
        )
    words = np.zeros((len(boxes), 16), "<u4")
    words[:, :12] = boxes.view("<u4")
    words[:, 12:14] = links
    return words.reshape(-1, 4)


def spectra_texture(ctx: moderngl.Context, rows: np.ndarray) -> moderngl.Texture:
    """RG32F texture of tables (R, samples >= 2)."""
    pairs = spectra_texels(rows)
    texture = ctx.texture(pairs.shape[1::-1], 2, pairs, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def spectra_texels(rows: np.ndarray) -> np.ndarray:
    """float32 (R, samples - 1, 2) of tables (R, samples >= 2): texel (i, r) holds samples i and i + 1 of row r."""
    table = np.asarray(rows, "<f4")
    return np.ascontiguousarray(np.stack([table[:, :-1], table[:, 1:]], axis=-1))


def _words(part: np.ndarray | None) -> np.ndarray:
    if part is None or part.size == 0:
        return np.zeros((0, 4), "<u4")
    return np.ascontiguousarray(part).reshape(-1).view("<u4").reshape(-1, 4)
