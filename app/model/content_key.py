"""Hashes of what a picture depends on: equal content gives equal keys, whatever objects hold it."""

from __future__ import annotations

import hashlib

import numpy as np


class ContentKey:
    """SHA-256 over labelled values, in the order in which they are added."""

    def __init__(self, start: str = "") -> None:
        """`start`: a key that this one goes on from."""
        self._digest = hashlib.sha256(start.encode())

    def add(self, label: str, *values: object) -> None:
        """Arrays count by type, shape and content, everything else by its `repr`."""
        self._digest.update(f"\n{label}:".encode())
        for value in values:
            if isinstance(value, np.ndarray):
                self._digest.update(f"{value.dtype.str}{value.shape}".encode())
                self._digest.update(np.ascontiguousarray(value).data)
            else:
                self._digest.update(f"{value!r};".encode())

    def hexdigest(self) -> str:
        """The key so far, 64 hexadecimal digits."""
        return self._digest.hexdigest()
