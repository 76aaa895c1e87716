"""Where numba keeps machine code: in the user's cache folder, so that every clone of the same source finds it.

Imports numba (0.4 s); `compiling` names the class to it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from numba import config
from numba.core.caching import UserWideCacheLocator

from . import paths

_MOST_BYTES = 256 << 20
"""References of one version take 10 MiB."""
_MOST_INDICES = 8192


class ByContent(UserWideCacheLocator):
    """All functions in one folder: `compiling` puts the version of their source into their names."""

    def get_cache_path(self) -> str:
        return _folder()

    def get_source_stamp(self) -> str:
        return ""  # the name says it


@cache
def _folder() -> str:
    folder = Path(vars(config)["CACHE_DIR"] or paths.cache_dir()) / "compiled"
    folder.mkdir(parents=True, exist_ok=True)
    paths.forget_oldest(folder, ".nbc", size=_MOST_BYTES)
    paths.forget_oldest(folder, ".nbi", files=_MOST_INDICES)
    return str(folder)
