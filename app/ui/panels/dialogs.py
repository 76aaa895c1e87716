"""The dialogues that keep the user from losing work: open, save as, unsaved changes, quit.

Which question is open is memory of the interface; the host gets only the final requests.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from imgui_bundle import imgui

from ...base.paths import SCENE_SUFFIXES, assets_dir, shipped_scenes
from ...edit import edits, requests
from ...edit.opening import import_objects
from ...edit.state import Selection, State
from .. import theme
from ..view_model import JobInfo, ViewModel
from . import file_browser, picture_choice, widgets

COMPARABLE = (".exr", ".npy")
"""Dropped while the compare panel is open, these are compared with."""
_SAVE_AS = "Save as"
SAVEABLE = (".toml", ".glb")


@dataclass
class _Memory:
    pending: list[requests.Request] = field(default_factory=list)
    """What waits for the answer to "save first?"."""
    is_saving: bool = False
    """Save was chosen: `pending` is requested once nothing is unsaved."""


_memory = _Memory()


def reset() -> None:
    """Close every dialogue, as a new window does."""
    file_browser.close()
    _memory.pending.clear()
    _memory.is_saving = False


def open_file(state: State, view_model: ViewModel) -> State:
    """Ask which file to open."""
    start = _folder(view_model)
    file_browser.ask(file_browser.Question("Open", SCENE_SUFFIXES, start, open_path, known=shipped_scenes()))
    return state


def import_file(state: State, view_model: ViewModel) -> State:
    """Ask which file's objects are to join the scene."""
    title, start = "Import into this scene", _folder(view_model)
    file_browser.ask(file_browser.Question(title, SCENE_SUFFIXES, start, _imported, known=shipped_scenes()))
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
    path, hint = view_model.path, ""
    if path is None:
        kept = "".join(c if c.isalnum() or c in "-_ " else "_" for c in view_model.title).strip()
        path = _folder(view_model) / f"{kept or 'scene'}.toml"
        # Else Ctrl+S on a scene that comes with the program would open this dialogue without a reason.
        hint = NO_FILE.format(view_model.title)
    file_browser.ask(file_browser.Question(_SAVE_AS, SAVEABLE, path, _saved, saving=True, hint=hint))
    return state


def _saved(state: State, _view_model: ViewModel, path: Path) -> State:
    return state.asking(requests.Save(path))


def draw_dialogs(state: State, view_model: ViewModel) -> State:
    """Draw what is open and carry its answers on."""
    was_saving = file_browser.is_open(_SAVE_AS)
    state = file_browser.draw(state, view_model)
    if _memory.is_saving and not was_saving:
        state = _after_saving(state, view_model)
    if (_memory.pending and not _memory.is_saving) or view_model.asks_to_quit:
        state = _unsaved_question(state, view_model)
    elif view_model.asks_about_export and view_model.job is not None:
        state = _export_question(state, view_model.job)
    elif view_model.asks_about_export:  # it has ended by itself meanwhile
        state = state.asking(requests.QuitAfterExport())
    return state


def _imported(state: State, _view_model: ViewModel, path: Path) -> State:
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


def _asked(title: str, words: str, hint: str, buttons: Mapping[str, str]) -> str:
    """The button of a question that was pressed, the last one by Esc too; empty while none was. `buttons`: labels, and
    what their tooltips say."""
    if not imgui.is_popup_open(title):
        imgui.open_popup(title)
    # Always: its height is known only once its words are wrapped.
    imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.always, imgui.ImVec2(0.5, 0.5))
    if not imgui.begin_popup_modal(title, None, imgui.WindowFlags_.always_auto_resize)[0]:
        return ""
    imgui.text_unformatted(words)
    widgets.hint(hint)
    imgui.dummy(imgui.ImVec2(theme.em(26), theme.em(0.4)))
    pressed = ""
    for label, tip in buttons.items():
        width = max(theme.em(7), imgui.calc_text_size(label.split("##")[0]).x + theme.em(1))
        if widgets.button(label, tip=tip, width=width):
            pressed = label
        imgui.same_line()
    imgui.new_line()
    if imgui.is_key_pressed(imgui.Key.escape):
        pressed = list(buttons)[-1]
    if pressed:
        imgui.close_current_popup()
    imgui.end_popup()
    return pressed.split("##")[0]


def _export_question(state: State, job: JobInfo) -> State:
    pressed = _asked(
        "Unfinished export",
        f"{job.title} is not finished ({job.fraction:.0%}).",
        f"Wait for it before quitting? Stopped now, {job.when_stopped}.",
        {
            "Finish, then quit": "Quit once it is there.",
            "Stop, then quit": f"{job.when_stopped[:1].upper()}{job.when_stopped[1:]}.",
            "Cancel##export": "Stay, and let it continue.",
        },
    )
    if not pressed:
        return state
    stop = pressed == "Stop, then quit"
    return state.asking(requests.CancelQuit() if pressed == "Cancel" else requests.QuitAfterExport(stop))


def _unsaved_question(state: State, view_model: ViewModel) -> State:
    is_quitting = view_model.asks_to_quit
    pressed = _asked(
        "Unsaved changes",
        f"{view_model.title} has changes that are not saved.",
        "Save them before quitting?" if is_quitting else "Save them before another scene takes its place?",
        {
            "Save##unsaved": "Save, then continue.",
            "Discard": "Continue; the changes are lost.",
            "Cancel##unsaved": "Stay, with everything as it is.",
        },
    )
    if not pressed:
        return state
    pending, _memory.pending, _memory.is_saving = tuple(_memory.pending), [], False
    if pressed == "Discard":
        if is_quitting:
            return state.asking(requests.Quit(discard=True))
        return state.asking(*pending).with_panels(start_page=False)
    if is_quitting:
        state = state.asking(requests.CancelQuit())
    if pressed == "Cancel":
        return state
    _memory.pending, _memory.is_saving = [requests.Quit()] if is_quitting else list(pending), True
    return state.asking(requests.Save()) if view_model.path is not None else save_as(state, view_model)


def _folder(view_model: ViewModel) -> Path:
    """The scene's, else where the user last worked; never the folder of the scenes that come with the program."""
    if view_model.path is not None:
        return view_model.path.parent
    shipped = assets_dir().resolve()
    folders = [path.parent for path in view_model.recent if not path.resolve().is_relative_to(shipped)]
    return folders[0] if folders else Path.home()
