"""What a panel asks the host to do that a change of values cannot say: files, pictures, questions to the renderer.

A panel appends a request to the state it returns; the host (`session.py`) carries requests out in
order and clears them. Nothing here does anything.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..model.scene import Vec3
from ..model.staging import UpAxis


@dataclass(frozen=True)
class NewScene:
    """Start from the default scene."""


@dataclass(frozen=True)
class Open:
    """Load a scene, a GLB or a bare mesh (which gets a glass, a light and a table)."""

    path: Path


@dataclass(frozen=True)
class OpenLesson:
    """Open a lesson's scene, with what the lesson is about selected."""

    name: str


@dataclass(frozen=True)
class StandUp:
    """Take another axis of the opened mesh or glTF file to be up, and remember it for that file."""

    up: UpAxis


@dataclass(frozen=True)
class Save:
    """Save to `path` (.toml or .glb); None saves where the scene came from."""

    path: Path | None = None


@dataclass(frozen=True)
class Undo:
    """One step back."""


@dataclass(frozen=True)
class Redo:
    """One step forward again."""


@dataclass(frozen=True)
class GoTo:
    """To entry `index` of the history."""

    index: int


@dataclass(frozen=True)
class Quit:
    """Close; asks first where changes are unsaved (`ViewModel.asks_to_quit`)."""

    discard: bool = False
    """The answer "Discard" to that question: close without saving."""


@dataclass(frozen=True)
class FullScreen:
    """The window over the whole screen, or back to where it was."""


@dataclass(frozen=True)
class CancelQuit:
    """The answer "Cancel" to that question, and "Save" before it saves: stay open, ask no more. Likewise to the
    question about an export that is not finished."""


@dataclass(frozen=True)
class QuitAfterExport:
    """Close once the running export is finished."""

    stop: bool = False
    """As soon as possible: with what is done."""


@dataclass(frozen=True)
class Recover:
    """Load the autosave of a session that crashed; `discard` deletes it instead."""

    discard: bool = False


@dataclass(frozen=True)
class SelectAt:
    """Select what made the picture at a pixel of the viewport: glass, or the object whose caustic it is.

    `itself` selects the surface hit, even when a caustic lies on it."""

    x: float
    y: float
    itself: bool = False
    add: bool = False
    """To what is selected already."""


@dataclass(frozen=True)
class BeginPull:
    """Take hold of the caustic's colour at a pixel: the host fills `State.pull`."""

    x: float
    y: float
    local: bool = False
    """Solve for the local gain instead of the object's Abbe number."""


@dataclass(frozen=True)
class FrameSelection:
    """Move the camera so that the selection (or everything) fills the view."""


@dataclass(frozen=True)
class Retrace:
    """Trace anew with the present glass, where the picture followed an edit to first order only."""


@dataclass(frozen=True)
class ReloadShaders:
    """Compile the shaders from disk again, keeping the last good programs."""


@dataclass(frozen=True)
class Screenshot:
    """Write the picture to `path`: .png as displayed, .exr or .npy linear, .exr with spectral bins when `spectral`."""

    path: Path
    spectral: bool = False
    with_interface: bool = False


@dataclass(frozen=True)
class RenderPicture:
    """Render a finished picture to `path`: .png, .jpg and .webp as displayed, .exr and .npy linear."""

    path: Path
    size: tuple[int, int]
    """Pixels."""
    photons: int | None = 4_000_000
    seconds: float | None = None
    """Of the whole picture, instead of `photons`."""
    samples: int | None = None
    """Camera samples a pixel; None takes as many as the scene needs."""
    caustic: bool = False
    """Also write a second file with nothing but caustics."""
    bins: int | None = None
    """Spectral bins, in .exr only."""


@dataclass(frozen=True)
class Bake:
    """Write a receiver's caustic map with its placement (`.json` beside it): .exr or .png."""

    path: Path
    receiver: str
    size: tuple[int, int] = (1024, 1024)
    """Texels."""
    photons: int = 4_000_000


@dataclass(frozen=True)
class Animate:
    """Render an animation to `path` (.mp4, .gif, .webp, or a folder for PNGs): a turntable, or the keys of
    `State.animation`."""

    path: Path
    kind: Literal["turntable", "keys"] = "turntable"
    frames: int | None = 120
    """None takes as many as the keys last."""
    fps: float = 24.0
    size: tuple[int, int] | None = None
    """Pixels; None takes those of the viewport."""
    photons: int = 1_000_000
    """Of each traced frame."""
    samples: int = 16
    """Camera samples a pixel."""


@dataclass(frozen=True)
class CancelJob:
    """Stop the running export; what is finished stays."""


@dataclass(frozen=True)
class ComputeReference:
    """Start (again) the reference that compare modes show."""


@dataclass(frozen=True)
class CopyMaterial:
    """Of object `index` to the material clipboard."""

    index: int


@dataclass(frozen=True)
class Notice:
    """Show one sentence for a few seconds."""

    text: str
    is_error: bool = False


@dataclass(frozen=True)
class DismissMessage:
    """Take a message away (errors stay until then)."""

    text: str


Export = Screenshot | RenderPicture | Bake | Animate
Request = (
    NewScene
    | Open
    | OpenLesson
    | StandUp
    | Save
    | Undo
    | Redo
    | GoTo
    | Quit
    | CancelQuit
    | QuitAfterExport
    | FullScreen
    | Recover
    | SelectAt
    | BeginPull
    | FrameSelection
    | Retrace
    | ReloadShaders
    | Screenshot
    | RenderPicture
    | Bake
    | Animate
    | CancelJob
    | ComputeReference
    | CopyMaterial
    | Notice
    | DismissMessage
)


@dataclass(frozen=True)
class Pull:
    """A colour held by the cursor (`BeginPull`): what `pull.py` needs to solve for a dispersion while it is dragged."""

    object_index: int
    """The glass whose dispersion is solved for."""
    receiver_index: int
    start: Vec3
    """World position taken hold of."""
    reference: Vec3
    """World position where the same light lands at the d line: the point that stays."""
    direction: Vec3
    """Unit world direction along which this colour moves as the dispersion grows."""
    wavelength_nm: float
    gain_at_start: float
    """The material's dispersion gain, or the local gain there, when it was taken."""
    local: bool = False
