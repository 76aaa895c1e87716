"""How much memory this process may use, and pictures that would not fit into it."""

from __future__ import annotations

import math
import os
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


def memory_bytes() -> int:
    """Memory this process may use: the machine's, or its control group's where that is less."""
    total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii").strip()
    except OSError:
        return total
    return min(total, int(limit)) if limit.isdigit() else total
