"""Choosing a file to open or a place to save, drawn with imgui so that it works everywhere, without a window system
too.

Whoever needs a file calls `ask(Question(…))`; what is done with the chosen one is part of the question.
One question is open at a time; a new one replaces it.
"""

from __future__ import annotations

import mimetypes
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from ...base.errors import suggestion
from ...base.image_io import SUFFIXES
from ...base.paths import SCENE_SUFFIXES
from ...edit.state import State
from .. import item_rects, theme
from ..view_model import ViewModel
from . import widgets


@dataclass(frozen=True)
class Question:
    """What file is wanted."""

    title: str
    suffixes: tuple[str, ...]
    """Lower case with the dot; the first is the default of a file to save."""
    start: Path
    """Folder to begin in, or a file whose name is proposed."""
    then: Callable[[State, ViewModel, Path], State]
    """What is done with the chosen file."""
    saving: bool = False
    known: Mapping[str, Path] = field(default_factory=dict)
    """Files that are found by a bare name from any folder."""
    hint: str = ""
    """Why, where that is not plain."""


@dataclass(frozen=True)
class _Entry:
    path: Path
    is_folder: bool
    size: int
    modified: float


@dataclass
class _Browser:
    question: Question | None = None
    folder: Path = field(default_factory=Path.home)
    name: str = ""
    entries: Sequence[_Entry] = ()
    error: str = ""
    confirming: Path | None = None
    """An existing file that is about to be replaced."""
    wants_focus: bool = True
    chosen: Path | None = None


_browser = _Browser()
_OVERWRITE = "Replace file?"
_OWN_FORMATS = (*SUFFIXES, ".hdr", ".json", ".ies", ".ldt", *SCENE_SUFFIXES)
"""Kinds of files that Python's table lacks, or has on some systems only."""


def ask(question: Question) -> None:
    """Open the dialogue."""
    start = question.start.expanduser()
    _browser.question, _browser.confirming, _browser.wants_focus = question, None, True
    _browser.name = start.name if question.saving and not start.is_dir() else ""
    _enter(start if start.is_dir() else start.parent)


def beside(path: Path | None, name: str, suffix: str) -> Path:
    """A file to propose, in the folder of the scene's file or at home; only letters, digits, - and _ are kept."""
    stem = "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
    return (Path.home() if path is None else path.parent) / f"{stem}{suffix}"


def is_open(title: str) -> bool:
    """Whether that question is still on the screen."""
    return _browser.question is not None and _browser.question.title == title


def close() -> None:
    """Forget the question."""
    _browser.question = None


