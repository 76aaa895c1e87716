"""Version, driver and licences."""

from __future__ import annotations

from imgui_bundle import imgui

from ...base.paths import assets_dir
from ...base.version import __version__
from ...edit.state import State
from .. import theme
from ..view_model import ViewModel
from . import widgets


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
