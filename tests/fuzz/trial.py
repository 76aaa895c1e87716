"""One damaged file given to a reader, and what came of it."""

from __future__ import annotations

import hashlib
import signal
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from tests.fuzz.mutate import mutant
from tests.fuzz.readers import READERS, Reader

CASES = Path(__file__).parent / "cases"
PATIENCE_S = 20.0
"""What takes longer hangs: of processor time, for machines that do other things too."""


class Hang(Exception):
    """A reader that does not come back."""


def try_mutant(name: str, seed: int, index: int, folder: Path) -> tuple[bytes, str | None]:
    """Mutant `index` of the run `seed`, and the failure of reader `name` over it (a traceback), or None."""
    data = mutant(seeds_of(name), seed, index)
    return data, try_file(READERS[name], data, folder)


def try_file(reader: Reader, data: bytes, folder: Path) -> str | None:
    """What reading `data` from a file in `folder` raises that it must not: a traceback, or None. Warnings count."""
    path = folder / reader.name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    try:
        with _patience(), warnings.catch_warnings():
            warnings.simplefilter("error")
            reader.read(path)
    except reader.refusals:
        return None
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return "".join(traceback.format_exception(error))
    return None


def seeds_of(name: str) -> tuple[bytes, ...]:
    """The sound files of a reader."""
    if name not in _SEEDS:
        _SEEDS[name] = READERS[name].seeds()
    return _SEEDS[name]


_SEEDS: dict[str, tuple[bytes, ...]] = {}


def keep(name: str, data: bytes, cases: Path = CASES) -> Path:
    """Store an input that failed, for ever tried again (`test_fuzz.py`)."""
    folder = cases / name
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / hashlib.sha256(data).hexdigest()[:16]
    path.write_bytes(data)
    return path


@contextmanager
def _patience() -> Iterator[None]:
    """Within the block, `Hang` is raised after PATIENCE_S, as soon as Python is reached again."""

    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise Hang(f"over {PATIENCE_S:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
