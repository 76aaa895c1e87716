"""What moving objects and lights asks of a GPU: nothing is made anew, and next to nothing is uploaded or read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gl_counts import counted
from spectrasplat.base.errors import UserError
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.records import NONE
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.gpu.scene_records import TRIANGLE
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Light, Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.viewer.live_light import LiveLight


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


def shifted(lamp: Light, step: float) -> Light:
    return replace(lamp, position=(lamp.position[0] + step, *lamp.position[1:])) if lamp.has_place else lamp


def test_windows_stay_until_light_leaves_them(gl: Context) -> None:
    """Where something is moved to and fro the same maps serve, and a step that carries light off is followed."""
    scene = load_scene(shipped_scenes()["prism"])
    light = LiveLight(
        gl, scene, RenderSettings(width=120, height=68, batch=8192, any_view=True, editable=True), 1 << 26
    )
    try:
        light.light_pass.prepare()
        light.light_pass.begin(1 << 13, 1)
        layouts, fluxes = [], []
        for step in (0.0, 0.01, 0.0, 0.01, 0.0, 4.0, 4.01):
            lamps = tuple(shifted(lamp, step) for lamp in scene.lights)
            maps = light.move(replace(placed(scene, turn(0.0, step)), lights=lamps))
            assert maps is not None
            layouts.append(maps.layout)
            fluxes.append(maps.flux() * maps.scale)
        assert layouts[3] is layouts[4]
        assert layouts[6] is not layouts[5] and layouts[6].size == layouts[5].size
        assert fluxes[6] == pytest.approx(fluxes[0], rel=0.2)
    finally:
        light.release()


@pytest.mark.parametrize("name", ["wine_glass", "ball", "default"])
def test_a_step_of_a_movement_uploads_matrices_only(gl: Context, name: str) -> None:
    scene = load_scene(shipped_scenes()[name])
    buffers = scene_buffers(gl, scene, RenderSettings(width=64, height=36))
    try:
        assert buffers.move(placed(scene, turn(0.1, 0.1)))
        with counted() as counts:
            assert buffers.move(placed(scene, turn(0.2, 0.2)))
        assert not counts.made and not counts.programs and not counts.waits
        assert counts.written_bytes <= 4096
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
        theirs = theirs[np.argsort(theirs["source"])[np.argsort(np.argsort(mine["source"]))]]
        found = []
        for b, t in ((buffers, mine), (fresh, theirs)):  # their corners may be turned otherwise
            e1, e2 = (t[edge].astype(float) / b.space.scale for edge in ("edge1", "edge2"))
            middle = b.space.to_world(t["vertex"]) + (e1 + e2) / 3.0
            first = t["normals"][t["normals"] != NONE]
            normals = texels(b, "NORMALS", 3 * len(t))[first[:, None] + np.arange(3)].view("<f4")
            found.append((middle, np.cross(e1, e2), normals[..., :3].sum(axis=1)))
        assert len(found[0][2]) > 100
        for one, other in zip(*found, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-5)
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
