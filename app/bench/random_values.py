"""Values that scenes drawn by chance are made of: with as many digits as their files have."""

from __future__ import annotations

from typing import Any

import numpy as np

Values = dict[str, Any]
"""Tables of a scene file."""
_DIGITS = 4


def rounded(value: float) -> float:
    return round(float(value), _DIGITS)


def between(rng: np.random.Generator, low: float, high: float) -> float:
    return rounded(rng.uniform(low, high))


def vector(values: np.ndarray) -> list[float]:
    return [rounded(v) for v in values]


def chance(rng: np.random.Generator, share: float) -> bool:
    return bool(rng.random() < share)
