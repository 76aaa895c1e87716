"""A layout that follows light while something moves: tiles stay, and their windows keep to where light lands."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from ..gpu.scene_buffers import SceneBuffers
from ..model.scene import Scene
from .borders import lit_borders
from .landings import Landings
from .map_layout import LEVEL_STEPS, MapLayout, Window, extent_of, grown, known_windows, meet
from .plane_frame import PlaneFrame, plane_frame

ROOM = 0.25
"""Share of its size by which a new window is larger, on each side, than what it has to hold."""
LEAST_USED = 0.4
"""A window is kept while what it has to hold takes this share of its longer side, and lies within."""


def followed(
    layout: MapLayout, scene: Scene, buffers: SceneBuffers, landings: Mapping[int, Landings], moved: Collection[int]
) -> MapLayout | None:
    """`layout` for light that lands there now, `layout` itself where it still serves; None where only a new one does:
    where a curved receiver is among the objects that `moved`."""
    if any(buffers.receivers[receiver] in moved for receiver in layout.charts):
        return None
    placements, windows, frames = layout.placements.copy(), dict(layout.windows), dict(layout.frames)
    for receiver, frame in layout.frames.items():
        index, before = buffers.receivers[receiver], [w for w in windows[receiver] if isinstance(w, Window)]
        points = buffers.space.to_gpu(buffers.world_meshes[index].vertices)
        if index in moved:
            frames[receiver] = frame = plane_frame(points)
        landed = landings.get(receiver)
        if landed is not None:
            extent = extent_of(frame.project(points))
            windows[receiver] = [*_followed(before, frame, extent, landed, layout.seen.get(receiver))]
        for level, (tile, new) in enumerate(zip(layout.tiles[receiver], windows[receiver], strict=True)):
            if index in moved or new is not before[level]:
                assert isinstance(new, Window)
                first = int(layout.receivers["placement"][receiver]) + len(LEVEL_STEPS) * level
                texels = np.array([tile.width, tile.height]) / np.array(LEVEL_STEPS)[:, None]
                _place(placements[first : first + len(LEVEL_STEPS)], new, frame, texels, buffers.space.scale)
    if np.array_equal(placements, layout.placements):
        return layout
    borders = lit_borders(scene, buffers, frames, landings)
    return replace(layout, placements=placements, windows=windows, frames=frames, borders=borders)


def _followed(
    own: list[Window], frame: PlaneFrame, extent: Window, landed: Landings, seen: Window | None
) -> list[Window]:
    """Windows that hold what landed: those that there are where they do, and are not far too large."""
    light, everything = known_windows(frame, extent, landed)
    if seen is not None:
        light = meet(light, grown(seen, 0.02)) or light
    wanted = [light, everything][-sum(window.largest is None for window in own) :]
    windows = []
    for window, needed in zip(own, [*wanted, grown(everything, ROOM)], strict=False):
        is_beyond = window.largest is not None
        needed = meet(needed, extent) or extent
        holds = np.all(needed.low >= window.low) and np.all(needed.high <= window.high)
        if holds and (is_beyond or np.max(needed.size / window.size) >= LEAST_USED):
            windows.append(window)
            continue
        if is_beyond:
            needed = Window(np.minimum(needed.low, window.low), np.maximum(needed.high, window.high))
        windows.append(replace(meet(grown(needed, ROOM), extent) or extent, largest=window.largest))
    return windows


def _place(records: np.ndarray, window: Window, frame: PlaneFrame, texels: np.ndarray, scale: float) -> None:
    """Put a window's PLACEMENT records, of every width of texels, over it. `texels` (levels, 2): its size in these."""
    rows = np.column_stack([frame.axes, -(frame.axes @ frame.origin) - window.low]) * (texels / window.size)[..., None]
    rows[..., 3] += records["rect"][:, :2]
    records["row_u"], records["row_v"] = rows[:, 0], rows[:, 1]
    records["texel_area"] = np.prod(window.size / texels, axis=1) / scale**2
