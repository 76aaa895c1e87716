"""An animated WebP: plays where a GIF does, in all colours and a fraction of the bytes.

Each frame is compressed by Pillow as it comes, so that neither a pile of frames nor a long end waits for the last one,
and put into the container here. <https://developers.google.com/speed/webp/docs/riff_container>
"""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np

from .atomic import atomic_output, check_writable
from .errors import UserError
from .film import Film

LARGEST_SIDE = 16383
"""What the format can say."""
SHORTEST_MS = 11
"""Frames that are shown for less are slowed down by browsers."""
QUALITY = 90
_ANIMATED, _NO_BLENDING = 0x02, 0x02
_FRAME_CHUNKS = (b"VP8 ", b"VP8L")


class WebpFilm(Film):
    """A sink of frames (`movie.Sink`); the file appears when it is closed. Until then its frames are kept as they are
    compressed."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        """Raises `UserError` where the place cannot be written, or the pictures are too large for WebP."""
        check_size(path, size)
        check_writable(path)
        super().__init__(size)
        self._path, self._fps = path, fps
        self._frames: list[bytes] = []

    def write(self, index: int, codes: np.ndarray) -> None:
        """Append a frame."""
        from PIL import Image

        self._check(codes)
        into = io.BytesIO()
        Image.fromarray(codes).save(into, format="WEBP", quality=QUALITY, method=4)
        self._frames.append(_bitstream(into.getvalue()))

    def close(self) -> None:
        """Write the file; without a frame nothing appears."""
        frames, self._frames = self._frames, []
        if not frames:
            return
        sides = _three_bytes(self._size[0] - 1) + _three_bytes(self._size[1] - 1)
        chunks = [
            _chunk(b"VP8X", bytes([_ANIMATED, 0, 0, 0]) + sides),
            _chunk(b"ANIM", struct.pack("<IH", 0, 0)),  # on nothing, for ever
        ]
        for frame, shown_ms in zip(frames, durations_ms(len(frames), self._fps), strict=True):
            header = bytes(6) + sides + _three_bytes(shown_ms) + bytes([_NO_BLENDING])
            chunks.append(_chunk(b"ANMF", header + frame))
        length = 4 + sum(len(chunk) for chunk in chunks)
        if length > 0xFFFFFFFE:
            raise UserError(f"cannot write {self._path}: a WebP holds 4 GB at most; use .mp4, or a folder for PNGs")
        with atomic_output(self._path) as temporary, temporary.open("wb") as file:
            file.write(b"RIFF" + struct.pack("<I", length) + b"WEBP")
            for chunk in chunks:
                file.write(chunk)


def check_size(path: Path, size: tuple[int, int]) -> None:
    """Raise `UserError` where a WebP cannot be as large."""
    if max(size) > LARGEST_SIDE:
        raise UserError(
            f"cannot write {path}: a WebP has at most {LARGEST_SIDE} pixels a side, not {size[0]}×{size[1]}; "
            "choose a smaller size or another format"
        )


def durations_ms(count: int, fps: float) -> list[int]:
    """Of each frame, whole milliseconds, whose sum keeps pace."""
    ends = np.round(max(1000.0 / fps, SHORTEST_MS) * np.arange(count + 1)).astype(int)
    return [int(each) for each in np.diff(ends)]


def _bitstream(still: bytes) -> bytes:
    """The chunk of a still WebP that holds its pixels."""
    at = 12
    while at + 8 <= len(still):
        name, size = struct.unpack_from("<4sI", still, at)
        end = at + 8 + size + size % 2
        if name in _FRAME_CHUNKS:
            return still[at:end]
        at = end
    raise ValueError("Pillow wrote a WebP without pixels")


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + bytes(len(content) % 2)


def _three_bytes(value: int) -> bytes:
    return struct.pack("<I", value)[:3]
