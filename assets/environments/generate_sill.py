"""Paints the panorama of the scene prism_sill: a dim room with one bright strip of window and a soft box overhead.

Run from the project's folder: python assets/environments/generate_sill.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 512, 256
ELEVATION_DEG, HALF_DEG = 15.0, (10.0, 1.1)
"""Of the strip's middle, and half its width and height, in the direction of x."""
FINE = 4


def painted() -> np.ndarray:
    """sRGB codes, uint8 (HEIGHT, WIDTH, 3); the strip is 1, all else below a hundredth of it."""
    u = (np.arange(FINE * WIDTH) + 0.5) / (FINE * WIDTH)
    v = ((np.arange(FINE * HEIGHT) + 0.5) / (FINE * HEIGHT))[:, None]
    azimuth, elevation = 360.0 * (0.5 - u), 90.0 - 180.0 * v
    # Greys of few codes: what is as dark has no others.
    level = np.where(elevation > 72.0, 0.004, np.where(elevation > -5.0, 0.0006, 0.0003))
    room = np.broadcast_to(level[..., None], (FINE * HEIGHT, FINE * WIDTH, 3))
    strip = (np.abs(azimuth) < HALF_DEG[0]) & (np.abs(elevation - ELEVATION_DEG) < HALF_DEG[1])
    linear = np.where(strip[..., None], 1.0, room).reshape(HEIGHT, FINE, WIDTH, FINE, 3).mean(axis=(1, 3))
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.rint(255.0 * encoded).astype(np.uint8)


if __name__ == "__main__":
    Image.fromarray(painted()).save(Path(__file__).resolve().parent / "sill.png", optimize=True)
