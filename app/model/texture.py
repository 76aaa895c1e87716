"""Pictures as data of a scene: what a diffuse surface wears, and what lies beyond everything.

Both are linear Rec.709 whose white is D65; where a renderer needs spectra it upsamples with
`colorimetry.rgb_basis`, which is linear, so that filtering and upsampling may be done in either order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface; compared by identity."""

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709 reflectance, 0 to 1; row 0 is the top (v = 1)."""
    wrap: Literal["repeat", "clamp"] = "repeat"
    source: str | None = None
    """Path of the file it came from."""


@dataclass(frozen=True, eq=False)
class Environment:
    """Radiance from infinitely far away, compared by identity.

    `rgb` is a latitude-longitude picture: rows run from straight up (row 0) to straight down, and with
    local = world_to_local @ direction a direction is seen at u = ½ − atan2(local_y, local_x) / 2π
    (column u·W), v = acos(local_z) / π (row v·H). So local x is the middle of the picture, local z is up.
    """

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709, lm/(sr unit²), finite and not negative."""
    world_to_local: np.ndarray = field(default_factory=lambda: np.eye(3))
    """float64 (3, 3), a rotation."""
    kind: Literal["map", "gradient", "sky", "constant"] = "map"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """What the scene file said under [environment], so that it can be saved again."""
    source: str | None = None
    """Path of the file it came from, for a map."""
    lights: bool = False
    """Whether it lights what is diffuse, besides being seen: scene files say yes, a bare picture does not."""
