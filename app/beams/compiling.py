"""The search's functions as machine code."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}
"""References are not counted, so nothing may be allocated inside: scratch comes from the caller (`search.WORK`)."""


def _sources() -> str:
    """Hash of the compiled code of this folder."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        text = path.read_bytes()
        if b"import jit" in text or b"import part" in text or b", jit" in text or b", part" in text:
            digest.update(text)
    return digest.hexdigest()[:12]


_VERSION = _sources()


def jit(function: Callable, **more: Any) -> Callable:
    """`function` as machine code, kept on disk where some folder can be written (else compiled anew each run)."""
    # numba looks at the function's own file only, and would go on with what it linked of another's older version.
    function.__qualname__ += f"_{_VERSION}"
    try:
        return njit(cache=True, **_OPTIONS, **more)(function)
    except RuntimeError:  # numba: no folder for the cache
        return njit(**_OPTIONS, **more)(function)


def part(function: Callable) -> Callable:
    """The same for what compiled functions alone call: neither wrapped for Python nor kept on disk by itself."""
    options: dict[str, Any] = _OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return njit(**options)(function)
