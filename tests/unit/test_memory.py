"""How much memory there is, sentences where it does not suffice, and the age of the process."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest
from spectrasplat.base import memory
from spectrasplat.base.errors import UserError
from spectrasplat.base.process_age import process_age_s
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render import memory_estimate
from spectrasplat.render.memory_estimate import MemoryEstimate, check_room

GIB = 1 << 30


@pytest.fixture
def groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Control groups of nobody, in place of the kernel's."""
    monkeypatch.setattr(memory, "_V1", tmp_path / "v1")
    monkeypatch.setattr(memory, "_V2", tmp_path)
    return tmp_path


def group(folder: Path, names: tuple[str, str], limit: str, used: int, files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / names[0]).write_text(limit + "\n")
    (folder / names[1]).write_text(f"{used}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{files} {100 << 20}\n")


def test_a_control_group_limits(groups: Path) -> None:
    group(groups, ("memory.max", "memory.current"), "max", 0, "inactive_file")
    assert memory.memory_bytes() > 1 << 29
    group(groups, ("memory.max", "memory.current"), str(400 << 20), 300 << 20, "inactive_file")
    assert memory.memory_bytes() == 400 << 20
    assert memory.available_bytes() == 200 << 20  # files that are only kept do not count


def test_what_others_use_counts_against_their_group_only(groups: Path) -> None:
    """Around a group of 400 MiB lies one without a limit that uses much more."""
    own = Path("/proc/self/cgroup").read_text().splitlines()
    paths = [line.split(":", 2)[2] for line in own if line.startswith("0::")] or ["/"]
    names = ("memory.max", "memory.current")
    group(groups / "v1", ("memory.limit_in_bytes", "memory.usage_in_bytes"), str(1 << 62), GIB, "total_inactive_file")
    group(groups / paths[0].lstrip("/"), names, str(400 << 20), 300 << 20, "inactive_file")
    assert memory.available_bytes() == 200 << 20


def test_the_older_kind_too(groups: Path) -> None:
    group(
        groups / "v1",
        ("memory.limit_in_bytes", "memory.usage_in_bytes"),
        str(300 << 20),
        290 << 20,
        "total_inactive_file",
    )
    assert memory.available_bytes() == 110 << 20


def test_what_a_picture_takes() -> None:
    # Sums and list 20, read back 16 + 16.
    assert memory.picture_bytes(100, 10, None) == 1000 * 72
    # Five textures and the list 84; sums that were read, bins and colours of them 80 + 80 + 12.
    assert memory.picture_bytes(100, 10, 20) == 1000 * 256


def test_too_little_for_any_rendering_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "available_bytes", lambda: 50 << 20)
    with pytest.raises(UserError, match="at least 160 MiB and 50 MiB are left"):
        memory.check_picture_memory(64, 36, None)
    monkeypatch.setattr(memory, "address_limit", lambda: GIB)
    monkeypatch.setattr(memory, "available_bytes", lambda: 200 << 20)
    with pytest.raises(UserError, match="at least 560 MiB"):
        memory.check_picture_memory(64, 36, None)


def test_a_rendering_beyond_what_is_left_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory_estimate, "available_bytes", lambda: 500 << 20)
    settings = RenderSettings(width=800, height=600)
    check_room(MemoryEstimate(300 << 20, 480 << 20, 400 << 20), settings)
    with pytest.raises(
        UserError, match="about 1000 MiB, 700 MiB more than it has taken, and 500 MiB are left.*800x600"
    ):
        check_room(MemoryEstimate(300 << 20, 480 << 20, 700 << 20), settings)


def test_limits_of_the_process_count(monkeypatch: pytest.MonkeyPatch) -> None:
    def limits(which: int) -> tuple[int, int]:
        return (memory._kib("/proc/self/status", "VmData:")[0] * 1024 + GIB // 8, resource.RLIM_INFINITY)

    monkeypatch.setattr(resource, "getrlimit", limits)
    assert memory.available_bytes() <= GIB // 8


LATE = "import time; time.sleep(0.5); from spectrasplat.base.process_age import process_age_s; print(process_age_s())"


@pytest.mark.skipif(process_age_s() is None, reason="this system does not tell when a process began")
def test_it_counts_from_the_start_of_the_process() -> None:
    """And not from that of a module; the parent, which is older, must not be told."""
    told = float(subprocess.run([sys.executable, "-c", LATE], capture_output=True, text=True, check=True).stdout)
    parent = process_age_s()
    assert parent is not None and 0.5 <= told < parent
