"""The program ended by a signal at any moment: what it leaves must be whole, and it must say so without a traceback."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from spectrasplat.base import atomic
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import read_image

SCENE = """
[camera]
position = [0, -5, 2]
[[lights]]
kind = "point"
position = [0, 0, 4]
[[objects]]
name = "ball"
shape = "sphere"
triangles = 300
[[objects]]
name = "floor"
shape = "plane"
material = "diffuse"
position = [0, 0, -1.5]
"""
_SMALL = ("--size", "64x36", "--photons", "20k")
COMMANDS = (
    ("render", "scene.toml", "-o", "out.npy", *_SMALL),
    ("render", "scene.toml", "-o", "out.exr", *_SMALL, "--bins", "4"),
    ("render", "scene.toml", "-o", "out.png", *_SMALL),
    ("animate", "scene.toml", "-o", "frames", "--frames", "6", *_SMALL, "--spp", "1"),
    ("animate", "scene.toml", "-o", "out.mp4", "--frames", "6", *_SMALL, "--spp", "1"),
    ("bake", "scene.toml", "floor", "-o", "map.npy", *_SMALL),
)
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)


@dataclass(frozen=True)
class Kill:
    """One run of the program and its end."""

    command: tuple[str, ...]
    number: signal.Signals
    after_s: float
    code: int
    faults: tuple[str, ...]

    def __str__(self) -> str:
        told = "; ".join(self.faults) or "whole"
        return f"{' '.join(self.command)}: {self.number.name} after {self.after_s:.2f} s, exit {self.code}: {told}"


def kill_one(rng: np.random.Generator, folder: Path, longest_s: float = 4.0) -> Kill:
    """Start a command in `folder`, which is empty or holds what an earlier one left, and end it at some moment."""
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    command = COMMANDS[int(rng.integers(len(COMMANDS)))]
    number = SIGNALS[int(rng.integers(len(SIGNALS)))]
    after_s = float(rng.uniform(0.0, longest_s))
    process = subprocess.Popen(
        [sys.executable, "-m", "spectrasplat", *command],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    faults = []
    try:
        process.communicate(timeout=after_s)
        err = ""
    except subprocess.TimeoutExpired:
        process.send_signal(number)
        try:
            _, err = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            _, err = process.communicate()
            faults.append("does not end within a minute")
    code = process.returncode
    if code not in (0, 128 + number, -number):  # the last: before the program had the time to look out for it
        faults.append(f"exit code {code}")
    if "Traceback" in err and code != -number:
        faults.append(f"a traceback: {err.strip().splitlines()[-1]}")
    return Kill(command, number, after_s, code, (*faults, *left_behind(folder, number == signal.SIGKILL)))


def left_behind(folder: Path, killed: bool) -> list[str]:
    """What is wrong with the files in `folder` after the end."""
    if killed:  # nobody can clean up then: the next one that writes there does
        for place in {folder, *(path for path in folder.iterdir() if path.is_dir())}:
            atomic._swept.discard(str(place))
            atomic.check_writable(place / "next.png")
    faults = []
    for path in sorted(folder.rglob("*")):
        if ".part" in path.name or ".old" in path.name:
            faults.append(f"{path.name} is left")
        elif path.is_file() and path.suffix in (".npy", ".exr", ".png"):
            try:
                read_image(path)
            except UserError as error:
                faults.append(str(error))
        elif path.is_file() and path.stat().st_size == 0 and not (killed and path.suffix == ".claim"):
            # A claim is a lock, which ends with its holder, on a file that holds nothing.
            faults.append(f"{path.name} is empty")
    if (folder / "map.npy").exists() != (folder / "map.json").exists():
        faults.append("a baked map and its placement are not together")
    return faults
