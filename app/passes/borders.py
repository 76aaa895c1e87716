"""Straight borders of flat receivers, near which footprints have images (`shaders/lib/border.glsl`).

A footprint stands for light all round its photon, but photons that would have landed beyond a receiver's border are not
there: beside it the footprints' sum falls to a half, and what they spread beyond it is lost. Where light lands near a
border of a convex flat receiver, photons there stand for those beyond it too (`shaders/light/footprint_images.glsl`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..gpu.scene_buffers import SceneBuffers
from ..model.geometry.outline import convex_outline
from ..model.scene import Scene
from .landings import Landings
from .plane_frame import PlaneFrame

MOST_BORDERS = 256
"""Borders of a receiver at most, since every photon there is tested with all of them: an outline of more near which
light lands has no images."""
_NEAR = 0.1
"""Share of the root of a receiver's area: light that lands no nearer to a border in a pilot has footprints that do not
reach it. They would be 0.033 of it wide, with fewer than 200 photons on all of it."""


def lit_borders(
    scene: Scene, buffers: SceneBuffers, frames: Mapping[int, PlaneFrame], landings: Mapping[int, Landings]
) -> dict[int, np.ndarray]:
    """`borders_near` of all receivers that have any."""
    found = {}
    for receiver, frame in frames.items():
        index = buffers.receivers[receiver]
        landed = landings.get(receiver)
        if landed is None or not len(landed.positions) or not scene.objects[index].mesh.is_flat:
            continue
        mesh = buffers.world_meshes[index]
        points = frame.project(buffers.space.to_gpu(mesh.vertices))
        outline = convex_outline(points, mesh.triangles)
        if outline is None:
            continue
        near = borders_near(frame, outline, frame.project(landed.positions))
        if 0 < len(near) <= MOST_BORDERS:
            found[receiver] = near
    return found


def borders_near(frame: PlaneFrame, outline: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Borders near which light lands: float64 (n, 4), planes across a receiver's own with normals to its inside, GPU
    space. `outline`: corners (k, 2), counter-clockwise; `places`: where light lands (m, 2); both in the plane."""
    along = np.roll(outline, -1, axis=0) - outline
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    offsets = -np.einsum("ij,ij->i", normals, outline)
    x, y = (outline - outline.mean(axis=0)).T
    side = float(np.sqrt(0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))))
    near = np.array([(places @ n + c).min() < _NEAR * side for n, c in zip(normals, offsets, strict=True)])
    in_space = normals[near] @ frame.axes
    return np.concatenate([in_space, (offsets[near] - in_space @ frame.origin)[:, None]], axis=1)
