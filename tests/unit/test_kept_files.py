"""Files that can be made again: whole or not there, and bounded in what they take."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base import paths
from spectrasplat.base.kept_files import KeptFiles

CONTENT = np.random.default_rng(1).bytes(1000)


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> KeptFiles:
    monkeypatch.setattr(paths, "cache_dir", lambda: tmp_path)
    return KeptFiles("some", 1 << 12)


def test_what_was_saved_is_loaded(kept: KeptFiles) -> None:
    kept.save("a", CONTENT)
    kept.save("b", b"")
    assert (kept.load("a"), kept.load("b"), kept.load("c")) == (CONTENT, b"", None)


def test_what_is_damaged_or_too_large_is_not_there(kept: KeptFiles, tmp_path: Path) -> None:
    kept.save("a", CONTENT)
    (file,) = (tmp_path / "some").iterdir()
    whole = file.read_bytes()
    for damaged in (b"", whole[:500], whole[:-9] + bytes(9), bytes(1000), whole + b"more"):
        file.write_bytes(damaged)
        assert kept.load("a") in (None, CONTENT)
        assert kept.load("a") is None or damaged == whole + b"more"
    kept.save("large", bytes(1 << 12))
    assert kept.load("large") is None and len(list((tmp_path / "some").iterdir())) == 1


@pytest.mark.parametrize("limit", [{"most_bytes": 2500}, {"most_files": 2}])
def test_what_was_not_used_for_longest_is_forgotten(kept: KeptFiles, tmp_path: Path, limit: dict[str, int]) -> None:
    small = replace(kept, **limit)
    for at in range(5):
        small.save(str(at), CONTENT)
        (file,) = (tmp_path / "some").glob(f"{at}.*")
        os.utime(file, ns=(at, at))
    assert [small.load(str(at)) is not None for at in range(5)] == [False, False, False, True, True]


def test_without_a_folder_nothing_is_kept(kept: KeptFiles, tmp_path: Path) -> None:
    (tmp_path / "some").write_text("a file")
    kept.save("a", CONTENT)
    assert kept.load("a") is None
