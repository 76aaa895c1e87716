"""Files in the user's cache folder that can be made again: packed, checked when they are read, bounded in size.

A folder that cannot be read or written, and a damaged file, only cost time.
"""

from __future__ import annotations

import hashlib
import os
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from . import files, paths
from .atomic import atomic_output
from .errors import UserError

_SUFFIX = ".kept"
_DIGEST_BYTES = 32


@dataclass(frozen=True)
class KeptFiles:
    """Those of one folder; the least recently used ones are forgotten."""

    folder: str
    """In the user's cache folder, or a whole path."""
    largest: int
    """Bytes of one, packed and unpacked."""
    most_files: int | None = None
    most_bytes: int | None = None
    """Bytes of all of them, packed."""
    level: int = 1
    """zlib's, 0 to 9: 0 for what is large and hardly gets smaller."""

    def load(self, key: str) -> bytes | None:
        """What was saved under `key`, whole; else None."""
        try:
            path = self._path(key)
            unpacker = zlib.decompressobj()
            content = unpacker.decompress(files.read_bytes(path, self.largest), self.largest)
        except (OSError, UserError, zlib.error):
            return None
        digest, content = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if not unpacker.eof or hashlib.sha256(content).digest() != digest:
            return None
        with suppress(OSError):
            os.utime(path)
        return content

    def save(self, key: str, content: bytes) -> None:
        """Keep it, where the disk allows."""
        if len(content) > self.largest - _DIGEST_BYTES:
            return
        with suppress(OSError, UserError):
            path = self._path(key)
            with atomic_output(path, lasting=False) as temporary:
                temporary.write_bytes(zlib.compress(hashlib.sha256(content).digest() + content, self.level))
            paths.forget_oldest(path.parent, _SUFFIX, files=self.most_files, size=self.most_bytes)

    def _path(self, key: str) -> Path:
        folder = paths.cache_dir() / self.folder
        folder.mkdir(parents=True, exist_ok=True)
        return folder / (key + _SUFFIX)
