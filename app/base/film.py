"""What all sinks of frames that become one file have in common (`movie.Sink`)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


class Film:
    """Frames of one size, in one file that cannot be resumed."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size

    def has(self, index: int) -> bool:
        """It cannot be resumed."""
        return False

    @contextmanager
    def claimed(self, index: int) -> Iterator[bool]:
        """Nobody else writes it."""
        yield True

    def _check(self, codes: np.ndarray) -> None:
        """Raise ValueError where `codes` is no frame."""
        width, height = self._size
        if codes.shape != (height, width, 3) or codes.dtype != np.uint8:
            raise ValueError(f"a frame is uint8 {(height, width, 3)}, got {codes.dtype} {codes.shape}")
