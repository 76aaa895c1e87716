"""The same pictures and answers on a second driver: zink, which turns our GLSL into SPIR-V, on lavapipe, a Vulkan
driver for the processor (Debian: mesa-vulkan-drivers). It crashes where the first one is lenient.
`./test --drivers` runs all of it.
"""

from __future__ import annotations

import functools
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.paths import shipped_scenes

APT_LINE = "apt-get install mesa-vulkan-drivers libegl1 libgl1-mesa-dri"
ICD_FOLDERS = ("/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d")
NO_DISPLAY = ("DISPLAY", "WAYLAND_DISPLAY", "SPECTRASPLAT_BACKEND", "PYTEST_CURRENT_TEST")
DIFFERENT = 6e-3
"""Root mean square difference of two drivers' pictures over the root mean square: sums in another order, and where a
choice hangs on the last bit, another path: single photons, so that it falls with their number (ripples: 8e-3 with
20,000, 1.3e-3 with 400,000). 1e-4 is usual."""
PATIENCE_S = 600


def environment() -> dict[str, str] | None:
    """The variables that choose zink on lavapipe; None without its file."""
    files = [file for folder in ICD_FOLDERS for file in sorted(Path(folder).glob("lvp_icd*.json"))]
    if not files:
        return None
    kept = {name: value for name, value in os.environ.items() if name not in NO_DISPLAY}
    return kept | {
        "GALLIUM_DRIVER": "zink",
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "VK_ICD_FILENAMES": str(files[0]),
        "VK_DRIVER_FILES": str(files[0]),
    }


def on_zink(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The program's command line on the second driver."""
    return subprocess.run(
        [sys.executable, "-m", "spectrasplat", *arguments],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


@functools.cache
def missing() -> str:
    """Why there is no second driver; "" where there is."""
    if environment() is None:
        return f"lavapipe is not installed: run '{APT_LINE}' as root"
    told = next((line for line in on_zink("doctor").stdout.splitlines() if "renderer" in line), "no renderer")
    return "" if "zink" in told else f"zink does not start on lavapipe here ({' '.join(told.split())})"


@pytest.fixture(autouse=True)
def second_driver() -> None:
    if missing():
        pytest.skip(missing())


def picture(folder: Path, scene: str, zink: bool) -> np.ndarray:
    file = folder / f"{scene}{'-zink' if zink else ''}.npy"
    more = ["--size", "96x54", "--photons", "100k", "--spp", "1", "-o", str(file)]
    if zink:
        done = on_zink("render", scene, *more)
    else:
        done = subprocess.run(
            [sys.executable, "-m", "spectrasplat", "render", scene, *more],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-2000:]}"
    assert ("zink" in done.stdout) == zink
    return np.load(file)


def difference(folder: Path, scene: str) -> float:
    ours, theirs = (picture(folder, scene, zink).astype(float) for zink in (False, True))
    assert np.isfinite(theirs).all()
    return float(np.sqrt(np.mean((ours - theirs) ** 2) / np.mean(ours**2)))


def test_a_scene_with_curved_and_flat_glass_is_drawn_alike(tmp_path: Path) -> None:
    """Of the two scenes that crashed there: zink cannot load a bool out of memory (shaders/README.md)."""
    assert difference(tmp_path, "prism_edge") < DIFFERENT


@pytest.mark.slow
@pytest.mark.parametrize("scene", sorted(shipped_scenes()))
def test_every_scene_is_drawn_alike(tmp_path: Path, scene: str) -> None:
    assert difference(tmp_path, scene) < DIFFERENT


@pytest.mark.slow
def test_the_proof_holds(tmp_path: Path) -> None:
    """Programs, known answers, pictures, stress: the short form, which software renderers get."""
    done = on_zink("prove-gpu", "-o", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    proof = json.loads((tmp_path / "proof.json").read_text())
    assert {part["state"] for part in proof["parts"]} == {"holds"}
