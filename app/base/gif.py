"""A GIF: for places that show no movies. 256 colours a frame, and times in hundredths of a second."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .atomic import atomic_output, check_writable
from .film import Film

if TYPE_CHECKING:
    from PIL import Image

SHORTEST_CS = 2
"""Frames that are shown for less are slowed down by browsers."""


class Gif(Film):
    """A sink of frames (`movie.Sink`); the file appears when it is closed. Its frames are kept until then, a byte a
    pixel."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        """Raises `UserError` where the place cannot be written."""
        check_writable(path)
        super().__init__(size)
        self._path, self._fps = path, fps
        self._frames: list[Image.Image] = []

    def write(self, index: int, codes: np.ndarray) -> None:
        """Append a frame, in the 256 colours that suit it, dithered."""
        from PIL import Image

        self._check(codes)
        self._frames.append(Image.fromarray(codes).quantize(256, dither=Image.Dither.FLOYDSTEINBERG))

    def close(self) -> None:
        """Write the file; without a frame nothing appears."""
        frames, self._frames = self._frames, []
        if not frames:
            return
        with atomic_output(self._path) as temporary:
            frames[0].save(
                temporary,
                format="GIF",
                save_all=True,
                append_images=frames[1:],
                duration=durations_ms(len(frames), self._fps),
                loop=0,
            )


def durations_ms(count: int, fps: float) -> list[int]:
    """Of each frame, milliseconds in whole hundredths of a second, whose sum keeps pace."""
    step = max(100.0 / fps, SHORTEST_CS)
    ends = np.round(step * np.arange(count + 1)).astype(int)
    return [10 * int(each) for each in np.diff(ends)]
