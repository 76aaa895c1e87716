"""Shaders with one mistake in them, to show which test would notice it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from spectrasplat.base import paths


def mutate(monkeypatch: pytest.MonkeyPatch, folder: Path, file: str, old: str, new: str) -> None:
    """Until the test ends programs are built from a copy of the shaders in `folder` in which `old` is `new` in
    `file`."""
    copy = folder / "shaders"
    shutil.copytree(paths.shaders_dir(), copy)
    source = (copy / file).read_text(encoding="utf-8")
    if old not in source:
        raise LookupError(f"{file} no longer holds '{old}'")
    (copy / file).write_text(source.replace(old, new), encoding="utf-8")
    monkeypatch.setattr(paths, "shaders_dir", lambda: copy)
