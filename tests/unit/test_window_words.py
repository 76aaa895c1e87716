"""What a window says instead of the command line's options, from the sentences that are really told; and that lengths
are called what the scene's file calls them."""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from pathlib import Path

import pytest
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.ui.message_box import in_window
from spectrasplat.ui.panels import numbers

OF_THE_COMMAND_LINE_ALONE = (
    "animation.py",
    "bvh.py",
    "cookie.py",
    "export_caustic.py",
    "lit_receiver.py",
    "map_layout.py",
    "parts.py",
)
"""Exports, layers, parts and reports that the window does not offer."""


def test_every_option_that_layers_below_name_has_other_words() -> None:
    """Whoever writes another such sentence is told here."""
    root = Path(__file__).parents[2] / "app"
    left = []
    for folder in ("base", "model", "edit", "render", "passes"):
        for file in sorted((root / folder).rglob("*.py")):
            if file.name in OF_THE_COMMAND_LINE_ALONE:
                continue
            # What stands before a glass's error is told with a colon behind it.
            texts = [f"{text}: …" if text.startswith("--glass 1x1") else text for text in _texts(file)]
            left += [f"{file.name}: {text}" for text in texts if re.search(r"--\w", in_window(text))]
    assert left == []


def _texts(file: Path) -> list[str]:
    """Texts of a source that are no docstrings, with x for what is put into them."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    documentation = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    parts = {id(part) for n in ast.walk(tree) if isinstance(n, ast.JoinedStr) for part in n.values}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            found.append("".join(p.value if isinstance(p, ast.Constant) else "1x1" for p in node.values))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documentation | parts:
            found.append(node.value)
    return [text for text in found if " --" in text or text.startswith("--")]


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
    assert numbers.named(text) == text
    numbers.use_units("mm")
    assert numbers.named(text) == said
    numbers.use_units("")


def test_the_label_is_read_and_saved(tmp_path: Path) -> None:
    scene = load_scene(shipped_scenes()["frosted"])
    assert scene.units == "dm"
    path = tmp_path / "a.toml"
    save_scene(replace(scene, units="mm"), path)
    assert load_scene(path).units == "mm"
    save_scene(replace(scene, units=""), path)
    assert "units" not in path.read_text(encoding="utf-8")
