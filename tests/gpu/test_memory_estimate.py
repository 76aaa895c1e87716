"""What a rendering was thought to take is what it takes, and one that does not fit is refused before it has begun."""

from __future__ import annotations

import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

WITHIN = 0.2
SIZES = {
    "480x270": ("prism", "--size", "480x270", "--photons", "200k", "--spp", "1"),
    "480x270, bins": ("prism", "--size", "480x270", "--photons", "200k", "--spp", "1", "--bins", "20"),
    "512², 4 samples": ("default", "--size", "512x512", "--photons", "200k", "--spp", "4"),
    "1280x720": ("default", "--size", "1280x720", "--photons", "1M", "--spp", "1"),
    "3840x2160": ("prism", "--size", "3840x2160", "--photons", "100k", "--spp", "1"),
}
MOST_MIB = {"1280x720": 800.0}


def run(folder: Path, *options: str, addresses: int | None = None) -> subprocess.CompletedProcess[str]:
    def limit() -> None:
        if addresses is not None:
            resource.setrlimit(resource.RLIMIT_DATA, (addresses, addresses))

    command = [sys.executable, "-m", "spectrasplat", "render", *options, "-o", str(folder / "x.exr"), "--stats"]
    return subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=limit)


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_the_peak_is_what_was_expected(name: str, gl, tmp_path: Path) -> None:
    if not gl.is_software:
        pytest.skip("a device has memory of its own")
    done = run(tmp_path, *SIZES[name])
    found = re.search(r"peak of the process (\d+) MiB, (\d+) expected", done.stdout)
    assert done.returncode == 0 and found, done.stderr
    peak, expected = (float(text) for text in found.groups())
    assert abs(expected / peak - 1.0) < WITHIN
    assert peak < MOST_MIB.get(name, 1e9)


def test_what_does_not_fit_is_a_sentence(gl, tmp_path: Path) -> None:
    if not gl.is_software:
        pytest.skip("a device has memory of its own")
    done = run(tmp_path, *SIZES["480x270"], addresses=450_000_000)
    (told,) = [line for line in done.stderr.splitlines() if not line.startswith("note")]
    assert done.returncode == 2 and "this rendering needs about" in told and "MiB are left" in told
    assert not list(tmp_path.iterdir())
