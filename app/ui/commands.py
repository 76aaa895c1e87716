"""What can be done by name: one table that the menu, the shortcuts and their list are drawn from.

A command is a function of state and view model, like a panel. Those that need a file open the file
dialogue (`panels.dialogs`), those that would lose unsaved work ask first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial, reduce
from typing import Any

from ..edit import requests, selecting
from ..edit.state import SOLO_START_NM, Panels, Selection, State, Tool
from . import layout
from .panels import dialogs
from .view_model import ViewModel

Act = Callable[[State, ViewModel], State]
Test = Callable[[State, ViewModel], bool]

_NOT_HIDDEN = ("start_page", "shortcuts", "about")
"""Windows that "Hide panels" leaves alone."""
_hidden: list[Panels] = []
"""What the last "Hide panels" closed: memory of the interface, like a scroll position, so no part of the state."""


@dataclass(frozen=True)
class Command:
    """Something the user can ask for."""

    name: str
    keys: tuple[str, ...]
    """Shortcuts such as "Ctrl+Shift+Z", the first one shown in the menu; none is fine."""
    tip: str
    act: Act
    enabled: Test = lambda _state, _view_model: True
    checked: Test | None = None
    """Set for what is on or off."""
    group: str = ""


# ---- what they do --------------------------------------------------------------------------


def _save(state: State, view_model: ViewModel) -> State:
    return state.asking(requests.Save()) if view_model.path is not None else dialogs.save_as(state, view_model)


def _take_brush(state: State, view_model: ViewModel) -> State:
    """With its panel, which shows radius and strength and how to compare with the physical picture."""
    return _open_panel("brush", replace(state, tool="brush"), view_model)


def _open_panel(field: str, state: State, _view_model: ViewModel) -> State:
    """With the panel `Panels.<field>` open and in front."""
    layout.raise_panel(field)
    return state.opened(field, True)


def _toggle_panel(field: str, state: State, _view_model: ViewModel) -> State:
    is_open = getattr(state.preferences.panels, field)
    if is_open and field in layout.behind:  # whoever asks for it does not see that it is open
        layout.raise_panel(field)
        return state
    return state.opened(field, not is_open)


def _frame_all(state: State) -> State:
    return replace(state, selection=Selection()).asking(requests.FrameSelection())


def _go_to_view(number: int, state: State) -> State:
    """Go to numbered view `number` (1 to 9); a notice where none is stored."""
    camera = state.views[number - 1]
    if camera is None:
        return state.asking(requests.Notice(f"View {number} is empty. Ctrl+{number} stores the present view there."))
    return replace(state, camera=camera)


def _store_view(number: int, state: State) -> State:
    views = (*state.views[: number - 1], state.camera, *state.views[number:])
    words = f"Stored as view {number}. Key {number} comes back to it."
    return replace(state, views=views).asking(requests.Notice(words))


def _hide_panels(state: State) -> State:
    """Close all panels, or open those again that the last call closed."""
    panels = state.preferences.panels
    names = [f.name for f in fields(Panels) if f.name not in _NOT_HIDDEN]
    is_open = [name for name in names if getattr(panels, name)]
    if is_open:
        _hidden[:] = [panels]
        return state.with_panels(**dict.fromkeys(is_open, False))
    before = _hidden.pop() if _hidden else Panels()
    return state.with_panels(**{name: getattr(before, name) for name in names})


def _expose(stops: float, state: State, view_model: ViewModel) -> State:
    """Change the exposure by `stops` from the one in use; it is the user's from then on."""
    in_use = view_model.exposure_ev if state.display.auto_exposure else state.display.exposure_ev
    return state.with_display(exposure_ev=in_use + stops, auto_exposure=False)


def _toggle_auto(state: State, view_model: ViewModel) -> State:
    """Automatic exposure on, or off at the present value."""
    is_auto = state.display.auto_exposure
    return _expose(0.0, state, view_model) if is_auto else state.with_display(auto_exposure=True)


def _toggle_solo(state: State) -> State:
    return replace(state, solo_nm=None if state.solo_nm is not None else SOLO_START_NM)


def _is_object(state: State, _view_model: ViewModel) -> bool:
    return state.selection.kind == "object" and state.selection.index < len(state.scene.objects)


def _is_selected(state: State, _view_model: ViewModel) -> bool:
    return selecting.key_of(state.scene, state.selection) is not None


def _can_paste(state: State, view_model: ViewModel) -> bool:
    return state.clipboard is not None and _is_object(state, view_model)


# ---- rows of the table ---------------------------------------------------------------------


def _row(name: str, keys: str, act: Act, tip: str, enabled: Test | None = None, checked: Test | None = None) -> Command:
    shortcuts = tuple(keys.split(", ")) if keys else ()
    return Command(name, shortcuts, tip, act, enabled or Command.enabled, checked)


