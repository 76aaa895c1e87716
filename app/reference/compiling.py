"""Functions as machine code: how the reference's inner loops are compiled."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}


def _sources() -> str:
    """Hash of this folder's code."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


_VERSION = _sources()


def compiled(function: Callable, **more: Any) -> Callable:
    """`function` as machine code, kept on disk where some folder can be written (else compiled anew each run).

    References are not counted: a scene is some sixty arrays, and counting them took 60 % of a path's time. So nothing
    may be allocated inside; scratch comes from the caller.
    """
    # numba looks at the function's own file only, and would go on with what it inlined of another's older version.
    function.__qualname__ += f"_{_VERSION}"
    try:
        return njit(cache=True, **_OPTIONS, **more)(function)
    except RuntimeError:  # numba: no folder for the cache
        return njit(**_OPTIONS, **more)(function)


def inlined(function: Callable) -> Callable:
    """`compiled`, and put into its callers: arrays are not handed over at every call."""
    return compiled(function, forceinline=True)
