"""`./test --soak [MINUTES]`: damaged files, a viewer under random hands, and kills, over and over until the time is up.

Each round has seeds of its own, so no night repeats another; what fails is told with the command that repeats it, and
inputs are kept as cases. Ends with 1 where anything failed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.fuzz.kills import kill_one

MINUTES = 60.0
MUTANTS, ACTIONS, KILLS = 100, 150, 5
"""Of one round; mutants of each reader."""


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="./test --soak", description=__doc__)
    parser.add_argument("minutes", type=float, nargs="?", default=MINUTES)
    parser.add_argument("--seed", type=int, default=int(time.time()) // 60, help="of the first round")
    given = parser.parse_args()
    ends = time.monotonic() + 60.0 * given.minutes
    failures, seed = 0, given.seed
    print(f"soak of {given.minutes:g} minutes from seed {seed}", flush=True)
    while time.monotonic() < ends:
        for part in (_fuzz, _viewer, _kills):
            if time.monotonic() < ends:
                failures += part(seed, ends)
        seed += 1
    print(f"soak: {seed - given.seed} rounds, {failures} failures", flush=True)
    return 1 if failures else 0


def _fuzz(seed: int, ends: float) -> int:
    command = [sys.executable, "-m", "tests.fuzz", "--seed", str(seed), "--count", str(MUTANTS)]
    return _told("damaged files", command, {}, ends)


def _viewer(seed: int, ends: float) -> int:
    test = "tests/interface/test_soak.py::test_what_the_soak_asks_for"
    command = [sys.executable, "-m", "pytest", "-n", "0", "-q", "-p", "no:cacheprovider", test]
    return _told("viewer", command, {"SPECTRASPLAT_SOAK": f"{seed}:{ACTIONS}"}, ends)


def _told(what: str, command: list[str], environment: dict[str, str], ends: float) -> int:
    """Run a part of the soak; what it says is shown where it fails. Cut short by the end of the time it has not."""
    begun = time.monotonic()
    try:
        done = subprocess.run(
            command,
            env=os.environ | environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=max(ends - begun, 1.0),
            check=False,
        )
    except subprocess.TimeoutExpired:
        print(f"{what}: cut short", flush=True)
        return 0
    print(f"{what}: {'FAILED' if done.returncode else 'good'}, {time.monotonic() - begun:.0f} s", flush=True)
    if done.returncode:
        settings = "".join(f"{name}={value} " for name, value in environment.items())
        print(f"{done.stdout}\nrepeat: {settings}{' '.join(command)}", flush=True)
    return int(done.returncode != 0)


def _kills(seed: int, ends: float) -> int:
    rng, bad, number = np.random.default_rng(seed), 0, 0
    while number < KILLS and time.monotonic() < ends:
        with tempfile.TemporaryDirectory() as folder:
            kill = kill_one(rng, Path(folder))
        number += 1
        if kill.faults:
            bad += 1
            print(f"kill {number} of seed {seed}: {kill}", flush=True)
    print(f"kills: {number}, {bad} bad", flush=True)
    return bad


if __name__ == "__main__":
    sys.exit(main())
