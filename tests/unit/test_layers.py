"""The rooms of app/ stand in layers: a file imports from its own or from lower ones, and no files import in a circle.

    base < model < features < gpu, edit, beams < passes < render < ui, reference < bench < stress < farm < commands
      < api

Rooms of one layer do not import each other, but for `ui`, whose compare panel shows the reference.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
import spectrasplat

pytestmark = pytest.mark.core

APP = Path(spectrasplat.__path__[0])
LAYERS = (
    ("base",),
    ("model",),
    ("features",),
    ("gpu", "edit", "beams"),
    ("passes",),
    ("render",),
    ("ui", "reference"),
    ("bench",),
    ("stress",),
    ("farm",),
    ("commands",),
    ("api",),
)
BESIDE = {("ui", "reference")}
"""Arrows within a layer."""
FACE = {"__init__", "__main__"}
"""Files that stand before the rooms."""


def modules(root: Path) -> dict[str, Path]:
    """Every module below `root` by its dotted name, `a.b` for root/a/b.py."""
    found = {}
    for file in sorted(root.rglob("*.py")):
        parts = file.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)] = file
    return found


def imports(name: str, file: Path, known: dict[str, Path]) -> Iterator[tuple[str, int]]:
    """(module, line) of every import of this package in a file: types and late imports are arrows too."""
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(_parsed(file)):
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.level:
            base = package[: len(package) - node.level + 1]
        elif (node.module or "").split(".")[0] == "spectrasplat":
            base = []
        else:
            continue
        path = [part for part in (node.module or "").split(".") if part and part != "spectrasplat"]
        for alias in node.names:
            target = ".".join([*base, *path, alias.name])
            yield target if target in known else ".".join([*base, *path]), node.lineno


@cache
def _parsed(file: Path) -> ast.Module:
    """Once for all tests of the checkout."""
    return ast.parse(file.read_text(encoding="utf-8"))


def upward(root: Path) -> list[str]:
    """A sentence for every import that runs upward or sideways."""
    floor = {room: number for number, rooms in enumerate(LAYERS) for room in rooms}
    known, found = modules(root), []
    for name, file in known.items():
        room = name.split(".")[0]
        if room in FACE:
            continue
        assert room in floor, f"{file.relative_to(root)} stands in no room; rooms are {', '.join(floor)}"
        for target, line in imports(name, file, known):
            other = target.split(".")[0]
            if other in ("", *FACE) or other == room or (room, other) in BESIDE:
                continue
            if other not in floor or floor[other] >= floor[room]:
                found.append(f"app/{file.relative_to(root)}:{line} imports {target}: {room} may not know {other}")
    return found


def circle(root: Path) -> list[str]:
    """Modules that import each other in a loop; empty where none do."""
    known = modules(root)
    arrows = {name: {t for t, _ in imports(name, file, known) if t in known} - {name} for name, file in known.items()}
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_arrow_runs_upward() -> None:
    assert not upward(APP), "\n".join(upward(APP))


def test_no_file_imports_in_a_circle() -> None:
    assert not circle(APP), " → ".join(circle(APP))


@pytest.mark.parametrize(
    ("file", "text", "told"),
    [
        ("model/a.py", "from ..gpu import b\n", "app/model/a.py:1 imports gpu.b: model may not know gpu"),
        ("model/a.py", "def f():\n    from ..ui.b import c\n", "app/model/a.py:2 imports ui.b: model may not know ui"),
        ("gpu/a.py", "from spectrasplat.edit.b import c\n", "app/gpu/a.py:1 imports edit.b: gpu may not know edit"),
        ("reference/a.py", "from ..ui import b\n", "app/reference/a.py:1 imports ui.b: reference may not know ui"),
    ],
)
def test_an_arrow_that_runs_upward_is_named(tmp_path: Path, file: str, text: str, told: str) -> None:
    for room in ("gpu", "ui", "edit", "model", "reference"):
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").touch()
        (tmp_path / room / "b.py").touch()
    (tmp_path / file).write_text(text)
    assert upward(tmp_path) == [told]


def test_a_circle_is_named(tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "a.py").write_text("from .b import x\n")
    (tmp_path / "model" / "b.py").write_text("def f():\n    from . import a\n")
    assert set(circle(tmp_path)) == {"model.a", "model.b"}
