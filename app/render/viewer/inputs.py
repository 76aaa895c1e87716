"""What a live rendering is made of, and what a change of it costs.

The difference of two `LiveInputs` decides what is redone. A field that nobody thought about
falls through to the dearest answer, so a forgotten field is slow, never wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from ...model.scene import Camera, Scene


class DirtyLevel(IntEnum):
    """What must be done again, cheapest first; each includes those before it."""

    NOTHING = 0
    LOOK = 1
    """Camera samples only: photons and maps stay."""
    SPLAT = 2
    """Stored photons are splatted again; nothing is traced."""
    TRACE = 3
    """Photons are traced again through the same programs."""
    BUILD = 4
    """Programs and buffers are made anew."""


@dataclass(frozen=True)
class LiveInputs:
    """Everything the picture depends on."""

    scene: Scene
    camera: Camera
    """What the picture is seen by; `scene.camera` is only the saved view."""
    width: int
    height: int
    method: str = "srd"
    smoothing: float = 0.45
    solo_nm: float | None = None
    """Show the light of this one wavelength only."""
    local_gain: bool = True
    """Whether the dispersion brush's dabs count; False is the physical picture."""
    seed: int = 1
