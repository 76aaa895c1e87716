"""The whole interface with a view model that a test sets, with a synthetic mouse: no session, no engine."""

from __future__ import annotations

from dataclasses import replace

from spectrasplat.edit.requests import Request
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.headless import HeadlessInterface
from spectrasplat.ui.panels import dialogs
from spectrasplat.ui.shell import draw_interface
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import scene_state

SETTLED = 8
"""Frames until the default layout stands."""


class ShellRig(HeadlessInterface):
    """Draws the interface each frame; `asked` is every request so far."""

    def __init__(
        self,
        gl: Context,
        state: State | None = None,
        view_model: ViewModel | None = None,
        size: tuple[int, int] = (1280, 720),
    ) -> None:
        self.state = state or scene_state()
        self.view_model = view_model or ViewModel(title="prism")
        self.asked: list[Request] = []
        dialogs.reset()
        super().__init__(gl, self._draw_all, size, preferences=lambda: self.state.preferences)
        self.frame(SETTLED)

    def _draw_all(self) -> None:
        self.state = draw_interface(replace(self.state, interacting=False, requests=()), self.view_model)
        self.asked += self.state.requests

    def open_panel(self, **panels: bool) -> None:
        """Open and close panels by their `Panels` field."""
        self.state = self.state.with_panels(**panels)
        self.frame(3)

    def show_tab(self, title: str) -> None:
        """Bring a docked panel to the front by a click on its tab."""
        tab = self.find(f"Window: {title}")
        self.click(tab.centre)
        self.frame(2)

    def menu(self, *labels: str) -> None:
        """Click through the menu bar: `menu("File", "Save")`."""
        self.click(f"Menu: {labels[0]}")
        for label in labels[1:]:
            self.frame(2)
            self.click(label)
        self.frame(2)
