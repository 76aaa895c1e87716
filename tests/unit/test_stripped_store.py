"""Stripped shader texts come back from the disk as they were, and nothing but time depends on that."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from spectrasplat.base import paths
from spectrasplat.gpu import dead_code, stripped_store
from spectrasplat.gpu.glsl_conditionals import Line
from spectrasplat.gpu.shader import load_source

TEXTS = (
    "#define USED 1",
    "float unused() { return 2.0; } // never",
    "#ifdef USED",
    "void main() { int é = 1; }",
    "#endif",
)


def lines(shift: int = 0) -> list[Line]:
    return [Line(text, "ab"[n % 2], n + shift) for n, text in enumerate(TEXTS)]


@pytest.fixture
def stripping(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[int]:
    """A folder of its own; how many lines were stripped, each time that happened."""
    monkeypatch.setattr(paths, "cache_dir", lambda: tmp_path)
    counts: list[int] = []
    real = dead_code.stripped

    def counted(given: Sequence[Line]) -> list[Line]:
        counts.append(len(given))
        return real(given)

    monkeypatch.setattr(dead_code, "stripped", counted)
    return counts


def test_the_second_time_is_read(stripping: list[int]) -> None:
    first, second = stripped_store.stripped(lines()), stripped_store.stripped(lines())
    assert first == second == [line for line in first if "main" in line.text]
    assert len(stripping) == 1


def test_other_places_of_the_same_text_are_another_text(stripping: list[int]) -> None:
    assert stripped_store.stripped(lines()) != stripped_store.stripped(lines(7))
    assert len(stripping) == 2


def test_other_code_strips_anew(stripping: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    stripped_store.stripped(lines())
    monkeypatch.setattr(stripped_store, "_version", lambda: b"newer")
    stripped_store.stripped(lines())
    assert len(stripping) == 2


@pytest.mark.parametrize("damage", [b"", b"nothing", None])
def test_damage_costs_time_only(stripping: list[int], tmp_path: Path, damage: bytes | None) -> None:
    kept = stripped_store.stripped(lines())
    (file,) = (tmp_path / "shaders").iterdir()
    file.write_bytes(file.read_bytes()[:-5] if damage is None else damage)
    assert stripped_store.stripped(lines()) == kept
    assert stripped_store.stripped(lines()) == kept
    assert len(stripping) == 2


def test_without_a_folder_it_works(stripping: list[int], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(paths, "cache_dir", lambda: tmp_path / "file")
    assert stripped_store.stripped(lines()) == stripped_store.stripped(lines())
    assert len(stripping) == 2


def test_what_is_oldest_is_forgotten(stripping: list[int], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(stripped_store, "_MOST_FILES", 3)
    for shift in range(6):
        stripped_store.stripped(lines(shift))
    assert len(list((tmp_path / "shaders").iterdir())) == 3


def test_sources_are_the_same_from_the_disk(stripping: list[int]) -> None:
    defines = {"COLUMNS": 0, "TARGETS": 1}
    assert load_source("camera/average.comp", defines) == load_source("camera/average.comp", defines)
    assert len(stripping) == 1
