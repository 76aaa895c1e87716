"""The list of lights and objects: click selects, double click frames, F2 renames, right click offers the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from ...edit import selecting
from ...edit.adding import RECEIVERS, SHAPES, add_object
from ...edit.lights import add_light
from ...edit.requests import CopyMaterial, FrameSelection
from ...edit.state import Selection, State
from ...model.lights import LIGHT_KINDS
from ...model.optics.crystals import named
from ...model.scene import Light, Material, SceneObject
from .. import item_rects, theme
from ..view_model import ViewModel
from . import widgets

_SEARCH_FROM = 12
"""A scene of more things than this gets a search field."""

_EYES, _LOCKS = (icons.ICON_FA_EYE_SLASH, icons.ICON_FA_EYE), (icons.ICON_FA_LOCK, icons.ICON_FA_LOCK_OPEN)
_memory: dict[str, object] = {"renaming": None, "text": "", "search": ""}
"""What is being typed: memory of the interface, no part of the state."""


def draw_outliner(state: State, _view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    state = _toolbar(state)
    wanted = str(_memory["search"]).strip().lower()
    state = _world(state)
    state = _group(state, "Lights", "light", state.scene.lights, wanted)
    state = _group(state, "Objects", "object", state.scene.objects, wanted)
    if imgui.is_window_hovered() and imgui.is_mouse_clicked(0) and not imgui.is_any_item_hovered():
        state = replace(state, selection=Selection())
    if state.selection.kind is not None and imgui.is_window_focused() and imgui.is_key_pressed(imgui.Key.f2):
        _start_renaming(state, state.selection)
    return state


def _world(state: State) -> State:
    """What is neither an object nor a light: the scene's own settings with its environment, and its camera."""
    for name, icon, selection, tip in (
        ("World", icons.ICON_FA_GLOBE, Selection(), "The scene's settings and environment."),
        ("Camera", icons.ICON_FA_VIDEO, Selection("camera"), "The view that the scene is saved with."),
    ):
        with theme.chosen_rows():
            clicked, _ = imgui.selectable(f"{icon}  {name}###{name}", state.selection == selection)
        item_rects.note(name)
        widgets.tooltip(tip)
        if clicked:
            state = replace(state, selection=selection, also=())
    return state


def draw_add_items(state: State) -> State:
    """Menu items that add lights and objects to the scene and select what was added."""
    if imgui.begin_menu(f"{icons.ICON_FA_LIGHTBULB}  Light"):
        for kind, cls in LIGHT_KINDS.items():
            pressed, _ = imgui.menu_item(f"{kind.capitalize()}##light", "", False)
            item_rects.note(f"Add {kind} light")
            widgets.tooltip(cls.remark)
            if pressed:
                state = selecting.added(state, "light", f"Add {kind} light", add_light, kind, state.view)
        imgui.end_menu()
    item_rects.note("Add light")
    for title, shapes in (
        ("Glass", [s for s in SHAPES if s not in RECEIVERS]),
        ("Receiver", list(RECEIVERS)),
    ):
        icon = icons.ICON_FA_GEM if title == "Glass" else icons.ICON_FA_SQUARE
        if imgui.begin_menu(f"{icon}  {title}"):
            for shape in shapes:
                words = shape.replace("_", " ")
                pressed, _ = imgui.menu_item(f"{words.capitalize()}##shape", "", False)
                item_rects.note(f"Add {words}")
                widgets.tooltip(f"A {words} next to the other objects; lengths follow the scene.")
                if pressed:
                    state = selecting.added(state, "object", f"Add {words}", add_object, shape)
            imgui.end_menu()
        item_rects.note(f"Add {title.lower()}")
    return state


def icon_of(thing: SceneObject | Light) -> str:
    """The icon before a name: by material, or a lamp."""
    if isinstance(thing, Light):
        return icons.ICON_FA_SUN if not thing.has_place else icons.ICON_FA_LIGHTBULB
    return _material_icon(thing.material)


def _material_icon(material: Material) -> str:
    if material.transmits:
        return icons.ICON_FA_GEM
    if material.receives:
        return icons.ICON_FA_SQUARE
    return icons.ICON_FA_CIRCLE if material.is_black else icons.ICON_FA_CIRCLE_HALF_STROKE


def _toolbar(state: State) -> State:
    if widgets.button(f"{icons.ICON_FA_PLUS}  Add##outliner", tip="Add a light, a glass or a receiver."):
        imgui.open_popup("##add")
    if imgui.begin_popup("##add"):
        state = draw_add_items(state)
        imgui.end_popup()
    if len(state.scene.objects) + len(state.scene.lights) > _SEARCH_FROM:
        imgui.same_line()
        imgui.set_next_item_width(-1)
        _, _memory["search"] = imgui.input_text_with_hint("##search", "Search", str(_memory["search"]))
        item_rects.note("Search outliner")
        widgets.tooltip("Show only names that hold these letters.")
    else:
        _memory["search"] = ""
    return state


def _group(state: State, title: str, kind: str, things: Sequence[Light | SceneObject], wanted: str) -> State:
    imgui.separator_text(f"{title}  {len(things)}")
    for index, thing in enumerate(things):
        if wanted in thing.name.lower():
            imgui.push_id(f"{kind} {index}")
            state = _row(state, Selection("light" if kind == "light" else "object", index), thing)
            imgui.pop_id()
    return state


