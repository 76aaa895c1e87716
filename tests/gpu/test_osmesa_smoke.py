"""The fall-back without EGL draws the same picture: the whole program once through OSMesa.

Processes of their own: the current contexts of two libraries would fight over one thread.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.gpu import context, osmesa

ROOT = Path(__file__).resolve().parents[2]
SCENE = """
[camera]
position = [0.5, -4.0, 3.0]
target = [0.8, 0.0, 0.0]
[[lights]]
kind = "spot"
position = [-6.0, 0.3, 4.0]
target = [0.0, 0.0, 1.0]
half_angle_deg = 6.0
intensity_cd = 1000.0
[[objects]]
shape = "prism"
glass = "N-SF11"
position = [0.0, 0.0, 1.0]
[[objects]]
shape = "plane"
width = 12.0
height = 12.0
material = "diffuse"
"""


def picture(backend: str, folder: Path) -> np.ndarray:
    """The scene through `backend`, float32 (36, 64, 3)."""
    output = folder / f"{backend}.npy"
    options = ["--size", "64x36", "--photons", "10k", "--spp", "1", "--seed", "3"]
    done = subprocess.run(
        [sys.executable, "-m", "spectrasplat", "render", str(folder / "scene.toml"), "-o", str(output), *options],
        cwd=ROOT,
        env={**os.environ, "SPECTRASPLAT_BACKEND": backend},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return np.load(output)


@pytest.mark.slow
def test_osmesa_draws_what_egl_draws(tmp_path: Path) -> None:
    try:
        osmesa.load_library()
    except OSError as error:
        pytest.fail(f"{error}: run '{context.APT_LINE_OSMESA}' as root (./test does so where it may)")
    (tmp_path / "scene.toml").write_text(SCENE)
    through_osmesa = picture("osmesa", tmp_path)
    assert through_osmesa.max() > 0.0
    through_egl = picture("egl", tmp_path)
    assert np.linalg.norm(through_osmesa - through_egl) < 1e-3 * np.linalg.norm(through_egl)
