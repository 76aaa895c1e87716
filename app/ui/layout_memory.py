"""The places of docked windows, kept between sessions as Dear ImGui's own text, in the config folder."""

from __future__ import annotations

from contextlib import suppress

from imgui_bundle import imgui

from ..base import files
from ..base.atomic import atomic_output
from ..base.errors import UserError
from ..edit.preferences import layout_file


def load() -> None:
    """Give imgui the remembered layout, before the first frame; nothing remembered leaves the default."""
    with suppress(OSError, UserError, UnicodeDecodeError):
        imgui.load_ini_settings_from_memory(files.read_text(layout_file(), files.SETTINGS_BYTES))


def save() -> None:
    """Remember the layout. A folder that cannot be written costs only that."""
    with suppress(OSError, UserError), atomic_output(layout_file()) as temporary:
        temporary.write_text(imgui.save_ini_settings_to_memory(), encoding="utf-8")
