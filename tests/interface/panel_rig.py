"""One panel in a window of its own, with a synthetic mouse, for tests of panels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from imgui_bundle import imgui
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Dielectric, Diffuse
from spectrasplat.ui.headless import HeadlessInterface
from spectrasplat.ui.panels import rows
from spectrasplat.ui.view_model import ViewModel

Draw = Callable[[State, ViewModel], State]


def scene_state(name: str = "prism", select: type | str = Dielectric) -> State:
    """A scene of the assets with its first glass, its first receiver or ("light") its first light selected."""
    scene = load_scene(assets_dir() / "scenes" / f"{name}.toml")
    if select == "light":
        return State(scene, scene.camera, selection=Selection("light", 0))
    index = next(i for i, item in enumerate(scene.objects) if isinstance(item.material, select))  # type: ignore[arg-type]
    return State(scene, scene.camera, selection=Selection("object", index))


def receiver_of(state: State) -> int:
    """Index of the first diffuse object."""
    return next(i for i, item in enumerate(state.scene.objects) if isinstance(item.material, Diffuse))


class PanelRig(HeadlessInterface):
    """Runs `draw` each frame and keeps what it returns; `labels` are those of the edits, `was_held` whether any frame
    was interacting."""

    def __init__(self, gl: Context, draw: Draw, state: State, size: tuple[int, int] = (420, 900)) -> None:
        self.state = state
        self.view_model = ViewModel()
        self.labels: list[str] = []
        self.was_held = False
        self._panel = draw
        super().__init__(gl, self._draw_window, size)
        self.frame(3)

    @property
    def glass(self):
        """The selected object's glass."""
        return self.state.scene.objects[self.state.selection.index].material.dispersion

    @property
    def light(self):
        """The selected light."""
        return self.state.scene.lights[self.state.selection.index]

    def _draw_window(self) -> None:
        imgui.set_next_window_pos((0, 0))
        imgui.set_next_window_size(self.size)
        imgui.begin("Panel")
        before = replace(self.state, interacting=False)
        self.state = self._panel(before, self.view_model)
        if rows.take_held():
            self.state = replace(self.state, interacting=True)
        if self.state.scene is not before.scene and self.state.edit_label not in self.labels:
            self.labels.append(self.state.edit_label)
        self.was_held |= self.state.interacting
        imgui.end()

    def type_into(self, label: str, text: str) -> None:
        """Ctrl+click a number and type another one."""
        self.click(label, keys=[imgui.Key.mod_ctrl])
        self.type(text)
        self.key(imgui.Key.enter)
