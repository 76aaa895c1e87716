"""What a page's picture is made of, read from a browser, and the same pixels of a session."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import spectrasplat as ss
from interface.browser import Browser
from PIL import Image
from scipy.ndimage import map_coordinates, minimum_filter

BALL = {
    "name": "ball",
    "camera": {"position": [0.0, -6.0, 5.0], "target": [0.0, 0.0, 0.0]},
    "lights": [
        {"kind": "collimated", "position": [0.0, 0.0, 4.0], "target": [0, 0, 0], "radius": 0.8, "illuminance_lx": 2e4}
    ],
    "objects": [
        {"name": "ball", "shape": "sphere", "radius": 1, "triangles": 5120, "glass": "N-SF66", "position": [0, 0, 2]},
        {"name": "table", "shape": "plane", "width": 20.0, "height": 20.0, "material": {"kind": "diffuse"}},
    ],
}
LEVELS = 6
FINER = 4
MAP = """(({ gl, map }, values) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, map.framebuffer);
    gl.readPixels(0, 0, map.width, map.height, gl.RGBA, gl.FLOAT, values);
    return values;
})(spectrasplat.light, new Float32Array(4 * spectrasplat.light.map.width * spectrasplat.light.map.height))"""
"""Light on the texels of all levels, rows from below."""


def gathered(browser: Browser, to_uv: np.ndarray, width: int, height: int, thin: int = 1) -> np.ndarray:
    """Irradiance on the receiver (height, width, 3) that pixels show, top row first; `to_uv`: matrix of views.js. Sides
    are multiples of 32. `thin`: by one photon in so many."""
    browser.run(f"spectrasplat.light.gather({np.ravel(to_uv).tolist()}, {width}, {height}, 1, {thin})")
    stored = browser.floats(MAP).reshape(height, 3 * width // 2, 4)[..., :3].astype(float)
    found = stored[:, :width].copy()
    for level in range(1, LEVELS):
        low, shape = height - (height >> level - 1), (height >> level, width >> level)
        places = (np.mgrid[:height, :width] + 0.5) / 2**level - 0.5
        places = np.clip(places, 0, np.array(shape)[:, None, None] - 1)
        part = stored[low : low + shape[0], width : width + shape[1]]
        found += 0.25**level * np.stack([map_coordinates(part[..., c], places, order=1) for c in range(3)], axis=-1)
    y, x = np.mgrid[:height, :width] + 0.5
    weight = np.tensordot(np.reshape(to_uv, (3, 3))[2], [x, y, np.ones_like(x)], 1)
    area = abs(np.linalg.det(np.reshape(to_uv, (3, 3)))) / np.maximum(weight, 1e-30) ** 3
    return np.where(weight > 0.0, 1.0 / area, 0.0)[..., None] * found[::-1]


def page_pixels(
    browser: Browser, page: ss.Page, folder: Path, shown: Sequence[str]
) -> tuple[list[np.ndarray], np.ndarray]:
    """Linear pictures (H, W, 3) of a page for each of `shown`, what a reader sets (JavaScript), and which pixels (H, W)
    show nothing but the receiver, as bright as the page's 8 bits hold."""
    camera, width, height = page.head["camera"], page.head["camera"]["width"], page.head["camera"]["height"]
    base, weight = (
        np.asarray(Image.open(io.BytesIO(page.arrays[name].tobytes()))).astype(float) / 255.0
        for name in ("base", "weight")
    )
    browser.open(page.to_html(folder / "page.html"))
    found = []
    for changes in shown:
        browser.run(f"spectrasplat.set({changes}), spectrasplat.frame()")
        light = gathered(browser, np.array(camera["pixel_to_uv"]), width, height)
        found.append(camera["base_white"] * base**2.4 + camera["weight_white"] * weight * light)
    assert browser.mistakes == []
    bright = weight.max(axis=2)
    return found, minimum_filter((bright >= 0.99 * bright.max()) & (base.max(axis=2) < 1.0), 3)


def session_pixels(
    scene: ss.Scene, size: tuple[int, int], photons: int, shown: Sequence[Callable[[ss.Session], None]]
) -> list[np.ndarray]:
    """The same of a session, traced anew for each of `shown`: of pixels `FINER` times as small, averaged. A session's
    maps have texels of half a pixel, which blur what is narrower; a page's pixels are exact."""
    width, height = size
    fine = FINER * width, FINER * height
    with ss.Session(scene, size=fine, photons=photons, spp=4, exact=True) as session:
        found = []
        for change in shown:
            change(session)
            picture = session.render().rgb.astype(float)
            found.append(picture.reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3)))
        return found


def difference(found: np.ndarray, right: np.ndarray) -> float:
    """Root mean square, over that of what is right."""
    return float(np.sqrt(np.mean((found - right) ** 2) / np.mean(right**2)))
