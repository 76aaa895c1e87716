"""Shapes by everyday names that are special cases of others: each function gives the other shape's keys.

They are met, saved and drawn as those others, so nothing else has to know them. All are centred on the origin with
their axis along z.
"""

from __future__ import annotations

import math
from typing import Any

from .primitives_check import positive

SPECIAL = ("cylinder", "cone", "dome")


def cylinder(radius: float = 0.5, length: float = 1.0) -> dict[str, Any]:
    """A round rod with flat ends."""
    radius, half = positive("cylinder", "radius", radius), 0.5 * positive("cylinder", "length", length)
    return {"shape": "revolution", "profile": [[0.0, -half], [radius, -half], [radius, half], [0.0, half]]}


def cone(radius: float = 0.5, length: float = 1.0) -> dict[str, Any]:
    """A round cone with a flat base, its tip up."""
    radius, half = positive("cone", "radius", radius), 0.5 * positive("cone", "length", length)
    return {"shape": "revolution", "profile": [[0.0, -half], [radius, -half], [0.0, half]]}


def dome(radius: float = 0.5) -> dict[str, Any]:
    """Half a ball, its flat side down."""
    radius = positive("dome", "radius", radius)
    return {"shape": "lens", "radius1": math.inf, "radius2": -radius, "thickness": radius, "diameter": 2.0 * radius}
