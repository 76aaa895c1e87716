"""The viewer under Dear ImGui's own Test Engine: items found by their ids, not by places, on a platform without a
screen."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from spectrasplat.base.paths import assets_dir

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_select_edit_undo_redo(tmp_path: Path) -> None:
    """In a process of its own: the engine runs the main loop, and GLFW can be started on one platform only."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.interface.engine_flow", str(assets_dir() / "scenes" / "prism.toml")],
        cwd=ROOT,
        env=os.environ | {"SPECTRASPLAT_CONFIG": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    saw = json.loads(done.stdout.strip().splitlines()[-1][done.stdout.strip().splitlines()[-1].index("{") :])
    assert saw["gl_errors"] == []
    assert saw["seen"] == ["selected object 0", "selected object 1", "shortcuts True"]
    assert saw["gains"] == {"start": 1.0, "edited": 3.0, "undone": 1.0, "redone": 3.0}
    # Nothing was traced but what beams are too weak for, and that only through the glass as it was at first.
    rays = saw["rays"]
    assert rays["edited"] == rays["start"] and max(rays.values()) < 1.5 * rays["start"]
    assert saw["from_start"]["edited"] > 0.1
    assert saw["from_start"]["undone"] < 1e-5
    assert saw["redone_from_edited"] < 1e-5
