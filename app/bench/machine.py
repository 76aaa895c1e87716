"""On what machine a bench ran: figures mean little without it, and those of two machines are never mixed."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.paths import shaders_dir

if TYPE_CHECKING:
    from ..gpu.context import Context

_MEASURING = (
    "model/**/*.py",
    "gpu/*.py",
    "passes/*.py",
    "render/*.py",
    "reference/metrics.py",
    "bench/camera_rendering.py",
    "bench/rendering.py",
    "bench/runner.py",
)
"""Sources besides the shaders whose change changes a picture, its time or its error."""


def machine(context: Context) -> dict[str, str]:
    """What `results.BenchResult.machine` lists."""
    return {
        "processor": processor(),
        "cores": str(os.cpu_count() or 1),
        "renderer": context.renderer,
        "driver": context.vendor,
        "opengl": context.version,
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "program": program_hash(),
    }


_CLOCKS = "name,driver_version,clocks.sm,clocks.mem,clocks.max.sm,clocks.max.mem,memory.total,power.limit"


def clocks() -> str:
    """The device and its clocks as NVIDIA's own tool reports them; "" where there is none."""
    tool = shutil.which("nvidia-smi")
    if tool is None:
        return ""
    command = [tool, f"--query-gpu={_CLOCKS}", "--format=csv,noheader"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"nvidia-smi does not answer ({error})"
    return f"{'; '.join(done.stdout.splitlines()) or done.stderr.strip()[:200]} ({_CLOCKS})"


def words(figures: Mapping[str, float]) -> str:
    """Figures with units in their names, for people."""
    return ", ".join(f"{name.replace('_', ' ')} {figure:,}" for name, figure in figures.items())


def processor() -> str:
    """The processor's name, where the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def program_hash() -> str:
    """Short hash of the shaders and of the Python that renders and measures."""
    app = Path(__file__).resolve().parents[1]
    files = [path for path in sorted(shaders_dir().rglob("*")) if path.is_file()]
    files += [path for pattern in _MEASURING for path in sorted(app.glob(pattern))]
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
