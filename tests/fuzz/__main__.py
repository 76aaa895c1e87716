"""The fuzzing command for developers: `python -m tests.fuzz --count 2000 --seed 7 [--reader ply,obj] [--keep FOLDER]`.

Each reader works in a process of its own, under a limit of memory. What fails, hangs, or kills the process is kept as a
case, which the tests try again for ever; the last line of its traceback is shown. Exits with 1 where anything failed.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.readers import READERS
from tests.fuzz.trial import CASES, PATIENCE_S, keep, try_mutant

MEMORY_BYTES = 2 << 30


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="mutants of each reader")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--reader", default=",".join(READERS), help="names with commas between")
    parser.add_argument("--keep", type=Path, default=CASES, help="folder for inputs that fail")
    parser.add_argument("--worker", nargs=3, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        name, first, folder = given.worker
        _work(name, given.seed, int(first), given.count, Path(folder))
        return 0
    failures = 0
    for name in given.reader.split(","):
        failures += _supervise(name, given.seed, given.count, given.keep)
    return 1 if failures else 0


def _supervise(name: str, seed: int, count: int, cases: Path) -> int:
    """Run all mutants of a reader; start the process again behind one that ended it. Returns the failures."""
    begun, first, failed, largest = time.monotonic(), 0, 0, 0
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        while first < count:
            command = [sys.executable, "-m", "tests.fuzz", "--seed", str(seed), "--count", str(count)]
            command += ["--worker", name, str(first), text]
            with (folder / "told").open("w") as told:
                process = subprocess.Popen(command, stdout=told, stderr=subprocess.DEVNULL)
            ended = _wait(process, folder / "told")
            lines = [json.loads(line) for line in (folder / "told").read_text().splitlines() if line.endswith("}")]
            first = max((line["index"] for line in lines), default=first) + 1
            largest = max([largest, *(line["rss"] for line in lines)])
            for line in lines:
                if "failure" in line:
                    failed += 1
                    print(f"  {name} {line['index']}: {line['failure'].strip().splitlines()[-1][:160]}", flush=True)
                    _keep(name, seed, line["index"], cases)
            if ended is not None:
                failed += 1
                print(f"  {name} {first}: {ended}", flush=True)
                _keep(name, seed, first, cases)
                first += 1
    print(
        f"{name}: {count} mutants, {failed} failures, at most {largest >> 20} MiB, {time.monotonic() - begun:.0f} s",
        flush=True,
    )
    return failed


def _wait(process: subprocess.Popen[bytes], told: Path) -> str | None:
    """Until the process ends; what was wrong with its end, or None."""
    size, since = -1, time.monotonic()
    while process.poll() is None:
        time.sleep(0.1)
        if told.stat().st_size != size:
            size, since = told.stat().st_size, time.monotonic()
        elif time.monotonic() > since + 2 * PATIENCE_S + 20:  # importing takes a while too
            process.kill()
            process.wait()
            return "hangs"
    return None if process.returncode == 0 else f"ended its process with {process.returncode}"


def _keep(name: str, seed: int, index: int, cases: Path) -> None:
    from tests.fuzz.mutate import mutant
    from tests.fuzz.trial import seeds_of

    print(f"  kept as {keep(name, mutant(seeds_of(name), seed, index), cases)}", flush=True)


def _work(name: str, seed: int, first: int, count: int, folder: Path) -> None:
    """One process's part: a line of JSON on stdout for every failure, and now and then one that says how far it is."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, MEMORY_BYTES))
    for index in range(first, count):
        _, failure = try_mutant(name, seed, index, folder / name)
        line: dict[str, object] = {"index": index, "rss": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10}
        print(json.dumps(line | ({"failure": failure} if failure else {})), flush=True)


if __name__ == "__main__":
    sys.exit(main())
