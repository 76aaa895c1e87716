"""The dialogues that stand between the user and lost work: open, save as, unsaved changes, quit.

Which question is open is memory of the interface; the host gets only the final requests.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from imgui_bundle import imgui

from ...base.paths import assets_dir, shipped_scenes
from ...edit import edits, requests
from ...edit.importing import import_objects
from ...edit.state import Selection, State
from .. import theme
from ..view_model import JobInfo, ViewModel
from . import file_browser, picture_choice, widgets

OPENABLE = (".toml", ".glb", ".gltf", ".obj", ".ply", ".stl")
COMPARABLE = (".exr", ".npy")
"""Dropped while the compare panel is open, these are compared with."""
SAVEABLE = (".toml", ".glb")
_UNSAVED = "Unsaved changes"
_UNFINISHED = "Unfinished export"


@dataclass
class _Memory:
    pending: list[requests.Request] = field(default_factory=list)
    """What waits for the answer to "save first?"."""
    is_saving: bool = False
    """Save was chosen: `pending` goes on once nothing is unsaved."""


_memory = _Memory()


def reset() -> None:
    """Close every dialogue, as a new window does."""
    file_browser.close()
    _memory.pending.clear()
    _memory.is_saving = False


def open_file(state: State, view_model: ViewModel) -> State:
    """Ask which file to open."""
    start = view_model.path.parent if view_model.path is not None else _recent_folder(view_model)
    file_browser.ask(file_browser.Question("open", "Open", OPENABLE, start, known=shipped_scenes()))
    return state


def import_file(state: State, view_model: ViewModel) -> State:
    """Ask which file's objects are to join the scene."""
    start = view_model.path.parent if view_model.path is not None else _recent_folder(view_model)
    file_browser.ask(file_browser.Question("import", "Import into this scene", OPENABLE, start, known=shipped_scenes()))
    return state


def open_path(state: State, view_model: ViewModel, path: Path) -> State:
    """Open `path`; asks first when work would be lost. A picture or a lamp becomes part of the scene instead."""
    if state.preferences.panels.compare and path.suffix.lower() in COMPARABLE:
        mode = "wipe" if state.compare.mode == "off" else state.compare.mode
        return replace(state, compare=replace(state.compare, method="file", file=path, mode=mode))
    if picture_choice.is_part(path):
        return picture_choice.dropped(state, path)
    return unless_unsaved(state, view_model, requests.Open(path))


def new_scene(state: State, view_model: ViewModel) -> State:
    """Start from the default scene; asks first when work would be lost."""
    return unless_unsaved(state, view_model, requests.NewScene())


NO_FILE = "'{}' has no file of its own yet: what comes with SpectraSplat, and a mesh, are never written over."


def save_as(state: State, view_model: ViewModel) -> State:
    """Ask where to save."""
    folder = view_model.path.parent if view_model.path is not None else _recent_folder(view_model)
    name = view_model.path.name if view_model.path is not None else f"{_file_stem(view_model.title)}.toml"
    # Else Ctrl+S on a scene that comes with the program would ask this without a word why.
    hint = "" if view_model.path is not None else NO_FILE.format(view_model.title)
    file_browser.ask(file_browser.Question("save", "Save as", SAVEABLE, folder / name, saving=True, hint=hint))
    return state


def draw_dialogs(state: State, view_model: ViewModel) -> State:
    """Draw what is open and carry its answers on."""
    file_browser.draw()
    state = picture_choice.answers(state)
    chosen = file_browser.take("open")
    if chosen is not None:
        state = open_path(state, view_model, chosen)
    brought = file_browser.take("import")
    if brought is not None:
        state = _imported(state, brought)
    target = file_browser.take("save")
    if target is not None:
        state = state.asking(requests.Save(target))
    elif _memory.is_saving and not file_browser.is_open("save"):
        state = _after_saving(state, view_model)
    if (_memory.pending and not _memory.is_saving) or view_model.asks_to_quit:
        state = _unsaved_question(state, view_model)
    elif view_model.asks_about_export and view_model.job is not None:
        state = _export_question(state, view_model.job)
    elif view_model.asks_about_export:  # it has ended by itself meanwhile
        state = state.asking(requests.QuitAfterExport())
    return state


def _imported(state: State, path: Path) -> State:
    """With the file's objects, the first of them selected."""
    first = len(state.scene.objects)
    after = edits.attempt(state, f"Import {path.name}", import_objects, path)
    return after if after.scene is state.scene else replace(after, selection=Selection("object", first))


