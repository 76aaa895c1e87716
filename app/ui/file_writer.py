"""Files that are encoded and written on a thread: none of that needs OpenGL, and the largest take seconds."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..base.errors import UserError

WORTH_TELLING_S = 1.0
"""Longer than that a file is named while it is written."""


@dataclass(frozen=True)
class _File:
    name: str
    future: Future[None]
    begun_s: float
    sentence: str


class FileWriter:
    """Writes one file after another, in the order requested."""

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None
        self._files: deque[_File] = deque()

    @property
    def is_busy(self) -> bool:
        """Something is being written, or was and `finished` has not returned its sentence."""
        return bool(self._files)

    @property
    def words(self) -> str:
        """What takes long; empty while nothing does."""
        if not self._files or time.monotonic() - self._files[0].begun_s < WORTH_TELLING_S:
            return ""
        more = len(self._files) - 1
        return f"Writing {self._files[0].name} …" + (f" and {more} more" if more else "")

    def write(self, path: Path, work: Callable[[], None], sentence: str) -> None:
        """Let `work` write `path`; `finished` returns `sentence` then."""
        self._pool = self._pool or ThreadPoolExecutor(1, thread_name_prefix="writer")
        self._files.append(_File(path.name, self._pool.submit(work), time.monotonic(), sentence))

    def finished(self) -> str | None:
        """The sentence of the next file that is there. Raises what its writing raised, `UserError` for a place that
        cannot be written."""
        if not self._files or not self._files[0].future.done():
            return None
        file = self._files.popleft()
        file.future.result()
        return file.sentence

    def release(self) -> list[str]:
        """Wait until everything is written; sentences about what could not be."""
        problems = []
        while self._files:
            with suppress(Exception):  # a fault of the program: the next file may succeed
                self._files[0].future.exception()
            try:
                self.finished()
            except UserError as error:
                problems.append(str(error))
            except Exception as error:  # noqa: BLE001 - likewise
                problems.append(f"a file was not written ({type(error).__name__}: {error})")
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None
        return problems
