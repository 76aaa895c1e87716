"""Where the windows are docked: the picture in the middle, tools around it, and a way back to that.

Dear ImGui keeps what the user moves; the host saves it as ini text. The default layout is built
where that text holds none, and again after `reset`.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Literal, Protocol

from imgui_bundle import imgui

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..edit.preferences import layout_file
from . import theme

VIEWPORT = "Viewport"
_DOCKSPACE = "SpectraSplat dock"
_HOST = "##dock host"

_TALL_EM = 50.0
"""A window of more text heights than this has two rows of panels on the right, a lower one tabs only."""
_SETTLED_AFTER = 4
"""Frames until new windows have taken their places and the focus."""

Place = Literal["left top", "left bottom", "right top", "right bottom", "right bottom if tall", "bottom", "floating"]


class Docked(Protocol):
    """A window's title and where the default layout puts it; those of one place share tabs, first in front.

    "if tall": floating in a low window, whose one row of tabs is full.
    """

    @property
    def title(self) -> str: ...
    @property
    def place(self) -> Place: ...


BARE = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_docking
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
)
"""Flags of windows that the interface places itself."""
ON_PICTURE = BARE | imgui.WindowFlags_.no_focus_on_appearing | imgui.WindowFlags_.no_nav

_raised: dict[str, int] = {}
"""Fields of the panels to be shown in front, and for how many frames: a panel that is opened has its tab only in the
second."""

floating: dict[str, str] = {}
"""Titles of the panels that floated in this frame, by their fields; the last that was drawn comes last."""

behind: set[str] = set()
"""Fields of the panels that were behind another one's tab in the last frame."""


def begin_area(title: str, low: imgui.ImVec2, size: imgui.ImVec2, padding: imgui.ImVec2, flags: int = 0) -> None:
    """Begin a window that is a part of the whole: square, without border, behind all others."""
    imgui.set_next_window_pos(low)
    imgui.set_next_window_size(size)
    imgui.push_style_var(imgui.StyleVar_.window_padding, padding)
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
    imgui.begin(title, None, BARE | imgui.WindowFlags_.no_bring_to_front_on_focus | flags)
    imgui.pop_style_var(3)


def dockspace(windows: Sequence[Docked], bottom_margin: float) -> None:
    """Submit the dock space below the menu bar, `bottom_margin` pixels above the lower edge; before every docked
    window."""
    viewport = imgui.get_main_viewport()
    size = imgui.ImVec2(viewport.work_size.x, viewport.work_size.y - bottom_margin)
    flags = imgui.WindowFlags_.no_nav_focus | imgui.WindowFlags_.no_background
    begin_area(_HOST, viewport.work_pos, size, imgui.ImVec2(0, 0), flags)
    dock = imgui.get_id(_DOCKSPACE)
    memory, built = imgui.get_state_storage(), imgui.get_id("built in frame")
    if imgui.internal.dock_builder_get_node(dock) is None:
        _build(dock, size, windows)
        memory.set_int(built, imgui.get_frame_count())
    elif memory.get_int(built, -9) == imgui.get_frame_count() - _SETTLED_AFTER:
        _bring_to_front(windows)
    imgui.dock_space(dock)
    _hide_tab_of_picture()
    imgui.end()


def reset() -> None:
    """Forget where windows are docked: the next `dockspace` builds the default. Call it before that, in the same frame
    or not."""
    host = imgui.internal.find_window_by_name(_HOST)
    if host is not None:
        imgui.internal.dock_builder_remove_node(host.get_id(_DOCKSPACE))


def _build(dock: int, size: imgui.ImVec2, windows: Sequence[Docked]) -> None:
    builder = imgui.internal
    builder.dock_builder_add_node(dock, imgui.internal.DockNodeFlagsPrivate_.dock_space)
    builder.dock_builder_set_node_size(dock, size)
    nodes: dict[str, int] = {}
    # Side columns in text heights, so that labels fit at every scale; never more than their share of a small window.
    right = min(theme.em(24.0) / size.x, 0.36)
    nodes["right top"], rest = _split(dock, imgui.Dir.right, right)
    nodes["right bottom"] = nodes["right top"]
    if size.y > theme.em(_TALL_EM):
        nodes["right bottom"], nodes["right top"] = _split(nodes["right top"], imgui.Dir.down, 0.6)
        nodes["right bottom if tall"] = nodes["right bottom"]
    left = min(theme.em(15.0) / (size.x * (1.0 - right)), 0.25)
    nodes["left top"], rest = _split(rest, imgui.Dir.left, left)
    nodes["left bottom"], nodes["left top"] = _split(nodes["left top"], imgui.Dir.down, 0.46)
    nodes["bottom"], middle = _split(rest, imgui.Dir.down, min(theme.em(14.0) / size.y, 0.34))
    builder.dock_builder_dock_window(VIEWPORT, middle)
    for window in windows:
        if window.place in nodes:
            builder.dock_builder_dock_window(window.title, nodes[window.place])
    builder.dock_builder_finish(dock)


def is_in_dock_space(title: str) -> bool:
    """Whether this window was in the dock space in the last frame: its ground is what the frame was cleared to."""
    window = imgui.internal.find_window_by_name(title)
    node = None if window is None else window.dock_node
    return node is not None and imgui.internal.dock_node_get_root_node(node).is_dock_space()


def raise_panel(field: str) -> None:
    """Show this panel in front of the other tabs in the next frame."""
    _raised[field] = 3


def is_raised(field: str) -> bool:
    """Whether it was raised since the last call; not before a new window's tabs are in their order."""
    if imgui.get_frame_count() <= _SETTLED_AFTER + 2:
        return False
    frames = _raised.pop(field, 0)
    if frames > 1:
        _raised[field] = frames - 1
    return frames > 0


def _bring_to_front(windows: Sequence[Docked]) -> None:
    """Show the tab that matters of each place: all of them came to the front in turn as they appeared."""
    done: set[int] = set()
    for listed in windows:
        window = imgui.internal.find_window_by_name(listed.title)
        node = None if window is None else window.dock_node
        if window is not None and node is not None and node.tab_bar is not None and node.id_ not in done:
            done.add(node.id_)
            node.tab_bar.next_selected_tab_id = window.tab_id
    # Else the window with the focus, the last that appeared, would come back to the front.
    imgui.set_window_focus(VIEWPORT)


def _split(node: int, direction: imgui.Dir, share: float) -> tuple[int, int]:
    """(new node in that direction, what is left)."""
    split = imgui.internal.dock_builder_split_node(node, direction, share)
    return split.id_at_dir, split.id_at_opposite_dir


def _hide_tab_of_picture() -> None:
    """A lone viewport needs no tab: every pixel is the picture's."""
    window = imgui.internal.find_window_by_name(VIEWPORT)
    node = None if window is None else window.dock_node
    if node is not None:
        node.set_local_flags(node.local_flags | imgui.internal.DockNodeFlagsPrivate_.no_tab_bar)


def load() -> None:
    """Give imgui the remembered layout, before the first frame; nothing remembered leaves the default."""
    with suppress(OSError, UserError, UnicodeDecodeError):
        imgui.load_ini_settings_from_memory(files.read_text(layout_file(), files.SETTINGS_BYTES))


def save() -> None:
    """Remember the layout. A folder that cannot be written costs only that."""
    with suppress(OSError, UserError), atomic_output(layout_file()) as temporary:
        temporary.write_text(imgui.save_ini_settings_to_memory(), encoding="utf-8")
