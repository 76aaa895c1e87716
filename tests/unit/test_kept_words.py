"""An edited scene saved over its file: units, degrees, names and comments stay as they were written."""

from __future__ import annotations

import difflib
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit import edits
from spectrasplat.edit.document import Document
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Scene

Edit = Callable[[Scene], Scene]


def moved(position: tuple[float, float, float]) -> Edit:
    return lambda scene: edits.set_light(scene, 0, scene.lights[0].changed(position=position))


CASES: dict[str, tuple[Edit, list[str]]] = {
    "gain": (lambda s: edits.set_dispersion_gain(s, 0, 2.0), ["+dispersion_gain = 2.0"]),
    "turn": (
        lambda s: edits.set_rotation(s, 0, (-90.0, 0.0, 30.0)),
        [
            "-rotation_deg = [-90.0, 0.0, 0.0]      # stands upright, its refracting edge towards +y",
            "+rotation_deg = [-90.0, 0.0, 30.0]      # stands upright, its refracting edge towards +y",
        ],
    ),
    "move": (
        lambda s: edits.set_position(s, 0, (0.2, 0.0, 0.601)),
        ["+position = [0.2, 0.0, 0.601]"],
    ),
    "lift": (
        lambda s: edits.set_position(s, 0, (0.0, 0.0, 0.9)),
        ["-rests_at_z = 0.001", "+position = [0.0, 0.0, 0.9]"],
    ),
    "name": (lambda s: edits.rename(s, 0, "flint"), ['-name = "prism"', '+name = "flint"']),
    "power": (
        lambda s: edits.set_light_power(s, 0, 10_000.0, "illuminance_lx"),
        ["-illuminance_lx = 20_000", "+illuminance_lx = 10000.0"],
    ),
    "lamp": (moved((-4.0, -2.0, 1.0)), ["-position = [-4.404, -2.570, 0.909]", "+position = [-4.0, -2.0, 1.0]"]),
    "view": (
        lambda s: replace(s, camera=replace(s.camera, vertical_fov_deg=25.0)),
        ["-vertical_fov_deg = 30.0", "+vertical_fov_deg = 25.0"],
    ),
    "colour": (
        lambda s: edits.set_diffuse_colour(s, 1, (0.8, 0.5, 0.5)),
        [
            '-material = { kind = "diffuse", colour = 0.8 }',
            '+material = { kind = "diffuse", colour = [0.8, 0.5, 0.5] }',
        ],
    ),
}


@pytest.mark.parametrize("name", list(CASES))
def test_only_what_was_edited_differs(name: str, tmp_path: Path) -> None:
    edit, wanted = CASES[name]
    path = tmp_path / "prism.toml"
    text = (assets_dir() / "scenes" / "prism.toml").read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    document = Document.open(path)
    document.history.push(name, edit(document.scene))
    document.save()
    lines = difflib.unified_diff(text.splitlines(), path.read_text(encoding="utf-8").splitlines(), lineterm="", n=0)
    differing = [line for line in lines if not line.startswith(("---", "+++", "@@"))]
    assert sorted(differing) == sorted(wanted)
    _assert_alike(load_scene(path), document.scene)


@pytest.mark.parametrize("scene", ["achromat", "brilliant_studio", "spectrometer", "wine_glass", "ball"])
def test_whatever_is_edited_reads_back(scene: str, tmp_path: Path) -> None:
    path = tmp_path / f"{scene}.toml"
    text = (assets_dir() / "scenes" / f"{scene}.toml").read_text(encoding="utf-8")
    path.write_text(text.replace('"../', f'"{assets_dir().as_posix()}/'), encoding="utf-8")
    document = Document.open(path)
    changed = document.scene
    for index, item in enumerate(changed.objects):
        changed = edits.set_rotation(changed, index, (10.0 + index, 20.0, 30.0))
        changed = edits.set_scale(changed, index, (1.0, 2.0, 0.5 + index))
        changed = edits.rename(changed, index, f"{item.name} moved")
    for index, light in enumerate(changed.lights):
        changed = edits.set_light(changed, index, light.changed(direction=(0.6, 0.0, -0.8)))
    document.history.push("all", changed)
    document.save()
    _assert_alike(load_scene(path), changed)


def _assert_alike(found: Scene, wanted: Scene) -> None:
    assert [item.name for item in found.objects] == [item.name for item in wanted.objects]
    for a, b in zip(found.objects, wanted.objects, strict=True):
        np.testing.assert_allclose(a.object_to_world, b.object_to_world, atol=2e-8 * np.abs(b.object_to_world).max())
        assert a.material.values() == b.material.values()
    for a, b in zip(found.lights, wanted.lights, strict=True):
        assert a.name == b.name and a.spectral_power.power_w() == pytest.approx(b.spectral_power.power_w(), rel=1e-8)
        assert np.allclose(a.position, b.position) and np.allclose(a.direction, b.direction)
    assert found.camera == wanted.camera and found.render == wanted.render


def _changed_lines(before: str, after: str) -> list[str]:
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
    return [line for line in lines if line[0] in "+-" and not line.startswith(("---", "+++"))]


def test_saved_into_another_folder_only_names_of_files_differ(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    there.mkdir()
    scenes = assets_dir() / "scenes"
    shutil.copytree(scenes / "prism_case", here / "prism_case")
    # What is called like a file, and names none.
    text = (scenes / "prism_case.toml").read_text(encoding="utf-8").replace('name = "slit"', 'name = "prism_case"')
    (here / "case.toml").write_text(text, encoding="utf-8")
    document = Document.open(here / "case.toml")
    document.history.push("Rename", edits.rename(document.scene, 2, "ground"))
    document.save(there / "case.toml")
    saved = (there / "case.toml").read_text(encoding="utf-8")
    differing = _changed_lines(text, saved)
    assert {line.split(" = ")[0].lstrip("+-") for line in differing} == {"mesh", "name"}
    assert len(differing) == 2 * 4  # three meshes, which had to be copied, and the name
    _assert_alike(load_scene(there / "case.toml"), document.scene)
    shutil.rmtree(here)
    load_scene(there / "case.toml")


def test_saved_into_the_folder_above_files_are_named_where_they_are(tmp_path: Path) -> None:
    here = tmp_path / "here"
    scenes = assets_dir() / "scenes"
    shutil.copytree(scenes / "prism_case", here / "prism_case")
    text = (scenes / "prism_case.toml").read_text(encoding="utf-8")
    (here / "case.toml").write_text(text, encoding="utf-8")
    Document.open(here / "case.toml").save(tmp_path / "above.toml")
    differing = _changed_lines(text, (tmp_path / "above.toml").read_text(encoding="utf-8"))
    assert [line for line in differing if line.startswith("+")] == [
        f'+mesh = "here/prism_case/{name}.ply"' for name in ("prism", "slit", "floor")
    ]
    load_scene(tmp_path / "above.toml")
