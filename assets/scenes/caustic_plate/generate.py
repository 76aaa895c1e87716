"""Makes the plate that draws a λ, and the λ.

Run from the project's folder: `python assets/scenes/caustic_plate/generate.py`.

Parallel light that is even over a square is led to the target's density by the gradient of a convex function, which
exists and is the only one (Brenier 1991): det D²φ = 1/g(∇φ), solved as Benamou, Froese and Oberman do (2010, their
second method), by Poisson equations in cosines, which keep the light of each side of the square on it. What the face's
slope must be then follows by Snell's law, and its height by one more Poisson equation.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.fft import dctn
from spectrasplat.base.image_io import write_image
from spectrasplat.model.geometry.primitives import height_field
from spectrasplat.model.io.mesh_io import save_ply
from spectrasplat.model.optics.catalogue import find
from spectrasplat.model.optics.glass import LINE_D_NM

HERE = Path(__file__).resolve().parent
SIDE, DISTANCE, DEPTH = 10.0, 30.0, 0.6
"""Of plate and picture, from the plate's far side to the screen, and the plate's thickness, cm."""
NODES = 121
"""Of a side where equations are solved."""
KEPT = 2
"""One node of so many along a side is a vertex."""
STROKES = (((0.70, 0.80), (0.63, 0.82)), ((0.63, 0.82), (0.32, 0.18)), ((0.49, 0.53), (0.68, 0.18)))
"""Of the letter, from one place to another, in parts of the side, x to the left and y up."""
STROKE_RADIUS, GROUND = 0.045, 0.2
K = np.pi * np.arange(NODES)
COS, SIN = (wave(np.outer(np.linspace(0.0, 1.0, NODES), K)) for wave in (np.cos, np.sin))


def letter(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Density of the target at places of the unit square."""
    found = np.zeros(np.broadcast(x, y).shape)
    for (x0, y0), (x1, y1) in STROKES:
        dx, dy = x1 - x0, y1 - y0
        along = np.clip(((x - x0) * dx + (y - y0) * dy) / (dx**2 + dy**2), 0.0, 1.0)
        away = (x - x0 - along * dx) ** 2 + (y - y0 - along * dy) ** 2
        found = np.maximum(found, np.exp(-away / STROKE_RADIUS**2))
    return GROUND + found


def poisson(rhs: np.ndarray) -> np.ndarray:
    """Cosine coefficients (y, x) of u with Δu = rhs less its mean, and no slope across the sides."""
    ends = np.where((np.arange(NODES) % (NODES - 1)) == 0, 0.5, 1.0)
    coefficients = dctn(rhs, type=1) / (NODES - 1) ** 2 * ends[:, None] * ends
    coefficients[0, 0] = 0.0
    return coefficients / np.minimum(-(K[:, None] ** 2 + K**2), -1.0)


def transport() -> tuple[np.ndarray, np.ndarray]:
    """By how much light is moved along x and y, in sides: float64 (NODES, NODES) each, rows along +y."""
    places = (np.arange(1024) + 0.5) / 1024
    mean = letter(places, places[:, None]).mean()
    x = np.linspace(0.0, 1.0, NODES)
    u = np.zeros((NODES, NODES))
    for _ in range(160):
        dx, dy = -COS @ (u * K) @ SIN.T, -(SIN * K) @ u @ COS.T
        xx, yy, xy = 1.0 - COS @ (u * K**2) @ COS.T, 1.0 - (COS * K**2) @ u @ COS.T, (SIN * K) @ (u * K) @ SIN.T
        wanted = mean / letter(x + dx, x[:, None] + dy)
        u += 0.7 * (poisson(np.sqrt(xx**2 + yy**2 + 2.0 * xy**2 + 2.0 * wanted) - 2.0) - u)
    assert np.abs((xx * yy - xy**2) / wanted - 1.0).max() < 1e-3
    return dx, dy


def heights() -> np.ndarray:
    """Of the shaped side, whose highest place is 0, cm."""
    n = float(find("PMMA").index(LINE_D_NM))
    dx, dy = (SIDE * moved for moved in transport())
    z = np.zeros_like(dx)
    for _ in range(3):  # the screen is farther from what is lower
        way = np.sqrt(dx**2 + dy**2 + (DISTANCE - z) ** 2)
        slopes = (moved / (n * way - (DISTANCE - z)) for moved in (dx, dy))
        across, along = (slope / SIDE for slope in slopes)
        step = 1.0 / (NODES - 1)
        z = COS @ poisson(np.gradient(across, step, axis=1) + np.gradient(along, step, axis=0)) @ COS.T * SIDE**2
        z -= z.max()
    return z


def main() -> None:
    """Write plate and target beside this file."""
    z = heights()[::KEPT, ::KEPT]
    # Without normals, which PLY would keep as long as the places themselves: a reader makes them of its faces.
    save_ply(replace(height_field(z, (SIDE, SIDE), depth=DEPTH), corner_normals=None), HERE / "plate.ply")
    places = (np.arange(256) + 0.5) / 256
    seen = letter(places, places[:, None])[::-1, ::-1]  # from the plate x is to the left, y up
    write_image(HERE / "target.png", np.repeat(seen[..., None], 3, axis=2).astype(np.float32) / (1.0 + GROUND))


if __name__ == "__main__":
    main()
