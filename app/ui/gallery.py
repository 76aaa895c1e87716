"""The scenes of the start page with their pictures, which come with the program: one is read in each frame."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import moderngl

from ..base import files
from ..base.paths import assets_dir
from ..gpu.context import Context
from .view_model import SceneEntry

SIZE = (640, 360)
"""Largest of a picture on the page, pixels."""
BEST = (
    "default",
    "brilliant",
    "crystal_ball",
    "wine_glass",
    "prism",
    "brilliant_studio",
    "spectrum",
    "lens_text",
    "water",
    "ripples",
)
"""What the start page begins with: by name it would begin with a grey achromat, and first cards are what is clicked."""


class Gallery:
    """Owns the pictures' textures. `scenes`: name → file."""

    def __init__(self, context: Context, scenes: Mapping[str, Path]) -> None:
        self._ctx = context.ctx
        self._textures: list[moderngl.Texture] = []
        self.entries = tuple(_entry(name, path) for name, path in scenes.items())
        self._waiting = list(range(len(self.entries)))

    @property
    def is_busy(self) -> bool:
        """There are pictures to be read."""
        return bool(self._waiting)

    def step(self) -> None:
        """Read the next picture, between frames."""
        if self._waiting:
            self._show(self._waiting.pop(0))

    def _show(self, index: int) -> None:
        """Put a scene's picture into a texture; one that is not there or broken is none."""
        from PIL import Image

        path = picture_of(self.entries[index].path)
        try:
            files.check_regular(path, files.SETTINGS_BYTES)
            with Image.open(path) as image:
                image.thumbnail(SIZE)
                rgba = image.convert("RGBA")
        except (OSError, ValueError):
            return
        texture = self._ctx.texture(rgba.size, 4, rgba.tobytes())
        self._textures.append(texture)
        entry = replace(self.entries[index], thumbnail=texture.glo)
        self.entries = (*self.entries[:index], entry, *self.entries[index + 1 :])

    def release(self) -> None:
        """Free the textures."""
        for texture in self._textures:
            texture.release()
        self._textures.clear()
        self._waiting.clear()


def best_first(scenes: Mapping[str, Path]) -> dict[str, Path]:
    """`scenes`, those of `BEST` first; the rest in the order they come in."""
    known = [name for name in BEST if name in scenes]
    return {name: scenes[name] for name in (*known, *(name for name in scenes if name not in BEST))}


def picture_of(scene: Path) -> Path:
    """The picture that comes with a shipped scene."""
    picture = assets_dir() / "gallery" / f"{scene.stem}.png"
    return picture if picture.is_file() else picture.with_suffix(".jpg")


def _entry(name: str, path: Path) -> SceneEntry:
    """Title from the file's `name`, description from the comment it opens with."""
    try:
        text = files.read_text(path, files.SCENE_BYTES)
        title = str(tomllib.loads(text).get("name", name))
    except (OSError, ValueError, RecursionError):
        return SceneEntry(path, name, "", None)
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    # The comment has names in backticks.
    return SceneEntry(path, title[:1].upper() + title[1:], " ".join(lines).replace("`", ""), None)
