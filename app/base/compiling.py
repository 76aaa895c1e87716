"""Functions as machine code, kept on disk from one run to the next where that can be.

`compiled` imports numba (0.4 s): only what is imported when it must truly compute may use it at its top.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

_PLACES = f"{__package__}.compiled_place.ByContent,InTreeCacheLocator"


def compiled(function: Callable, version: str = "", **options: Any) -> Callable:
    """`function` as machine code, kept on disk where some folder can be written (else compiled anew each run).

    `version`: of the compiled functions in other files that it calls, from `version_of`; empty where all are in its
    own. numba looks at the function's own file only, and would go on with what it linked of another's older version.
    `options`: numba's.
    """
    from numba import config, njit

    function.__qualname__ += f"_{version or version_of([Path(function.__code__.co_filename).read_bytes()])}"
    settings = vars(config)
    places = settings.get("CACHE_LOCATOR_CLASSES", "")  # older ones know none
    settings["CACHE_LOCATOR_CLASSES"] = _PLACES
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # numba: no folder for the cache
        return njit(**options)(function)
    finally:
        settings["CACHE_LOCATOR_CLASSES"] = places


def version_of(sources: Iterable[bytes]) -> str:
    """Twelve digits that change with the text of some source files."""
    digest = hashlib.sha256()
    for text in sources:
        digest.update(text)
    return digest.hexdigest()[:12]