def _does(name: str, keys: str, act: Callable[[State], State], tip: str, enabled: Test | None = None) -> Command:
    """What needs only the state."""
    return _row(name, keys, lambda state, _view_model: act(state), tip, enabled)


def _asks(name: str, keys: str, request: requests.Request, tip: str, enabled: Test | None = None) -> Command:
    """What the host does."""
    return _does(name, keys, lambda state: state.asking(request), tip, enabled)


def _switch(name: str, keys: str, path: str, tip: str) -> Command:
    """What turns a field of the state on and off: its path, such as "display.magnifier"."""

    def value(state: State, _view_model: ViewModel) -> Any:
        return reduce(getattr, path.split("."), state)

    def turned(state: State, view_model: ViewModel) -> State:
        *outer, name = path.split(".")
        changed: Any = {name: not value(state, view_model)}
        return state.with_display(**changed) if outer else replace(state, **changed)

    return _row(name, keys, turned, tip, checked=value)


def _panel(name: str, keys: str, field: str, tip: str) -> Command:
    """What opens and closes the panel `Panels.<field>`."""
    act = partial(_toggle_panel, field)
    return _row(name, keys, act, tip, checked=lambda state, _view_model: getattr(state.preferences.panels, field))


def _tool(name: str, keys: str, tool: Tool, tip: str, act: Act | None = None) -> Command:
    act = act or (lambda state, _view_model: replace(state, tool=tool))
    return _row(name, keys, act, tip, checked=lambda state, _view_model: state.tool == tool)


def _group(title: str, *commands: Command) -> tuple[Command, ...]:
    return tuple(replace(command, group=title) for command in commands)


COMMANDS: tuple[Command, ...] = (
    *_group(
        "File",
        _row("New scene", "Ctrl+N", dialogs.new_scene, "Start from the default scene."),
        _panel("Start page", "", "start_page", "Scenes to begin with, recent files."),
        _row(
            "Open…",
            "Ctrl+O",
            dialogs.open_file,
            "Open a scene (.toml), glTF (.glb, .gltf), a bare mesh (.obj, .ply, .stl), a faceting "
            "design (.asc) or a lens (.zmx, .csv).",
        ),
        _row(
            "Import…",
            "Ctrl+I",
            dialogs.import_file,
            "Bring the objects of a mesh, a glTF file or another scene into this one.",
        ),
        _row("Save", "Ctrl+S", _save, "Save the scene where it came from."),
        _row("Save as…", "Ctrl+Shift+S", dialogs.save_as, "Save as scene TOML, or as GLB for other programs."),
        _row(
            "Render…",
            "F12",
            partial(_open_panel, "export"),
            "Render a finished picture: size, photons or time, samples, layers.",
        ),
        _panel("Export…", "Ctrl+E", "export", "Screenshots, baked caustic maps and animations."),
        _asks("Quit", "Ctrl+Q", requests.Quit(), "Close SpectraSplat; asks first where changes are unsaved."),
    ),
    *_group(
        "Edit",
        _asks("Undo", "Ctrl+Z", requests.Undo(), "Take back the last edit.", lambda _, shown: shown.undo is not None),
        _asks(
            "Redo",
            "Ctrl+Shift+Z, Ctrl+Y",
            requests.Redo(),
            "Do again what was taken back.",
            lambda _, shown: shown.redo is not None,
        ),
        _does("Duplicate", "Ctrl+D", selecting.duplicated, "Copy the selected object or light in place.", _is_selected),
        _does("Delete", "Delete", selecting.deleted, "Remove the selected object or light.", _is_selected),
        _does(
            "Copy material",
            "Ctrl+C",
            lambda state: state.asking(requests.CopyMaterial(state.selection.index)),
            "Copy the selected object's material.",
            _is_object,
        ),
        _does(
            "Paste material",
            "Ctrl+V",
            selecting.with_pasted_material,
            "Give the selected object the copied material.",
            _can_paste,
        ),
    ),
    *_group(
        "View",
        _asks(
            "Frame selection",
            "F",
            requests.FrameSelection(),
            "Move the camera so that the selection, or everything, fills the view.",
        ),
        _does("Frame everything", "Home", _frame_all, "Deselect, and fit the whole scene in the view."),
        _does(
            "Scene's own view",
            "0",
            lambda state: replace(state, camera=state.scene.camera),
            "Back to the camera that the scene was saved with.",
        ),
        _does(
            "Keep as scene's view",
            "Ctrl+0",
            lambda state: state.edited(replace(state.scene, camera=state.camera), "Keep view"),
            "Save the present camera with the scene.",
        ),
        _asks("Full screen", "F11", requests.FullScreen(), "The window over the whole screen, and back."),
        _does("Hide panels", "H", _hide_panels, "Leave only the picture; again brings the panels back."),
    ),
    *_group(
        "Tools",
        _tool("Select", "Esc", "select", "Click an object, or its caustic, to select what made it."),
        _tool("Move", "G", "move", "Move the selection with the gizmo."),
        _tool("Rotate", "T", "rotate", "Turn the selection with the gizmo."),
        _tool("Scale", "Y", "scale", "Scale the selection with the gizmo."),
        _tool(
            "Dispersion brush",
            "B",
            "brush",
            "Paint a local gain of dispersion on a receiver. Not physical.",
            _take_brush,
        ),
        _tool("Pull a colour", "P", "pull", "Drag a colour of the caustic: the dispersion follows."),
        _tool("Measure", "K", "measure", "Ruler and protractor: two points give a length, a third the angle between."),
    ),
    *_group(
        "Render",
        _switch("Accumulate photons", "Space", "playing", "Continue or pause."),
        _asks("Trace again", "Ctrl+R", requests.Retrace(), "Trace photons anew with the present glass."),
        _switch("Physical picture", "V", "physical", "Leave the dispersion brush out, to compare."),
        _asks(
            "Reload shaders",
            "F5",
            requests.ReloadShaders(),
            "Compile the shaders from disk again; the last good ones stay on errors.",
        ),
    ),
    *_group(
        "Display",
        _row("Brighter", "=", partial(_expose, 0.25), "Exposure up by a quarter stop."),
        _row("Darker", "-", partial(_expose, -0.25), "Exposure down by a quarter stop."),
        _row(
            "Automatic exposure",
            "Shift+E",
            _toggle_auto,
            "Let the exposure follow the picture.",
            checked=lambda state, _view_model: state.display.auto_exposure,
        ),
        _switch("False colour", "X", "display.false_colour", "Luminance on a logarithmic colour scale."),
        _switch("Ray overlay", "R", "display.ray_overlay", "Draw a fan of rays through the selected object."),
        _switch("Magnifier", "M", "display.magnifier", "Magnify the pixels under the cursor."),
        _row(
            "Single wavelength",
            "L",
            lambda state, _view_model: _toggle_solo(state),
            "Show the light of one wavelength only.",
            checked=lambda state, _view_model: state.solo_nm is not None,
        ),
    ),
    *_group(
        "Help",
        _panel("Shortcuts", "F1", "shortcuts", "List the shortcuts."),
        _panel("About SpectraSplat", "", "about", "Version, graphics driver, licences."),
    ),
)
"""All but the numbered views and the panels, in the order of the menus."""

