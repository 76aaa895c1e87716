"""On what machine a bench ran: figures mean little without it, and those of two machines are never mixed."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.paths import shaders_dir

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..gpu.shader import Built

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
_COPIED_BYTES = {True: 1 << 24, False: 1 << 28}
"""By whether the processor draws."""
_COPIES = 8


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


def copied_bytes_per_second(context: Context, repeats: int = 4) -> float:
    """Bytes that the device reads and writes where it copies memory: what its bandwidth can be taken for."""
    size = _COPIED_BYTES[context.is_software]
    from_here, to_there = (context.ctx.buffer(reserve=size) for _ in range(2))
    try:
        best = 0.0
        for _ in range(repeats):
            context.finish()
            started = time.perf_counter()
            for _ in range(_COPIES):  # so that starting and waiting, some 0.1 ms on a GPU, take little of it
                context.ctx.copy_buffer(to_there, from_here)
            context.finish()
            best = max(best, 2 * _COPIES * size / max(time.perf_counter() - started, 1e-9))
        return best
    finally:
        from_here.release()
        to_there.release()


def compile_line(programs: Iterable[Built]) -> str:
    """Seconds that the driver took to compile and link, in all and for the longest three."""
    slowest = sorted(programs, key=lambda built: built.seconds, reverse=True)
    longest = ", ".join(f"{built.name} {built.seconds:.2f}" for built in slowest[:3])
    return f"{len(slowest)} programs in {sum(built.seconds for built in slowest):.2f} s (the longest: {longest})"


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
