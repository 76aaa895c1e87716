"""The scenes of the start page with their thumbnails, which another process renders one by one where they lack one.

Shipped scenes come with a picture. Any other thumbnail is kept in the config folder under a name made of the scene's
content, so it is rendered once. The process runs at the lowest priority: neither its start nor a broken scene can hold
up the interface.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import files
from ..base.paths import assets_dir
from ..base.version import __version__
from .view_model import SceneEntry

if TYPE_CHECKING:
    import moderngl

    from ..gpu.context import Context

SIZE = (320, 180)
PHOTONS = "400k"
PATIENCE_S = 120.0
FOLDER = "thumbnails"
BEST = (
    "default",
    "brilliant",
    "crystal_ball",
    "wine_glass",
    "prism",
    "brilliant_studio",
    "spectrum",
    "lens_text",
    "water",
    "ripples",
)
"""What the start page begins with: by name it would begin with a grey achromat, and first cards are what is clicked."""

Render = Callable[[Path, Path], "subprocess.Popen[bytes]"]


@dataclass
class _Job:
    index: int
    process: subprocess.Popen[bytes]
    part: Path
    target: Path
    started_s: float


class Gallery:
    """Owns the thumbnails' textures. `scenes`: name → file."""

    def __init__(
        self, context: Context, config: Path, scenes: Mapping[str, Path], render: Render | None = None
    ) -> None:
        self._ctx = context.ctx
        self._folder = config / FOLDER
        self._render = render or _render
        self._textures: list[moderngl.Texture] = []
        self._job: _Job | None = None
        self.entries = tuple(_entry(name, path) for name, path in scenes.items())
        self._waiting = list(range(len(self.entries)))
        """To be looked for, before any is rendered: one that takes long would hold up pictures that are there."""
        self._missing: list[int] = []
        """To be rendered."""

    @property
    def is_busy(self) -> bool:
        """A thumbnail is being rendered or read."""
        return self._job is not None or bool(self._waiting or self._missing)

    def step(self) -> None:
        """A little of the work, between frames: take what is finished, start the next."""
        if self._job is not None:
            self._look_after(self._job)
        elif self._waiting:
            index = self._waiting.pop(0)
            path = self.entries[index].path
            target = self._thumbnail(path)
            if not any(self._show(index, picture) for picture in (*_shipped_pictures(path), target)):
                self._missing.append(index)
        elif self._missing:
            index = self._missing.pop(0)
            self._start(index, self._thumbnail(self.entries[index].path))

    def pause(self) -> None:
        """Nothing more for now: somebody works on a scene, whose light needs the processor. What is half done is done
        again."""
        if self._job is not None:
            self._missing.insert(0, self._job.index)
            self._stop(self._job)

    def _start(self, index: int, target: Path) -> None:
        part = target.with_suffix(".part.png")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            process = self._render(self.entries[index].path, part)
        except OSError:  # no thumbnail is no harm
            return
        self._job = _Job(index, process, part, target, time.monotonic())

    def _look_after(self, job: _Job) -> None:
        if job.process.poll() is None:
            if time.monotonic() - job.started_s > PATIENCE_S:
                self._stop(job)
            return
        self._job = None
        with suppress(OSError):
            if job.process.returncode == 0:
                os.replace(job.part, job.target)
                self._show(job.index, job.target)
            else:
                job.part.unlink(missing_ok=True)

    def _stop(self, job: _Job) -> None:
        job.process.kill()
        job.process.wait()
        self._job = None
        with suppress(OSError):
            job.part.unlink(missing_ok=True)

    def _show(self, index: int, path: Path) -> bool:
        """Put the picture at `path` into a texture; False when it is not there or broken."""
        from PIL import Image

        try:
            files.check_regular(path, files.SETTINGS_BYTES)
            with Image.open(path) as image:
                image.thumbnail((2 * SIZE[0], 2 * SIZE[1]))
                rgba = image.convert("RGBA")
        except (OSError, ValueError):
            return False
        texture = self._ctx.texture(rgba.size, 4, rgba.tobytes())
        self._textures.append(texture)
        entry = replace(self.entries[index], thumbnail=texture.glo, thumbnail_size=rgba.size)
        self.entries = (*self.entries[:index], entry, *self.entries[index + 1 :])
        return True

    def _thumbnail(self, scene: Path) -> Path:
        try:
            content = files.read_bytes(scene, files.SCENE_BYTES)
        except OSError:
            content = b""
        key = hashlib.sha256(f"{__version__} {SIZE} {PHOTONS}".encode() + content).hexdigest()[:16]
        return self._folder / f"{scene.stem}-{key}.png"

    def release(self) -> None:
        """Free the textures and end the process."""
        if self._job is not None:
            self._stop(self._job)
        for texture in self._textures:
            texture.release()
        self._textures.clear()
        self._waiting.clear()
        self._missing.clear()


def best_first(scenes: Mapping[str, Path]) -> dict[str, Path]:
    """`scenes`, those of `BEST` first; the rest in the order they come in."""
    known = [name for name in BEST if name in scenes]
    return {name: scenes[name] for name in (*known, *(name for name in scenes if name not in BEST))}


def _shipped_pictures(scene: Path) -> tuple[Path, ...]:
    """Where the picture that comes with a shipped scene would be."""
    assets = assets_dir()
    if scene.parent != assets / "scenes":
        return ()
    return tuple(assets / "gallery" / f"{scene.stem}{suffix}" for suffix in (".png", ".jpg"))


def _entry(name: str, path: Path) -> SceneEntry:
    """Title from the file's `name`, description from the comment it opens with."""
    try:
        text = files.read_text(path, files.SCENE_BYTES)
        title = str(tomllib.loads(text).get("name", name))
    except (OSError, ValueError, RecursionError):
        return SceneEntry(path, name, "", None)
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    # Names stand in backticks there.
    return SceneEntry(path, title[:1].upper() + title[1:], " ".join(lines).replace("`", ""), None)


def _render(scene: Path, output: Path) -> subprocess.Popen[bytes]:
    """Start rendering a thumbnail."""
    size = f"{SIZE[0]}x{SIZE[1]}"
    command = [sys.executable, "-P", "-m", "spectrasplat", "render", str(scene), "-o", str(output)]
    command += ["--size", size, "--photons", PHOTONS, "--spp", "4"]
    # One thread: the others belong to the window.
    environment = os.environ | {"LP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    silent = subprocess.DEVNULL
    lowest_priority = (lambda: os.nice(19)) if os.name == "posix" else None
    return subprocess.Popen(
        command, env=environment, stdin=silent, stdout=silent, stderr=silent, preexec_fn=lowest_priority
    )
