"""What is installed: the package `spectrasplat` with its shaders and assets, and nothing called `app`."""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
STAYS_HOME = ("gallery/viewer", "gallery/error_time")
"""Pictures of the documentation, which the program does not show."""


def folders_with_python() -> list[str]:
    """The packages that app/ holds, by the names they are imported by."""
    folders = {file.parent.relative_to(ROOT / "app") for file in (ROOT / "app").rglob("*.py")}
    return sorted(".".join(("spectrasplat", *folder.parts)) for folder in folders)


def data_files(folder: str) -> list[str]:
    """What of assets/ or shaders/ must be installed, relative to the folder."""
    files = (file.relative_to(ROOT / folder).as_posix() for file in (ROOT / folder).rglob("*") if file.is_file())
    return sorted(f for f in files if not f.endswith((".py", ".pyc")) and not f.startswith(STAYS_HOME))


def test_every_folder_is_listed_and_nothing_else() -> None:
    listed = PROJECT["tool"]["setuptools"]["packages"]
    assert sorted(set(listed) - {"spectrasplat.assets", "spectrasplat.shaders"}) == folders_with_python()
    assert len(set(listed)) == len(listed)


def test_every_folder_is_a_package() -> None:
    """A folder without __init__.py would be imported from a checkout and missing in other tools' eyes."""
    folders = {file.parent for file in (ROOT / "app").rglob("*.py")}
    assert [folder for folder in folders if not (folder / "__init__.py").is_file()] == []


def test_only_python_lies_in_the_packages() -> None:
    """Data has its own folders; a stray file in app/ would not be installed."""
    files = (file for file in (ROOT / "app").rglob("*") if file.is_file() and "__pycache__" not in file.parts)
    assert [file.name for file in files if file.suffix != ".py"] == ["py.typed"]


def test_the_program_finds_its_files_in_the_checkout() -> None:
    from spectrasplat.base import paths

    assert paths.assets_dir() == ROOT / "assets" and paths.shaders_dir() == ROOT / "shaders"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy: setuptools writes beside what it builds."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in ("app", "assets", "shaders"):
        shutil.copytree(ROOT / name, folder / "tree" / name)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / "tree" / name)
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(folder), str(folder / "tree")]
    try:
        if int(importlib.metadata.version("setuptools").split(".")[0]) >= 77:
            command.append("--no-build-isolation")
    except importlib.metadata.PackageNotFoundError:
        pass  # pip fetches one
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "No matching distribution found for setuptools" in done.stderr:
        pytest.skip("setuptools 77 is neither installed nor to be had from a package index")
    assert done.returncode == 0, done.stderr
    return next(folder.glob("*.whl"))


@pytest.mark.slow
def test_the_wheel_holds_the_package_its_data_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if not name.endswith("/")]
    assert {name.split("/")[0] for name in names if ".dist-info" not in name} == {"spectrasplat"}
    python = (file.relative_to(ROOT / "app").as_posix() for file in (ROOT / "app").rglob("*.py"))
    wanted = {f"spectrasplat/{name}" for name in python}
    wanted |= {"spectrasplat/py.typed"} | {
        f"spectrasplat/{folder}/{name}" for folder in ("assets", "shaders") for name in data_files(folder)
    }
    assert {name for name in names if ".dist-info" not in name} == wanted


@pytest.mark.slow
def test_the_unpacked_wheel_runs_and_finds_its_files(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    check = (
        "import spectrasplat\n"
        "from spectrasplat.base import paths\n"
        "from spectrasplat.commands.scenes import shipped_scenes\n"
        "from spectrasplat.model.io.scene_file import load_scene\n"
        "load_scene(shipped_scenes()['brilliant_studio'])\n"
        "assert (paths.shaders_dir() / 'light' / 'trace.comp').is_file()\n"
        "print(spectrasplat.__file__)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", check],
        env={"PYTHONPATH": str(tmp_path / "site"), "PATH": "", "HOME": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).is_relative_to(tmp_path / "site")


EXAMPLES = r"""
import json, re, sys
from pathlib import Path
import matplotlib
matplotlib.use("Agg")
import spectrasplat
assert Path(spectrasplat.__file__).is_relative_to(sys.prefix), spectrasplat.__file__
for page in map(Path, sys.argv[1:]):
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        code = ["".join(c["source"]) for c in json.loads(text)["cells"] if c["cell_type"] == "code"]
    else:
        code = re.findall(r"^```python\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    assert code, page
    names = {}
    for part in code:
        exec(compile(part, page.name, "exec"), names)
    print("ran", page.name)
"""
"""Every example of a page, or every cell of a notebook, as a reader would run them."""


@pytest.mark.slow
def test_notebooks_and_examples_run_from_the_wheel_alone(wheel: Path, tmp_path: Path) -> None:
    """In an environment that holds the wheel and what it asks for, with the checkout out of reach; two minutes of
    processor time."""
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True)
    python = tmp_path / "venv" / "bin" / "python"
    around = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(wheel)]
    done = subprocess.run(install, env=around, capture_output=True, text=True, check=False)
    if "No matching distribution found" in done.stderr:
        pytest.skip(f"what the wheel needs is not to be had from a package index: {done.stderr[-200:]}")
    assert done.returncode == 0, done.stderr
    pages = [ROOT / "docs" / "python.md", *sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))]
    copies = [Path(shutil.copy(page, tmp_path)) for page in pages]
    here = tmp_path / "here"
    here.mkdir()
    command = [str(python), "-W", "error::SyntaxWarning", "-c", EXAMPLES, *map(str, copies)]
    done = subprocess.run(command, cwd=here, env=around, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if line.startswith("ran ")] == [f"ran {c.name}" for c in copies]