def unless_unsaved(state: State, view_model: ViewModel, request: requests.Request) -> State:
    """`request`, after the question whether to save first where work would be lost."""
    if not view_model.unsaved:
        return state.asking(request).with_panels(start_page=False)
    _memory.pending, _memory.is_saving = [request], False
    return state


def _after_saving(state: State, view_model: ViewModel) -> State:
    """Saving was carried out last frame: go on, or, when it failed or was cancelled, keep everything as it is."""
    pending = tuple(_memory.pending)
    _memory.pending, _memory.is_saving = [], False
    if view_model.unsaved:
        return state
    return state.asking(*pending).with_panels(start_page=False)


def _begin_question(title: str) -> bool:
    if not imgui.is_popup_open(title):
        imgui.open_popup(title)
    centre = imgui.get_main_viewport().get_center()
    # Always: its height is known only once its words are wrapped.
    imgui.set_next_window_pos(centre, imgui.Cond_.always, imgui.ImVec2(0.5, 0.5))
    return imgui.begin_popup_modal(title, None, imgui.WindowFlags_.always_auto_resize)[0]


def _export_question(state: State, job: JobInfo) -> State:
    if not _begin_question(_UNFINISHED):
        return state
    imgui.text_unformatted(f"{job.title} is not finished ({job.fraction:.0%}).")
    widgets.hint(f"Wait for it before quitting? Stopped now, {job.when_stopped}.")
    imgui.dummy(imgui.ImVec2(theme.em(26), theme.em(0.4)))
    width = theme.em(7)
    asked: requests.Request | None = None
    if widgets.button("Finish, then quit", tip="Quit once it is there.", width=width + theme.em(2)):
        asked = requests.QuitAfterExport()
    imgui.same_line()
    if widgets.button("Stop, then quit", tip=f"{job.when_stopped[:1].upper()}{job.when_stopped[1:]}.", width=width):
        asked = requests.QuitAfterExport(stop=True)
    imgui.same_line()
    if widgets.button("Cancel##export", tip="Stay, and let it go on.", width=width) or imgui.is_key_pressed(
        imgui.Key.escape
    ):
        asked = requests.CancelQuit()
    if asked is not None:
        imgui.close_current_popup()
        state = state.asking(asked)
    imgui.end_popup()
    return state


def _unsaved_question(state: State, view_model: ViewModel) -> State:
    if not _begin_question(_UNSAVED):
        return state
    is_quitting = view_model.asks_to_quit
    imgui.text_unformatted(f"{view_model.title} has changes that are not saved.")
    widgets.hint("Save them before quitting?" if is_quitting else "Save them before another scene takes its place?")
    imgui.dummy(imgui.ImVec2(theme.em(26), theme.em(0.4)))
    width = theme.em(7)
    if widgets.button("Save##unsaved", tip="Save, then go on.", width=width):
        state = _save_first(state, view_model)
    imgui.same_line()
    if widgets.button("Discard", tip="Go on; the changes are lost.", width=width):
        state = _go_on(state, view_model)
    imgui.same_line()
    if widgets.button("Cancel##unsaved", tip="Stay, with everything as it is.", width=width) or imgui.is_key_pressed(
        imgui.Key.escape
    ):
        state = _stay(state, view_model)
    imgui.end_popup()
    return state


def _go_on(state: State, view_model: ViewModel) -> State:
    """Without saving."""
    imgui.close_current_popup()
    if view_model.asks_to_quit:
        return state.asking(requests.Quit(discard=True))
    pending, _memory.pending = tuple(_memory.pending), []
    return state.asking(*pending).with_panels(start_page=False)


def _stay(state: State, view_model: ViewModel) -> State:
    imgui.close_current_popup()
    _memory.pending, _memory.is_saving = [], False
    return state.asking(requests.CancelQuit()) if view_model.asks_to_quit else state


def _save_first(state: State, view_model: ViewModel) -> State:
    imgui.close_current_popup()
    if view_model.asks_to_quit:
        state = _stay(state, view_model)
        _memory.pending = [requests.Quit()]
    _memory.is_saving = True
    return state.asking(requests.Save()) if view_model.path is not None else save_as(state, view_model)


def _recent_folder(view_model: ViewModel) -> Path:
    """Where the user last worked; never the folder of the scenes that come with the program."""
    shipped = assets_dir().resolve()
    folders = [path.parent for path in view_model.recent if not path.resolve().is_relative_to(shipped)]
    return folders[0] if folders else Path.home()


def _file_stem(title: str) -> str:
    kept = "".join(c if c.isalnum() or c in "-_ " else "_" for c in title).strip()
    return kept or "scene"
