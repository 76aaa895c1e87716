"""The pictures of the bench report: one exposure for all, the part worth looking at, and where a picture errs and by
how much.

Arrays in, `data:` addresses out; pictures are XYZ float (H, W, 3), row 0 at the top.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.tone_map import auto_exposure, tone_map_8bit
from ...model.optics.colorimetry import xyz_to_rgb709
from ...reference.metrics import EPSILON_SHARE, lit_mean

ERROR_STEPS = 65
"""Colours of an error map: odd, so that no error has a colour of its own."""
_CROP_SHARE = 0.27
"""Width of the crop over the picture's."""
_ROUND_LIMITS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Window:
    """A part of a picture, in pixels."""

    row: int
    column: int
    height: int
    width: int

    def of(self, picture: np.ndarray) -> np.ndarray:
        """That part of a picture (H, W, …)."""
        return picture[self.row : self.row + self.height, self.column : self.column + self.width]


def load_pictures(files: Mapping[str, str], directory: Path) -> dict[str, np.ndarray]:
    """Those of the .npy `files` that exist, are whole, finite and of the reference's size; float64 (H, W, 3) by name.

    Without a readable "reference" nothing is returned: there is nothing to compare with.
    """
    pictures = {name: picture for name, file in files.items() if (picture := _load(directory / file)) is not None}
    if "reference" not in pictures:
        return {}
    size = pictures["reference"].shape
    return {name: picture for name, picture in pictures.items() if picture.shape == size}


def _load(path: Path) -> np.ndarray | None:
    try:
        picture = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    if picture.ndim != 3 or picture.shape[2] != 3 or 0 in picture.shape or picture.dtype.kind != "f":
        return None
    return picture.astype(np.float64) if np.isfinite(picture).all() else None


def choose_window(reference: np.ndarray) -> Window:
    """The 3:2 part of the reference that holds most light and most structure, in equal shares.

    Light is Y compressed at its mean, so that one bright focus does not decide; structure the gradient of log(1 +
    Y/mean).
    """
    height, width = reference.shape[:2]
    crop_width = min(max(round(_CROP_SHARE * width), 12), width)
    crop_height = min(max(round(crop_width * 2 / 3), 8), height)
    luminance = np.maximum(reference[..., 1], 0.0)
    mean = float(luminance.mean())
    if mean <= 0.0:
        return Window((height - crop_height) // 2, (width - crop_width) // 2, crop_height, crop_width)
    light = luminance / (luminance + mean)
    level = np.log1p(luminance / mean)
    structure = np.zeros_like(level)
    structure[:, 1:] += np.abs(np.diff(level, axis=1))
    structure[1:] += np.abs(np.diff(level, axis=0))
    score = light / light.sum() + structure / max(float(structure.sum()), 1e-30)
    table = np.pad(score, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    sums = (
        table[crop_height:, crop_width:]
        - table[:-crop_height, crop_width:]
        - table[crop_height:, :-crop_width]
        + table[:-crop_height, :-crop_width]
    )
    row, column = np.unravel_index(int(sums.argmax()), sums.shape)
    return Window(int(row), int(column), crop_height, crop_width)


def exposure_of(reference: np.ndarray) -> float:
    """Stops that show the reference well, for every picture of its scene."""
    return auto_exposure(xyz_to_rgb709(reference).astype(np.float32))


def toned(xyz: np.ndarray, exposure_ev: float) -> str:
    """A tone-mapped picture as a data: address."""
    return data_address(tone_map_8bit(xyz_to_rgb709(xyz).astype(np.float32), exposure_ev))


def halved(xyz: np.ndarray) -> np.ndarray:
    """Means of 2×2 pixels; a picture too small for that stays as it is."""
    height, width = (n // 2 * 2 for n in xyz.shape[:2])
    if min(height, width) < 2:
        return xyz
    return xyz[:height, :width].reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))


def signed_error(xyz: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(Y_I − Y_R)/√(Y_R² + ε), (H, W), with relMSE's ε: the mean of its square is the luminance's part of relMSE."""
    mean = max(lit_mean(reference), 1e-30)
    return (xyz[..., 1] - reference[..., 1]) / np.sqrt(reference[..., 1] ** 2 + EPSILON_SHARE * mean**2)


def error_limit(errors: list[np.ndarray]) -> float:
    """One round scale for all maps of a scene: about the 98th percentile of what errs at all."""
    sizes = np.concatenate([np.abs(error).ravel() for error in errors]) if errors else np.zeros(1)
    sizes = sizes[sizes > 1e-4]
    wanted = float(np.percentile(sizes, 98.0)) if sizes.size else 0.0
    return next((limit for limit in _ROUND_LIMITS if limit >= wanted), _ROUND_LIMITS[-1])


def error_map(error: np.ndarray, limit: float) -> str:
    """A map of `signed_error` as a data: address: blue too dark, red too bright, the root of the size as saturation."""
    scaled = np.sign(error) * np.sqrt(np.minimum(np.abs(error) / limit, 1.0))
    half = ERROR_STEPS // 2
    return _indexed(np.rint(half + half * scaled).astype(np.uint8))


def error_scale() -> str:
    """The colour bar of the error maps as a data: address, from −limit to limit."""
    return _indexed(np.arange(ERROR_STEPS, dtype=np.uint8)[None])


def _indexed(codes: np.ndarray) -> str:
    from matplotlib import colormaps
    from PIL import Image

    image = Image.fromarray(codes).convert("P")
    image.putpalette(
        (255 * colormaps["RdBu_r"](np.linspace(0.0, 1.0, ERROR_STEPS))[:, :3]).round().astype(np.uint8).tobytes()
    )
    return _png(image)


def data_address(rgb: np.ndarray) -> str:
    """uint8 (H, W, 3) as a PNG in a data: address."""
    from PIL import Image

    return _png(Image.fromarray(rgb))


def _png(image: object) -> str:
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", optimize=True)  # type: ignore[attr-defined]
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
