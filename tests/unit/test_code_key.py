"""What is kept of the references goes with the code that made it, and with nothing else."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from spectrasplat.reference import code_key


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the rooms that references are made in; keys are of that."""
    for room in ("reference", "model"):
        shutil.copytree(code_key._PACKAGE / room, tmp_path / room, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(code_key, "_PACKAGE", tmp_path)
    return tmp_path


def key(*modules: str) -> str:
    code_key.code_key.cache_clear()
    code_key._parsed.cache_clear()
    return code_key.code_key(*modules)


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("reference/scattering.py", "1e-6", "1e-4"),
        ("reference/photon_emission.py", "def ", "def _x():\n    return 1\n\n\ndef "),
        ("model/optics/colorimetry.py", "683.002", "683.0"),
        ("model/geometry/bvh.py", "\nimport numpy", "\nimport math\nimport numpy"),
    ],
)
def test_a_change_of_code_gives_another_key(copy: Path, file: str, old: str, new: str) -> None:
    before = key("photon_run"), key("camera_run")
    change(copy / file, old, new)
    after = key("photon_run"), key("camera_run")
    assert before[0] != after[0] and before[1] != after[1]


def test_comments_and_code_that_takes_no_part_do_not_count(copy: Path) -> None:
    before = key("photon_run")
    change(copy / "reference/scattering.py", '"""What happens', '# A word more.\n"""Otherwise: what happens')
    change(copy / "reference/metrics.py", "1e-", "2e-")
    change(copy / "reference/camera_kernel.py", "1.0 - 1e-9", "1.0 - 1e-8")
    assert key("photon_run") == before
    assert key("camera_run") != before


def test_every_module_of_the_tracers_takes_part() -> None:
    found = {path.name for path in code_key._imported([code_key._PACKAGE / "reference" / "camera_run.py"])}
    assert {"camera_kernel.py", "scattering.py", "photon_intersect.py", "caustic_kernel.py", "colorimetry.py"} <= found
