"""Picture files as a scene uses them: linear light in, checked, whatever the format.

`image_io` is about this program's own pictures; here come other people's, as textures and environments.
An 8-bit picture is decoded from sRGB, the others are linear already; all are taken for Rec.709.
"""

from __future__ import annotations

import io
import os
import warnings
from functools import cache

import numpy as np

from ...base import files
from ...base.errors import UserError
from ...base.image_io import MAX_PIXELS
from ...base.tone_map import luminance, srgb_eotf

PICTURE_SUFFIXES = (".hdr", ".pic", ".exr", ".npy", ".png", ".jpg", ".jpeg")
_NOISE = 1e-3
"""Negatives this far below 0, as a share of the brightest value, come from compression and become 0."""


def read_picture(path: str | os.PathLike[str]) -> tuple[np.ndarray, tuple[str, ...]]:
    """The picture in `path` (of an EXR, "a.exr:layer"), float32 (H, W, 3) linear Rec.709, row 0 the top, and notes.

    Finite and not negative, but for colours from other primaries that lie outside of Rec.709. Raises UserError for a
    missing, damaged, empty or far too large file, for another format, and for values that are no radiance, with their
    number.
    """
    path, layer = files.with_part(path)
    suffix = path.suffix.lower()
    if suffix not in PICTURE_SUFFIXES:
        raise UserError(
            f"cannot read {path}: '{suffix}' is not a picture format; use one of {', '.join(PICTURE_SUFFIXES)}"
        )
    if suffix in (".exr", ".npy"):
        from ...base.image_io import read_image

        held = read_image(path, layer)
        rgb, notes, is_converted = held.rgb, held.notes, held.is_converted
    else:
        with files.reading(path, "check the file and its permissions"):
            data = files.read_bytes(path, files.DATA_BYTES)
        if suffix in (".hdr", ".pic"):
            from .radiance_hdr import read_hdr

            rgb, notes, is_converted = read_hdr(data, str(path), MAX_PIXELS)
        else:
            rgb, notes = decode_8bit(data, str(path))
            is_converted = False
    if 0 in rgb.shape:
        raise UserError(f"{path}: the picture is empty ({rgb.shape[1]} × {rgb.shape[0]} pixels); export it again")
    rgb, more = _checked(rgb, str(path), is_converted)
    return rgb, notes + more


def decode_8bit(data: bytes, where: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """The PNG or JPEG in `data` as `read_picture` gives it; `where` opens every sentence.

    Turned as its camera says (Exif); transparency is left aside with a note.
    """
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            # The limit below says it better; and damaged Exif turns nothing.
            warnings.simplefilter("ignore", UserWarning)
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(io.BytesIO(data), formats=("PNG", "JPEG"))
            upright = ImageOps.exif_transpose(image) if image.width * image.height <= MAX_PIXELS else image
        if image.width * image.height > MAX_PIXELS:
            raise UserError(
                f"{where}: {image.width} × {image.height} pixels are more than {MAX_PIXELS >> 20} million; make "
                "it smaller"
            )
        if image.mode.startswith(("I", "F")):
            raise UserError(
                f"{where}: more than 8 bits a channel in a grey PNG are not understood; save it as 8 bit or as .exr"
            )
        notes = _transparency(upright, where)
        encoded = np.asarray(upright.convert("RGB"))
    except UnidentifiedImageError as error:
        raise UserError(
            f"{where}: this is neither a PNG nor a JPEG picture; check the suffix or export it again"
        ) from error
    except (OSError, ValueError, SyntaxError, EOFError, Image.DecompressionBombError) as error:
        raise UserError(f"{where}: the picture is damaged ({error}); copy or export it again") from error
    return _decoded_levels()[encoded], notes


def _transparency(image, where: str) -> tuple[str, ...]:
    if "A" not in image.getbands() and "transparency" not in image.info:
        return ()
    if image.convert("RGBA").getextrema()[3][0] == 255:
        return ()
    return (f"{where}: its transparency is left aside; every pixel shows its colour.",)


@cache
def _decoded_levels() -> np.ndarray:
    """Linear value of each 8-bit sRGB level, float32 (256,)."""
    return srgb_eotf(np.arange(256) / 255.0).astype(np.float32)


def _checked(rgb: np.ndarray, where: str, is_converted: bool) -> tuple[np.ndarray, tuple[str, ...]]:
    """`rgb` without the negative noise of lossy compression. Raises UserError that counts what is no radiance."""
    undefined, infinite = int(np.isnan(rgb).sum()), int(np.isinf(rgb).sum())
    if undefined or infinite:
        raise UserError(
            f"{where}: {undefined} values are not a number and {infinite} infinite; export it with finite values"
        )
    # Of colours outside of Rec.709 one channel is negative and their luminance is not.
    negative = luminance(rgb) < 0.0 if is_converted else rgb < 0.0
    if not negative.any():
        return rgb, ()
    count, lowest, highest = int(negative.sum()), float(rgb[negative].min()), float(rgb.max())
    if lowest <= -_NOISE * highest:
        raise UserError(
            f"{where}: {count} values are negative (down to {lowest:.3g}), which light cannot be; export it "
            "without them"
        )
    darkened = np.where(negative if rgb.shape == negative.shape else negative[..., None], np.float32(0.0), rgb)
    return darkened, (f"{where}: {count} slightly negative values (down to {lowest:.3g}) were set to 0.",)
