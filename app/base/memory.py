"""How much memory this process may use, and pictures that would not fit into it."""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path

from .errors import UserError

MAX_SIDE_PX = 16384
"""Largest texture side OpenGL 4.3 promises."""
_BYTES_PER_TARGET_PX = 16  # RGBA32F
_GIB = 1 << 30


def check_picture_memory(width: int, height: int, bins: int | None) -> None:
    """Refuse a picture whose targets would not fit into the machine's memory."""
    targets = 1 + math.ceil((bins or 0) / 4)
    # Accumulation on the device, its read-back, and the float32 picture made from it.
    needed = 3 * width * height * targets * _BYTES_PER_TARGET_PX
    available = memory_bytes()
    if needed > available:
        with_bins = f" with --bins {bins}" if bins else ""
        raise UserError(
            f"--size {width}x{height}{with_bins} needs about {needed / _GIB:.1f} GiB "
            f"and this machine has {available / _GIB:.1f} GiB: choose a smaller one"
        )


def waste_little() -> None:
    """Give memory back as soon as it is free, where the C library is GNU's: with an arena for each thread and a
    threshold that grows, a tenth of what a rendering takes is held for nothing."""
    import ctypes

    arenas_at_most, mapped_from, trimmed_from = -8, -3, -1  # M_ARENA_MAX, M_MMAP_THRESHOLD, M_TRIM_THRESHOLD
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return
    mallopt(arenas_at_most, 1)
    mallopt(mapped_from, 1 << 20)
    mallopt(trimmed_from, 1 << 20)


def peak_bytes() -> int:
    """Most memory that this process has held at once."""
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024)


def available_bytes() -> int:
    """Memory this process may still take: the machine's free memory, what is left of its control group's, and of the
    process's own limit of addresses (`ulimit -v`), whichever is least."""
    found = [memory_bytes()]
    found += [1024 * size for size in _kib("/proc/meminfo", "MemAvailable:")]
    try:
        used = int(Path("/sys/fs/cgroup/memory.current").read_text(encoding="ascii"))
        reclaimable = sum(
            int(line.split()[1])
            for line in Path("/sys/fs/cgroup/memory.stat").read_text(encoding="ascii").splitlines()
            if line.startswith(("inactive_file ", "active_file "))
        )
        found.append(max(memory_bytes() - used + reclaimable, 0))
    except (OSError, ValueError):
        pass
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY:
        found += [max(limit - 1024 * size, 0) for size in _kib("/proc/self/status", "VmSize:")]
    return min(found)


def _kib(path: str, key: str) -> list[int]:
    """The number that follows `key` in a file of the kernel's; nothing where there is none."""
    try:
        lines = Path(path).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return []
    return [int(line.split()[1]) for line in lines if line.startswith(key)]


def memory_bytes() -> int:
    """Memory this process may use: the machine's, or its control group's where that is less."""
    total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii").strip()
    except OSError:
        return total
    return min(total, int(limit)) if limit.isdigit() else total
