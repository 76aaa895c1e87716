"""What a panel wants of the host that a change of values cannot say: files, pictures, questions to the renderer.

A panel appends a request to the state it returns; the host (`ui/session_requests.py`) carries requests out in
order and clears them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..model.staging import UpAxis
from ..model.vectors import Vec3


class Request:
    """One wish; its class says what."""


@dataclass(frozen=True)
class NewScene(Request):
    """Start from the default scene."""


@dataclass(frozen=True)
class Open(Request):
    """Load a scene, a GLB or a bare mesh (which gets a glass, a light and a table)."""

    path: Path


@dataclass(frozen=True)
class OpenLesson(Request):
    """Open a lesson's scene, with what the lesson is about selected."""

    name: str


@dataclass(frozen=True)
class StandUp(Request):
    """Take another axis of the opened mesh or glTF file to be up, and remember it for that file."""

    up: UpAxis


@dataclass(frozen=True)
class Save(Request):
    """Save to `path` (.toml or .glb); None saves where the scene came from."""

    path: Path | None = None


@dataclass(frozen=True)
class Undo(Request):
    """One step back."""


@dataclass(frozen=True)
class Redo(Request):
    """One step forward again."""


@dataclass(frozen=True)
class GoTo(Request):
    """To entry `index` of the history."""

    index: int


@dataclass(frozen=True)
class Quit(Request):
    """Close; asks first where changes are unsaved (`ViewModel.asks_to_quit`)."""

    discard: bool = False
    """The answer "Discard" to that question: close without saving."""


@dataclass(frozen=True)
class FullScreen(Request):
    """The window over the whole screen, or back to where it was."""


@dataclass(frozen=True)
class CancelQuit(Request):
    """The answer "Cancel" to that question, and "Save" before it saves: stay open, ask no more. Likewise to the
    question about an export that is not finished."""


@dataclass(frozen=True)
class QuitAfterExport(Request):
    """Close once the running export is finished."""

    stop: bool = False
    """As soon as possible: with what is done."""


@dataclass(frozen=True)
class Recover(Request):
    """Load the autosave of a session that crashed; `discard` deletes it instead."""

    discard: bool = False


@dataclass(frozen=True)
class SelectAt(Request):
    """Select what made the picture at a pixel of the viewport: glass, or the object whose caustic it is.

    `itself` selects the surface hit, even when a caustic is on it."""

    x: float
    y: float
    itself: bool = False
    add: bool = False
    """To what is selected already."""


@dataclass(frozen=True)
class BeginPull(Request):
    """Begin to drag the caustic's colour at a pixel: the host fills `State.pull`."""

    x: float
    y: float
    local: bool = False
    """Solve for the local gain instead of the object's Abbe number."""


@dataclass(frozen=True)
class FrameSelection(Request):
    """Move the camera so that the selection (or everything) fills the view."""


@dataclass(frozen=True)
class Retrace(Request):
    """Trace anew with the present glass, where the picture followed an edit to first order only."""


@dataclass(frozen=True)
class ReloadShaders(Request):
    """Compile the shaders from disk again, keeping the last good programs."""


@dataclass(frozen=True)
class Screenshot(Request):
    """Write the picture to `path`: .png as displayed, .exr or .npy linear."""

    path: Path
    with_interface: bool = False
    """The whole window, .png only."""


@dataclass(frozen=True)
class RenderPicture(Request):
    """Render a finished picture to `path`: .png, .jpg and .webp as displayed, .exr and .npy linear."""

    path: Path
    size: tuple[int, int]
    """Pixels."""
    photons: int | None = 4_000_000
    seconds: float | None = None
    """Time of the whole picture, instead of `photons`."""
    samples: int | None = None
    """Camera samples a pixel; None takes as many as the scene needs."""
    caustic: bool = False
    """Also write a second file with nothing but caustics."""
    bins: int | None = None
    """Spectral bins, in .exr only."""


@dataclass(frozen=True)
class Bake(Request):
    """Write a receiver's caustic map with its placement (`.json` beside it): .exr or .png; or its page: .html."""

    path: Path
    receiver: str
    size: tuple[int, int] = (1024, 1024)
    """Texels."""
    photons: int = 4_000_000


@dataclass(frozen=True)
class Animate(Request):
    """Render an animation to `path` (.mp4, .gif, .webp, or a folder for PNGs): a turntable, or the keys of
    `State.animation`."""

    path: Path
    kind: Literal["turntable", "keys"] = "turntable"
    frames: int | None = 120
    """None takes as many as the keys last."""
    fps: float = 24.0
    size: tuple[int, int] = (960, 540)
    """Pixels."""
    photons: int = 1_000_000
    """Photons of each traced frame."""
    samples: int = 16
    """Camera samples a pixel."""


@dataclass(frozen=True)
class MatchGlass(Request):
    """Find the catalogue's glasses whose light is nearest to what object `index` casts now, or to what is wanted; or
    numbers `of` the scene (paths of `edit.parameters`) with which it casts that."""

    index: int
    file: Path | None = None
    """A picture or spectra that are wanted …"""
    width: float | None = None
    """… or a width …"""
    between: tuple[Vec3, ...] = ()
    """… there: two ends of a line or three corners, world; of the light as it is, empty for the first flat receiver."""
    of: tuple[str, ...] = ()
    photons: int = 100_000
    """Photons of each glass that is tried."""


@dataclass(frozen=True)
class Derive(Request):
    """The picture's derivative by a parameter."""

    path: str
    photons: int = 200_000


@dataclass(frozen=True)
class CheckPlate(Request):
    """Compare what object `index` draws in parallel light with a picture."""

    index: int
    target: Path
    distance: float | None = None
    """Scene units; None: where it is most like."""


@dataclass(frozen=True)
class JudgeStone(Request):
    """Find figures and pictures of the cut stone of that name."""

    name: str


@dataclass(frozen=True)
class CancelJob(Request):
    """Stop the running export; what is finished stays."""


@dataclass(frozen=True)
class ComputeReference(Request):
    """Start (again) the reference that compare modes show."""


@dataclass(frozen=True)
class CopyMaterial(Request):
    """The material of object `index` to the clipboard."""

    index: int


@dataclass(frozen=True)
class Notice(Request):
    """Show one sentence for a few seconds."""

    text: str
    is_error: bool = False


@dataclass(frozen=True)
class DismissMessage(Request):
    """Take a message away (errors stay until then)."""

    text: str


Solving = MatchGlass | Derive | CheckPlate | JudgeStone
LongExport = RenderPicture | Bake | Animate | Solving
Export = Screenshot | LongExport
