"""A user's own file, as pixels: large in the picture, in a lit room, with a caustic where it is glass, never black."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.edit.opening import Opening, open_scene
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Scene
from spectrasplat.model.scene_objects import make_shape
from spectrasplat.model.settings import RenderSettings
from spectrasplat.model.staging import Staging
from spectrasplat.render.still import render

from tests.unit.test_staging import obj_file, opaque_file

SETTINGS = RenderSettings(width=96, height=64, photons=30_000, spp=2, method="srd-photons")
pytestmark = pytest.mark.slow


def luminance(gl: Context, scene: Scene) -> np.ndarray:
    """Of every pixel (64, 96)."""
    return render(scene, SETTINGS, context=gl).rgb @ np.array([0.2126, 0.7152, 0.0722])


def seen_and_bare(gl: Context, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Luminance with what the file holds, and of the room and the table alone."""
    bare = replace(scene, objects=scene.objects[-1:])
    assert bare.objects[0].name == "table"
    return luminance(gl, scene), luminance(gl, bare)


def torus(folder: Path) -> Scene:
    return open_scene(obj_file(folder / "torus.obj", make_shape("torus"), y_up=True, scale=37.0))


def stone(folder: Path) -> Scene:
    made = obj_file(folder / "stone.obj", make_shape("brilliant"), y_up=True, scale=0.01)
    return open_scene(made, Opening(Staging(glass=((None, "diamond"),))))


def opaque(folder: Path) -> Scene:
    return open_scene(opaque_file(folder / "opaque.glb"))


@pytest.mark.parametrize("make", [torus, stone, opaque])
def test_it_is_large_lit_and_throws_a_caustic_where_it_is_glass(
    gl: Context, tmp_path: Path, make: Callable[[Path], Scene]
) -> None:
    scene = make(tmp_path)
    seen, bare = seen_and_bare(gl, scene)
    usual = float(np.median(seen))
    assert seen.min() > 0.01 * usual and bare.min() > 0.2 * usual  # neither holes nor a black room
    changed = np.abs(seen / bare - 1.0) > 0.1
    wide, high = changed.any(axis=0).mean(), changed.any(axis=1).mean()
    assert max(wide, high) > 0.5 and min(wide, high) > 0.25, (wide, high)
    brightest = float(np.percentile(seen / bare, 99.8))
    is_glass = any(item.material.transmits for item in scene.objects)
    assert brightest > 1.5 if is_glass else brightest < 1.4, brightest
