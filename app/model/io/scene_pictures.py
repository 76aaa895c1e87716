"""Picture files beside a scene that is saved: named where there is one, written where a picture has none."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np

from ...base.errors import UserError
from ...base.tone_map import srgb_eotf, srgb_oetf


def picture_file(rgb: np.ndarray, source: str | None, scene_path: Path) -> str:
    """Name, relative to the scene file `scene_path`, of a file that holds `rgb` float32 (H, W, 3), row 0 the top.

    That is `source` while it exists. A picture without one (out of a .glb, say) is written into the folder
    `<stem>_pictures` beside the scene, as PNG where 8 bits hold it exactly, else as EXR. Raises UserError when it
    cannot be.
    """
    if source is not None and Path(source).is_file():
        return relative_name(source, scene_path.parent)
    folder = scene_path.parent / f"{scene_path.stem}_pictures"
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(
            f"cannot write the pictures of {scene_path}: {folder} cannot be made ({error.strerror}); choose "
            "another name"
        ) from error
    levels = eight_bit_levels(rgb)
    target = folder / f"{picture_name(rgb)}{'.exr' if levels is None else '.png'}"
    if levels is None:
        from ...base.image_io import write_image

        write_image(target, rgb)
    else:
        from ...base.atomic import atomic_output

        with atomic_output(target) as temporary:
            temporary.write_bytes(png_bytes(levels))
    return relative_name(str(target), scene_path.parent)


def picture_name(rgb: np.ndarray) -> str:
    """A name that is the same only for the same picture."""
    digest = hashlib.sha256(repr(rgb.shape).encode() + np.ascontiguousarray(rgb, np.float32).tobytes())
    return f"picture_{digest.hexdigest()[:12]}"


def nearest_levels(rgb: np.ndarray) -> np.ndarray:
    """The sRGB levels uint8 (H, W, 3) nearest to `rgb`, clipped."""
    return np.rint(255.0 * srgb_oetf(np.clip(rgb, 0.0, 1.0))).astype(np.uint8)


def eight_bit_levels(rgb: np.ndarray) -> np.ndarray | None:
    """The sRGB levels uint8 (H, W, 3) whose decoding is exactly `rgb`, or None."""
    levels = nearest_levels(rgb)
    decoded = srgb_eotf(np.arange(256) / 255.0).astype(np.float32)
    return levels if np.array_equal(decoded[levels], rgb) else None


def png_bytes(levels: np.ndarray) -> bytes:
    """A PNG file of uint8 (H, W, 3)."""
    import io

    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(levels).save(buffer, "PNG")
    return buffer.getvalue()


def relative_name(target: str, folder: Path) -> str:
    """`target` as a file in `folder` would name it, with forward slashes."""
    try:
        return Path(os.path.relpath(target, folder.resolve())).as_posix()
    except ValueError:  # another drive
        return Path(target).as_posix()
