"""What the panels may know and cannot change: filled by the host before every frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..edit.autosave import Recovery
from ..edit.history import HistoryEntry
from ..edit.picking import PickHit
from ..model.scene import Scene, Vec3
from ..model.staging import UpAxis
from ..passes.ray_line import RayLine
from ..render.viewer.stats import LiveStats
from .ray_readings import RayReading


@dataclass(frozen=True)
class LightHere:
    """What falls on the receiver under the cursor."""

    wavelength_nm: np.ndarray
    """Bin centres."""
    irradiance: np.ndarray
    """W/(unit² nm), mean of each bin: caustic, and direct light where that is known."""
    error: float
    """Standard error of a bin of the caustic, relative."""
    too_few_photons: bool
    """The caustic has too few photons for a spectrum: `irradiance` lacks it."""
    direct_illuminance: float | None
    """Part of it that came straight from lights, lm/unit²; None where that is not known, and missing."""


@dataclass(frozen=True)
class CursorInfo:
    """What is under the cursor in the viewport, as of the last frame."""

    pixel: tuple[int, int]
    rgb: Vec3 | None
    """Linear Rec.709 radiance, lm/(sr unit²); None while the picture is being drawn."""
    hit: PickHit | None = None
    """First surface; None for the background."""
    light: LightHere | None = None
    """While the spectrum panel is open; None where the light is not known yet."""
    magnified: int | None = None
    """Texture id of the magnifier's picture."""


@dataclass(frozen=True)
class SceneEntry:
    """A scene of the start page."""

    path: Path
    title: str
    description: str
    thumbnail: int | None
    """Texture id; None until it is read."""


@dataclass(frozen=True)
class Message:
    """A sentence to the user that fades after a while."""

    text: str
    is_error: bool
    left_s: float
    """Until it is gone."""


@dataclass(frozen=True)
class JobInfo:
    """A running export."""

    title: str
    fraction: float
    text: str
    is_stopped: bool = False
    """It ends with what is done, as soon as that is a picture."""
    when_stopped: str = "what is done is kept"
    """What becomes of it where it is stopped now."""


@dataclass(frozen=True)
class Found:
    """What a job found, some with a picture of it."""

    of: tuple[object, ...]
    """What it was found for."""
    rows: tuple[tuple[str, str], ...]
    codes: np.ndarray | None = None
    """uint8 (h, w, 3), sRGB."""
    texture: int = 0
    """Texture id of that."""

    def is_of(self, *now: object) -> bool:
        """Whether that has not changed since."""
        plain = str, float, Path
        pairs = zip(self.of, now, strict=True)
        return all(a is b or (isinstance(a, plain) and isinstance(b, plain) and a == b) for a, b in pairs)


@dataclass(frozen=True)
class ViewModel:
    """What panels show in one frame."""

    stats: LiveStats = LiveStats()
    shown: Scene | None = None
    """What the picture shows; another one than the state's until that is drawn."""
    picture: int | None = None
    """Texture id of the displayed picture, top row first."""
    frame_ms: tuple[float, ...] = ()
    """Durations of the last frames, newest last."""
    wanted_hz: float = 60.0
    """Frames a second that the engine's share of a frame is meant for."""
    pass_ms: dict[str, float] = field(default_factory=dict)
    """Times of the last frame, by pass: trace, splats, resolve, camera, display, interface."""
    process_bytes: int = 0
    """Resident memory of this process while a panel shows it; 0 where the system does not say."""
    cursor: CursorInfo | None = None
    title: str = "untitled"
    path: Path | None = None
    unsaved: bool = False
    up: UpAxis | None = None
    """The axis taken to be up of a file that was just opened and may be on its side."""
    undo: str | None = None
    """Label of what undo would take back."""
    redo: str | None = None
    history: tuple[HistoryEntry, ...] = ()
    recent: tuple[Path, ...] = ()
    scenes: tuple[SceneEntry, ...] = ()
    messages: tuple[Message, ...] = ()
    shader_error: str | None = None
    recovery: Recovery | None = None
    """An autosave found at the start."""
    asks_to_quit: bool = False
    """Unsaved changes: the dialogue with Save, Discard and Cancel is open."""
    asks_about_export: bool = False
    """An export runs at quitting: the dialogue with Finish, Stop and Cancel is open."""
    reference_progress: float | None = None
    """How far the picture that compare modes show is, 0 to 1; None where none was begun."""
    compare_text: str = ""
    """What that picture is and how good, or why there is none: one or two sentences."""
    compare_label: str = ""
    """What that picture is, for its side of the wipe."""
    compared_rgb: Vec3 | None = None
    """Linear Rec.709 of that picture under the cursor."""
    compare_ready: bool = False
    """There is a picture to compare with."""
    compare_stale: bool = False
    """The scene or the view has changed since it was begun."""
    rays: tuple[RayLine, ...] = ()
    readings: tuple[RayReading, ...] = ()
    """What those rays say in numbers."""
    found: Mapping[str, Found] = field(default_factory=dict)
    """What jobs found last, by the name of the job."""
    job: JobInfo | None = None
    engine_rests: bool = False
    """The job has all of the time: it is waited for."""
    writing: str = ""
    """Which screenshot takes long to be written."""
    exposure_ev: float = 0.0
    """The exposure in use, automatic or not."""
    delta_s: float = 1 / 60
    """Since the last frame."""
    framebuffer_scale: float = 1.0
    """Device pixels per interface pixel."""
    interface_scale: float = 1.0
    """Interface pixels per logical pixel: what `theme.apply` takes."""

    def called(self, recent: Path) -> str:
        """A recent file's name, with its folder where another one has the same."""
        is_alone = sum(other.name == recent.name for other in self.recent) == 1
        return recent.name if is_alone else f"{recent.name} ({recent.parent.name})"
