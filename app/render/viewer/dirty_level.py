"""What a change of a live rendering's inputs costs.

The difference of two `LiveInputs` decides what is redone. A field that nobody thought about
falls through to the most expensive level, so a forgotten field is slow, never wrong.
"""

from __future__ import annotations

from enum import IntEnum


class DirtyLevel(IntEnum):
    """What must be done again, cheapest first; each includes those before it."""

    NOTHING = 0
    CAMERA = 1
    """Camera samples only: photons and maps stay."""
    SPLAT = 2
    """Stored photons are splatted again; nothing is traced."""
    TRACE = 3
    """Photons are traced again through the same programs."""
    BUILD = 4
    """Programs and buffers are made anew."""
