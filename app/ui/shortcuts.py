"""Keyboard shortcuts: the keys of `commands`, and the list of keys and mouse gestures that F1 shows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

from imgui_bundle import imgui

from ..edit.state import State
from . import layout
from .commands import COMMANDS, PANELS, VIEWS, Command
from .view_model import ViewModel

COMPARE_KEY = imgui.Key.c
"""Held down, the viewport shows the reference."""

_REPEATING = ("Undo", "Redo", "Brighter", "Darker")
"""Commands that a held key repeats."""

_ON_START_PAGE = ("File", "Help")
_ALWAYS = ("Shortcuts", "Quit", "Full screen")
"""Even while a text is typed or a menu is open; quitting in dialogues too."""

focused_panel = {"field": ""}
"""The panel that floats or was called up and had the keyboard in the last frame, of `Panels`: Esc closes it."""

_NAMED = {
    "Esc": imgui.Key.escape,
    "Delete": imgui.Key.delete,
    "Space": imgui.Key.space,
    "Home": imgui.Key.home,
    "=": imgui.Key.equal,
    "-": imgui.Key.minus,
}
_MODIFIERS = {"Ctrl": imgui.Key.mod_ctrl, "Shift": imgui.Key.mod_shift, "Alt": imgui.Key.mod_alt}


@dataclass(frozen=True)
class Gesture:
    """A line of the list that is no command: what the viewport does with mouse and keys."""

    keys: str
    group: str
    what: str


GESTURES = (
    Gesture("Click", "Mouse in the picture", "Select an object, or the object whose caustic it is"),
    Gesture("Shift+click", "Mouse in the picture", "Select one thing more, or one less"),
    Gesture("Ctrl+click", "Mouse in the picture", "Select the surface itself, even under a caustic"),
    Gesture("Middle drag, Alt+left drag", "Mouse in the picture", "Orbit"),
    Gesture("Shift+middle drag", "Mouse in the picture", "Pan"),
    Gesture("Wheel", "Mouse in the picture", "Zoom to the cursor"),
    Gesture("Right drag + W A S D Q E", "Mouse in the picture", "Fly; Shift is faster, Ctrl slower"),
    Gesture("Hold C", "Compare", "Show the reference"),
    Gesture("[  and  ]", "Brush and pull", "Smaller, larger brush"),
    Gesture("Shift+wheel", "Brush and pull", "Radius of the brush"),
    Gesture("Shift while painting", "Brush and pull", "Erase"),
    Gesture("Ctrl while painting", "Brush and pull", "Narrow instead of widen"),
    Gesture("Shift while pulling", "Brush and pull", "Change the local gain, not the glass"),
    Gesture("Ctrl+click on a field", "Panels", "Type a value"),
    Gesture("Double-click on a field", "Panels", "Back to its default"),
)


@cache
def chord(keys: str) -> int:
    """The imgui key chord of "Ctrl+Shift+Z"; KeyError for a key that does not exist."""
    *modifiers, name = keys.split("+")
    key = _NAMED.get(name) or imgui.Key[f"_{name}" if name.isdigit() else name.lower()]
    return sum(int(_MODIFIERS[modifier]) for modifier in modifiers) + int(key)


def handle(state: State, view_model: ViewModel) -> State:
    """Carry out the commands whose keys were pressed in this frame; nothing while a text field or a dialogue has
    them."""
    io = imgui.get_io()
    has_closed_menu = _close_menus()
    is_modal = imgui.internal.get_top_most_popup_modal() is not None
    for command in _all():
        if command.name in _ALWAYS and _is_pressed(command) and (command.name == "Quit" or not is_modal):
            return command.act(state, view_model)
    # The Esc that closes a menu closes nothing more: the panel below it would be closed as well.
    is_free = (
        not has_closed_menu and not io.want_text_input and not imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
    )
    # The right button held means flying: its letters belong to the camera.
    if not is_free or imgui.is_mouse_down(imgui.MouseButton_.right):
        return _hold_compare(state, False)
    on_start_page = state.preferences.panels.start_page
    # With nothing else to leave, it closes the last of those that float.
    closing = focused_panel["field"] or (next(reversed(layout.floating), "") if state.tool == "select" else "")
    if closing and imgui.is_key_pressed(imgui.Key.escape):
        return state.opened(closing, False)
    if on_start_page and imgui.is_key_pressed(imgui.Key.escape):
        return state.with_panels(start_page=False)
    for command in _all():
        # What the page hides must not be edited blindly.
        is_reachable = not on_start_page or command.group in _ON_START_PAGE
        if is_reachable and _is_pressed(command) and command.enabled(state, view_model):
            state = command.act(state, view_model)
    return _hold_compare(state, imgui.is_key_down(COMPARE_KEY) and not (io.key_ctrl or io.key_shift or io.key_alt))


def _close_menus() -> bool:
    """Esc closes menus and pickers, and whether it did; dialogues handle it themselves. (imgui does so only with its
    keyboard navigation on.)"""
    is_menu = imgui.is_popup_open("", imgui.PopupFlags_.any_popup) and imgui.internal.get_top_most_popup_modal() is None
    if not (is_menu and imgui.is_key_pressed(imgui.Key.escape)):
        return False
    imgui.internal.close_popup_to_level(0, True)
    return True


@cache
def _all() -> tuple[Command, ...]:
    return (*COMMANDS, *PANELS, *VIEWS)


def _is_pressed(command: Command) -> bool:
    flags = imgui.InputFlags_.repeat if command.name in _REPEATING else 0
    return any(imgui.internal.is_key_chord_pressed(chord(keys), flags) for keys in command.keys)


def _hold_compare(state: State, is_held: bool) -> State:
    if state.compare.holding == is_held:
        return state
    return replace(state, compare=replace(state.compare, holding=is_held))


def listed() -> dict[str, list[tuple[str, str]]]:
    """What F1 shows: (keys, what they do) by group."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for command in COMMANDS:
        if command.keys:
            groups.setdefault(command.group, []).append((", ".join(command.keys), command.name))
    groups["View"] += [("1 … 9", "Go to a stored view"), ("Ctrl+1 … 9", "Store the present view")]
    for gesture in GESTURES:
        groups.setdefault(gesture.group, []).append((gesture.keys, gesture.what))
    return groups
