"""Autosave, so that work survives a crash: a changed scene is also written to the config folder, never to its own file.

Each running process has one autosave, which it removes when it ends normally. It holds a lock file next to it for as
long as it lives, so an autosave that the next start finds unlocked is left over from a crash (the process number alone
could since belong to another process).
"""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

import msgspec

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..base.locks import lock
from ..model.geometry.mesh import Mesh
from ..model.io.scene_file import load_scene
from ..model.io.scene_save import save_scene
from ..model.scene import Scene

INTERVAL_S = 30.0
_FOLDER = "autosave"


@dataclass(frozen=True)
class Note:
    """What is stored next to an autosaved scene, as JSON."""

    pid: int
    title: str
    original: str | None
    """The user's own scene file, which autosaving never changes; None: never saved."""
    saved_at: float
    """Seconds since 1970."""


@dataclass(frozen=True)
class Recovery:
    """An autosave whose process no longer runs."""

    path: Path
    """The scene (.toml)."""
    note: Note

    @property
    def original(self) -> Path | None:
        """The user's own scene file, None for a scene that was never saved."""
        return None if self.note.original is None else Path(self.note.original)

    @property
    def written(self) -> str:
        """When it was saved, in local time: "22 November 2026, 14:05"."""
        at = datetime.fromtimestamp(self.note.saved_at, UTC).astimezone()
        return f"{at.day} {at:%B %Y, %H:%M}"

    def load(self) -> Scene:
        """The scene, which no longer depends on the autosave's files. Raises UserError when it cannot be read."""
        with files.own_files():
            scene = load_scene(self.path)
        here = self.path.parent.resolve()
        own: dict[Mesh, Mesh] = {}
        for mesh in {item.mesh for item in scene.objects}:
            recipe = mesh.recipe or {}
            if "mesh" in recipe and Path(recipe["mesh"]).is_relative_to(here):
                # A new Mesh has no recipe, so it is saved as triangles, not as a reference to a file soon deleted.
                own[mesh] = replace(mesh, source=None)
        return replace(scene, objects=tuple(replace(o, mesh=own.get(o.mesh, o.mesh)) for o in scene.objects))

    def discard(self) -> None:
        """Delete the autosave."""
        _remove(self.path)


class Autosave:
    """Autosaves the scene of this process at intervals, on a thread of its own.

    `update` is called every frame and returns at once. Nothing here raises, since a failed autosave must not stop the
    work: `problem` says in one sentence what went wrong, or is None.
    """

    def __init__(
        self, folder: Path, interval_s: float = INTERVAL_S, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`folder`: the config folder."""
        self.problem: str | None = None
        self._interval_s = interval_s
        self._clock = clock
        self._folder = folder / _FOLDER
        self.path = self._folder / f"{os.getpid()}_{id(self):x}.toml"
        """The autosaved scene of this process; the file exists only while the scene has unsaved changes."""
        self._lock: IO[str] | None = None
        self._thread: threading.Thread | None = None
        self._written: Scene | None = None
        self._last_s = clock()

    def update(self, scene: Scene, title: str, original: Path | None, unsaved: bool) -> None:
        """Write `scene` if it is unsaved, has changed, and was last written at least `interval_s` ago."""
        if self._thread is not None and self._thread.is_alive():
            return
        if not unsaved:
            if self._written is not None:
                self.close()
            return
        now = self._clock()
        if scene is self._written or now - self._last_s < self._interval_s:
            return
        self._start(scene, title, original, now)

    def write_now(self, scene: Scene, title: str, original: Path | None) -> None:
        """Write at once and wait until it is done: after an error, an interruption or a recovery."""
        self.wait()
        if scene is not self._written:
            self._start(scene, title, original, self._clock())
            self.wait()

    def wait(self) -> None:
        """Wait until the autosave that is being written, if any, is on the disk."""
        if self._thread is not None:
            self._thread.join()

    def _start(self, scene: Scene, title: str, original: Path | None, now: float) -> None:
        self._written, self._last_s = scene, now
        note = Note(os.getpid(), title, None if original is None else str(original), time.time())
        # Scenes are immutable, so a thread may read one while the user edits.
        self._thread = threading.Thread(target=self._write, args=(scene, note), name="autosave", daemon=True)
        self._thread.start()

    def _write(self, scene: Scene, note: Note) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with files.own_files():  # refers to the scene's meshes and pictures in place
                save_scene(scene, self.path)
            if self._lock is None:
                self._lock = self.path.with_suffix(".lock").open("w", encoding="utf-8")
                lock(self._lock.fileno())
            with atomic_output(self.path.with_suffix(".json")) as temporary:
                temporary.write_bytes(msgspec.json.encode(note))
            self.problem = None
        except (OSError, UserError) as error:
            self.problem = f"The scene could not be autosaved: {error}."

    def close(self) -> None:
        """Remove the autosave: there is nothing to recover."""
        self.wait()
        if self._lock is not None:
            self._lock.close()
            self._lock = None
        _remove(self.path)
        self._written = None


def recoveries(folder: Path) -> tuple[Recovery, ...]:
    """Autosaves in the config folder `folder` whose process no longer runs, newest first; unreadable ones are left
    out."""
    found = []
    for entry in sorted((folder / _FOLDER).glob("*.json")):
        scene = entry.with_suffix(".toml")
        try:
            note = msgspec.json.decode(files.read_bytes(entry, files.SETTINGS_BYTES), type=Note)
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
            continue
        if scene.is_file() and not _is_held(entry.with_suffix(".lock")):
            found.append(Recovery(scene, note))
    return tuple(sorted(found, key=lambda recovery: -recovery.note.saved_at))


def _remove(path: Path) -> None:
    """Delete the autosave at `path` with its note, lock, meshes and pictures."""
    for each in (path.with_suffix(".json"), path, path.with_suffix(".lock")):
        with suppress(OSError):
            each.unlink()
    for what in ("meshes", "pictures"):
        shutil.rmtree(path.parent / f"{path.stem}_{what}", ignore_errors=True)


def _is_held(path: Path) -> bool:
    """Whether a running process holds the lock file `path`."""
    try:
        with path.open("r+", encoding="utf-8") as file:
            return lock(file.fileno()) is False
    except OSError:
        return False  # there is no lock file
