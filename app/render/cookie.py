"""A caustic as a spot light's cookie: the picture that a projector would need to cast it onto its receiver.

A game engine lights a point at distance r, whose normal is turned by θ from the spot, with I cos θ/r² times the cookie.
So the cookie holds E r²/cos θ over its largest value I, for the map's irradiance E; both are reported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import UserError
from ..base.tone_map import into_gamut, luminance
from ..model.scene import Scene
from .lit_receiver import rectangle_uv

WIDEST_DEG = 75.0
"""Half angle beyond which a spot's picture is mostly border."""
_SAMPLES = 3
"""Across and down a pixel."""


@dataclass(frozen=True)
class Cookie:
    """What an engine needs."""

    rgb: np.ndarray
    """float32 (n, n, 3), linear Rec.709, 0 to 1; row 0 is `up`."""
    intensity_cd: float
    """Luminous intensity of a value of 1."""
    position: np.ndarray
    direction: np.ndarray
    up: np.ndarray
    """The picture's upward direction, world; unit, perpendicular to `direction`."""
    half_angle_deg: float
    """From the axis to the middle of the picture's sides; all that is lit is within this cone."""
    seen_from: str
    flux_lm: float

    def numbers(self) -> dict[str, object]:
        """Its numbers for a file."""
        right = np.cross(self.direction, self.up)
        return {
            "kind": "spot cookie",
            "seen_from": self.seen_from,
            "position": self.position.tolist(),
            "direction": self.direction.tolist(),
            "up": self.up.tolist(),
            "right": right.tolist(),
            "half_angle_deg": self.half_angle_deg,
            "full_angle_deg": 2.0 * self.half_angle_deg,
            "intensity_cd": self.intensity_cd,
            "flux_lm": self.flux_lm,
            "projection": "a point p is at x = (p - position)·right/d, y = (p - position)·up/d with d = "
            "(p - position)·direction; the picture's sides are x, y = ±tan(half_angle_deg), row 0 is +y",
            "falloff": "inverse square; no penumbra, no shadows of the glass",
        }


def cookie(
    scene: Scene,
    receiver: str,
    rgb: np.ndarray,
    placement: Mapping[str, Any],
    pixels: int,
    source: Sequence[float] | None,
) -> Cookie:
    """The map `rgb` (h, w, 3) as seen from `source`, or else from the scene's only point-like light where that sees
    all of it, or else from straight above. Raises `UserError` where the receiver is curved or out of sight."""
    if placement["kind"] != "rectangle":
        raise UserError(f"'{receiver}' is curved: a cookie can only be made for a flat receiver")
    corners = np.array(list(placement["corners_world"].values()), float)
    normal = np.asarray(placement["normal_world"], float)
    position, seen_from = _place(scene, corners, normal, source)
    direction = corners.mean(axis=0) - position
    direction /= np.linalg.norm(direction)
    up = _up(placement, direction)
    right = np.cross(direction, up)
    reach = _reach(corners, position, direction)
    if reach is None:
        raise UserError(
            f"from {_words(position)} the caustic on '{receiver}' is seen at more than {WIDEST_DEG:g}° off the axis or "
            "from its edge: give a place above it with --source"
        )
    light = into_gamut(np.asarray(rgb, np.float32))
    steps = ((np.arange(pixels * _SAMPLES) + 0.5) / (pixels * _SAMPLES) * 2.0 - 1.0) * reach
    found = np.zeros((pixels, pixels, 3))
    height = float((corners.mean(axis=0) - position) @ normal)
    for row, y in enumerate(-steps):
        rays = direction + y * up + steps[:, None] * right
        facing = rays @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.where(facing * height > 0.0, height / facing, np.inf)
        hit = np.isfinite(distance) & (distance < 1e6 * abs(height))
        points = position + np.where(hit, distance, 0.0)[:, None] * rays
        squared = ((points - position) ** 2).sum(axis=1)
        cosine = np.abs(facing) / np.linalg.norm(rays, axis=1)
        sampled = _sampled(light, rectangle_uv(placement, points)) * hit[:, None]
        value = sampled * (squared / np.maximum(cosine, 1e-9))[:, None]
        found[row // _SAMPLES] += value.reshape(pixels, _SAMPLES, 3).sum(axis=1) / _SAMPLES**2
    largest = float(found.max()) or 1.0
    texel = float(np.prod(placement["texel_size_units"]))
    flux = float(luminance(light.astype(np.float64)).sum() * texel)
    half = float(np.degrees(np.arctan(reach)))
    return Cookie((found / largest).astype(np.float32), largest, position, direction, up, half, seen_from, flux)


def _place(
    scene: Scene, corners: np.ndarray, normal: np.ndarray, source: Sequence[float] | None
) -> tuple[np.ndarray, str]:
    centre = corners.mean(axis=0)
    if source is not None:
        return np.asarray(source, float), "the place that was given"
    lamps = [light for light in scene.lights if light.has_place and not light.is_parallel]
    if len(lamps) == 1 == len(scene.lights):
        position = np.asarray(lamps[0].position, float)
        towards = centre - position
        if np.linalg.norm(towards) > 0.0 and _reach(corners, position, towards / np.linalg.norm(towards)) is not None:
            return position, f"light '{lamps[0].name}'"
    # On the side where the glass is.
    glasses = [o.mesh.transformed(o.object_to_world).bounds() for o in scene.objects if o.material.transmits]
    middle = np.mean([0.5 * (low + high) for low, high in glasses], axis=0) if glasses else scene.camera.position
    side = 1.0 if (np.asarray(middle, float) - centre) @ normal >= 0.0 else -1.0
    return centre + side * np.linalg.norm(corners - centre, axis=1).max() * 2.0 * normal, "straight above the receiver"


def _reach(corners: np.ndarray, position: np.ndarray, direction: np.ndarray) -> float | None:
    """Tangent of the cone's half angle that holds all corners; None beyond `WIDEST_DEG`, or seen edge-on."""
    seen = corners - position
    ahead = seen @ direction
    plane = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    height = abs(seen[0] @ plane) / max(float(np.linalg.norm(plane)), 1e-300)
    if ahead.min() <= 0.0 or height < 1e-3 * np.linalg.norm(seen, axis=1).max():
        return None
    across = np.linalg.norm(seen - ahead[:, None] * direction, axis=1)
    reach = float((across / ahead).max())
    return reach if reach < np.tan(np.radians(WIDEST_DEG)) else None


def _up(placement: Mapping[str, Any], direction: np.ndarray) -> np.ndarray:
    corner = {name: np.asarray(place, float) for name, place in placement["corners_world"].items()}
    for wish in (corner["top_left"] - corner["bottom_left"], corner["top_right"] - corner["top_left"]):
        up = wish - (wish @ direction) * direction
        if np.linalg.norm(up) > 0.1 * np.linalg.norm(wish):
            break
    return up / np.linalg.norm(up)


def _sampled(picture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear (n, 3) at (n, 2), (0, 0) the upper left corner; black beyond."""
    height, width = picture.shape[:2]
    x, y = np.clip(uv * (width, height) - 0.5, -2.0, (width + 1.0, height + 1.0)).T
    padded = np.pad(picture, ((3, 3), (3, 3), (0, 0)))
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - left)[:, None], (y - top)[:, None]
    left, top = left + 3, top + 3
    upper = padded[top, left] * (1 - fx) + padded[top, left + 1] * fx
    lower = padded[top + 1, left] * (1 - fx) + padded[top + 1, left + 1] * fx
    return upper * (1 - fy) + lower * fy


def _words(place: np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.3g}" for v in place) + ")"
