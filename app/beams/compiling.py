"""The functions of this folder as machine code."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

from ..base.compiling import compiled, version_of

_ALLOCATING: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
_OPTIONS: dict[str, Any] = _ALLOCATING | {"_nrt": False}
"""References are not counted, so nothing may be allocated inside: scratch comes from the caller (`search.WORK`)."""

_TEXTS = (path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
_VERSION = version_of(text for text in _TEXTS if b"from .compiling import" in text)


def jit(function: Callable) -> Callable:
    """`function` as machine code, which calls no function that allocates."""
    return compiled(function, _VERSION, **_OPTIONS)


def part(function: Callable) -> Callable:
    """The same for what compiled functions alone call: neither wrapped for Python nor kept on disk by itself."""
    options: dict[str, Any] = _OPTIONS | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return njit(**options)(function)


def allocating(function: Callable) -> Callable:
    """`function` as machine code, which makes arrays."""
    return compiled(function, _VERSION, **_ALLOCATING)
