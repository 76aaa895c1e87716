"""Formatters, linter and types are clean over the whole tree; the rules stand in pyproject.toml."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

pytestmark = pytest.mark.core

ROOT = Path(__file__).resolve().parents[2]
needs_ruff = pytest.mark.skipif(
    find_spec("ruff") is None and shutil.which("ruff") is None, reason="ruff is not installed: pip install '.[test]'"
)
needs_mypy = pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed: pip install '.[test]'")


def complaints(*command: str) -> str:
    """What the tool prints where it is not content; "" where it is."""
    done = subprocess.run([sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stdout + done.stderr


@needs_ruff
def test_the_tree_is_formatted() -> None:
    told = complaints("ruff", "format", "--check", ".")
    assert told == "", f"run 'ruff format .'\n{told}"


@needs_ruff
def test_the_linter_is_content() -> None:
    assert complaints("ruff", "check", "--output-format", "concise", ".") == ""


def test_shaders_and_scripts_are_formatted() -> None:
    """By .clang-format."""
    clang_format = pytest.importorskip("clang_format", reason="clang-format is not installed: pip install '.[test]'")
    files = [path for path in (ROOT / "shaders").rglob("*.*") if path.suffix != ".md"]
    files += (ROOT / "assets" / "page").glob("*.js")
    command = [clang_format.get_executable("clang-format"), "--dry-run", "-Werror", *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"run 'clang-format -i' on these\n{done.stderr}"


def test_scripts_of_pages_are_clean() -> None:
    """Oxlint's rules for what is certainly wrong."""
    oxlint = shutil.which("oxlint", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    if oxlint is None:
        pytest.skip("oxlint is not installed: pip install '.[test]'")
    command = [oxlint, "--deny", "correctness", "assets/page"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@needs_mypy
@pytest.mark.slow
def test_the_types_hold() -> None:
    """Half a minute on two cores the first time, two seconds with its cache (.mypy_cache, which git ignores)."""
    assert complaints("mypy", "--no-error-summary") == ""
