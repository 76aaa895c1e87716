"""What the picture of a live rendering depends on: the part of the interface's state that the renderer follows."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.scene import Camera, Scene


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
