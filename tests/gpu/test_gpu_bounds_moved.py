"""What moving objects and lights asks of a GPU: nothing is made anew, and next to nothing is uploaded or read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gl_counts import counted
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.gpu.scene_records import TRIANGLE
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.device_scene import scene_buffers


def placed(scene: Scene, matrix: np.ndarray) -> Scene:
    """All that is no receiver carried along by `matrix`."""
    objects = (
        o if o.material.receives else replace(o, object_to_world=matrix @ o.object_to_world) for o in scene.objects
    )
    return replace(scene, objects=tuple(objects))


def turn(angle: float, step: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:2, :2] = (np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))
    matrix[0, 3] = step
    return matrix


def texels(buffers: SceneBuffers, name: str, count: int) -> np.ndarray:
    """The first texels of a section, uint32 (count, 4)."""
    words = np.frombuffer(buffers.texels.texture.read(), "<u4").reshape(-1, 4)
    return words[buffers.texels.defines[f"{name}_AT"] :][:count]


def triangles(buffers: SceneBuffers) -> np.ndarray:
    words = texels(buffers, "TRIANGLES", TRIANGLE.stride // 16 * buffers.triangle_count)
    return np.ascontiguousarray(words).reshape(-1).view(TRIANGLE.dtype)


@pytest.mark.parametrize("name", ["wine_glass", "ball", "default"])
def test_a_step_of_a_movement_uploads_matrices_only(gl: Context, name: str) -> None:
    scene = load_scene(shipped_scenes()[name])
    buffers = scene_buffers(gl, scene, RenderSettings(width=64, height=36))
    try:
        assert buffers.move(placed(scene, turn(0.1, 0.1)))
        with counted() as counts:
            assert buffers.move(placed(scene, turn(0.2, 0.2)))
        assert not counts.made and not counts.programs and not counts.waits
        assert counts.written_bytes <= 1024
    finally:
        buffers.release()


def test_moved_triangles_their_normals_and_boxes(gl: Context) -> None:
    scene = load_scene(shipped_scenes()["wine_glass"])
    after = placed(scene, turn(0.7, 0.3))
    settings = RenderSettings(width=64, height=36)
    buffers, fresh = scene_buffers(gl, scene, settings), scene_buffers(gl, after, settings)
    try:
        at_first = texels(buffers, "TREE", 4).copy()
        assert buffers.move(after)
        mine, theirs = triangles(buffers), triangles(fresh)
        place = np.argsort(theirs["source"])[np.argsort(np.argsort(mine["source"]))]
        scale = buffers.space.scale / fresh.space.scale
        for field in ("edge1", "edge2"):  # places are in two GPU spaces
            np.testing.assert_allclose(mine[field], scale * theirs[field][place], atol=2e-6)
        normals = [
            texels(b, "NORMALS", 3 * len(mine)).view("<f4")[t["normals"][t["normals"] != 0xFFFFFFFF]]
            for b, t in ((buffers, mine), (fresh, theirs[place]))
        ]
        np.testing.assert_allclose(normals[0], normals[1], atol=2e-6)
        corners = mine["vertex"][:, None] + np.stack([0.0 * mine["edge1"], mine["edge1"], mine["edge2"]], axis=1)
        root = texels(buffers, "TREE", 3).view("<f4").ravel()
        low, high = np.minimum(root[0:3], root[6:9]), np.maximum(root[3:6], root[9:12])
        np.testing.assert_array_equal(low, corners.min(axis=(0, 1)))
        np.testing.assert_array_equal(high, corners.max(axis=(0, 1)))
        assert buffers.move(scene)
        np.testing.assert_allclose(texels(buffers, "TREE", 3).view("<f4"), at_first[:3].view("<f4"), atol=1e-6)
    finally:
        buffers.release()
        fresh.release()


def test_what_is_mirrored_is_packed_anew_and_nothing_is_flattened(gl: Context) -> None:
    scene = load_scene(shipped_scenes()["prism"])
    buffers = scene_buffers(gl, scene, RenderSettings(width=64, height=36))
    try:
        assert not buffers.move(placed(scene, np.diag([-1.0, 1.0, 1.0, 1.0])))
        with pytest.raises(UserError, match="flattens"):
            buffers.move(placed(scene, np.diag([0.0, 1.0, 1.0, 1.0])))
        assert buffers.scene is scene
    finally:
        buffers.release()