PANELS = _group(
    "Panels",
    _panel("Outliner", "", "outliner", "Objects and lights of the scene."),
    _panel("Inspector", "", "inspector", "Placement and material of the selection."),
    _panel("Dispersion", "", "dispersion", "The selected glass: n_d, V_d, gain, n(λ)."),
    _panel("Abbe diagram", "", "abbe", "Catalogue glasses by n_d and V_d; click to choose one."),
    _panel("Brush", "", "brush", "The dispersion brush."),
    _panel("View", "", "view", "Exposure, tone, false colour, single wavelength, camera, sampling."),
    _panel("Timing", "", "timing", "Frame time by pass, photons, memory, fall-backs."),
    _panel("Spectrum", "", "spectrum", "The spectrum under the cursor."),
    _panel("Compare", "", "compare", "Reference, wipe, error map."),
    _panel("Gem", "", "gem", "Light return, fire, scintillation and windows of the selected stone, face up."),
    _panel(
        "Lens", "", "lens", "Focal lengths, chromatic shift and spots of the selected lens, by wavelength; a plate."
    ),
    _panel("Solve", "", "solve", "The picture's derivative by a number; which glass casts a picture or a width."),
    _panel("Rays", "", "rays", "Deviation and focal length of the ray overlay, by wavelength."),
    _panel("Lesson", "", "lesson", "Lessons: a scene each, a few sentences, what to try."),
    _panel("History", "", "history", "All steps that can be undone."),
    _panel("Export", "", "export", "Renderings, screenshots, baked maps, animations."),
)


def _is_stored(number: int, state: State, _view_model: ViewModel) -> bool:
    return state.views[number - 1] is not None


VIEWS = _group(
    "Views",
    *(
        command
        for number in range(1, 10)
        for command in (
            _does(
                f"View {number}",
                str(number),
                partial(_go_to_view, number),
                "Go to this stored view.",
                partial(_is_stored, number),
            ),
            _does(
                f"Store view {number}",
                f"Ctrl+{number}",
                partial(_store_view, number),
                "Keep the present camera under this number.",
            ),
        )
    ),
)

_BY_NAME = {command.name: command for command in (*COMMANDS, *VIEWS)} | {
    f"Panel: {command.name}": command for command in PANELS
}


def command(name: str) -> Command:
    """By name; panels are "Panel: Outliner" …. KeyError for a name that does not exist."""
    return _BY_NAME[name]
