"""Functions as machine code: how the reference's inner loops are compiled."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..base import compiling

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}
NONE, FIRST, NO = np.int64(-1), np.int64(0), np.bool_(False)
"""What a loop begins with. Of a literal numba would compile all that is called with it once more for that literal."""
_VERSION = compiling.version_of(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))


def compiled(function: Callable, **more: Any) -> Callable:
    """`function` as machine code.

    References are not counted: a scene is some sixty arrays, and counting them took 60 % of a path's time. So nothing
    may be allocated inside; scratch comes from the caller.
    """
    return compiling.compiled(function, _VERSION, **_OPTIONS, **more)


def inlined(function: Callable) -> Callable:
    """`compiled` for compiled functions alone, and inlined into them: arrays are not passed at every call."""
    return compiled(function, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
