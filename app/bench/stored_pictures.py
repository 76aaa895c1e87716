"""Small pictures that were made with many photons on one device, for comparison with another.

They show whether a driver draws what another drew, not whether that is right (known answers do): a new driver's faults
show here in every part of a picture at once. `python -m spectrasplat.bench.stored_pictures` makes them anew.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..base.paths import assets_dir, shipped_scenes
from ..model.io.scene_file import load_scene
from ..model.settings import RenderSettings

if TYPE_CHECKING:
    from ..gpu.context import Context

SCENES = ("prism", "prism_case", "ball", "lens", "star", "water", "spectrometer")
"""Facets, smooth glass, nested and touching solids, beams and photons, narrow slits."""
SIZE = (96, 54)
BLOCK_PX = 6
"""Pictures are compared by the means of blocks with this side: fewer photons are then enough."""
LARGEST_ERROR = 0.04
"""Of block means, as `block_error` has it. Llvmpipe comes to at most 0.015 with other photons."""
_STORED = {"photons": 4_000_000, "spp": 64, "seed": 7}
_COMPARED = {"photons": 200_000, "spp": 8, "seed": 1}


@dataclass(frozen=True)
class Comparison:
    """One scene, drawn here and compared with the stored picture."""

    scene: str
    error: float
    """See `block_error`."""
    picture: np.ndarray
    """float (H, W, 3), linear Rec.709."""
    reference: np.ndarray
    seconds: float

    @property
    def agrees(self) -> bool:
        """Whether it is the same picture; not where anything is NaN."""
        return self.error <= LARGEST_ERROR


def compare(context: Context, scenes: tuple[str, ...] = SCENES) -> Iterator[Comparison]:
    """Draw each scene on the device and compare."""
    for name in scenes:
        picture, seconds = _drawn(context, name, _COMPARED)
        reference = stored()[name].astype(float)
        yield Comparison(name, block_error(picture, reference), picture, reference, seconds)


def block_error(picture: np.ndarray, reference: np.ndarray) -> float:
    """Sum of absolute differences of block means over the sum of the reference's; both (H, W, 3).

    Squares would be the few pixels' where a caustic is seen through glass."""
    a, b = _blocks(picture), _blocks(reference)
    return float(np.abs(a - b).sum() / np.abs(b).sum())


def _blocks(picture: np.ndarray) -> np.ndarray:
    height, width, channels = picture.shape
    parts = picture.reshape(height // BLOCK_PX, BLOCK_PX, width // BLOCK_PX, BLOCK_PX, channels)
    return parts.astype(float).mean(axis=(1, 3))


@cache
def stored() -> dict[str, np.ndarray]:
    """The pictures by scene, float32 (H, W, 3). Raises `UserError` where they are missing."""
    path = _path()
    try:
        with np.load(path) as held:
            return {name: held[name].astype(np.float32) * held[f"{name} scale"] for name in SCENES}
    except (OSError, KeyError, ValueError) as error:
        raise UserError(f"{path}: the stored pictures cannot be read ({error}); install the program anew") from error


def _path() -> Path:
    return assets_dir() / "references" / "pictures.npz"


def _drawn(context: Context, name: str, work: dict[str, int]) -> tuple[np.ndarray, float]:
    from ..render.still import render

    scene = load_scene(shipped_scenes()[name])
    settings = RenderSettings(
        width=SIZE[0],
        height=SIZE[1],
        max_depth=scene.render.max_depth,
        **work,  # type: ignore[arg-type]
    )
    result = render(scene, settings, context=context)
    return result.rgb, result.stats.seconds


def _write() -> None:
    from ..gpu.context import create_context

    parts: dict[str, np.ndarray | np.float32] = {}
    with create_context() as context:
        for name in SCENES:
            rgb, seconds = _drawn(context, name, _STORED)
            scale = float(np.abs(rgb).max()) / 1024.0  # float16 holds 1024 well, and what is far darker too
            parts |= {name: (rgb / scale).astype(np.float16), f"{name} scale": np.float32(scale)}
            print(f"{name}: {seconds:.1f} s", file=sys.stderr)
    _path().parent.mkdir(exist_ok=True)
    with atomic_output(_path()) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **parts)  # type: ignore[arg-type]  # its names are any but one


if __name__ == "__main__":
    _write()
