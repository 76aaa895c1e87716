"""Colour scales for numbers shown as pictures: false-colour luminance and signed error, for shaders and legends alike.

Each is a short table of sRGB codes, interpolated linearly between entries as their authors define them.
"""

from __future__ import annotations

import numpy as np

from .tone_map import luminance

_BRIGHTEST = 0.998
"""Share of a signed picture whose colours are not full yet."""

FALSE_COLOUR = np.array(
    [
        (0.190, 0.072, 0.232),
        (0.251, 0.252, 0.634),
        (0.276, 0.421, 0.891),
        (0.259, 0.580, 0.999),
        (0.158, 0.736, 0.923),
        (0.093, 0.866, 0.762),
        (0.197, 0.949, 0.595),
        (0.428, 0.994, 0.386),
        (0.644, 0.990, 0.234),
        (0.805, 0.925, 0.205),
        (0.933, 0.812, 0.227),
        (0.993, 0.674, 0.203),
        (0.984, 0.493, 0.128),
        (0.921, 0.315, 0.055),
        (0.816, 0.185, 0.018),
        (0.664, 0.084, 0.004),
        (0.480, 0.016, 0.011),
    ]
)
"""Turbo (Mikhailov 2019), dark blue to dark red, sRGB (17, 3). It holds neither black nor white, which mark what is
below and above it."""

ERROR = np.array(
    [
        (0.621, 0.690, 1.000),
        (0.385, 0.652, 0.879),
        (0.198, 0.501, 0.649),
        (0.124, 0.321, 0.415),
        (0.069, 0.153, 0.196),
        (0.098, 0.047, 0.035),
        (0.214, 0.063, 0.001),
        (0.381, 0.126, 0.044),
        (0.589, 0.289, 0.214),
        (0.793, 0.482, 0.443),
        (1.000, 0.680, 0.680),
    ]
)
"""Berlin (Crameri 2018), sRGB (11, 3): blue is too dark, red too bright, and where there is no error it is nearly
black."""


def sample(table: np.ndarray, position: np.ndarray | float) -> np.ndarray:
    """sRGB colours (…, 3) at `position` (…,) in 0…1 along `table`; clamped."""
    place = np.clip(np.asarray(position, float), 0.0, 1.0) * (len(table) - 1)
    low = np.minimum(place.astype(int), len(table) - 2)
    share = (place - low)[..., None]
    return (1.0 - share) * table[low] + share * table[low + 1]


def glsl_table(table: np.ndarray) -> str:
    """The table as a GLSL array expression, for a define."""
    return f"vec3[{len(table)}](" + ", ".join(f"vec3({r:.4f}, {g:.4f}, {b:.4f})" for r, g, b in table) + ")"


def signed_codes(rgb: np.ndarray) -> np.ndarray:
    """sRGB codes uint8 (H, W, 3) of a change (H, W, 3), linear Rec.709: what becomes brighter is red, darker blue."""
    change = luminance(rgb)
    share = change / max(float(np.quantile(np.abs(change), _BRIGHTEST)), 1e-30)
    left = 1.0 - np.sqrt(np.clip(np.abs(share), 0.0, 1.0))
    up, down = np.where(share > 0.0, 1.0, left), np.where(share < 0.0, 1.0, left)
    return np.round(255.0 * np.stack([up, left, down], axis=-1)).astype(np.uint8)
