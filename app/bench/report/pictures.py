"""The pictures of the bench report side by side: one exposure for all, the part with most to see, and where a picture
errs and by how much.

Arrays are XYZ float (H, W, 3), row 0 at the top; images are `data:` addresses.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...base.tone_map import auto_exposure, tone_map_8bit
from ...model.optics.colorimetry import xyz_to_rgb709
from ...reference.metrics import EPSILON_SHARE, lit_mean
from ..measured_passes import MEASURED_PASSES
from ..results import SceneResult
from .style import by_rank
from .text import count, number

if TYPE_CHECKING:
    from PIL import Image as PilImage

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

    def outline(self, picture: np.ndarray) -> str:
        """CSS of a frame round that part of a picture."""
        height, width = picture.shape[:2]
        across = {"left": self.column / width, "width": self.width / width}
        sides = across | {"top": self.row / height, "height": self.height / height}
        return ";".join(f"{side}:{100 * share:.2f}%" for side, share in sides.items())


@dataclass(frozen=True)
class Image:
    """A cell of the matrix of pictures."""

    source: str
    label: str
    is_part: bool = False
    numbers: Sequence[str] = ()
    outline: str = ""
    """CSS of the frame round what the parts show."""
    marks: Sequence[str] = ()
    """The numbers under a colour scale."""


@dataclass(frozen=True)
class Matrix:
    """Pictures side by side: a column for the reference and each method, rows that can be compared across."""

    names: Sequence[str]
    rows: Sequence[tuple[str, Mapping[str, Image]]]
    exposure_ev: float


def matrix(scene: SceneResult, directory: Path) -> Matrix | None:
    """None where there is no picture yet."""
    found = load_pictures(scene.pictures, directory)
    if not found:
        return None
    reference = found["reference"]
    window = choose_window(reference)
    exposure = auto_exposure(xyz_to_rgb709(reference).astype(np.float32))
    methods = by_rank([curve.method for curve in scene.curves])
    errors = {name: signed_error(found[name], reference) for name in methods if name in found}
    limit = error_limit(list(errors.values()))

    def part(name: str, numbers: Sequence[str] = ()) -> Image:
        shown = _toned(window.of(found[name]), exposure)
        return Image(shown, f"{scene.scene}, {name}: part of the picture", True, numbers)

    rows: list[tuple[str, Mapping[str, Image]]] = []
    for ending, share in reversed(MEASURED_PASSES[scene.measured_pass].pictures):
        shown = {n: part(n + ending, _numbers(scene, n + ending, found)) for n in methods if n + ending in found}
        if shown or not ending:
            rows.append((f"{share * scene.equal_time:.2g} s, part", shown | {"reference": part("reference")}))
    whole = {
        name: Image(
            _toned(halved(found[name]), exposure),
            f"{scene.scene}, {name}: whole picture",
            outline=window.outline(reference),
        )
        for name in ("reference", *errors)
    }
    scale = Image(error_scale(), "colour scale of the error maps", marks=(f"−{limit:g}", "0", f"+{limit:g}"))
    maps = {
        name: Image(error_map(error, limit), f"{scene.scene}, {name}: signed error") for name, error in errors.items()
    }
    rows += [(f"{scene.equal_time:.2g} s, whole", whole), ("signed error, whole", {"reference": scale} | maps)]
    return Matrix(["reference", *methods], rows, exposure)


def _numbers(scene: SceneResult, name: str, found: Mapping[str, np.ndarray]) -> list[str]:
    """relMSE and HDR-FLIP of a picture, as the run measured them; relMSE from the pictures where it did not."""
    sample = scene.picture_samples.get(name)
    metrics = sample.metrics if sample is not None else {}
    relmse, flip, source = metrics.get("relmse", math.nan), metrics.get("flip", math.nan), ""
    if not math.isfinite(relmse):
        reference = found["reference"]
        epsilon = EPSILON_SHARE * max(lit_mean(reference), 1e-30) ** 2
        relmse, source = float(np.mean((found[name] - reference) ** 2 / (reference**2 + epsilon))), " (raw)"
    lines = [
        f"relMSE {number(relmse)}{source}",
        f"HDR-FLIP {flip:.3f}" if math.isfinite(flip) else "HDR-FLIP not measured",
    ]
    if sample is not None:
        units = MEASURED_PASSES[scene.measured_pass].units
        lines.append(f"{sample.photon_seconds:.2g} s, {count(sample.photons)} {units}")
    return lines


# -- arrays -------------------------------------------------------------------------------


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


def _toned(xyz: np.ndarray, exposure_ev: float) -> str:
    """A tone-mapped picture."""
    from PIL import Image as PilImage

    return _png(PilImage.fromarray(tone_map_8bit(xyz_to_rgb709(xyz).astype(np.float32), exposure_ev)))


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
    from PIL import Image as PilImage

    image = PilImage.fromarray(codes).convert("P")
    colours = colormaps["RdBu_r"](np.linspace(0.0, 1.0, ERROR_STEPS))[:, :3]
    image.putpalette((255 * colours).round().astype(np.uint8).tobytes())
    return _png(image)


def _png(image: PilImage.Image) -> str:
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
