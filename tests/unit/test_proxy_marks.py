"""The outline of what was added or moved and is not in the picture yet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from spectrasplat.base.paths import assets_dir
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.ui.viewport_marks import not_shown, outline_of


def test_what_was_added_or_stands_elsewhere_is_not_shown_yet() -> None:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    assert not_shown(scene, scene) == []
    matrix = scene.objects[0].object_to_world.copy()
    matrix[0, 3] += 1.0
    added = replace(scene.objects[0], name="another", object_to_world=matrix)
    assert not_shown(replace(scene, objects=(*scene.objects, added)), scene) == [added]
    assert not_shown(scene, replace(scene, objects=(added, *scene.objects[1:]))) == [scene.objects[0]]
    renamed = replace(scene.objects[0], name="renamed")
    assert not_shown(replace(scene, objects=(renamed, *scene.objects[1:])), scene) == []


def test_an_outline_goes_once_round_all_places() -> None:
    square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0), (2.0, 1.0), (1.0, 2.0)])
    outline = outline_of(square)
    assert {tuple(p) for p in outline} == {(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)}
    x, y = np.roll(outline, -1, axis=0).T, outline.T
    assert abs(float((y[0] * x[1] - x[0] * y[1]).sum())) == 24.0  # twice the area: in order
    assert len(outline_of(np.zeros((0, 2)))) == 0
    assert len(outline_of(np.ones((7, 2)))) < 3
