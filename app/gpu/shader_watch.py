"""Notices that a shader on disk was changed, so that a running viewer compiles it again.

Times of modification are compared every half second: no service of the operating system is
needed, and the few dozen files cost less than a millisecond.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from ..base import paths

INTERVAL_S = 0.5
SUFFIXES = (".glsl", ".comp", ".vert", ".frag")

Stamps = dict[Path, tuple[int, int]]


class ShaderWatch:
    """`changed()` is cheap enough to be called in every frame."""

    def __init__(self, root: Path | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._root = root or paths.shaders_dir()
        self._clock = clock
        self._next_look = clock() + INTERVAL_S
        self._stamps = self._look()

    def changed(self) -> tuple[str, ...]:
        """Files written, added or deleted since the last answer, relative to the folder; checks every half second."""
        now = self._clock()
        if now < self._next_look:
            return ()
        self._next_look = now + INTERVAL_S
        stamps = self._look()
        different = {path for path, _ in self._stamps.items() ^ stamps.items()}
        self._stamps = stamps
        return tuple(sorted(path.relative_to(self._root).as_posix() for path in different))

    def _look(self) -> Stamps:
        stamps: Stamps = {}
        for path in self._root.rglob("*"):
            if path.suffix not in SUFFIXES:
                continue
            try:
                status = path.stat()
            except OSError:  # an editor is just replacing it: it will be there at the next check
                continue
            stamps[path] = (status.st_mtime_ns, status.st_size)
        return stamps
