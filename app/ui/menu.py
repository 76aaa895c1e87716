"""The menu bar: every command by name, with its shortcut and its tooltip."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import imgui

from ..edit.state import Panels, State, Theme
from . import commands, item_rects, layout, theme
from .commands import Command
from .panels import dialogs, lesson_panel, outliner, widgets
from .panels.methods import MENU_METHODS, METHOD_TIPS
from .view_model import ViewModel

_SCALES = (0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0)


def draw_menu(state: State, view_model: ViewModel) -> State:
    """Draw the menu bar at the top of the window."""
    if not imgui.begin_main_menu_bar():
        return state
    for title, contents in _MENUS:
        opened = imgui.begin_menu(title)
        item_rects.note(f"Menu: {title}")
        if opened:
            state = contents(state, view_model)
            imgui.end_menu()
    _title(view_model)
    imgui.end_main_menu_bar()
    return state


def _item(command: Command, state: State, view_model: ViewModel, label: str | None = None) -> State:
    checked = command.checked is not None and command.checked(state, view_model)
    keys = command.keys[0] if command.keys else ""
    pressed, _ = imgui.menu_item(label or command.name, keys, checked, command.enabled(state, view_model))
    item_rects.note(command.name)
    widgets.tooltip(command.tip)
    return command.act(state, view_model) if pressed else state


def _items(names: tuple[str, ...], state: State, view_model: ViewModel) -> State:
    """Several commands; an empty name is a line between them."""
    for name in names:
        if name:
            state = _item(commands.command(name), state, view_model)
        else:
            imgui.separator()
    return state


def _file(state: State, view_model: ViewModel) -> State:
    state = _items(("New scene", "Start page", "", "Open…"), state, view_model)
    if imgui.begin_menu("Open recent", bool(view_model.recent)):
        for path in view_model.recent:
            if imgui.menu_item(f"{view_model.called(path)}##{path}", "", False)[0]:
                state = dialogs.open_path(state, view_model, path)
            widgets.tooltip(str(path))
        imgui.end_menu()
    return _items(("Import…", "", "Save", "Save as…", "", "Render…", "Export…", "", "Quit"), state, view_model)


def _edit(state: State, view_model: ViewModel) -> State:
    for name, label in (("Undo", view_model.undo), ("Redo", view_model.redo)):
        shown = f"{name} {_lowered(label)}" if label else name
        state = _item(commands.command(name), state, view_model, f"{shown}###{name}")
    state = _items(("", "Duplicate", "Delete", "", "Copy material", "Paste material"), state, view_model)
    imgui.separator()
    if imgui.begin_menu("Add"):
        state = outliner.draw_add_items(state)
        imgui.end_menu()
    return state


def _view(state: State, view_model: ViewModel) -> State:
    state = _items(
        ("Frame selection", "Frame everything", "Scene's own view", "Keep as scene's view"), state, view_model
    )
    for title, prefix in (("Go to view", "View"), ("Store view", "Store view")):
        if imgui.begin_menu(title):
            state = _items(tuple(f"{prefix} {number}" for number in range(1, 10)), state, view_model)
            imgui.end_menu()
    imgui.separator()
    state = _items(
        ("Automatic exposure", "False colour", "Single wavelength", "Ray overlay", "Magnifier"), state, view_model
    )
    imgui.separator()
    if imgui.begin_menu("Panels"):
        state = _items(tuple(f"Panel: {command.name}" for command in commands.PANELS), state, view_model)
        imgui.end_menu()
    state = _items(("Hide panels", "Full screen"), state, view_model)
    if imgui.menu_item("Reset layout", "", False)[0]:
        layout.reset()
        state = replace(state, preferences=replace(state.preferences, panels=Panels()))
    item_rects.note("Reset layout")
    widgets.tooltip("Put all panels back where they were at the first start.")
    imgui.separator()
    return _appearance(state)


def _appearance(state: State) -> State:
    preferences = state.preferences
    themes: tuple[tuple[str, Theme], ...] = (("Dark theme", "dark"), ("Light theme", "light"))
    for name, theme_name in themes:
        if imgui.menu_item(name, "", preferences.theme == theme_name)[0]:
            preferences = replace(preferences, theme=theme_name)
        item_rects.note(name)
        widgets.tooltip("Colours of the interface; the picture stays as it is.")
    if imgui.begin_menu("Interface size"):
        for scale in _SCALES:
            if imgui.menu_item(f"{scale:.0%}", "", abs(preferences.ui_scale - scale) < 1e-3)[0]:
                preferences = replace(preferences, ui_scale=scale)
            item_rects.note(f"{scale:.0%}")
            widgets.tooltip("Size of text and controls, on top of the screen's own scale.")
        imgui.end_menu()
    return state if preferences == state.preferences else replace(state, preferences=preferences)


def _render(state: State, view_model: ViewModel) -> State:
    state = _items(("Accumulate photons", "Trace again", "Physical picture", ""), state, view_model)
    if imgui.begin_menu("Method"):
        for method, name in MENU_METHODS.items():
            if imgui.menu_item(name, "", state.method == method)[0]:
                state = replace(state, method=method)
            item_rects.note(name)
            widgets.tooltip(METHOD_TIPS[method])
        imgui.end_menu()
    imgui.separator()
    return _items(("Render…", "Panel: Compare", "", "Reload shaders"), state, view_model)


def _tools(state: State, view_model: ViewModel) -> State:
    return _items(
        ("Select", "Move", "Rotate", "Scale", "", "Dispersion brush", "Pull a colour", "", "Measure"), state, view_model
    )


def _help(state: State, view_model: ViewModel) -> State:
    opened = imgui.begin_menu("Lessons")
    item_rects.note("Lessons")
    if opened:
        state = lesson_panel.draw_lesson_items(state, view_model)
        imgui.end_menu()
    imgui.separator()
    return _items(("Shortcuts", "About SpectraSplat"), state, view_model)


_MENUS = (
    ("File", _file),
    ("Edit", _edit),
    ("View", _view),
    ("Render", _render),
    ("Tools", _tools),
    ("Help", _help),
)


def _title(view_model: ViewModel) -> None:
    """The scene's name at the right end, with a dot while it is not saved."""
    text = view_model.path.name if view_model.path is not None else view_model.title
    mark = "  •" if view_model.unsaved else ""
    width = imgui.calc_text_size(text + mark).x + theme.em(0.8)
    free = imgui.get_window_width() - imgui.get_cursor_pos_x()
    if free < width + theme.em(1):
        return
    imgui.set_cursor_pos_x(imgui.get_window_width() - width)
    imgui.text_disabled(text)
    widgets.tooltip(str(view_model.path) if view_model.path is not None else "Not saved to a file yet.")
    if view_model.unsaved:
        imgui.same_line(0, 0)
        with theme.coloured(theme.palette().warning):
            imgui.text_unformatted(mark)
        widgets.tooltip("There are changes that are not saved.")


def _lowered(label: str) -> str:
    """An edit's label in the middle of a line: "Undo move prism"; acronyms keep their capitals."""
    return label if label[:2].isupper() else label[:1].lower() + label[1:]
