"""Shaders with one mistake in them, to show which test would notice it."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from spectrasplat.base import paths

SHADERS_VARIABLE = "SPECTRASPLAT_TEST_SHADERS"


@dataclass(frozen=True)
class Mutant:
    """`old` of a shader became `new`; `killed_by`: a test, from `tests` on."""

    file: str
    old: str
    new: str
    killed_by: str


def mutate(monkeypatch: pytest.MonkeyPatch, folder: Path, file: str, old: str, new: str) -> None:
    """Until the test ends programs are built from a copy of the shaders in `folder` in which `old` is `new` in
    `file`."""
    copy = mutated(folder, file, old, new)
    monkeypatch.setattr(paths, "shaders_dir", lambda: copy)


def mutated(folder: Path, file: str, old: str, new: str) -> Path:
    """A copy of the shaders in `folder` in which `old` is `new` in `file`."""
    copy = folder / "shaders"
    shutil.copytree(paths.shaders_dir(), copy)
    source = (copy / file).read_text(encoding="utf-8")
    if old not in source:
        raise LookupError(f"{file} no longer holds '{old}'")
    (copy / file).write_text(source.replace(old, new), encoding="utf-8")
    return copy


def pytest_configure() -> None:
    """As a plugin (`-p tests.gpu.mutants`): run the tests with the shaders that the environment names."""
    if folder := os.environ.get(SHADERS_VARIABLE):
        paths.shaders_dir = lambda: Path(folder)
