"""The colours of the two themes: neutral greys, so that the caustic is what shines, and one accent."""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[float, float, float, float]
"""sRGB and opacity, 0 to 1."""


@dataclass(frozen=True)
class Palette:
    """The colours of one theme; panels take theirs from here."""

    is_dark: bool
    canvas: Colour
    """Behind the docked windows and around the picture."""
    window: Colour
    frame: Colour
    """Ground of fields, sliders and buttons."""
    raised: Colour
    """Title and menu bars, headers of tables."""
    border: Colour
    text: Colour
    muted: Colour
    accent: Colour
    warning: Colour
    """What is not physical, not saved or only approximate."""
    error: Colour
    good: Colour


DARK = Palette(
    is_dark=True,
    canvas=(0.055, 0.055, 0.055, 1.0),
    window=(0.115, 0.115, 0.115, 1.0),
    frame=(0.190, 0.190, 0.190, 1.0),
    raised=(0.150, 0.150, 0.150, 1.0),
    border=(0.260, 0.260, 0.260, 1.0),
    text=(0.880, 0.880, 0.880, 1.0),
    muted=(0.580, 0.580, 0.580, 1.0),
    accent=(0.400, 0.620, 0.920, 1.0),
    warning=(0.960, 0.720, 0.280, 1.0),
    error=(0.960, 0.420, 0.380, 1.0),
    good=(0.470, 0.780, 0.480, 1.0),
)
LIGHT = Palette(
    is_dark=False,
    canvas=(0.560, 0.560, 0.560, 1.0),
    window=(0.925, 0.925, 0.925, 1.0),
    frame=(0.835, 0.835, 0.835, 1.0),
    raised=(0.870, 0.870, 0.870, 1.0),
    border=(0.720, 0.720, 0.720, 1.0),
    text=(0.100, 0.100, 0.100, 1.0),
    muted=(0.380, 0.380, 0.380, 1.0),
    accent=(0.130, 0.400, 0.760, 1.0),
    warning=(0.580, 0.330, 0.000, 1.0),
    error=(0.740, 0.140, 0.100, 1.0),
    good=(0.130, 0.450, 0.160, 1.0),
)
