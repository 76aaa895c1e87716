"""How long this process has run: what a command took before its own first line counts for who waits for it."""

from __future__ import annotations

import os
from pathlib import Path


def process_age_s() -> float | None:
    """Seconds of the clock since this process began; None where the system does not tell as Linux does."""
    try:
        # What follows the name in brackets, which may hold anything: the state is field 3, the start field 22.
        fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
        since_boot_s = float(Path("/proc/uptime").read_text().split()[0])
        return since_boot_s - int(fields[22 - 3]) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return None
