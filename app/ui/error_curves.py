"""Error against time of pictures that get better: a few snapshots each, on a fixed sample of pixels.

Errors are worked out anew whenever the reference has improved, so early points do not suffer from an early reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..model.optics.colorimetry import rgb709_to_xyz
from ..reference.metrics import ReferencePicture, relmse_raw
from .view_model import ErrorCurve

MAX_PIXELS = 1 << 16
GROWTH = 1.3
"""Of photons, from one point of a curve to the next."""
MAX_POINTS = 48
_SEED = 1


@dataclass(frozen=True)
class _Point:
    seconds: float
    rgb: np.ndarray
    """float32 (n, 3) at the sampled pixels."""


class ErrorCurves:
    """Curves of one scene and view."""

    def __init__(self) -> None:
        self._points: dict[str, list[_Point]] = {}
        self._photons: dict[str, float] = {}
        self._pixels: np.ndarray | None = None
        self._reference_image: ReferencePicture | None = None
        self._chosen = np.zeros(0, bool)
        """Which of the sampled pixels count."""
        self.curves: tuple[ErrorCurve, ...] = ()

    def wants(self, method: str, photons: int) -> bool:
        """Whether the picture has come far enough for another point."""
        last = self._photons.get(method, 0.0)
        if photons < last:  # it began anew
            self._points.pop(method, None)
            last = 0.0
        return photons > 0 and photons >= GROWTH * last and len(self._points.get(method, ())) < MAX_POINTS

    def add(self, method: str, seconds: float, photons: int, rgb: np.ndarray) -> None:
        """A picture float32 (H, W, 3) after so many seconds."""
        pixels = rgb.reshape(-1, 3)
        if self._pixels is None:
            count = min(MAX_PIXELS, len(pixels))
            self._pixels = np.sort(np.random.default_rng(_SEED).choice(len(pixels), count, replace=False))
        self._photons[method] = float(photons)
        self._points.setdefault(method, []).append(_Point(seconds, pixels[self._pixels].copy()))
        self._measure()

    def set_reference(self, rgb: np.ndarray, variance_xyz: np.ndarray, directly: np.ndarray) -> None:
        """The reference picture (H, W, 3), the variance of its XYZ, and the pixels (H, W) that count."""
        if self._pixels is None:
            count = min(MAX_PIXELS, directly.size)
            self._pixels = np.sort(np.random.default_rng(_SEED).choice(directly.size, count, replace=False))
        self._chosen = directly.reshape(-1)[self._pixels]
        at = self._pixels[self._chosen]
        self._reference_image = ReferencePicture(
            rgb709_to_xyz(rgb.reshape(-1, 3)[at][:, None].astype(float)),
            variance_xyz.reshape(-1, 3)[at][:, None].astype(float),
        )
        self._measure()

    def _measure(self) -> None:
        reference_image = self._reference_image
        if reference_image is None or not reference_image.xyz.size:
            return
        curves = []
        for method, points in self._points.items():
            errors = [
                relmse_raw(rgb709_to_xyz(p.rgb[self._chosen][:, None].astype(float)), reference_image)
                - reference_image.own_relmse
                for p in points
            ]
            curves.append(ErrorCurve(method, np.array([p.seconds for p in points]), np.maximum(errors, 0.0)))
        self.curves = tuple(curves)
