"""The parts of one picture that are done, in a folder beside it: what a farm that was stopped goes on from."""

from __future__ import annotations

import os
import shutil
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..base.atomic import make_output_folder
from ..base.errors import UserError
from ..base.locks import locked
from ..render.part_file import SUFFIX, read_header, read_sums, write_part_bytes
from ..render.parts import PartHeader, Share

_LOCK = ".farm"
PREVIEW = "preview.png"


@contextmanager
def held(folder: Path, output: Path) -> Iterator[None]:
    """Make the folder and hold it. Raises `UserError` where another process does, or it cannot be made."""
    make_output_folder(folder)
    lock = folder / _LOCK
    with ExitStack() as stack:
        try:
            is_ours = stack.enter_context(locked(lock, wait=False))
        except OSError as error:
            raise UserError(f"cannot write in {folder}: {error.strerror}; choose another place") from error
        if not is_ours:
            raise UserError(f"another farm is at work on {output} ({_who(lock)}): wait for it, or choose another -o")
        now = time.strftime("%H:%M", time.localtime())
        with suppress(OSError):  # a disk that is full is told of when a part is written
            lock.write_text(f"process {os.getpid()} on {socket.gethostname()} since {now}", encoding="utf-8")
        try:
            yield
        finally:
            with suppress(OSError):
                lock.unlink(missing_ok=True)
                folder.rmdir()  # where nothing was kept in it


def _who(lock: Path) -> str:
    try:
        told = lock.read_bytes()[:200].decode("utf-8", errors="replace").strip()
    except OSError:
        told = ""
    return told or "another process"


def _read(path: Path) -> tuple[PartHeader, list[np.ndarray]]:
    """A part with its sums, whole; raises `UserError` otherwise."""
    header = read_header(path)
    return header, [read_sums(path, header, number) for number in range(header.targets)]


@dataclass
class PartFolder:
    """Parts of one rendering and the sum of them all."""

    folder: Path
    key: str
    """Of the rendering."""
    headers: list[PartHeader] = field(default_factory=list)
    """Of what is summed up."""
    indices: set[int] = field(default_factory=set)
    """Of all parts in that."""
    sums: list[np.ndarray] = field(default_factory=list)
    """Float64 (height, width, 4) for every texture."""
    size_bytes: int = 0
    """Of all files."""
    seconds: float = 0.0
    """Spent on writing, reading and adding."""

    def take_up(self, note: Callable[[str], None]) -> None:
        """Add what an earlier farm left. Parts that are not whole are told of and traced again. Raises `UserError`
        where the folder holds parts of another rendering."""
        for path in sorted(self.folder.glob(f"*{SUFFIX}")):
            try:
                header, found = _read(path)
            except UserError as error:
                note(f"{error}; that is done now")
                path.unlink(missing_ok=True)
                continue
            if header.key != self.key:
                raise UserError(
                    f"{self.folder} holds parts of another rendering, of '{header.name}' or with other settings: "
                    "remove it, or choose another -o"
                )
            self._add(path, header, found)

    @property
    def count(self) -> int | None:
        """Parts in all, where that is settled; None before the first."""
        return next((header.share.count for header in self.headers), None)

    def put(self, share: Share, data: bytes) -> None:
        """Keep a part that a worker has traced, and add it. Raises `UserError`, also where the disk is full."""
        started = time.perf_counter()
        path = self.folder / f"part{share.index:0{len(str(share.count))}}of{share.count}{SUFFIX}"
        write_part_bytes(path, data)
        header, found = _read(path)
        if (header.key, header.indices, header.share) != (self.key, (share.index,), share):
            path.unlink()
            raise UserError("a worker traced something else than it was asked for: install one version everywhere")
        self._add(path, header, found)
        self.seconds += time.perf_counter() - started

    def _add(self, path: Path, header: PartHeader, found: list[np.ndarray]) -> None:
        if not set(header.indices).isdisjoint(self.indices):
            return
        first = next(iter(self.headers), header)
        if (header.share.count, header.rounds, header.layout, header.size, header.targets) != (
            (first.share.count, first.rounds, first.layout, first.size, first.targets)
        ):
            raise UserError(
                f"{path} was traced by '{header.renderer}' and does not fit to what '{first.renderer}' traced: give "
                "workers of one kind, and the same --batch as before"
            )
        self.sums = self.sums or [np.zeros(texels.shape) for texels in found]
        for total, texels in zip(self.sums, found, strict=True):
            total += texels
        self.headers.append(header)
        self.indices |= set(header.indices)
        self.size_bytes += path.stat().st_size

    def merged(self) -> tuple[list[PartHeader], list[np.ndarray]]:
        """What a picture is made of: headers and float32 sums."""
        return list(self.headers), [total.astype(np.float32) for total in self.sums]

    def remove(self) -> None:
        """The picture is written: nothing of this is needed any more."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def leave(self) -> str:
        """What is kept, in words."""
        if self.headers:
            return f"{len(self.indices)} of {self.count} parts are kept in {self.folder}"
        with suppress(OSError):
            (self.folder / PREVIEW).unlink(missing_ok=True)
        return "no part was done yet"
