"""Mistakes put into the search on purpose: each must fail a quick test of beams."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import spectrasplat

TESTS = Path(__file__).parent
RAYS, SPECTRUM = TESTS / "test_beams_against_rays.py", TESTS / "test_beams_along_the_spectrum.py"
MUTANTS = {
    "none: what is copied passes": ("hand.py", "FIRST = 2\n", "FIRST = 2\n", RAYS, "lost_or_doubled and prism"),
    "an edge's half-plane is forgotten": (
        "flight.py",
        "        for e in range(facet.corners):\n            is_turn = ",
        "        for e in range(1, facet.corners):\n            is_turn = ",
        RAYS,
        "lost_or_doubled and prism",
    ),
    "a sweep is reversed": (
        "convert.py",
        "edges[:, 0:3], edges[:, 4:7] = chosen.edge[:, 0], chosen.edge[:, 2]",
        "edges[:, 0:3], edges[:, 4:7] = chosen.edge[:, 2], chosen.edge[:, 0]",
        SPECTRUM,
        "move_along",
    ),
    "a child counts twice": (
        "at_facet.py",
        "        child(nodes, action,",
        "        for _ in range(2):\n          child(nodes, action,",
        RAYS,
        "lost_or_doubled and prism",
    ),
    "what survives roulette is not boosted": (
        "at_facet.py",
        "        new.boost /= chance\n",
        "        new.boost /= 1.0\n",
        RAYS,
        "roulette",
    ),
    "the seed is not drawn": (
        "at_facet.py",
        "unit(mixed(new.key ^ work.seed, np.int64(17)))",
        "unit(mixed(new.key, np.int64(17)))",
        RAYS,
        "roulette",
    ),
    "nearer facets do not hide farther ones": (
        "flight.py",
        "return t_one < t_other",
        "return False",
        RAYS,
        "lost_or_doubled and two",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_a_mistake_in_the_search_is_found(name: str, tmp_path: Path) -> None:
    file, old, new, test, chosen = MUTANTS[name]
    copy = tmp_path / "spectrasplat"
    original = Path(spectrasplat.__file__).parent.resolve()
    shutil.copytree(original, copy, ignore=shutil.ignore_patterns("*.nbi", "*.nbc", "*.pyc"))
    for data in ("shaders", "assets"):
        if not (copy / data).exists():
            (copy / data).symlink_to(original.parent / data)
        (tmp_path / data).symlink_to(original.parent / data)
    path = copy / "beams" / file
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", "-v", "-x", "-p", "no:cacheprovider", str(test), "-k", chosen],
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        cwd=TESTS.parent.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == (1 if old != new else 0), run.stdout[-2000:] + run.stderr[-2000:]
    assert old == new or "AssertionError" in run.stdout, run.stdout[-2000:]
