"""What a picture may be compared with besides methods and the reference: the same scene in another glass, a picture
file; and what two pictures say of each other, pixel by pixel and as histograms."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import UserError
from ..base.image_io import read_image
from ..edit import edits
from ..model.optics import catalogue

if TYPE_CHECKING:
    import moderngl

    from ..edit.state import Selection
    from ..gpu.context import Context
    from ..model.scene import Scene

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear Rec.709."""
HISTOGRAM_STOPS = (-12.0, 8.0)
HISTOGRAM_BINS = 60


@dataclass(frozen=True)
class Histogram:
    """Of two pictures' luminances."""

    stops: np.ndarray
    """Middles of the bins, stops about display white."""
    own: np.ndarray
    """Share of the pixels in each bin."""
    other: np.ndarray


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
            self._scene = edits.set_dispersion(scene, index, catalogue.find(glass))
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
        texels = np.concatenate([rgb, np.ones((*rgb.shape[:2], 1), np.float32)], axis=-1)
        self.texture = self._context.ctx.texture(size, 4, np.ascontiguousarray(texels).tobytes(), dtype="f4")

    def release(self) -> None:
        """Forget it."""
        if self.texture is not None:
            self.texture.release()
        self.texture, self.problem, self.words, self._key = None, None, "", ()


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


class Histograms:
    """Of the picture and of what it is compared with, counted beside the window."""

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None
        self._asked: Future[Histogram] | None = None
        self._last: Histogram | None = None

    @property
    def is_counting(self) -> bool:
        """The last question has no answer yet."""
        return self._asked is not None and not self._asked.done()

    @property
    def last(self) -> Histogram | None:
        """The answer to the last question that has one."""
        if self._asked is not None and self._asked.done():
            self._last, self._asked = self._asked.result(), None
        return self._last

    def ask(self, own: np.ndarray, other: np.ndarray, exposure_ev: float) -> None:
        """As of `histogram_of`."""
        self._pool = self._pool or ThreadPoolExecutor(1, thread_name_prefix="histogram")
        self._asked = self._pool.submit(histogram_of, own, other, exposure_ev)

    def release(self) -> None:
        """End the thread and forget what it counted."""
        if self._pool is not None:
            self._pool.shutdown()
        self._pool = self._asked = self._last = None


def histogram_of(own: np.ndarray, other: np.ndarray, exposure_ev: float) -> Histogram:
    """Of two linear pictures (h, w, 3) as exposed; black pixels are in no bin."""
    edges = np.linspace(*HISTOGRAM_STOPS, HISTOGRAM_BINS + 1)
    shares = []
    for rgb in (own, other):
        # Not a product of matrices: those of several threads wait for each other, and the reference has long ones.
        luminance = sum(weight * rgb[..., i].ravel() for i, weight in enumerate(LUMINANCE))
        lit = luminance[luminance > 0.0]
        stops = np.log2(np.maximum(lit, 1e-30)) + exposure_ev
        shares.append(np.histogram(np.clip(stops, *HISTOGRAM_STOPS), edges)[0] / max(len(luminance), 1))
    return Histogram(0.5 * (edges[:-1] + edges[1:]), *shares)
