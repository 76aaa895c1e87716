"""What a picture may be compared with besides methods and the reference: the same scene in another glass, a picture
file."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np

from ..base.errors import UserError
from ..base.image_io import read_image
from ..edit.glass import set_dispersion
from ..edit.state import Selection
from ..gpu.context import Context
from ..model.optics import catalogue
from ..model.scene import Scene


class GlassSwap:
    """A scene with one object of another glass; the same value as long as nothing changes."""

    def __init__(self) -> None:
        self._key: tuple[object, ...] = ()
        self._scene: Scene | None = None

    def scene(self, scene: Scene, selection: Selection, glass: str) -> Scene:
        """`scene` with the selected solid, or else the first, of the catalogue's `glass`. Raises `UserError`."""
        index = glass_object(scene, selection)
        if index is None:
            raise UserError("nothing in this scene is glass, so there is no other glass to compare with")
        key = (scene, index, glass)
        if self._scene is None or self._key[0] is not scene or self._key[1:] != key[1:]:
            self._scene = set_dispersion(scene, index, catalogue.find(glass))
            self._key = key
        return self._scene


def glass_object(scene: Scene, selection: Selection) -> int | None:
    """Index of the selected solid of glass, else of the first."""
    solids = [i for i, item in enumerate(scene.objects) if item.material.transmits]
    if selection.kind == "object" and selection.index in solids:
        return selection.index
    return solids[0] if solids else None


class FilePicture:
    """A picture file as a texture of the viewport's size."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._key: tuple[object, ...] = ()
        self.texture: moderngl.Texture | None = None
        self.problem: str | None = None
        self.words = ""

    def show(self, path: Path, size: tuple[int, int]) -> None:
        """Read `path`, once; `problem` says what is wrong with it."""
        if (path, size) == self._key:
            return
        self.release()
        self._key = (path, size)
        try:
            rgb = read_image(path).rgb.astype(np.float32)
        except UserError as error:
            self.problem = str(error)
            return
        height, width = rgb.shape[:2]
        self.words = f"{path.name}, {width}×{height}"
        if (width, height) != size:
            rgb = of_height(rgb, size)
            self.words += f", scaled to the height of this view, {size[0]}×{size[1]}; one of that size compares best"
        self.texture = self._context.ctx.texture(size, 4, with_alpha(rgb), dtype="f4")

    def release(self) -> None:
        """Forget it."""
        if self.texture is not None:
            self.texture.release()
        self.texture, self.problem, self.words, self._key = None, None, "", ()


def with_alpha(rgb: np.ndarray) -> np.ndarray:
    """float32 (h, w, 4), as textures hold it."""
    return np.concatenate([rgb, np.ones((*rgb.shape[:2], 1), np.float32)], axis=-1, dtype=np.float32)


def of_height(rgb: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A linear picture (h, w, 3) in one of another (width, height): as high, and in its middle, cut or with black at
    both sides. So a camera, whose angle of view is that of the height, sees the same things in the same places."""
    width, height = size
    scaled = resized(rgb, (max(round(rgb.shape[1] * height / rgb.shape[0]), 1), height))
    spare = width - scaled.shape[1]
    if spare < 0:
        return scaled[:, -spare // 2 : -spare // 2 + width]
    return np.pad(scaled, ((0, 0), (spare // 2, spare - spare // 2), (0, 0)))


def resized(rgb: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A linear picture (h, w, 3) at another (width, height), by means of what falls on a pixel. Nearest pixels would
    show a chequer of errors that is in neither picture."""
    from PIL import Image

    resample = Image.Resampling.BILINEAR
    channels = [Image.fromarray(np.ascontiguousarray(rgb[..., i], np.float32)) for i in range(3)]
    return np.stack([np.asarray(channel.resize(size, resample)) for channel in channels], axis=-1)
