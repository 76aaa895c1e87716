"""What the window shows, as numbers and as a file: textures are read at once, the rest is a `FileWriter`'s."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np

from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..base.image_io import SHOWN_SUFFIXES, check_finite, check_suffix, save_codes, write_image
from ..gpu.context import Context
from ..model.scene import Vec3


@dataclass(frozen=True)
class Shown:
    """What is on the screen."""

    codes: moderngl.Texture
    """RGBA8, sRGB, row 0 on top."""
    radiance: moderngl.Texture | None
    """RGBA32F, linear Rec.709, row 0 on top; None while the engine is at work on it."""
    exposure_ev: float
    """Absolute, the one in use."""
    photons: int = 0
    """In the picture."""


def screenshot(path: Path, shown: Shown) -> Callable[[], None]:
    """What writes what is shown: .png, .jpg and .webp as on the screen, .exr and .npy linear without tone curve. It
    needs no OpenGL any more. Raises `UserError` for an unknown suffix, and for linear numbers that are not there."""
    rgb = None if shown.radiance is None else texels_of(shown.radiance)
    if check_suffix(path) not in SHOWN_SUFFIXES:
        if rgb is None:
            raise UserError("the picture is being made; wait a moment")
        return lambda: write_image(path, rgb)
    codes = texture_codes(shown.codes)

    def write() -> None:
        check_finite(path.name, rgb)
        write_codes(path, codes)

    return write


def write_codes(path: Path, codes: np.ndarray) -> None:
    """Write uint8 (H, W, 3) sRGB codes, row 0 on top; for pictures of the whole window too."""
    with atomic_output(path) as temporary:
        save_codes(temporary, codes)


def texture_codes(texture: moderngl.Texture) -> np.ndarray:
    """uint8 (H, W, 3) of an RGBA8 texture whose row 0 is the top."""
    raw = np.frombuffer(texture.read(alignment=1), np.uint8)
    return np.ascontiguousarray(raw.reshape(texture.height, texture.width, 4)[..., :3])


def texels_of(texture: moderngl.Texture) -> np.ndarray:
    """float32 (H, W, 3) of an RGBA32F texture whose row 0 is the top."""
    texels = np.empty((texture.height, texture.width, 4), np.float32)
    texture.read_into(texels)
    return np.ascontiguousarray(texels[..., :3])


def read_pixel(context: Context, texture: moderngl.Texture, place: tuple[float, float]) -> Vec3:
    """Linear Rec.709 of an RGBA32F texture at a place, 0..1 from the top left."""
    framebuffer = context.ctx.framebuffer([texture])
    data = framebuffer.read(viewport=(*pixel_of(place, texture.size), 1, 1), components=3, dtype="f4")
    framebuffer.release()
    red, green, blue = (float(v) for v in np.frombuffer(data, np.float32))
    return red, green, blue


def pixel_of(place: tuple[float, float], size: tuple[int, int]) -> tuple[int, int]:
    """Column and row (from the top) of a place 0..1 in a picture of `size`."""
    return min(max(int(place[0] * size[0]), 0), size[0] - 1), min(max(int(place[1] * size[1]), 0), size[1] - 1)
