"""Opening and closing panels, what follows from that, and the layout that is kept between sessions.

Who opens Compare wants to see two pictures, and who closes it one again: nothing else would take the wipe away.
Hiding all panels (H) is neither: it leaves the pictures alone with each other.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from imgui_bundle import imgui

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..edit.preferences import layout_file
from ..edit.state import CompareMode, State


def set_open(state: State, field: str, is_open: bool) -> State:
    """The panel `Panels.<field>` opened or closed by somebody."""
    state = state.with_panels(**{field: is_open})
    if field != "compare":
        return state
    compare = state.compare
    mode: CompareMode = "off" if not is_open else "wipe" if compare.mode == "off" else compare.mode
    return replace(state, compare=replace(compare, mode=mode))


def load_layout() -> None:
    """Give imgui the remembered layout, before the first frame; nothing remembered leaves the default."""
    with suppress(OSError, UserError, UnicodeDecodeError):
        imgui.load_ini_settings_from_memory(files.read_text(layout_file(), files.SETTINGS_BYTES))


def save_layout() -> None:
    """Remember the layout. A folder that cannot be written costs only that."""
    with suppress(OSError, UserError), atomic_output(layout_file()) as temporary:
        temporary.write_text(imgui.save_ini_settings_to_memory(), encoding="utf-8")
