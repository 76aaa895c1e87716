"""What every stress case needs to judge its errors: rounding units, worst offenders, and counts of what is not
finite."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

EPSILON = float(np.finfo(np.float32).eps)
"""float32's spacing at 1, 2⁻²³; one rounding errs by at most half of it, relatively."""


def worst(error: np.ndarray, bound: np.ndarray | float) -> tuple[float, float]:
    """(error, its bound) of the row (N,) that comes closest to its bound, or exceeds it most.

    An error that is not finite is the worst there is.
    """
    error = np.asarray(error, np.float64).ravel()
    bound = np.broadcast_to(np.asarray(bound, np.float64), error.shape)
    finite = np.isfinite(error)
    if not finite.all():
        return float("inf"), float(bound[np.argmin(finite)])
    at = int(np.argmax(error / np.maximum(bound, 1e-300)))
    return float(error[at]), float(bound[at])


def judged(rows: Mapping[str, tuple[np.ndarray, np.ndarray | float]]) -> tuple[dict[str, float], dict[str, float]]:
    """(errors, bounds) of a `Measurement` from {name: (error of each row, bound of each row)}; what has no row is left
    out."""
    pairs = {name: worst(error, bound) for name, (error, bound) in rows.items() if np.size(error)}
    return {name: pair[0] for name, pair in pairs.items()}, {name: pair[1] for name, pair in pairs.items()}


def not_finite(arrays: Iterable[np.ndarray]) -> int:
    """How many values are NaN or infinite."""
    return sum(int(np.count_nonzero(~np.isfinite(a))) for a in arrays)


def not_finite_in(records: np.ndarray) -> int:
    """How many floating point values of structured records are NaN or infinite."""
    assert records.dtype.names is not None
    return not_finite(records[name] for name in records.dtype.names if records.dtype[name].base.kind == "f")


def length(vectors: np.ndarray) -> np.ndarray:
    """Euclidean length over the last axis."""
    return np.linalg.norm(vectors, axis=-1)
