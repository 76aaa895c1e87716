"""Compiled functions are kept on disk, go with the code they were made of, and do without a folder for them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from spectrasplat.base.compiling import version_of

PROGRAM = """
import sys
from spectrasplat.base.compiling import compiled

def doubled(x):
    return 2 * x

doubled = compiled(doubled, sys.argv[1], nogil=True)
assert doubled(21) == 42
print(sum(doubled.stats.cache_hits.values()))
"""
NO_FOLDER = "from numba.core import caching\ncaching.CacheImpl._locator_classes = []\n"


def hits(folder: Path, version: str = "", before: str = "") -> int:
    """Functions that a new process takes from the disk; `before`: what it does first."""
    program = folder / "program.py"
    if not program.exists():  # numba looks at its time
        program.write_text(before + PROGRAM)
    run = [sys.executable, str(program), version]
    return int(subprocess.run(run, check=True, capture_output=True, text=True, cwd=folder).stdout)


def test_the_next_run_takes_it_from_the_disk_until_its_version_changes(tmp_path: Path) -> None:
    assert [hits(tmp_path, version) for version in ("one", "one", "two", "two")] == [0, 1, 0, 1]


def test_it_is_compiled_anew_where_no_cache_folder_can_be_written(tmp_path: Path) -> None:
    assert [hits(tmp_path, before=NO_FOLDER) for _ in range(2)] == [0, 0]


def test_a_version_is_that_of_all_files() -> None:
    versions = {version_of(files) for files in ([b"a"], [b"a", b"b"], [b"a", b"c"])}
    assert len(versions) == 3 and all(len(version) == 12 for version in versions)
