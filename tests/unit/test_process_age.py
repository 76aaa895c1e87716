"""How old a process says it is, as `bench-view` tells times from its start."""

from __future__ import annotations

import subprocess
import sys

import pytest
from spectrasplat.base.process_age import process_age_s

LATE = "import time; time.sleep(0.5); from spectrasplat.base.process_age import process_age_s; print(process_age_s())"


@pytest.mark.skipif(process_age_s() is None, reason="this system does not tell when a process began")
def test_it_counts_from_the_start_of_the_process() -> None:
    """And not from that of a module; the parent, which is older, must not be told."""
    told = float(subprocess.run([sys.executable, "-c", LATE], capture_output=True, text=True, check=True).stdout)
    parent = process_age_s()
    assert parent is not None and 0.5 <= told < parent
