"""What the references keep in the user's cache folder: arrays in one `.npz` a key, the least recently used forgotten.

A cache may only save time: a damaged file is as good as none, and a folder that cannot be written costs the saving
alone.
"""

from __future__ import annotations

import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from ..base import files, paths
from ..base.atomic import atomic_output
from ..base.errors import UserError
from .rounds import Cancelled, EstimateT, Limits, PartsRun, Progress, continue_run

_CACHE_BYTES = 2 << 30
_DAMAGED = (
    OSError,
    ValueError,
    TypeError,
    AttributeError,
    KeyError,
    EOFError,
    MemoryError,
    RuntimeError,  # "encrypted", and compression that is not known
    SyntaxError,
    tokenize.TokenError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""What numpy and zipfile raise over damage."""


def kept_path(key: str, folder: Path | None) -> Path | None:
    """The file of a key in `folder` (None: the user's cache); None where no folder can be had."""
    try:
        folder = folder or paths.cache_dir() / "reference"
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder / f"{key}.npz"


def load_kept(path: Path | None, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, np.ndarray] | None:
    """The arrays that `shapes` names; None when the file is missing, damaged or holds other shapes."""
    if path is None or not files.is_file(path):
        return None
    try:
        with path.open("rb") as file, np.load(file) as stored:
            values = {name: stored[name] for name in shapes}
    except _DAMAGED:
        return None
    if any(values[name].shape != shape for name, shape in shapes.items()):
        return None
    with suppress(OSError):
        os.utime(path)  # the cache forgets the least recently used
    return values


def save_kept(path: Path | None, **arrays: object) -> None:
    """Put `arrays` in the place of what `path` held, whole or not at all."""
    if path is None:
        return
    with suppress(OSError, UserError):
        with atomic_output(path, lasting=False) as temporary:
            np.savez(temporary, **arrays)  # type: ignore[arg-type]
        _forget_oldest(path.parent, path)


def continue_kept(
    path: Path | None,
    shapes: Mapping[str, tuple[int, ...]],
    picture_of: Callable[[Mapping[str, np.ndarray]], EstimateT],
    begin: Callable[[Mapping[str, np.ndarray] | None], PartsRun[EstimateT]],
    limits: Limits,
    progress: Progress,
    cancelled: Cancelled,
) -> EstimateT:
    """The picture of what `path` holds, where that is good enough, otherwise of that and more, stored again.

    `picture_of` makes it from the arrays that `shapes` names; `begin` gives the run that goes on from them (None: from
    nothing). An interrupt (KeyboardInterrupt) stores what is done and goes on upwards.
    """
    stored = load_kept(path, shapes)
    if stored is not None and limits.are_met_by(picture := picture_of(stored)):
        return picture
    run = begin(stored)
    before = run.amount
    try:
        return continue_run(run, limits, progress, cancelled)
    finally:
        if run.amount > before:
            save_kept(path, **run.kept())


def _forget_oldest(folder: Path, newest: Path) -> None:
    """Keep the most recently used files within _CACHE_BYTES, the newest in any case."""
    states = [(path, path.stat()) for path in folder.glob("*.npz")]
    states.sort(key=lambda item: item[1].st_mtime_ns, reverse=True)
    used = 0
    for path, state in states:
        used += state.st_size
        if used > _CACHE_BYTES and path != newest:
            path.unlink(missing_ok=True)
