"""Textures of a scene file: `texture = "poster.png"` on a diffuse material, each picture read once."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..base.errors import UserError
from .io.picture_files import read_picture
from .io.scene_table import SceneTable
from .texture import Texture

WRAPS = ("repeat", "clamp")
_ABOVE_ONE = 1e-3
"""Reflectances this far above 1 come from rounding and become 1."""


class TextureReader:
    """Reads pictures as reflectances; the same file with the same wrap is the same `Texture`."""

    def __init__(self) -> None:
        self._pictures: dict[str, np.ndarray] = {}
        self._textures: dict[tuple[str, str], Texture] = {}
        self.notes: list[str] = []

    def read(self, table: SceneTable, key: str = "texture") -> Texture:
        """The texture under `key`: a file name, or a table {file, wrap}. Raises UserError for one that cannot be
        used."""
        if isinstance(table.raw(key), str):
            return self._checked(table, key, table.existing_file(key, or_part=True), "repeat")
        inner = table.table(key)
        assert inner is not None
        wrap = inner.choice("wrap", WRAPS, "repeat")
        texture = self._checked(inner, "file", inner.existing_file("file", or_part=True), wrap)
        inner.finish("a texture")
        return texture

    def _checked(self, table: SceneTable, key: str, path: Path, wrap: str) -> Texture:
        try:
            return self.load(path, wrap)
        except UserError as error:
            table.fail(key, f"cannot be used: {error}")

    def load(self, path: Path, wrap: str) -> Texture:
        """The picture in `path` as a texture; notes on it are kept. Raises UserError for one that is no reflectance."""
        source = str(path.resolve())
        if (source, wrap) not in self._textures:
            if source not in self._pictures:
                rgb, notes = read_picture(source)
                self._pictures[source] = as_reflectance(rgb, source)
                self.notes += notes
            self._textures[source, wrap] = Texture(self._pictures[source], wrap, source)  # type: ignore[arg-type]
        return self._textures[source, wrap]


def as_reflectance(rgb: np.ndarray, where: str) -> np.ndarray:
    """`rgb` float32 (H, W, 3), read-only, at most 1. Raises UserError that counts what lies above."""
    count = int((rgb > 1.0 + _ABOVE_ONE).sum())
    if count:
        raise UserError(
            f"{where}: {count} values lie above 1 (up to {rgb.max():.3g}), which no surface reflects; scale the "
            "picture down"
        )
    rgb = np.clip(rgb, np.float32(0.0), np.float32(1.0))  # colours outside of Rec.709 have negative channels
    rgb.setflags(write=False)
    return rgb