def _row(state: State, selection: Selection, thing: SceneObject | Light) -> State:
    if _memory["renaming"] == selection:
        return _rename_field(state, selection, thing)
    flags = imgui.SelectableFlags_.allow_double_click | imgui.SelectableFlags_.allow_overlap
    with theme.chosen_rows():
        clicked, _ = imgui.selectable(
            f"{icon_of(thing)}  {thing.name}###row", selecting.is_selected(state, selection), flags
        )
    item_rects.note(thing.name)
    widgets.tooltip(_about(thing), "Double-click: frame. F2: rename. Right-click: more.")
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    if clicked:
        io = imgui.get_io()
        state = selecting.chosen(state, selection, io.key_ctrl or io.key_shift)
        if imgui.is_mouse_double_clicked(0):
            state = state.asking(FrameSelection())
    if imgui.begin_popup_context_item("##more"):
        state = _context_menu(replace(state, selection=selection), selection)
        imgui.end_popup()
    return _switches(state, selection, thing, low, high)


def _switches(
    state: State, selection: Selection, thing: SceneObject | Light, low: imgui.ImVec2, high: imgui.ImVec2
) -> State:
    """Eye and lock at the right end: of rows under the mouse, and where they are set."""
    key = selecting.key_of(state.scene, selection)
    assert key is not None
    is_hidden, is_locked = key in state.hidden, key in state.locked
    hovered = imgui.is_mouse_hovering_rect(
        low, imgui.ImVec2(imgui.get_window_pos().x + imgui.get_window_width(), high.y)
    )
    side = high.y - low.y
    for position, (name, is_set, (on, off), tip) in enumerate(
        (
            ("Hide", is_hidden, _EYES, "Leave it out of the picture, or show it again."),
            ("Lock", is_locked, _LOCKS, "Keep it from being selected and moved in the picture."),
        )
    ):
        if not (hovered or is_set):
            continue
        corner = imgui.ImVec2(high.x - (2 - position) * theme.em(1.4), low.y)
        imgui.same_line(corner.x - imgui.get_window_pos().x + imgui.get_scroll_x())
        pressed = imgui.invisible_button(f"##{name}", imgui.ImVec2(theme.em(1.3), imgui.get_text_line_height()))
        item_rects.note(f"{name} {thing.name}")
        widgets.tooltip(tip)
        colours = theme.palette()
        tint = colours.text if is_set or imgui.is_item_hovered() else colours.muted
        middle = low.y + 0.5 * (side - imgui.get_font_size())
        imgui.get_window_draw_list().add_text(imgui.ImVec2(corner.x, middle), theme.packed(tint), on if is_set else off)
        if pressed and name == "Hide":
            state = replace(state, hidden=state.hidden ^ {key})
        elif pressed:
            state = replace(state, locked=state.locked ^ {key})
    if not (hovered or is_hidden or is_locked):
        _aside(thing, low, high)
    return state


def _aside(thing: SceneObject | Light, low: imgui.ImVec2, high: imgui.ImVec2) -> None:
    """What it is made of, at the right end where there is room."""
    text = _material_words(thing.material) if isinstance(thing, SceneObject) else thing.kind
    width = imgui.calc_text_size(text).x
    name_end = low.x + imgui.calc_text_size(f"{icon_of(thing)}  {thing.name}").x
    if name_end + theme.em(1) + width < high.x:
        at = imgui.ImVec2(high.x - width - theme.em(0.2), low.y + 0.5 * (high.y - low.y - imgui.get_font_size()))
        imgui.get_window_draw_list().add_text(at, theme.packed(theme.palette().muted), text)


def _material_words(material: Material) -> str:
    if material.dispersion is None or material.is_grating:
        return material.kind
    if material.is_crystal:
        return named(material.dispersion, material.extraordinary) or "crystal"
    return material.dispersion.name or material.kind


def _about(thing: SceneObject | Light) -> str:
    if isinstance(thing, Light):
        return f"{thing.kind.capitalize()} light."
    return f"{_material_words(thing.material)}, {len(thing.mesh.triangles):,} triangles."


def _context_menu(state: State, selection: Selection) -> State:
    def item(label: str, tip: str, enabled: bool = True) -> bool:
        pressed, _ = imgui.menu_item(label, "", False, enabled)
        item_rects.note(f"Context: {label}")
        widgets.tooltip(tip)
        return pressed

    if item("Frame", "Move the camera so that it fills the view (F)."):
        state = state.asking(FrameSelection())
    if item("Rename", "Give it another name (F2)."):
        _start_renaming(state, selection)
    if item("Duplicate", "Copy it (Ctrl+D)."):
        return selecting.duplicated(state, (selection,))
    if selection.kind == "object":
        imgui.separator()
        if item("Copy material", "Copy its material (Ctrl+C)."):
            state = state.asking(CopyMaterial(selection.index))
        if item("Paste material", "Give it the copied material (Ctrl+V).", state.clipboard is not None):
            return selecting.with_pasted_material(state)
    imgui.separator()
    if item("Delete", "Remove it (Delete)."):
        return selecting.deleted(state, (selection,))
    return state


def _start_renaming(state: State, selection: Selection) -> None:
    _memory.update(renaming=selection, text=selecting.name_of(state.scene, selection), focus=True)


def _rename_field(state: State, selection: Selection, thing: SceneObject | Light) -> State:
    if _memory.get("focus"):
        imgui.set_keyboard_focus_here()
        _memory["focus"] = False
    imgui.set_next_item_width(-1)
    flags = imgui.InputTextFlags_.auto_select_all | imgui.InputTextFlags_.enter_returns_true
    done, _memory["text"] = imgui.input_text("##name", str(_memory["text"]), flags)
    item_rects.note("Rename")
    widgets.tooltip("Enter keeps the name, Esc the old one.")
    if not done and not imgui.is_item_deactivated():
        return state
    _memory["renaming"] = None
    text = str(_memory["text"]).strip()
    if imgui.is_key_pressed(imgui.Key.escape) or text == thing.name:
        return state
    return selecting.renamed(state, selection, text)
