"""Paints the shipped environment: a dark studio with lamps of all sizes, for glass that is lit by nothing else.

A cut stone is only as lively as what it mirrors: small bright lamps give fire, large soft ones show facets,
darkness between them gives contrast. The room is a box seen from its middle, so that straight edges stay straight.
Run from the project's folder: python assets/environments/generate.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from spectrasplat.model.environment import direction_of
from spectrasplat.model.texture import Environment

HERE = Path(__file__).resolve().parent

WIDTH, HEIGHT = 1024, 512
SAMPLES = 4
"""Along each side of a texel."""
ROOM = np.array([3.2, 2.6, 1.5])
"""Half the room's size along x, y, z; its floor and ceiling lie at z = ∓1.5."""

Colour = tuple[float, float, float]
DAYLIGHT: Colour = (0.86, 0.97, 1.15)
NEUTRAL: Colour = (1.0, 1.0, 1.0)
WARM: Colour = (1.35, 0.95, 0.5)
SOFT_BOXES: tuple[tuple[tuple[float, float, float], tuple[float, float], float, Colour], ...] = (
    # middle, size (width, height), radiance, colour; each faces the middle of the room
    ((2.1, 1.5, 0.9), (1.1, 0.8), 9.0, NEUTRAL),
    ((0.3, -2.0, 0.7), (0.35, 1.5), 14.0, NEUTRAL),
    ((-0.4, -2.1, 0.5), (0.08, 1.6), 30.0, NEUTRAL),
    ((-1.4, -1.5, 1.0), (0.5, 0.5), 6.0, DAYLIGHT),
    ((0.2, 0.3, 1.4), (0.9, 0.6), 11.0, NEUTRAL),
    ((1.9, -1.2, -0.5), (0.25, 0.25), 20.0, DAYLIGHT),
    ((-1.6, 1.4, 1.2), (0.12, 0.12), 40.0, NEUTRAL),
    ((0.8, 2.1, 1.15), (0.1, 0.1), 40.0, NEUTRAL),
)
LAMP_MIDDLE, LAMP_RADIUS, LAMP_RADIANCE = np.array([2.3, 0.1, 0.25]), 0.16, 37.0


def painted() -> np.ndarray:
    """The panorama, float32 (HEIGHT, WIDTH, 3): means over SAMPLES² rays a texel."""
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES
    total = np.zeros((HEIGHT, WIDTH, 3))
    local = Environment(np.zeros((1, 2, 3), np.float32))
    for dy in offsets:
        for dx in offsets:
            u = np.broadcast_to((np.arange(WIDTH) + dx) / WIDTH, (HEIGHT, WIDTH))
            v = np.broadcast_to(((np.arange(HEIGHT) + dy) / HEIGHT)[:, None], (HEIGHT, WIDTH))
            total += radiance(direction_of(local, u, v))
    return (total / SAMPLES**2).astype(np.float32)


def radiance(direction: np.ndarray) -> np.ndarray:
    """What is seen from the room's middle along unit `direction` (…, 3)."""
    seen = _walls(direction)
    for middle, size, level, colour in SOFT_BOXES:
        cover = _soft_box(direction, np.array(middle), size)[..., None]
        seen = seen * (1.0 - cover) + cover * level * np.array(colour)
    toward = LAMP_MIDDLE / np.linalg.norm(LAMP_MIDDLE)
    angle = np.arccos(np.clip(direction @ toward, -1.0, 1.0))
    glow = np.exp(-((angle / 0.25) ** 2))[..., None]
    lamp = (angle < np.arctan(LAMP_RADIUS / np.linalg.norm(LAMP_MIDDLE)))[..., None]
    return np.where(lamp, LAMP_RADIANCE * np.array(WARM), seen + 0.25 * glow * np.array(WARM))


def _walls(direction: np.ndarray) -> np.ndarray:
    """The room itself: grey walls, a chequered floor, a window."""
    distance = np.min(ROOM / np.maximum(np.abs(direction), 1e-9), axis=-1)
    point = distance[..., None] * direction
    x, y, z = np.moveaxis(point, -1, 0)
    height = (z + ROOM[2]) / (2.0 * ROOM[2])
    seen = np.multiply.outer(0.06 + 0.08 * height, (1.0, 0.98, 0.95))
    floor = z < -ROOM[2] + 1e-6
    # Soft edges, as of something out of focus: magnified behind a stone sharp ones would show the texels.
    light = 0.5 + 0.5 * np.tanh(3.0 * np.sin(np.pi * x / 0.4) * np.sin(np.pi * y / 0.4))
    # Lighter towards the window, so that the floor is no flat pattern.
    near = np.exp(-((x + ROOM[0]) ** 2 + 0.5 * y**2) / 6.0)
    tiles = (0.05 + 0.07 * light) * (1.0 + 3.0 * near)
    seen = np.where(floor[..., None], np.multiply.outer(tiles, np.ones(3)), seen)
    return np.where(_window(point)[..., None], 16.0 * np.array(DAYLIGHT) * (0.75 + 0.5 * height[..., None]), seen)


def _window(point: np.ndarray) -> np.ndarray:
    """Panes of a window in the wall at −x: three by two, between mullions of sharp edges."""
    x, y, z = np.moveaxis(point, -1, 0)
    across, up = (y + 0.75) / 1.5, (z + 0.35) / 1.3
    inside = (x < -ROOM[0] + 1e-6) & (across > 0.0) & (across < 1.0) & (up > 0.0) & (up < 1.0)
    bar = 0.04
    in_pane = (np.abs((across * 3.0) % 1.0 - 0.5) < 0.5 - 3.0 * bar / 1.5) & (
        np.abs((up * 2.0) % 1.0 - 0.5) < 0.5 - 2.0 * bar / 1.3
    )
    return inside & in_pane


def _soft_box(direction: np.ndarray, middle: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """How much of each ray meets a rectangle that faces the room's middle, 0 to 1, fading over a tenth of its short
    side."""
    distance = np.linalg.norm(middle)
    axis = middle / distance
    right = np.cross(axis, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, axis)
    ahead = direction @ axis
    scale = np.where(ahead > 1e-6, distance / np.maximum(ahead, 1e-6), np.inf)
    edge = 0.1 * min(size)
    with np.errstate(invalid="ignore"):
        inside = [
            0.5 * side - np.abs(np.where(ahead > 1e-6, scale * (direction @ along), np.inf))
            for along, side in zip((right, up), size, strict=True)
        ]
    return np.prod([np.clip(depth / edge, 0.0, 1.0) for depth in inside], axis=0)


def rgbe_of(rgb: np.ndarray) -> np.ndarray:
    """Shared-exponent pixels uint8 (H, W, 4) of float (H, W, 3), rounded to the nearest mantissa."""
    largest = rgb.max(axis=-1)
    # A mantissa that would round to 256 takes the next exponent.
    exponent = np.frexp(largest * (256.0 / 255.5))[1]
    mantissa = np.rint(np.ldexp(rgb, 8 - exponent[..., None]))
    return np.concatenate([mantissa, exponent[..., None] + 128.0], axis=-1).astype(np.uint8)


def write_hdr(path: Path, rgb: np.ndarray) -> None:
    """A Radiance picture of float (H, W, 3), without runs: what reads those takes half a second to import."""
    height, width = rgb.shape[:2]
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    path.write_bytes(header + rgbe_of(rgb).tobytes())


if __name__ == "__main__":
    write_hdr(HERE / "studio.hdr", painted())
