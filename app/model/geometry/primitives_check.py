"""Range checks of the primitives' dimensions, each failure one sentence."""

from __future__ import annotations

import math

from ...base.errors import UserError

MAX_TRIANGLES = 4_000_000
"""Of one shape: making twice as many takes more than 2 GiB."""


def positive(shape: str, key: str, value: float) -> float:
    """`value` as a float, finite and greater than zero."""
    value = float(value)
    if not (math.isfinite(value) and value > 0.0):
        raise UserError(f"{shape}: {key} must be a number greater than 0, not {value:g}")
    return value


def in_range(shape: str, key: str, value: float, low: float, high: float) -> float:
    """`value` as a float, strictly between `low` and `high`."""
    value = float(value)
    if not low < value < high:
        raise UserError(f"{shape}: {key} must lie between {low:g} and {high:g}, not {value:g}")
    return value


def count(shape: str, key: str, value: int, low: int, high: int = MAX_TRIANGLES) -> int:
    """`value` as an int, from `low` to `high` inclusive."""
    if int(value) != value or not low <= value <= high:
        raise UserError(f"{shape}: {key} must be a whole number from {low} to {high}, not {value:g}")
    return int(value)
