"""Damaged files give one sentence or are read: a few hundred mutants, and every input that ever failed."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.mutate import mutant
from tests.fuzz.readers import READERS
from tests.fuzz.trial import CASES, seeds_of, try_file, try_mutant

QUICK, SLOW = 200, 2000
"""Mutants of all readers together."""
KEPT = sorted(path for path in CASES.glob("*/*") if path.parent.name in READERS)


def try_many(name: str, seed: int, count: int, folder: Path) -> None:
    for index in range(count):
        _, failure = try_mutant(name, seed, index, folder)
        assert failure is None, f"python -m tests.fuzz --reader {name} --seed {seed} keeps mutant {index}:\n{failure}"


@pytest.mark.parametrize("name", READERS)
def test_sound_files_are_read(name: str, tmp_path: Path) -> None:
    for data in seeds_of(name):
        assert try_file(READERS[name], data, tmp_path) is None
        READERS[name].read(tmp_path / READERS[name].name)  # and not refused


@pytest.mark.parametrize("name", READERS)
def test_a_few_damaged_files(name: str, tmp_path: Path) -> None:
    try_many(name, 1, QUICK // len(READERS) + 1, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_many_damaged_files(name: str, tmp_path: Path) -> None:
    try_many(name, 2, SLOW // len(READERS) + 1, tmp_path)


@pytest.mark.parametrize("case", KEPT, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_once_failed(case: Path, tmp_path: Path) -> None:
    assert try_file(READERS[case.parent.name], case.read_bytes(), tmp_path) is None


def test_mutants_repeat_and_differ() -> None:
    seeds = seeds_of("obj")
    first = [mutant(seeds, 5, index) for index in range(20)]
    assert first == [mutant(seeds, 5, index) for index in range(20)]
    assert len(set(first)) > 15 and first != [mutant(seeds, 6, index) for index in range(20)]


def test_a_reader_that_fails_is_found(tmp_path: Path) -> None:
    from dataclasses import replace

    broken = replace(READERS["obj"], read=lambda path: int(path.read_bytes()[:1]))
    assert "ValueError" in (try_file(broken, b"x", tmp_path) or "")
    assert try_file(broken, b"1", tmp_path) is None
