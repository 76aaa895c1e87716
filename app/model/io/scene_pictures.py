"""Files of a scene that is saved: named where the scene may read them, copied next to it where not; pictures
without a file are written."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np

from ...base import files
from ...base.atomic import atomic_output
from ...base.errors import UserError
from ...base.tone_map import srgb_eotf, srgb_oetf


def picture_file(rgb: np.ndarray, source: str | None, scene_path: Path) -> str:
    """Name, relative to the scene file `scene_path`, of a file that holds `rgb` float32 (H, W, 3), row 0 the top.

    That is `source` while it exists (`kept_name`). A picture without one (out of a .glb, say) is written into the
    folder `<stem>_pictures` beside the scene, as PNG where 8 bits hold it exactly, else as EXR. Raises UserError when
    it cannot be.
    """
    path, part = files.with_part(source or "")
    if source is not None and files.is_file(path):
        return f"{kept_name(str(path), scene_path)}:{part}".rstrip(":")
    folder = folder_beside(scene_path, "pictures")
    from ...base.image_io import png_bytes, write_image

    levels = eight_bit_levels(rgb)
    target = folder / f"{picture_name(rgb)}{'.exr' if levels is None else '.png'}"
    if levels is None:
        write_image(target, rgb)
    else:
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


def kept_name(source: str, scene_path: Path) -> str:
    """Name of the file `source`, relative to the scene file `scene_path`, with which that scene can be read again.

    A file that the scene may not read from there (`files.may_read`) is copied into the folder `<stem>_files` beside it.
    Raises UserError when it cannot be.
    """
    if files.may_read(source, scene_path.parent) or not files.is_file(source):
        return relative_name(source, scene_path.parent)
    with files.reading(source, f"check the file, which is copied beside {scene_path}"):
        data = files.read_bytes(source, files.DATA_BYTES)
    name = Path(source)
    digest = hashlib.sha256(data).hexdigest()[:12]
    target = folder_beside(scene_path, "files") / f"{name.stem[:60]}_{digest}{name.suffix}"
    if not target.exists():  # the name says that it holds the same
        with atomic_output(target) as temporary:
            temporary.write_bytes(data)
    return relative_name(str(target), scene_path.parent)


def folder_beside(scene_path: Path, what: str) -> Path:
    """The folder `<stem>_<what>` beside a scene file, made where it is missing. Raises UserError when it cannot be."""
    folder = scene_path.parent / f"{scene_path.stem}_{what}"
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(
            f"cannot write the {what} of {scene_path}: {folder} cannot be made ({error.strerror}); choose another name"
        ) from error
    return folder


def relative_name(target: str, folder: Path) -> str:
    """`target` as a file in `folder` would name it, with forward slashes."""
    try:
        return Path(os.path.relpath(target, folder.resolve())).as_posix()
    except ValueError:  # another drive
        return Path(target).as_posix()
