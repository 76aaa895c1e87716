"""What can be done by name: one table that the menu, the shortcuts and their list are drawn from.

A command is a function of state and view model, like a panel. Those that need a file open the file
dialogue (`panels.dialogs`), those that would lose unsaved work ask first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from ..edit import requests
from ..edit.state import State, Tool
from . import layout, view_commands
from .open_panels import set_open
from .panels import dialogs
from .view_model import ViewModel

Act = Callable[[State, ViewModel], State]


@dataclass(frozen=True)
class Command:
    """Something the user can ask for."""

    name: str
    keys: tuple[str, ...]
    """Shortcuts such as "Ctrl+Shift+Z", the first one shown in the menu; none is fine."""
    group: str
    tip: str
    act: Act
    enabled: Callable[[State, ViewModel], bool] = lambda _state, _view_model: True
    checked: Callable[[State, ViewModel], bool] | None = None
    """Set for what is on or off."""


def _ask(*what: requests.Request) -> Act:
    return lambda state, _view_model: state.asking(*what)


def _duplicate(state: State, _view_model: ViewModel) -> State:
    from .panels import outliner

    return outliner.duplicate_all(state)


def _delete(state: State, _view_model: ViewModel) -> State:
    from .panels import outliner

    return outliner.delete_all(state)


def _save(state: State, view_model: ViewModel) -> State:
    return state.asking(requests.Save()) if view_model.path is not None else dialogs.save_as(state, view_model)


def _copy_material(state: State, _view_model: ViewModel) -> State:
    return state.asking(requests.CopyMaterial(state.selection.index))


def _paste_material(state: State, _view_model: ViewModel) -> State:
    from .panels import outliner

    return outliner.paste_material(state, state.selection)


def _set_tool(tool: Tool, state: State, _view_model: ViewModel) -> State:
    return replace(state, tool=tool)


def _take_brush(state: State, _view_model: ViewModel) -> State:
    """With its panel, which shows radius and strength and how to compare with the physical picture."""
    return _open_panel("brush", replace(state, tool="brush"), _view_model)


def _toggle_playing(state: State, _view_model: ViewModel) -> State:
    return replace(state, playing=not state.playing)


def _toggle_physical(state: State, _view_model: ViewModel) -> State:
    return replace(state, physical=not state.physical)


def _open_panel(name: str, state: State, _view_model: ViewModel) -> State:
    layout.raise_panel(name)
    return set_open(state, name, True)


def _toggle_panel(name: str, state: State, _view_model: ViewModel) -> State:
    is_open = getattr(state.preferences.panels, name)
    if is_open and name in layout.behind:
        # Who asks for it does not see that it is open.
        layout.raise_panel(name)
        return state
    return set_open(state, name, not is_open)


def _is_object(state: State, _view_model: ViewModel) -> bool:
    return state.selection.kind == "object" and state.selection.index < len(state.scene.objects)


def _is_selected(state: State, view_model: ViewModel) -> bool:
    lights = state.selection.kind == "light" and state.selection.index < len(state.scene.lights)
    return lights or _is_object(state, view_model)


def _is_stored(number: int, state: State, _view_model: ViewModel) -> bool:
    return state.views[number] is not None


def _can_paste(state: State, view_model: ViewModel) -> bool:
    return state.clipboard is not None and _is_object(state, view_model)


def _tool(name: str, tool: Tool, key: str, tip: str) -> Command:
    return Command(
        name, (key,), "Tools", tip, partial(_set_tool, tool), checked=lambda state, _view_model: state.tool == tool
    )


def panel(name: str, field: str, tip: str, keys: tuple[str, ...] = ()) -> Command:
    """The command that opens and closes the panel `Panels.<field>`."""
    return Command(
        name,
        keys,
        "Panels",
        tip,
        partial(_toggle_panel, field),
        checked=lambda state, _view_model: getattr(state.preferences.panels, field),
    )


COMMANDS: tuple[Command, ...] = (
    Command("New scene", ("Ctrl+N",), "File", "Start from the default scene.", dialogs.new_scene),
    Command(
        "Start page",
        (),
        "File",
        "Scenes to begin with, recent files.",
        partial(_toggle_panel, "start_page"),
        checked=lambda state, _view_model: state.preferences.panels.start_page,
    ),
    Command(
        "Open…",
        ("Ctrl+O",),
        "File",
        "Open a scene (.toml), glTF (.glb, .gltf) or a bare mesh (.obj, .ply, .stl).",
        dialogs.open_file,
    ),
    Command(
        "Import…",
        ("Ctrl+I",),
        "File",
        "Bring the objects of a mesh, a glTF file or another scene into this one.",
        dialogs.import_file,
    ),
    Command("Save", ("Ctrl+S",), "File", "Save the scene where it came from.", _save),
    Command(
        "Save as…", ("Ctrl+Shift+S",), "File", "Save as scene TOML, or as GLB for other programs.", dialogs.save_as
    ),
    Command(
        "Render…",
        ("F12",),
        "File",
        "Render a finished picture: size, photons or time, samples, layers.",
        partial(_open_panel, "export"),
    ),
    Command(
        "Export…",
        ("Ctrl+E",),
        "File",
        "Screenshots, baked caustic maps and animations.",
        partial(_toggle_panel, "export"),
        checked=lambda state, _view_model: state.preferences.panels.export,
    ),
    Command(
        "Quit", ("Ctrl+Q",), "File", "Close SpectraSplat; asks first where changes are unsaved.", _ask(requests.Quit())
    ),
    Command(
        "Undo",
        ("Ctrl+Z",),
        "Edit",
        "Take back the last edit.",
        _ask(requests.Undo()),
        enabled=lambda _state, view_model: view_model.undo is not None,
    ),
    Command(
        "Redo",
        ("Ctrl+Shift+Z", "Ctrl+Y"),
        "Edit",
        "Do again what was taken back.",
        _ask(requests.Redo()),
        enabled=lambda _state, view_model: view_model.redo is not None,
    ),
    Command(
        "Duplicate",
        ("Ctrl+D",),
        "Edit",
        "Copy the selected object or light in place.",
        _duplicate,
        enabled=_is_selected,
    ),
    Command("Delete", ("Delete",), "Edit", "Remove the selected object or light.", _delete, enabled=_is_selected),
    Command(
        "Copy material", ("Ctrl+C",), "Edit", "Copy the selected object's material.", _copy_material, enabled=_is_object
    ),
    Command(
        "Paste material",
        ("Ctrl+V",),
        "Edit",
        "Give the selected object the copied material.",
        _paste_material,
        enabled=_can_paste,
    ),
    Command(
        "Frame selection",
        ("F",),
        "View",
        "Move the camera so that the selection, or everything, fills the view.",
        _ask(requests.FrameSelection()),
    ),
    Command(
        "Frame everything", ("Home",), "View", "Deselect, and fit the whole scene in the view.", view_commands.frame_all
    ),
    Command(
        "Scene's own view",
        ("0",),
        "View",
        "Back to the camera that the scene was saved with.",
        view_commands.scene_view,
    ),
    Command(
        "Keep as scene's view",
        ("Ctrl+0",),
        "View",
        "Save the present camera with the scene.",
        view_commands.keep_as_scene_view,
    ),
    Command(
        "Full screen", ("F11",), "View", "The window over the whole screen, and back.", _ask(requests.FullScreen())
    ),
    Command(
        "Hide panels",
        ("H",),
        "View",
        "Leave only the picture; again brings the panels back.",
        view_commands.hide_panels,
    ),
    Command(
        "Select",
        ("Esc",),
        "Tools",
        "Click an object, or its caustic, to select what made it.",
        partial(_set_tool, "select"),
        checked=lambda state, _view_model: state.tool == "select",
    ),
    _tool("Move", "move", "G", "Move the selection with the gizmo."),
    _tool("Rotate", "rotate", "T", "Turn the selection with the gizmo."),
    _tool("Scale", "scale", "Y", "Scale the selection with the gizmo."),
    Command(
        "Dispersion brush",
        ("B",),
        "Tools",
        "Paint a local gain of dispersion on a receiver. Not physical.",
        _take_brush,
        checked=lambda state, _view_model: state.tool == "brush",
    ),
    _tool("Pull a colour", "pull", "P", "Drag a colour of the caustic: the dispersion follows."),
    _tool("Measure", "measure", "K", "Ruler and protractor: two points give a length, a third the angle between."),
    Command(
        "Accumulate photons",
        ("Space",),
        "Render",
        "Go on or pause.",
        _toggle_playing,
        checked=lambda state, _view_model: state.playing,
    ),
    Command(
        "Trace again", ("Ctrl+R",), "Render", "Trace photons anew with the present glass.", _ask(requests.Retrace())
    ),
    Command(
        "Physical picture",
        ("V",),
        "Render",
        "Leave the dispersion brush out, to compare.",
        _toggle_physical,
        checked=lambda state, _view_model: state.physical,
    ),
    Command(
        "Reload shaders",
        ("F5",),
        "Render",
        "Compile the shaders from disk again; the last good ones stay on errors.",
        _ask(requests.ReloadShaders()),
    ),
    Command("Brighter", ("=",), "Display", "Exposure up by a quarter stop.", partial(view_commands.expose, 0.25)),
    Command("Darker", ("-",), "Display", "Exposure down by a quarter stop.", partial(view_commands.expose, -0.25)),
    Command(
        "Automatic exposure",
        ("Shift+E",),
        "Display",
        "Let the exposure follow the picture.",
        view_commands.toggle_auto,
        checked=lambda state, _view_model: state.display.auto_exposure,
    ),
    Command(
        "False colour",
        ("X",),
        "Display",
        "Luminance on a logarithmic colour scale.",
        partial(view_commands.toggle_display, "false_colour"),
        checked=lambda state, _view_model: state.display.false_colour,
    ),
    Command(
        "Ray overlay",
        ("R",),
        "Display",
        "Draw a fan of rays through the selected object.",
        partial(view_commands.toggle_display, "ray_overlay"),
        checked=lambda state, _view_model: state.display.ray_overlay,
    ),
    Command(
        "Magnifier",
        ("M",),
        "Display",
        "Magnify the pixels under the cursor.",
        partial(view_commands.toggle_display, "magnifier"),
        checked=lambda state, _view_model: state.display.magnifier,
    ),
    Command(
        "Single wavelength",
        ("L",),
        "Display",
        "Show the light of one wavelength only.",
        view_commands.toggle_solo,
        checked=lambda state, _view_model: state.solo_nm is not None,
    ),
    Command(
        "Shortcuts",
        ("F1",),
        "Help",
        "List the shortcuts.",
        partial(_toggle_panel, "shortcuts"),
        checked=lambda state, _view_model: state.preferences.panels.shortcuts,
    ),
    Command("About SpectraSplat", (), "Help", "Version, graphics driver, licences.", partial(_toggle_panel, "about")),
)
"""All but the numbered views and the panels, in the order of the menus."""

PANELS: tuple[Command, ...] = (
    panel("Outliner", "outliner", "Objects and lights of the scene."),
    panel("Inspector", "inspector", "Place and material of the selection."),
    panel("Dispersion", "dispersion", "The selected glass: n_d, V_d, gain, n(λ)."),
    panel("Abbe diagram", "abbe", "Catalogue glasses by n_d and V_d; click to choose one."),
    panel("Brush", "brush", "The dispersion brush."),
    panel("View", "view", "Exposure, tone, false colour, single wavelength, camera, sampling."),
    panel("Timing", "timing", "Frame time by pass, photons, memory, fall-backs."),
    panel("Spectrum", "spectrum", "The spectrum under the cursor."),
    panel("Compare", "compare", "Reference, wipe, error map, error against time."),
    panel("Rays", "rays", "Deviation and focal length of the ray overlay, by wavelength."),
    panel("Lesson", "lesson", "Six lessons: a scene each, a few sentences, what to try."),
    panel("History", "history", "All steps that can be undone."),
    panel("Export", "export", "Screenshots, baked maps, animations."),
)

VIEWS: tuple[Command, ...] = tuple(
    command
    for number in range(9)
    for command in (
        Command(
            f"View {number + 1}",
            (str(number + 1),),
            "Views",
            "Go to this stored view.",
            partial(view_commands.go_to_view, number),
            enabled=partial(_is_stored, number),
        ),
        Command(
            f"Store view {number + 1}",
            (f"Ctrl+{number + 1}",),
            "Views",
            "Keep the present camera under this number.",
            partial(view_commands.store_view, number),
        ),
    )
)

_BY_NAME = {command.name: command for command in (*COMMANDS, *VIEWS)} | {
    f"Panel: {command.name}": command for command in PANELS
}


def command(name: str) -> Command:
    """By name; panels are "Panel: Outliner" …. KeyError for a name that does not exist."""
    return _BY_NAME[name]
