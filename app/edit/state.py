"""Everything the interface shows and edits, as one frozen value.

Panels are functions `draw(state, view_model) -> state`. They return a changed copy and know neither
OpenGL nor the renderer. The difference of two states decides what is redone: `live_inputs` names the
part that the picture depends on, `scene` is what undo and saving cover.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from ..model.scene import Camera, Material, Scene, Vec3
from .live_inputs import LiveInputs
from .projection import View, fitted
from .requests import Request

Tool = Literal["select", "move", "rotate", "scale", "brush", "pull", "measure"]
CompareMode = Literal["off", "hold", "wipe", "error"]
Theme = Literal["dark", "light"]
ToneCurve = Literal["spectrasplat", "aces", "reinhard", "linear"]
TARGET_PHOTONS = 32_000_000
"""Photons after which a picture of the viewer is finished, unless the user says otherwise."""
SOLO_START_NM = 550.0
"""Where single-wavelength display starts: green, which every white light has."""


@dataclass(frozen=True)
class Selection:
    """An object or a light by its index, the scene's camera, or nothing where `kind` is None."""

    kind: Literal["object", "light", "camera"] | None = None
    index: int = 0


@dataclass(frozen=True)
class Display:
    """How linear light becomes pixels; never touches the light itself."""

    exposure_ev: float = 0.0
    auto_exposure: bool = True
    """Follow the picture until the user sets an exposure."""
    tone: ToneCurve = "spectrasplat"
    false_colour: bool = False
    """Luminance on a logarithmic colour scale."""
    false_colour_stops: tuple[float, float] = (-8.0, 4.0)
    """Ends of that scale, stops about display white."""
    magnifier: bool = False
    ray_overlay: bool = False
    ray_count: int = 5
    ray_wavelengths: int = 9
    ray_reflections: int = 0
    """Within glass, before a ray leaves it."""
    ray_labels: bool = True
    """Wavelengths and deviations beside the rays."""


@dataclass(frozen=True)
class Brush:
    """The dispersion brush."""

    mode: Literal["widen", "narrow", "erase"] = "widen"
    radius: float = 0.05
    """Scene units."""
    strength: float = 0.5
    """Doublings of the gain a second under a still cursor; share taken away for the eraser."""
    falloff: float = 0.7


@dataclass(frozen=True)
class Compare:
    """A/B with a reference or another method."""

    mode: CompareMode = "off"
    method: str = "reference"
    """"reference", "glass", "file", or one of `METHODS`, run on its own in the time left over."""
    glass: str = "N-SF11"
    """With the method "glass": the catalogue's glass that the other picture is of."""
    file: Path | None = None
    """With the method "file": the picture."""
    wipe: float = 0.5
    """Place of the wipe's line, share of the width."""
    holding: bool = False
    """The compare key is down."""

    @property
    def is_active(self) -> bool:
        """Whether the other picture is wanted."""
        return self.mode != "off"


@dataclass(frozen=True)
class Solve:
    """What the panels that solve are set to."""

    parameter: str = ""
    """By which a derivative is wanted."""
    wanted: Literal["light", "picture", "width"] = "light"
    """What a glass is to throw: the light as it is, a picture where the ruler lies, or a width along it."""
    file: Path | None = None
    width: float = 0.0
    with_glass: bool = False
    """Whether n_d and V_d are fitted with `parameter`."""
    plate_target: Path | None = None
    plate_distance: float = 0.0
    """0: where it is most like."""


@dataclass(frozen=True)
class Panels:
    """Which windows are open."""

    outliner: bool = True
    inspector: bool = True
    dispersion: bool = True
    view: bool = True
    timing: bool = True
    brush: bool = False
    abbe: bool = False
    spectrum: bool = True
    compare: bool = False
    history: bool = False
    rays: bool = False
    lens: bool = False
    gem: bool = False
    solve: bool = False
    lesson: bool = False
    shortcuts: bool = False
    start_page: bool = False
    export: bool = False
    about: bool = False


@dataclass(frozen=True)
class Preferences:
    """Remembered between sessions."""

    theme: Theme = "dark"
    ui_scale: float = 1.0
    target_photons: int = TARGET_PHOTONS
    refine_when_still: bool = True
    """Trace again with the new glass once the interface is still, after an edit that was only splatted again."""
    panels: Panels = Panels()


