"""Baked maps: where they lie, what they hold, and that nothing is left behind when they are not finished."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import read_image
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.parameters import Stage
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.bake import bake, placement_path
from spectrasplat.render.frames import FrameRenderer

from tests.unit.scene_texts import load

SETTINGS = RenderSettings(width=96, height=64, photons=60_000)

BALL = """
[camera]
position = [0.5, -4.0, 3.0]
target = [0.0, 0.0, 0.0]
[[lights]]
kind = "directional"
direction = [0.0, 0.0, -1.0]
illuminance_lx = 1000.0
[[objects]]
name = "lens"
shape = "sphere"
radius = 0.5
glass = "N-BK7"
position = [0.4, -0.2, 1.2]
{receiver}
"""
FLOOR = (
    '[[objects]]\nname = "floor"\nshape = "plane"\nwidth = 6.0\nheight = 6.0\n'
    'material = {{ kind = "diffuse", colour = {} }}\n'
)
BOWL = '[[objects]]\nname = "bowl"\nshape = "sphere"\nradius = 2.0\nposition = [0.0, 0.0, -1.9]\nmaterial = "diffuse"\n'


def scene_of(tmp_path: Path, receiver: str) -> Scene:
    return load(tmp_path, BALL.format(receiver=receiver))


def done(gl, scene: Scene, receiver: str, path: Path) -> tuple[np.ndarray, dict]:
    for _ in bake(gl, Stage(scene, scene.camera), SETTINGS, receiver, path):
        pass
    return read_image(path).rgb, json.loads(placement_path(path).read_text())


def test_the_light_lies_where_the_placement_says(gl, tmp_path: Path) -> None:
    """A ball lens under a vertical beam: its caustic lies under it, and holds the light that falls on its disc."""
    rgb, placement = done(gl, scene_of(tmp_path, FLOOR.format(0.8)), "floor", tmp_path / "map.exr")
    assert rgb.shape == (64, 96, 3) and placement["kind"] == "rectangle"
    corners = {name: np.array(place) for name, place in placement["corners_world"].items()}
    across, down = corners["top_right"] - corners["top_left"], corners["bottom_left"] - corners["top_left"]
    assert abs(across @ down) < 1e-9 and np.abs(across[2]) < 1e-9
    assert [np.linalg.norm(across) / 96, np.linalg.norm(down) / 64] == pytest.approx(placement["texel_size_units"])
    light = rgb @ [0.2126, 0.7152, 0.0722]
    rows, columns = np.indices(light.shape) + 0.5
    middle = np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum() / [96, 64]
    place = corners["top_left"] + middle[0] * across + middle[1] * down
    assert place[:2] == pytest.approx([0.4, -0.2], abs=0.02)
    received = light.sum() * np.prod(placement["texel_size_units"])
    assert received == pytest.approx(1000.0 * np.pi * 0.5**2 * 0.92, rel=0.06)


def test_the_receivers_own_colour_is_left_out(gl, tmp_path: Path) -> None:
    bright, _ = done(gl, scene_of(tmp_path, FLOOR.format(0.8)), "floor", tmp_path / "a.exr")
    dark, _ = done(gl, scene_of(tmp_path, FLOOR.format(0.1)), "floor", tmp_path / "b.exr")
    assert np.array_equal(bright, dark)


def test_a_curved_receiver_comes_with_the_place_of_every_triangle(gl, tmp_path: Path) -> None:
    scene = scene_of(tmp_path, BOWL)
    rgb, placement = done(gl, scene, "bowl", tmp_path / "map.exr")
    uv = np.array(placement["triangle_uv"])
    assert uv.shape == (len(scene.objects[1].mesh.triangles), 3, 2)
    assert uv.min() >= 0.0 and uv.max() <= 1.0
    # Many points of every triangle, each with its share of the triangle's area.
    steps = (np.arange(12) + 0.5) / 12
    u, v = (c.ravel() for c in np.meshgrid(steps, steps))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    weights = np.stack([1 - u - v, u, v])
    corners = scene.objects[1].mesh.transformed(scene.objects[1].object_to_world).corners()
    points, places = (np.einsum("cp,tci->tpi", weights, x) for x in (corners, uv))
    height, width = rgb.shape[:2]
    lit = rgb[
        np.minimum((places[..., 1] * height).astype(int), height - 1),
        np.minimum((places[..., 0] * width).astype(int), width - 1),
        1,
    ]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flux = lit * area[:, None] / len(u)
    stage = Stage(scene, scene.camera)
    renderer = FrameRenderer(gl, replace(SETTINGS, layer="map:bowl"), [stage])
    for _ in renderer.steps(stage):
        pass
    light = renderer.light
    energy = light.maps.receiver(0)[light.layout.charts[0].owner >= 0].astype(float)[:, 1].sum() * light.maps.scale
    renderer.release()
    assert flux.sum() == pytest.approx(energy, rel=0.02)
    middle = np.einsum("tp,tpi->i", flux, points) / flux.sum()
    assert middle[:2] == pytest.approx([0.4, -0.2], abs=0.05)  # the bowl slopes


def test_left_early_or_wrong_nothing_appears(gl, tmp_path: Path) -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    stage = Stage(scene, scene.camera)
    work = bake(gl, stage, SETTINGS, "table", tmp_path / "x.png")
    next(work)
    work.close()
    for receiver, name, told in (
        ("tabel", "x.png", "did you mean 'table'"),
        ("prism", "x.png", "'table'"),
        ("table", "x.gif", "picture format"),
    ):
        with pytest.raises(UserError, match=told):
            list(bake(gl, stage, SETTINGS, receiver, tmp_path / name))
    assert list(tmp_path.iterdir()) == []
