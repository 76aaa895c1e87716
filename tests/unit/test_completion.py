"""Shell completion: the scripts for bash, zsh and fish, and what is offered for scenes, receivers, glasses, methods."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SHELLS = ("bash", "zsh", "fish")


def answer(shell: str, line: str, folder: Path | None = None) -> str:
    """What the program prints when `shell` asks how `line` goes on."""
    words = line.split(" ")
    asked = {
        "bash": {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)},
        "zsh": {"_TYPER_COMPLETE_ARGS": line},
        "fish": {"_TYPER_COMPLETE_ARGS": line, "_TYPER_COMPLETE_FISH_ACTION": "get-args"},
    }[shell]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "spectrasplat"],
        env=os.environ | asked | {"_SPECTRASPLAT_COMPLETE": f"complete_{shell}"},
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize("shell", SHELLS)
def test_shipped_scenes(shell: str) -> None:
    offered = answer(shell, "spectrasplat render pri")
    assert all(name in offered for name in ("prism", "prism_case", "prism_edge")) and "ball" not in offered


@pytest.mark.parametrize(
    ("line", "wanted", "unwanted"),
    [
        ("spectrasplat ren", "render", "bake"),
        ("spectrasplat render --camera-m", "--camera-method", "--photons"),
        ("spectrasplat bake prism ", "table", "caustic"),
        ("spectrasplat render prism --layer m", "map:table", "beauty"),
        ("spectrasplat render --spp 4 prism --layer ", "caustic", "map:floor"),
        ("spectrasplat render prism --method sr", "srd-lambda", "regular-7"),
        ("spectrasplat render prism --camera-method sto", "stochastic-even", "stochastic-point"),
        ("spectrasplat bench --methods srd,reg", "srd,regular-16", "srd,srd"),
        ("spectrasplat glass N-SF", "N-SF11", "N-BK7"),
    ],
)
def test_what_is_offered(line: str, wanted: str, unwanted: str) -> None:
    offered = answer("bash", line).splitlines()
    assert wanted in offered and unwanted not in offered


@pytest.mark.parametrize("scene", ["nowhere", "broken.toml", "folder"])
def test_a_scene_that_cannot_be_read_offers_nothing(scene: str, tmp_path: Path) -> None:
    (tmp_path / "broken.toml").write_text("= 3")
    (tmp_path / "folder").mkdir()
    assert answer("bash", f"spectrasplat bake {scene} ", tmp_path).strip() == ""


@pytest.mark.parametrize("shell", SHELLS)
def test_scripts_are_shown(shell: str) -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "spectrasplat"],
        env=os.environ | {"_SPECTRASPLAT_COMPLETE": f"source_{shell}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "_SPECTRASPLAT_COMPLETE" in done.stdout and "spectrasplat" in done.stdout