@dataclass(frozen=True)
class Pull:
    """A colour that is dragged (`requests.BeginPull`): what `pull.py` needs to solve for a dispersion."""

    object_index: int
    """The glass whose dispersion is solved for."""
    receiver_index: int
    start: Vec3
    """World position where the drag began."""
    reference: Vec3
    """World position where the same light lands at the d line: the point that stays."""
    direction: Vec3
    """Unit world direction along which this colour moves as the dispersion grows."""
    wavelength_nm: float
    gain_at_start: float
    """The material's dispersion gain, or the local gain there, when it was taken."""
    local: bool = False


@dataclass(frozen=True)
class Key:
    """One key of the animation: parameter `path` (see `animation.py`) has `value` at `time_s`."""

    time_s: float
    path: str
    value: float


@dataclass(frozen=True)
class State:
    """The interface."""

    scene: Scene
    camera: Camera
    views: tuple[Camera | None, ...] = (None,) * 9
    """Numbered views, keys 1 to 9."""
    selection: Selection = Selection()
    also: tuple[Selection, ...] = ()
    """Selected besides: they are moved, copied and deleted together with it."""
    hidden: frozenset[tuple[str, str]] = frozenset()
    """What the picture leaves out: ("object" or "light", name). Not saved."""
    locked: frozenset[tuple[str, str]] = frozenset()
    """What cannot be selected and moved in the picture, likewise."""
    tool: Tool = "select"
    display: Display = Display()
    brush: Brush = Brush()
    compare: Compare = Compare()
    solve: Solve = Solve()
    preferences: Preferences = Preferences()
    method: str = "srd"
    smoothing: float = 0.45
    solo_nm: float | None = None
    physical: bool = False
    """Leave the brush's local gain out, to compare with the physical picture."""
    playing: bool = True
    """Photons accumulate."""
    viewport_size: tuple[int, int] = (960, 540)
    """Pixels of the picture."""
    hover: tuple[float, float] | None = None
    """Where the cursor is over the picture, 0..1 from the top left; the viewport sets it in every frame."""
    clipboard: Material | None = None
    pull: Pull | None = None
    measured: tuple[Vec3, ...] = ()
    """Points of the ruler, world; see `measuring`."""
    lesson: str = ""
    """Name of the lesson that the scene is shown in; see `lessons`."""
    animation: tuple[Key, ...] = ()
    preview_s: float | None = None
    """Show the animation at this time; the scene that is edited and saved stays (`preview`)."""
    interacting: bool = False
    """Something is being dragged: answer quickly, refine later, and keep undo steps together."""
    edit_label: str = ""
    """What the last change of `scene` is called in the undo menu ("Move prism"); same label while dragging is one
    step."""
    requests: tuple[Request, ...] = ()

    def edited(self, scene: Scene, label: str) -> State:
        """With another scene, undone as `label`."""
        return replace(self, scene=scene, edit_label=label)

    def asking(self, *requests: Request) -> State:
        """With more requests."""
        return replace(self, requests=self.requests + requests)

    def with_panels(self, **changes: bool) -> State:
        """With windows opened or closed."""
        return replace(self, preferences=replace(self.preferences, panels=replace(self.preferences.panels, **changes)))

    def opened(self, field: str, is_open: bool) -> State:
        """With the panel `Panels.<field>` opened or closed by the user. Opening Compare begins a wipe, closing it ends
        that; hiding all panels (H) does neither."""
        state = self.with_panels(**{field: is_open})
        if field != "compare":
            return state
        mode: CompareMode = "off" if not is_open else "wipe" if self.compare.mode == "off" else self.compare.mode
        return replace(state, compare=replace(self.compare, mode=mode))

    def with_display(self, **changes: Any) -> State:
        """With something else of `Display`."""
        return replace(self, display=replace(self.display, **changes))

    @property
    def frame_aspect(self) -> float:
        """Width over height of the picture that the scene is meant to be."""
        return self.scene.render.width / self.scene.render.height

    def camera_for(self, size: tuple[int, int]) -> Camera:
        """The camera of a picture of `size` pixels, which shows all of the scene's frame."""
        return fitted(self.camera, self.frame_aspect, size[0] / size[1])

    @property
    def view(self) -> View:
        """What the picture in the window shows."""
        width, height = self.viewport_size
        return View.of(self.camera_for(self.viewport_size), width / height)

    @property
    def live_inputs(self) -> LiveInputs:
        """What the picture depends on."""
        width, height = self.viewport_size
        return LiveInputs(
            self.scene,
            self.camera_for(self.viewport_size),
            width,
            height,
            self.method,
            self.smoothing,
            self.solo_nm,
            not self.physical,
        )
