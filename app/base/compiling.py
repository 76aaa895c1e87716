"""Functions as machine code, kept on disk from one run to the next where that can be.

`compiled` imports numba (0.4 s): only what is imported when it must truly compute may use it at its top.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from typing import Any


def compiled(function: Callable, version: str = "", **options: Any) -> Callable:
    """`function` as machine code, kept on disk where some folder can be written (else compiled anew each run).

    `version`: of the compiled functions in other files that it calls, from `version_of`. numba looks at the
    function's own file only, and would go on with what it linked of another's older version. `options`: numba's.
    """
    from numba import njit

    if version:
        function.__qualname__ += f"_{version}"
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # numba: no folder for the cache
        return njit(**options)(function)


def version_of(sources: Iterable[bytes]) -> str:
    """Twelve digits that change with the text of some source files."""
    digest = hashlib.sha256()
    for text in sources:
        digest.update(text)
    return digest.hexdigest()[:12]
