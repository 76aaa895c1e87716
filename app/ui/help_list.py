"""F1: every shortcut and mouse gesture, searchable. And what program this is."""

from __future__ import annotations

from imgui_bundle import imgui

from ..base.paths import assets_dir
from ..base.version import __version__
from ..edit.state import State
from . import item_rects, shortcuts, theme
from .panels import widgets
from .view_model import ViewModel

_search = {"text": ""}
"""What is typed in the search field: memory of the interface."""


def draw_shortcuts(state: State, _view_model: ViewModel) -> State:
    """Draw the list's contents."""
    imgui.set_next_item_width(-1)
    _, _search["text"] = imgui.input_text_with_hint("##search", "Search", _search["text"])
    item_rects.note("Search shortcuts")
    widgets.tooltip("Show only what holds these letters: a key or what it does.")
    wanted = _search["text"].strip().lower()
    columns = max(1, min(3, int(imgui.get_content_region_avail().x / theme.em(19))))
    groups = _matching(wanted)
    if not groups:
        widgets.hint("No shortcut holds these letters.")
        return state
    if imgui.begin_table("##groups", columns, imgui.TableFlags_.sizing_stretch_same | imgui.TableFlags_.scroll_y):
        imgui.table_next_row()
        for column, titles in enumerate(_balanced(groups, columns)):
            imgui.table_set_column_index(column)
            for title in titles:
                _group(title, groups[title])
        imgui.end_table()
    return state


def _matching(wanted: str) -> dict[str, list[tuple[str, str]]]:
    found = {
        title: [(keys, what) for keys, what in lines if wanted in f"{keys} {what} {title}".lower()]
        for title, lines in shortcuts.listed().items()
    }
    return {title: lines for title, lines in found.items() if lines}


def _balanced(groups: dict[str, list[tuple[str, str]]], columns: int) -> list[list[str]]:
    """Titles by column, each group where it is shortest so far."""
    heights = [0] * columns
    result: list[list[str]] = [[] for _ in range(columns)]
    for title, lines in groups.items():
        column = heights.index(min(heights))
        result[column].append(title)
        heights[column] += len(lines) + 2
    return result


def _group(title: str, lines: list[tuple[str, str]]) -> None:
    with theme.heading():
        imgui.text_unformatted(title)
    if imgui.begin_table(f"##{title}", 2, imgui.TableFlags_.sizing_stretch_prop):
        imgui.table_setup_column("keys", imgui.TableColumnFlags_.width_stretch, 0.42)
        imgui.table_setup_column("what", imgui.TableColumnFlags_.width_stretch, 0.58)
        for keys, what in lines:
            imgui.table_next_row()
            imgui.table_next_column()
            with theme.coloured(theme.palette().accent):
                imgui.push_text_wrap_pos(0.0)
                imgui.text_unformatted(keys)
                imgui.pop_text_wrap_pos()
            imgui.table_next_column()
            imgui.push_text_wrap_pos(0.0)
            imgui.text_unformatted(what)
            imgui.pop_text_wrap_pos()
        imgui.end_table()
    imgui.dummy(imgui.ImVec2(0, theme.em(0.4)))


def draw_about(state: State, view_model: ViewModel) -> State:
    """Draw the window's contents."""
    with theme.heading(1.5):
        imgui.text_unformatted("SpectraSplat")
    widgets.hint(f"Version {__version__}")
    imgui.dummy(imgui.ImVec2(0, theme.em(0.3)))
    imgui.push_text_wrap_pos(0.0)
    imgui.text_unformatted(
        "Dispersive caustics in real time: photons carry the derivative of their path by refractive index, "
        "and each is drawn as one splat swept along its own spectrum."
    )
    imgui.pop_text_wrap_pos()
    imgui.dummy(imgui.ImVec2(0, theme.em(0.3)))
    for label, text in (
        ("Draws with", view_model.stats.renderer or "not started yet"),
        ("Licence", "MIT"),
        ("Data and fonts", str(assets_dir() / "LICENSES.md")),
    ):
        widgets.hint(label)
        imgui.push_text_wrap_pos(0.0)
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
    return state
