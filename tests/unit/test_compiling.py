"""What is compiled or computed is kept on disk and goes with the code that made it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from spectrasplat.base.compiling import version_of
from spectrasplat.reference import code_key

PROGRAM = """
import sys
from spectrasplat.base.compiling import compiled

def doubled(x):
    return 2 * x

doubled = compiled(doubled, sys.argv[1], nogil=True)
assert doubled(21) == 42
print(sum(doubled.stats.cache_hits.values()))
"""


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder for what is compiled."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def hits(folder: Path, version: str = "", more: str = "") -> int:
    """Functions that a new process takes from the disk; `more`: what the source ends with."""
    program = folder / "program.py"
    folder.mkdir(exist_ok=True)
    program.write_text(PROGRAM + more)
    run = [sys.executable, str(program), version]
    return int(subprocess.run(run, check=True, capture_output=True, text=True, cwd=folder).stdout)


@pytest.mark.usefixtures("cache")
def test_clones_take_it_from_the_disk_until_its_source_or_version_changes(tmp_path: Path) -> None:
    changed = "# another\n"
    runs = (("here", "", ""), ("there", "", ""), ("there", "", changed), ("here", "", ""), ("here", "two", ""))
    assert [hits(tmp_path / clone, version, more) for clone, version, more in runs] == [0, 1, 0, 1, 0]


def test_it_is_compiled_anew_where_no_cache_folder_can_be_written(tmp_path: Path, cache: Path) -> None:
    for folder in (cache, tmp_path / "__pycache__"):
        folder.write_text("a file")
    assert [hits(tmp_path) for _ in range(2)] == [0, 0]


def test_a_version_is_that_of_all_files() -> None:
    versions = {version_of(files) for files in ([b"a"], [b"a", b"b"], [b"a", b"c"])}
    assert len(versions) == 3 and all(len(version) == 12 for version in versions)


KERNEL = """
import sys
import numpy as np
from spectrasplat.beams.compiling import jit, part

@part
def root(x):
    return np.sqrt(x)

@jit
def roots(values, first, factor, out):
    total = 0.0
    for i in range(first, len(values)):
        out[i] = factor * np.arctan2(root(values[i]), 1.0)
        total += out[i]
    return total

values, out = np.arange(12.0)[::3], np.zeros(4)
total = roots(values, 1, 2.0, out)
assert np.array_equal(out, 2.0 * np.arctan2(np.sqrt([0, 3, 6, 9]), 1.0)) and total == out.sum(), (out, total)
print("numba" in sys.modules)
"""


@pytest.mark.usefixtures("cache")
def test_another_version_of_numba_calls_its_functions_itself(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    unknown = "from spectrasplat.beams import compiling\ncompiling._KNOWN = ()\n"
    program.write_text(unknown + KERNEL)
    run = subprocess.run([sys.executable, str(program)], check=True, capture_output=True, text=True)
    assert run.stdout == "True\n"


def test_a_kernel_is_compiled_once_and_then_needs_no_compiler(tmp_path: Path, cache: Path) -> None:
    """What is damaged, or another version's, is compiled again."""
    program = tmp_path / "program.py"
    program.write_text(KERNEL)

    def compiles() -> bool:
        run = subprocess.run([sys.executable, str(program)], check=True, capture_output=True, text=True)
        return run.stdout == "True\n"

    assert [compiles(), compiles()] == [True, False]
    (kept,) = cache.rglob("program.roots-*.kept")
    kept.write_bytes(kept.read_bytes()[:20])
    assert [compiles(), compiles()] == [True, False]
    program.write_text("from spectrasplat.beams import compiling\ncompiling._version = lambda: 'another'\n" + KERNEL)
    assert [compiles(), compiles()] == [True, False]


UNUSED = (
    "IPython",
    "OpenEXR",
    "colour",
    "dask",
    "glfw",
    "imgui_bundle",
    "matplotlib",
    "numba",
    "rich",
    "scipy",
    "yaml",
)
RENDERING = f"""
import sys
from spectrasplat.__main__ import main
assert main(["render", "prism_case", "-o", sys.argv[1], "--size", "32x18", "--photons", "1000", "--spp", "1"]) == 0
print([name for name in {UNUSED} if name in sys.modules])
"""


def test_a_rendering_with_beams_imports_no_compiler_and_nothing_of_windows_and_plots(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-P", "-m", "spectrasplat.beams.compile"], check=True)
    run = [sys.executable, "-c", RENDERING, str(tmp_path / "prism.png")]
    assert subprocess.run(run, capture_output=True, text=True, check=True).stdout.splitlines()[-1] == "[]"


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


def test_a_change_of_code_that_takes_part_gives_another_key(copy: Path) -> None:
    keys = [key("photon_reference")]
    for file, old, new in (
        ("reference/scattering.py", "1e-6", "1e-4"),
        ("reference/photon_emission.py", "def ", "def _x():\n    return 1\n\n\ndef "),
        ("model/optics/colorimetry.py", "683.002", "683.0"),
        ("model/geometry/bvh.py", "\nimport numpy", "\nimport math\nimport numpy"),
    ):
        change(copy / file, old, new)
        keys.append(key("photon_reference"))
    assert len(set(keys)) == len(keys)
    camera = key("camera_reference")
    change(copy / "reference/scattering.py", '"""What happens', '# A word more.\n"""Otherwise: what happens')
    change(copy / "reference/metrics.py", "1e-", "2e-")
    change(copy / "reference/camera_kernel.py", "1.0 - 1e-9", "1.0 - 1e-8")
    assert key("photon_reference") == keys[-1]
    assert key("camera_reference") != camera


def test_every_module_of_the_tracers_takes_part() -> None:
    found = {path.name for path in code_key._imported([code_key._PACKAGE / "reference" / "camera_reference.py"])}
    assert {"camera_kernel.py", "scattering.py", "photon_intersect.py", "photon_kernel.py", "colorimetry.py"} <= found
