"""Pictures as data of a scene: textures of diffuse surfaces with their words in a scene file, and environments.

Both are linear Rec.709 whose white is D65; where a renderer needs spectra it upsamples with
`colorimetry.rgb_basis`, which is linear, so that filtering and upsampling may be done in either order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..base.errors import UserError
from .io.picture_files import read_picture
from .io.scene_table import SceneTable
from .vectors import frozen


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface; compared by identity."""

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709 reflectance, 0 to 1; row 0 is the top (v = 1)."""
    wrap: Literal["repeat", "clamp"] = "repeat"
    source: str | None = None
    """Path of the file it came from."""


@dataclass(frozen=True, eq=False)
class Environment:
    """Radiance from infinitely far away, compared by identity.

    `rgb` is a latitude-longitude picture: rows run from straight up (row 0) to straight down, and with
    local = world_to_local @ direction a direction is seen at u = ½ − atan2(local_y, local_x) / 2π
    (column u·W), v = acos(local_z) / π (row v·H). So local x is the middle of the picture, local z is up.
    """

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709, lm/(sr unit²), finite and not negative."""
    world_to_local: np.ndarray = field(default_factory=lambda: np.eye(3))
    """float64 (3, 3), a rotation."""
    kind: Literal["map", "gradient", "sky", "constant"] = "map"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """What the scene file said under [environment], so that it can be saved again."""
    source: str | None = None
    """Path of the file it came from, for a map."""
    lights: bool = False
    """Whether it lights what is diffuse, besides being seen: scene files say yes, a bare picture does not."""


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
        inner = table.given_table(key, '{ file = "wood.png" }')
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
    # Colours outside of Rec.709 have negative channels.
    return frozen(np.clip(rgb, np.float32(0.0), np.float32(1.0)))