def draw(state: State, view_model: ViewModel) -> State:
    """Draw the dialogue, when a question is open; the state with what is done with the chosen file."""
    question = _browser.question
    if question is None:
        return state
    title = f"{question.title}##file browser"
    if not imgui.is_popup_open(title):
        imgui.open_popup(title)
    viewport = imgui.get_main_viewport()
    imgui.set_next_window_pos(viewport.get_center(), imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
    size = (min(theme.em(48), viewport.work_size.x * 0.9), min(theme.em(34), viewport.work_size.y * 0.85))
    imgui.set_next_window_size(size, imgui.Cond_.appearing)
    shown, stays = imgui.begin_popup_modal(title, True, imgui.WindowFlags_.no_saved_settings)
    if shown:
        _contents(question)
        if _browser.question is None:
            imgui.close_current_popup()  # one that is merely not drawn any more takes the next click
        imgui.end_popup()
    if not stays or (imgui.is_key_pressed(imgui.Key.escape) and _browser.confirming is None):
        _browser.question = None
    path, _browser.chosen = _browser.chosen, None
    return state if path is None else question.then(state, view_model, path)


def _contents(question: Question) -> None:
    if question.hint:
        widgets.hint(question.hint)
    _places(question)
    footer = imgui.get_frame_height_with_spacing() * 2 + theme.em(0.6)
    if _browser.error:
        footer += imgui.get_text_line_height_with_spacing()
    imgui.begin_child("##files", imgui.ImVec2(0, -footer), imgui.ChildFlags_.borders)
    _table(question)
    imgui.end_child()
    if _browser.error:
        widgets.error(_browser.error)
    _footer(question)
    _confirm_overwrite()


def _places(question: Question) -> None:
    """Up, home, and the folder as a field to type in."""
    if widgets.button(icons.ICON_FA_ARROW_UP + "##up", tip="To the folder above."):
        _enter(_browser.folder.parent)
    imgui.same_line()
    if widgets.button(icons.ICON_FA_HOUSE + "##home", tip="To your home folder."):
        _enter(Path.home())
    imgui.same_line()
    imgui.set_next_item_width(-1)
    done, text = imgui.input_text("##folder", str(_browser.folder), imgui.InputTextFlags_.enter_returns_true)
    item_rects.note("Folder")
    widgets.tooltip("The folder shown below. Type another and press Enter.")
    if done:
        typed = Path(text).expanduser()
        _enter(typed if typed.is_dir() else typed.parent)
        if typed.is_file():
            _browser.name = typed.name
            _choose(question)


def _table(question: Question) -> None:
    if not _browser.entries:
        widgets.hint(f"No folders and no {', '.join(question.suffixes)} files here.")
        return
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y | imgui.TableFlags_.sortable
    if not imgui.begin_table("##entries", 3, flags):
        return
    imgui.table_setup_scroll_freeze(0, 1)
    imgui.table_setup_column("Name", imgui.TableColumnFlags_.width_stretch | imgui.TableColumnFlags_.default_sort)
    imgui.table_setup_column("Changed", imgui.TableColumnFlags_.width_fixed, theme.em(9.5))
    imgui.table_setup_column("Size", imgui.TableColumnFlags_.width_fixed, theme.em(5))
    imgui.table_headers_row()
    for entry in _sorted(_browser.entries, imgui.table_get_sort_specs()):
        imgui.table_next_row()
        imgui.table_next_column()
        _row(entry, question)
        imgui.table_next_column()
        imgui.text_disabled(f"{datetime.fromtimestamp(entry.modified).astimezone():%Y-%m-%d  %H:%M}")
        imgui.table_next_column()
        imgui.text_disabled("" if entry.is_folder else _size_text(entry.size))
    imgui.end_table()


def _row(entry: _Entry, question: Question) -> None:
    icon = icons.ICON_FA_FOLDER if entry.is_folder else icons.ICON_FA_FILE
    flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_double_click
    flags |= imgui.SelectableFlags_.no_auto_close_popups
    clicked, _ = imgui.selectable(f"{icon}  {entry.path.name}", entry.path.name == _browser.name, flags)
    item_rects.note(entry.path.name)
    if not clicked:
        return
    if not entry.is_folder:
        _browser.name = entry.path.name
    if imgui.is_mouse_double_clicked(0):
        if entry.is_folder:
            _enter(entry.path)
        else:
            _choose(question)


def _footer(question: Question) -> None:
    if _browser.wants_focus:
        imgui.set_keyboard_focus_here()
        _browser.wants_focus = False
    imgui.set_next_item_width(-1)
    hint = "File name" if question.saving else "File name, or a whole path"
    if question.known:
        hint += ", or a shipped scene"
    entered, _browser.name = imgui.input_text_with_hint(
        "##name", hint, _browser.name, imgui.InputTextFlags_.enter_returns_true
    )
    item_rects.note("File name")
    tip = "The ending chooses the format" if question.saving else "Typed, or marked above"
    widgets.tooltip(f"Name of the file. {tip}: {', '.join(question.suffixes)}.")
    if not question.saving:
        entered = entered or (imgui.is_key_pressed(imgui.Key.enter) and not imgui.is_any_item_active())
    entered = entered and bool(_browser.name)
    width = theme.em(6.5)
    room = imgui.get_content_region_avail().x
    imgui.align_text_to_frame_padding()
    imgui.text_disabled(", ".join(question.suffixes))
    imgui.same_line(imgui.get_cursor_start_pos().x + room - 2 * width - imgui.get_style().item_spacing.x)
    if widgets.button("Cancel##file", tip="Close without choosing.", width=width):
        _browser.question = None
    imgui.same_line()
    word = "Save##file" if question.saving else "Open##file"
    if widgets.button(word, tip="Take the file named or marked.", enabled=bool(_browser.name), width=width) or entered:
        _choose(question)


def _choose(question: Question) -> None:
    """Answer the question, unless the file cannot be opened or would replace another."""
    path = _browser.folder / Path(_browser.name.strip()).expanduser()
    if question.saving:
        if path.suffix.lower() not in question.suffixes:
            if _is_format(path.suffix):
                _browser.error = f"{path.name}: no {path.suffix} is written here; end the name in {_either(question)}."
                return
            path = path.with_name(path.name + question.suffixes[0])
        if not path.parent.is_dir():
            near = suggestion(path.parent.name, [entry.path.name for entry in _browser.entries if entry.is_folder])
            _browser.error = f"There is no folder {path.parent}{near.rstrip('?')}{'?' if near else '.'}"
        elif path.is_dir():
            _browser.error = f"{path.name} is a folder."
        elif path.exists():
            _browser.confirming = path
        else:
            _answer(path)
    elif path.is_dir():
        _enter(path)
    elif not path.is_file() and _browser.name.strip() in question.known:
        _answer(question.known[_browser.name.strip()])
    elif not path.is_file():
        is_here = path.parent == _browser.folder
        near = suggestion(
            path.name, [*(entry.path.name for entry in _browser.entries), *question.known] if is_here else ()
        )
        where = "here" if is_here else f"in {path.parent}"
        _browser.error = f"There is no file {path.name} {where}{near.rstrip('?')}{'?' if near else '.'}"
    else:
        _answer(path)


def _either(question: Question) -> str:
    """ ".png, .jpg or .exr"."""
    *others, last = question.suffixes
    return f"{', '.join(others)} or {last}" if others else last


def _is_format(suffix: str) -> bool:
    """Whether `suffix` names a kind of file: shot.tiff asks for a TIFF, but v1.2 is only a name."""
    kind = mimetypes.types_map.get(suffix.lower(), "")
    return suffix.lower() in _OWN_FORMATS or kind.partition("/")[0] in ("image", "video", "model")


def _answer(path: Path) -> None:
    _browser.chosen, _browser.question, _browser.confirming = path, None, None


def _confirm_overwrite() -> None:
    path = _browser.confirming
    if path is None:
        return
    if not imgui.is_popup_open(_OVERWRITE):
        imgui.open_popup(_OVERWRITE)
    imgui.set_next_window_pos(imgui.get_main_viewport().get_center(), imgui.Cond_.appearing, imgui.ImVec2(0.5, 0.5))
    if not imgui.begin_popup_modal(_OVERWRITE, None, imgui.WindowFlags_.always_auto_resize)[0]:
        return
    imgui.text_unformatted(f"{path.name} exists already. Replace it?")
    imgui.dummy(imgui.ImVec2(theme.em(20), theme.em(0.3)))
    if widgets.button("Replace", tip="Write over the old file.", width=theme.em(6.5)):
        _answer(path)
        imgui.close_current_popup()
    imgui.same_line()
    if widgets.button("Keep old file", tip="Choose another name.", width=theme.em(8)):
        _browser.confirming = None
        imgui.close_current_popup()
    imgui.end_popup()


def _enter(folder: Path) -> None:
    """Show another folder; one that cannot be read leaves the present one and says why."""
    question = _browser.question
    if question is None:
        return None
    folder = folder.absolute()
    try:
        found = [_entry(item) for item in os.scandir(folder) if not item.name.startswith(".")]
    except OSError as error:
        _browser.error = f"{folder} cannot be read: {error.strerror}."
        if folder.exists() or folder == folder.parent:
            return None
        return _enter(folder.parent)
    _browser.folder, _browser.error = folder, ""
    if not question.saving:
        _browser.name = ""
    wanted = (entry for entry in found if entry is not None)
    _browser.entries = [e for e in wanted if e.is_folder or e.path.suffix.lower() in question.suffixes]
    return None


def _entry(item: os.DirEntry[str]) -> _Entry | None:
    try:
        status = item.stat()
        return _Entry(Path(item.path), item.is_dir(), status.st_size, status.st_mtime)
    except OSError:
        return None  # a dangling link, or gone since


def _sorted(entries: Sequence[_Entry], specs: imgui.TableSortSpecs | None) -> list[_Entry]:
    column, is_descending = 0, False
    if specs is not None and specs.specs_count > 0:
        spec = specs.get_specs(0)
        column, is_descending = spec.column_index, spec.get_sort_direction() == imgui.SortDirection.descending
    keys = (lambda e: e.path.name.lower(), lambda e: e.modified, lambda e: e.size)
    ordered = sorted(entries, key=keys[column], reverse=is_descending)
    return sorted(ordered, key=lambda e: not e.is_folder)


def _size_text(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} GB"
