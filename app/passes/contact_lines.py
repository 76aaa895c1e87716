"""Which parts of a map's texels the camera sees, where something touches the receiver.

Beneath the foot of a glass a table is bright, beside it dark, and a map's texel that lies across the line of contact
holds the mean of both. In a still every texel of a flat receiver's fine window is part of a pixel, so the rasteriser
can tell what is seen in sixteen parts of each: light that lands on seen parts is then kept from what lands on hidden
ones (`shaders/lib/contact.glsl`). Away from such lines nothing is asked and nothing changes.
"""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np

from ..gpu import shader
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.tiles import Tile
from ..model.scene import Camera
from ..model.scene_camera import camera_frame
from .map_layout import MapLayout
from .picture_window import PictureWindow

PARTS = 4
"""Parts of a texel along its side."""
CLOSE = 6.0
"""Texels that a surface may be off a receiver and still hide a place whose light has nothing to do with what falls
next to it."""
ALL_SEEN = 0xFFFF
"""Word of a texel that holds no contact."""
_SAMPLES_AT_ONCE = 1 << 22
_SIDE = 8
"""Side of a work group of `light/contact.comp`."""
_NEAREST = 1e-4
"""Share of the farthest corner's depth at which what is drawn begins, however near the camera."""
_TIE = 4e-6
"""Share of the range of depths by which the last object is taken to be farther off."""
_CORNER = np.dtype([("position", "f4", 3), ("object", "u4")])


def contact_words(
    ctx: moderngl.Context, scene: SceneBuffers, layout: MapLayout, camera: Camera
) -> moderngl.Texture | None:
    """R32UI of the atlas's size: a word a texel (`lib/contact.glsl`), for the view by `camera` that the windows of
    `layout` are laid out on; None where no texel holds a line of contact."""
    windows = [(r, w[0]) for r, w in layout.windows.items() if w and isinstance(w[0], PictureWindow)]
    if not windows:
        return None
    words = ctx.texture(layout.size, 1, np.full(layout.size[::-1], ALL_SEEN, "u4"), dtype="u4")
    drawn = _Drawn(ctx, scene, camera)
    try:
        for receiver, window in windows:
            normal = np.cross(*layout.frames[receiver].axes)
            close = CLOSE * float(np.sqrt(window.texel_area(layout.frames[receiver], 1)))
            plane = np.append(normal, -normal @ layout.frames[receiver].origin) / close
            drawn.run(window, plane, scene.receivers[receiver], layout.tiles[receiver][0], words)
    finally:
        drawn.release()
    ctx.memory_barrier()
    if (read_words(words) > ALL_SEEN).any():
        return words
    words.release()
    return None


def read_words(words: moderngl.Texture) -> np.ndarray:
    """uint32 (height, width)."""
    return np.frombuffer(words.read(), np.uint32).reshape(words.height, words.width)


def seen_shares(words: np.ndarray) -> np.ndarray:
    """Which part of a texel the energy in its map is of: the seen part of one that a line of contact crosses, else
    all."""
    seen = np.bitwise_count(words & ALL_SEEN) / float(PARTS * PARTS)
    return np.where((words > ALL_SEEN) & (seen > 0.0), seen, 1.0)


class _Drawn:
    """Owns the scene's corners and the programs."""

    def __init__(self, ctx: moderngl.Context, scene: SceneBuffers, camera: Camera) -> None:
        self._ctx = ctx
        self._program = shader.program(ctx, "light/contact.vert", "light/contact.frag")
        self._pack = shader.compute(ctx, "light/contact.comp")
        places = [scene.space.to_gpu(mesh.corners()).reshape(-1, 3) for mesh in scene.world_meshes]
        corners = np.zeros(sum(map(len, places)), _CORNER)
        corners["position"] = np.concatenate(places)
        corners["object"] = np.repeat(np.arange(len(places)), [len(p) for p in places])
        self._corners = ctx.buffer(corners.tobytes())
        self._array = ctx.vertex_array(self._program, [(self._corners, "3f 1u", "position", "object")])
        # Above rounding: of two surfaces in one place the first is met.
        self._tie = _TIE / max(len(places) - 1, 1)
        self._is_pinhole = camera.kind != "orthographic"
        forward = camera_frame(camera)[2]
        position = scene.space.to_gpu(np.asarray(camera.position, float))
        self._depth = np.append(forward, -forward @ position)
        depths = np.concatenate(places) @ forward + self._depth[3]
        margin = 1e-3 * float(np.ptp(depths)) + 1e-6
        self._far = max(float(depths.max()) + margin, 1e-6)
        self._near = max(float(depths.min()) - margin, _NEAREST * self._far if self._is_pinhole else 0.0)

    def run(self, window: PictureWindow, plane: np.ndarray, receiver: int, tile: Tile, words: moderngl.Texture) -> None:
        """Write the words of one window, a stripe of rows at a time."""
        ctx, width = self._ctx, tile.width * PARTS
        rows = max(1, _SAMPLES_AT_ONCE // (width * PARTS))
        self._program["plane"] = tuple(plane)
        self._program["receiver"] = receiver
        from_near = self._depth - np.array([0.0, 0.0, 0.0, self._near])
        self._program["tie"] = self._tie
        self._program["depth_row"] = tuple(from_near / (self._far - self._near))
        for first, count in _stripes(tile.height, rows):
            seen = ctx.texture((width, count * PARTS), 1, dtype="u1")
            depth = ctx.depth_texture((width, count * PARTS))
            frame = ctx.framebuffer([seen], depth)
            frame.use()
            frame.clear(depth=1.0)
            self._program["to_clip"] = tuple(self._to_clip(window, first, count).T.ravel())
            ctx.enable_only(moderngl.DEPTH_TEST)
            ctx.depth_func = "<"
            self._array.render(moderngl.TRIANGLES)
            ctx.enable_only(moderngl.NOTHING)
            ctx.memory_barrier()
            seen.use(0)
            words.bind_to_image(0, read=False, write=True)
            self._pack["first"].value = tile.x, tile.y + first
            self._pack["count"].value = tile.width, count
            self._pack.run(-(-tile.width // _SIDE), -(-count // _SIDE))
            ctx.finish()
            ctx.detect_framebuffer(0).use()
            shader.release(frame, depth, seen)

    def _to_clip(self, window: PictureWindow, first: int, count: int) -> np.ndarray:
        """GPU space to clip space (4, 4) of texel rows `first` to `first + count` of a window."""
        u, v, w = window.texel_rows(1)
        width = window.texels[0]
        near, far = self._near, self._far
        if self._is_pinhole:
            # The weight is depth times a constant.
            factor = float(np.linalg.norm(w[:3]))
            z = (factor * ((near + far) * self._depth - np.array([0.0, 0.0, 0.0, 2.0 * near * far]))) / (far - near)
        else:
            z = w[3] * (2.0 * self._depth - np.array([0.0, 0.0, 0.0, near + far])) / (far - near)
        return np.stack([2.0 * u / width - w, 2.0 * (v - first * w) / count - w, z, w])

    def release(self) -> None:
        shader.release(self._array, self._corners, self._program, self._pack)


def _stripes(height: int, rows: int) -> Iterator[tuple[int, int]]:
    """(first row, rows) of parts of at most `rows`."""
    for first in range(0, height, rows):
        yield first, min(rows, height - first)
