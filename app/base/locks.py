"""Locks between processes, on one machine or on many that share a file system; each ends with its process, however that
ends."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def lock(descriptor: int, wait: bool = False) -> bool | None:
    """Lock an open file until it is closed: whether it could be had; None where system or file system have no locks."""
    if sys.platform == "win32":
        return None
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


@contextmanager
def locked(path: Path, wait: bool = True, make: bool = True) -> Iterator[bool]:
    """Hold a lock on a folder, or on a file that is made for it; whether it could be had. Where there are no locks, it
    always can."""
    if sys.platform == "win32":
        yield True
        return
    is_folder = path.is_dir()
    descriptor = os.open(path, os.O_RDONLY if is_folder else os.O_RDWR | (os.O_CREAT if make else 0), 0o666)
    try:
        yield lock(descriptor, wait) is not False
    finally:
        os.close(descriptor)
