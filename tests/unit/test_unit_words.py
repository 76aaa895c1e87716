"""Lengths are called what the scene's file calls them: read, saved and shown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.ui.panels import unit_words


@pytest.fixture(autouse=True)
def _afterwards_nothing_is_said() -> Iterator[None]:
    yield
    unit_words.use("")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("units", "mm"),
        ("Unit: units", "Unit: mm"),
        ("Illuminance (lm/unit²)", "Illuminance (lm/mm²)"),
        ("Radiance, lm/(sr unit²).", "Radiance, lm/(sr mm²)."),
        ("x, y, z in scene units.", "x, y, z in mm."),
        ("lux where a scene unit is a metre", "lux where a scene unit is a metre"),
        ("communities", "communities"),
    ],
)
def test_units_are_called_by_the_scene_label(text: str, said: str) -> None:
    assert unit_words.named(text) == text
    unit_words.use("mm")
    assert unit_words.named(text) == said


def test_the_label_is_read_and_saved(tmp_path: Path) -> None:
    scene = load_scene(shipped_scenes()["frosted"])
    assert scene.units == "dm"
    path = tmp_path / "a.toml"
    save_scene(replace(scene, units="mm"), path)
    assert load_scene(path).units == "mm"
    save_scene(replace(scene, units=""), path)
    assert "units" not in path.read_text(encoding="utf-8")
