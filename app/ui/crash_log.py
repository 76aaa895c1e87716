"""What went wrong unexpectedly, written down for a bug report; the interface continues.

One file in the config folder, appended to, and cut to its newest part when it grows.
"""

from __future__ import annotations

import datetime
import platform
import sys
import traceback
from pathlib import Path

from ..base import files
from ..base.version import __version__

FILE_NAME = "crash.log"
MAX_BYTES = 256 * 1024


def write_crash(folder: Path, doing: str, error: BaseException, device: str) -> Path | None:
    """Append `error` with its traceback; `doing` names the action, `device` the renderer.

    Returns the file, or None where it cannot be written: a log must not fail in its turn.
    """
    path = folder / FILE_NAME
    when = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    head = f"--- {when} SpectraSplat {__version__}, Python {sys.version.split()[0]}, {platform.platform()}, {device}"
    entry = "\n".join([head, f"while: {doing}", "".join(traceback.format_exception(error))])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        before = files.read_bytes(path, files.SETTINGS_BYTES)[-MAX_BYTES:] if path.exists() else b""
        path.write_bytes(before + entry.encode("utf-8", "replace"))
    except OSError:
        return None
    return path
