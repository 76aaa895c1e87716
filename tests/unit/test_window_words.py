"""What a window says instead of the command line's options, from the sentences that are really told; and that lengths
are called what the scene's file calls them."""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from pathlib import Path

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.memory import check_picture_memory
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.edit.opening import open_scene
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.io.scene_save import save_scene
from spectrasplat.model.staging import Staging, opaque_note
from spectrasplat.render.notices import loss_notices
from spectrasplat.ui.message_box import MessageBox, in_window
from spectrasplat.ui.panels import numbers

SOLID = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
MORE = "v 3 0 0\nv 4 0 0\nv 3 1 0\nv 3 0 1\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n"


@pytest.mark.parametrize("text", [SOLID, f"o one\n{SOLID}o two\n{MORE}"])
def test_notes_of_a_mesh_name_what_the_window_has(tmp_path: Path, text: str) -> None:
    path = tmp_path / "ball.obj"
    path.write_text(text, encoding="utf-8")
    notes = load_scene(path).notes
    assert any("--glass" in note for note in notes) and any("--up" in note for note in notes)
    box = MessageBox(clock=lambda: 0.0)
    for note in notes:
        box.show(note)
    told = " ".join(message.text for message in box.messages())
    assert "--" not in told and "Dispersion panel" in told and "button on the picture" in told
    assert ("it holds 'one', 'two'" in told) == ("o two" in text)


def test_nothing_of_glass_and_what_was_lost(tmp_path: Path) -> None:
    path = tmp_path / "card.toml"
    path.write_text('[[objects]]\nname = "card"\nshape = "box"\nmaterial = "diffuse"\n', encoding="utf-8")
    note = opaque_note(open_scene(path).objects)
    assert note is not None and "--glass" in note
    told = in_window(note)
    assert "--" not in told and "Make glass, on the picture. The file holds 'card'" in told
    (lost,) = loss_notices({"lost_depth": 0.3}, 64)
    assert "Longest path" in in_window(lost) and "--" not in in_window(lost)


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(UserError) as error:
        check_picture_memory(60_000, 60_000, 400)
    told = in_window(str(error.value))
    assert told.startswith("A picture of 60000x60000 with 400 spectral bins needs about")
    path = tmp_path / "ball.obj"
    path.write_text(SOLID, encoding="utf-8")
    for glass in ((None, "N-SF99"), ("sphere", "N-SF11")):
        with pytest.raises(UserError) as error:
            load_scene(path, Staging(glass=(glass,)))
        assert "--glass" in str(error.value) and "--" not in in_window(str(error.value))


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
