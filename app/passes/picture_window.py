"""A map whose texels are a picture's pixels, or an equal part of them: what the camera sees directly is then filtered
once, by the pixel, and neither a focus nor a spectral line is blurred by texels that straddle pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu.gpu_space import GpuSpace
from ..model.scene import Camera
from ..model.scene_camera import camera_frame
from .plane_frame import PlaneFrame

_MARGIN, _MARGIN_PIXELS = 0.04, 4.0
"""Round where light lands: a share of that, and pixels."""
_LEAST_COSINE = 0.02
"""Between the plane's normal and the view in the window's middle: texels of a plane seen edge-on are of no use to what
is seen in mirrors or through glass."""
PLENTY, FINER = 2, 1536
"""Texels along a pixel that windows as large as there is room for may have; more of them, in windows up to this side,
texels."""
_LEAST_SHARE = 0.02
"""Share of the light that must land where the camera sees the plane, or that could as well be behind it."""


@dataclass(frozen=True)
class PictureWindow:
    """A rectangle of whole pixels of a picture, as a window of a flat receiver."""

    low: np.ndarray
    """int (2,): pixels from the left, and from the top or the bottom, whichever does not mirror the plane's frame."""
    high: np.ndarray
    per_pixel: int
    """Texels along a pixel's side."""
    rows: np.ndarray
    """float64 (3, 4): GPU space to homogeneous pixels; the weight is 1 about the middle of what lands there."""
    is_all: bool
    """Nothing lands elsewhere."""

    @property
    def pixels(self) -> np.ndarray:
        """Its sides, pixels."""
        return self.high - self.low

    @property
    def texels(self) -> tuple[int, int]:
        """Its sides, texels."""
        width, height = (int(side) for side in self.per_pixel * self.pixels)
        return width, height

    def texel_rows(self, step: int) -> np.ndarray:
        """float64 (3, 4): GPU space to homogeneous texels of the window, `step` times as wide as the finest."""
        scale = self.per_pixel / step
        to_texels = np.array([[scale, 0.0, -scale * self.low[0]], [0.0, scale, -scale * self.low[1]], [0.0, 0.0, 1.0]])
        return to_texels @ self.rows

    def texel_area(self, frame: PlaneFrame, step: int) -> float:
        """GPU units² of a texel where the weight is 1."""
        return 1.0 / float(np.linalg.det(frame.on_plane(self.texel_rows(step))))

    def holds_grid(self, frame: PlaneFrame, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """bool (m, n): which places of the plane are in it, `u` (n,) and `v` (m,) along its axes.

        Homogeneous pixels are a sum of a term in u and a term in v; a border p ≥ low is p_h − low w ≥ 0, so
        nothing is divided."""
        rows = frame.on_plane(self.rows)
        along, across = rows[:, 0, None] * u, rows[:, 1, None] * v + rows[:, 2, None]
        held = np.add.outer(across[2], along[2]) > 0.0
        for i in (0, 1):
            for border, sign in ((self.low[i], 1.0), (self.high[i], -1.0)):
                inside = np.add.outer(sign * (across[i] - border * across[2]), sign * (along[i] - border * along[2]))
                held &= inside >= 0.0 if sign > 0.0 else inside > 0.0
        return held


def picture_window(
    camera: Camera,
    space: GpuSpace,
    frame: PlaneFrame,
    positions: np.ndarray,
    weights: np.ndarray,
    picture: tuple[int, int],
    per_pixel: int,
    largest: int,
) -> PictureWindow | None:
    """The window of the pixels in which light lands, `positions` (n, 3) in GPU space with `weights` (n,) > 0, with at
    most `per_pixel` texels along a pixel and `largest` along a side; None where hardly any lands in sight, the plane is
    seen edge-on, or pixels are more than that."""
    rows = _pixel_rows(camera, space, picture)
    found = positions @ rows[:, :3].T + rows[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = found[:, :2] / found[:, 2:]
    size = np.array(picture, float)
    seen = (found[:, 2] > 0.0) & np.all((pixels >= 0.0) & (pixels <= size), axis=1)
    if not seen.any() or weights[seen].sum() < _LEAST_SHARE * weights.sum():
        return None
    rows = rows / np.median(found[seen, 2])
    if np.linalg.det(frame.on_plane(rows)) < 0.0:
        rows = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, size[1]], [0.0, 0.0, 1.0]]) @ rows
        pixels[:, 1] = size[1] - pixels[:, 1]
    # Between what lands in sight and beside it other wavelengths may land.
    ahead = pixels[found[:, 2] > 0.0]
    low, high = np.clip([ahead.min(axis=0), ahead.max(axis=0)], 0.0, size)
    margin = _MARGIN * (high - low) + _MARGIN_PIXELS
    low = np.floor(np.maximum(low - margin, 0.0)).astype(int)
    high = np.ceil(np.minimum(high + margin, size)).astype(int)
    for count in range(per_pixel, 0, -1):
        if count * (high - low).max() <= (largest if count <= PLENTY else min(largest, FINER)):
            middle = np.average(positions[seen], axis=0)
            is_aslant = _cosine(camera, space.to_world(middle), np.cross(*frame.axes)) < _LEAST_COSINE
            return None if is_aslant else PictureWindow(low, high, count, rows, bool(seen.all()))
    return None


def _pixel_rows(camera: Camera, space: GpuSpace, picture: tuple[int, int]) -> np.ndarray:
    """float64 (3, 4): GPU space to homogeneous pixels from the left and the top (`camera.comp`, `picture_point`)."""
    right, up, forward = camera_frame(camera)
    position = space.to_gpu(np.asarray(camera.position, float))
    width, height = picture

    def row(axis: np.ndarray, at: float = 0.0) -> np.ndarray:
        return np.append(axis, at - axis @ position)

    if camera.kind == "orthographic":
        half, depth = 0.5 * camera.vertical_extent * space.scale, np.array([0.0, 0.0, 0.0, 1.0])
    else:
        half, depth = float(np.tan(np.radians(0.5 * camera.vertical_fov_deg))), row(forward)
    scale = 0.5 * height / half
    return np.stack([scale * row(right) + 0.5 * width * depth, 0.5 * height * depth - scale * row(up), depth])


def _cosine(camera: Camera, at: np.ndarray, normal: np.ndarray) -> float:
    towards = np.asarray(camera.position, float) - at if camera.kind != "orthographic" else camera_frame(camera)[2]
    return float(abs(towards @ normal) / max(float(np.linalg.norm(towards)), 1e-30))
