"""A part of a rendering as a file (.ssp): a zip archive of its header and the sums of its maps."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from .parts import Part, PartHeader, Share

SUFFIX = ".ssp"
FORMAT = 2
_HEADER = "part.json"
_HEADER_BYTES = 1 << 20
_MAX_SIDE = 1 << 15
_MAX_TARGETS = 64


def write_part(path: Path, part: Part) -> None:
    """Write a part, whole or not at all. Raises `UserError` where it cannot be written."""
    with atomic_output(path) as temporary:
        _write(temporary, part)


def part_bytes(part: Part) -> bytes:
    """What `write_part` would write, for another process to write."""
    into = io.BytesIO()
    _write(into, part)
    return into.getvalue()


def write_part_bytes(path: Path, data: bytes) -> None:
    """Write what `part_bytes` gave elsewhere, whole or not at all. Raises `UserError` where it cannot be written."""
    with atomic_output(path) as temporary:
        temporary.write_bytes(data)


def _write(into: Path | io.BytesIO, part: Part) -> None:
    with zipfile.ZipFile(into, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(_HEADER, json.dumps({"format": FORMAT} | asdict(part.header)))
        for number, texels in enumerate(part.sums):
            archive.writestr(f"sums{number}", texels.tobytes())


def read_header(path: Path) -> PartHeader:
    """The header of a part. Raises `UserError` where it is none, or not whole."""
    try:
        files.check_regular(path, files.DATA_BYTES)
        with zipfile.ZipFile(path) as archive:
            if archive.getinfo(_HEADER).file_size > _HEADER_BYTES:
                raise ValueError("its header is too long")
            values = json.loads(archive.read(_HEADER))
            if values.pop("format") != FORMAT:
                raise ValueError("it is of another version of this program")
            share = Share(**values.pop("share"))
            lists = {"share": share, "size": tuple(values["size"]), "others": tuple(values["others"])}
            header = PartHeader(**values | lists)
            width, height = header.size
            if not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE and 0 < header.targets <= _MAX_TARGETS):
                raise ValueError("its maps are of impossible size")
            if not all(isinstance(index, int) and 1 <= index <= share.count for index in header.indices):
                raise ValueError("it is no part of anything")
            if len(set(header.indices)) < len(header.indices):
                raise ValueError("it counts a part twice")
            header.light_stats()
            for number in range(header.targets):
                if archive.getinfo(f"sums{number}").file_size != 16 * width * height:
                    raise ValueError("its maps are not whole")
        return header
    except _BAD as error:
        raise _refusal(path, error) from error


def merged_sums(paths: Sequence[Path], header: PartHeader) -> Iterator[np.ndarray]:
    """For each texture the sum over all parts, added in float64: float32 (height, width, 4). Raises `UserError`."""
    width, height = header.size
    for number in range(header.targets):
        total = np.zeros((height, width, 4))
        for path in paths:
            total += read_sums(path, header, number)
        yield total.astype(np.float32)


def read_sums(path: Path, header: PartHeader, number: int) -> np.ndarray:
    """A part's sums in texture `number`: float32 (height, width, 4). Raises `UserError` where they are damaged."""
    width, height = header.size
    try:
        with zipfile.ZipFile(path) as archive:
            return np.frombuffer(archive.read(f"sums{number}"), np.float32).reshape(height, width, 4)
    except _BAD as error:
        raise _refusal(path, error) from error


_BAD = (OSError, EOFError, ValueError, KeyError, TypeError, AttributeError, NotImplementedError, RuntimeError,
        RecursionError, zipfile.BadZipFile, zlib.error)  # fmt: skip


def _refusal(path: Path, error: Exception) -> UserError:
    reason = files.reason_of(error) if isinstance(error, OSError) else "it is cut short, damaged, or something else"
    if isinstance(error, ValueError) and not isinstance(error, UnicodeDecodeError | json.JSONDecodeError):
        reason = str(error)
    return UserError(f"{path} is no whole part of a rendering ({reason}): render that part again")
