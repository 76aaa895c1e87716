"""Choosing a glass from the catalogue: search as you type, makers, sorting, keyboard.

`draw_glass_picker` draws the contents of a popup that the dispersion panel opens; one click (or
Enter) gives the selected object that glass and closes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from imgui_bundle import ImVec2, imgui

from ...edit import edits
from ...edit.glass import set_dispersion
from ...edit.state import State
from ...model.optics import catalogue
from ...model.optics.catalogue import Entry
from .. import item_rects, theme
from ..view_model import ViewModel
from . import widgets
from .glass_values import abbe_text, selected_glass

POPUP = "Choose a glass"
"""Name for `imgui.open_popup`."""

_ALL_MAKERS = "All makers"
_COLUMNS = ("Name", "Maker", "n_d", "V_d", "Remark")


@dataclass
class _Memory:
    """What the list shows; not part of the document."""

    query: str = ""
    maker: str = _ALL_MAKERS
    row: int = 0
    """The row that Enter takes."""
    order: tuple[int, bool] | None = None
    """Column and whether it descends; None keeps the best match first."""


_memory = _Memory()


def draw_glass_picker(state: State, view_model: ViewModel) -> State:
    """Search field, maker and table; the state with the chosen glass, or as it was."""
    if selected_glass(state) is None:
        widgets.hint("Select an object of glass to choose its material.")
        return state
    by_enter = _draw_search()
    found = matching(_memory.query, _memory.maker, _memory.order)
    _move_by_keys(len(found))
    if found and catalogue.is_guess(_memory.query):
        widgets.note(f"Nothing is called '{_memory.query}'. These are guesses by its letters.")
    widgets.hint(f"{len(found)} of {len(catalogue.entries())}    ↑ ↓ move, Enter takes, Esc closes")
    clicked = _draw_table(found)
    chosen = clicked if clicked is not None else found[_memory.row] if by_enter and found else None
    if chosen is None:
        return state
    imgui.close_current_popup()
    return apply_glass(state, chosen)


def apply_glass(state: State, entry: Entry) -> State:
    """The selected object of that glass, without the gain of the other one. A refusal becomes a notice."""
    selected = selected_glass(state)
    if selected is None:
        return state
    index, item, _ = selected
    return edits.attempt(state, f"Glass of {item.name}: {entry.name}", set_dispersion, index, entry.dispersion)


@lru_cache(maxsize=64)
def matching(query: str, maker: str, order: tuple[int, bool] | None) -> tuple[Entry, ...]:
    """Entries for a search, best first or in the order of a column."""
    found = [e for e in catalogue.search(query) if maker in (_ALL_MAKERS, e.maker)]
    if order is None:
        return tuple(found)
    column, descends = order
    keys = (
        lambda e: e.name.casefold(),
        lambda e: e.maker,
        lambda e: e.dispersion.n_d,
        lambda e: e.dispersion.V_d,
        remark,
    )
    return tuple(sorted(found, key=keys[column], reverse=descends))


def remark(entry: Entry) -> str:
    """Other names, the maker's status and the source's remark, as one short line."""
    return ", ".join(filter(None, (entry.status, *entry.aliases, entry.note.rstrip("."))))


def _draw_search() -> bool:
    """The field (focused when the popup opens) and the makers; True when Enter is pressed in it."""
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
        _memory.row = 0
    imgui.set_next_item_width(theme.em(18.0))
    flags = imgui.InputTextFlags_.enter_returns_true.value | imgui.InputTextFlags_.escape_clears_all.value
    before = _memory.query
    by_enter, _memory.query = imgui.input_text_with_hint(
        "##search", "Search: N-BK7, flint, schott sf, diamond …", before, flags
    )
    item_rects.note("Search glasses")
    widgets.tooltip(
        "Words of a name, a maker or another name, in any order. Without a match, similar names are listed."
    )
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    maker_before = _memory.maker
    if imgui.begin_combo("##maker", _memory.maker):
        for maker in (_ALL_MAKERS, *catalogue.MAKER_ORDER):
            if imgui.selectable(maker, maker == _memory.maker)[0]:
                _memory.maker = maker
        imgui.end_combo()
    item_rects.note("Maker")
    widgets.tooltip("Show the glasses of one maker. “Materials” are water, plastics, crystals and gems.")
    if before != _memory.query or maker_before != _memory.maker:
        _memory.row = 0
    return by_enter


def _move_by_keys(count: int) -> None:
    page = 12
    for key, step in (
        (imgui.Key.down_arrow, 1),
        (imgui.Key.up_arrow, -1),
        (imgui.Key.page_down, page),
        (imgui.Key.page_up, -page),
    ):
        if imgui.is_key_pressed(key):
            _memory.row += step
    _memory.row = max(0, min(_memory.row, count - 1))


def _draw_table(found: tuple[Entry, ...]) -> Entry | None:
    kinds = imgui.TableFlags_
    flags = (
        kinds.sortable | kinds.sort_tristate | kinds.scroll_y | kinds.row_bg | kinds.borders_inner_v | kinds.resizable
    )
    if not imgui.begin_table("glasses", len(_COLUMNS), int(flags), ImVec2(0.0, -1.0)):
        return None
    widths = (2.6, 1.6, 1.2, 1.0, 3.6)
    for name, width in zip(_COLUMNS, widths, strict=True):
        imgui.table_setup_column(name, imgui.TableColumnFlags_.width_stretch.value, width)
    imgui.table_setup_scroll_freeze(0, 1)
    imgui.table_headers_row()
    _take_order()
    clicked = None
    clipper = imgui.ListClipper()
    clipper.begin(len(found))
    if imgui.is_key_pressed(imgui.Key.down_arrow) or imgui.is_key_pressed(imgui.Key.up_arrow):
        clipper.include_item_by_index(_memory.row)
    while clipper.step():
        for row in range(clipper.display_start, clipper.display_end):
            clicked = found[row] if _draw_row(found[row], row) else clicked
    imgui.end_table()
    return clicked


def _take_order() -> None:
    specs = imgui.table_get_sort_specs()
    if specs is None or not specs.specs_dirty:
        return
    _memory.order = None
    if specs.specs_count:
        first = specs.get_specs(0)
        _memory.order = (first.column_index, first.get_sort_direction() == imgui.SortDirection.descending)
    specs.specs_dirty = False


def _draw_row(entry: Entry, row: int) -> bool:
    imgui.table_next_row()
    imgui.table_next_column()
    span = imgui.SelectableFlags_.span_all_columns.value
    pressed = imgui.selectable(f"{entry.name}##{row}", row == _memory.row, span)[0]
    item_rects.note(entry.qualified_name)
    widgets.tooltip(f"{entry.qualified_name}\n{remark(entry)}".strip(), *entry.dispersion.notes())
    if row == _memory.row and (imgui.is_key_pressed(imgui.Key.down_arrow) or imgui.is_key_pressed(imgui.Key.up_arrow)):
        imgui.set_scroll_here_y(0.5)
    cells = (entry.maker, f"{entry.dispersion.n_d:.5f}", abbe_text(entry.dispersion.V_d), remark(entry))
    for text in cells:
        imgui.table_next_column()
        imgui.text_unformatted(text)
    return pressed
