"""Run in a process of its own by `test_imgui_test_engine`: the viewer under Dear ImGui's Test Engine, on GLFW's null
platform.

Prints one line of JSON: what the flow saw. The test function runs on a thread of the engine's, without an OpenGL
context, so pictures are taken by the frame function when the flow asks for one by name.
"""

from __future__ import annotations

import json
import sys
import threading
from dataclasses import replace
from pathlib import Path

from imgui_bundle import hello_imgui, imgui, immapp
from imgui_bundle.immapp import testing

import glfw  # isort: skip
import moderngl
import numpy as np
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Dielectric
from spectrasplat.ui import theme
from spectrasplat.ui.session import Session
from spectrasplat.ui.viewer import Viewer
from spectrasplat.ui.window import GlfwLoader

from tests.interface.rig import small_engine, target

SIZE = (900, 600)
PHOTONS = 1 << 13
WATCHDOG_S = 300.0


class Flow:
    """The viewer, and what is to be found out about it."""

    def __init__(self, scene: Path) -> None:
        self._scene = scene
        self.viewer: Viewer | None = None
        self.pictures: dict[str, np.ndarray] = {}
        self.rays: dict[str, int] = {}
        self.gains: dict[str, float] = {}
        self.seen: list[str] = []
        self.gl_errors: list[str] = []
        self._wanted: str | None = None
        self._taken = threading.Event()

    @property
    def session(self) -> Session:
        assert self.viewer is not None
        return self.viewer.session

    # On the thread of the window

    def begin(self) -> None:
        context = Context(moderngl.create_context(require=430, context=GlfwLoader()), "window")
        session = Session(context, self._scene, make_engine=small_engine(PHOTONS))
        session.jobs.gallery.release()
        preferences = replace(session.state.preferences, target_photons=target(PHOTONS), refine_when_still=False)
        session.state = replace(session.state, preferences=preferences)
        self.viewer = Viewer(session)

    def prepare(self) -> None:
        assert self.viewer is not None
        self.viewer.prepare()
        theme.apply(self.viewer.preferences)

    def draw(self) -> None:
        assert self.viewer is not None
        self.viewer.draw()
        if self._wanted is not None and self.session.picture.stats.converged and not imgui.is_any_item_active():
            self._take(self._wanted)
            self._wanted = None
            self._taken.set()
        self.session.context.ctx.detect_framebuffer(0).use()  # hello_imgui clears and draws what is bound

    def _take(self, name: str) -> None:
        texture = self.session.picture.radiance
        assert texture is not None
        self.pictures[name] = np.frombuffer(texture.read(), np.float32).reshape(-1, 4)[:, :3].copy()
        self.rays[name] = self.session.picture.stats.rays_traced
        objects = self.session.state.scene.objects
        self.gains[name] = next(o.material.dispersion.gain for o in objects if isinstance(o.material, Dielectric))
        error = self.session.context.ctx.error
        if error != "GL_NO_ERROR":
            self.gl_errors.append(f"{name}: {error}")

    def end(self) -> None:
        self.session.autosave.close()
        self.session.release()

    # On the thread of the engine

    def picture(self, ctx: imgui.test_engine.TestContext, name: str) -> None:
        """Wait until the viewer has converged, and keep its picture."""
        ctx.yield_(3)
        self._taken.clear()
        self._wanted = name
        for _ in range(3000):
            if self._taken.is_set():
                return
            ctx.yield_()
        raise AssertionError(f"not converged at '{name}'")

    def run(self, ctx: imgui.test_engine.TestContext) -> None:
        """The flow itself."""
        # The engine gives a test a minute, which suits an interface; here a software renderer makes four pictures.
        ctx.engine_io.config_watchdog_warning = ctx.engine_io.config_watchdog_kill_test = WATCHDOG_S
        self.picture(ctx, "start")
        ctx.item_click("//Outliner/object 0/###row")
        ctx.yield_(2)
        self.seen.append(f"selected {self.session.state.selection.kind} {self.session.state.selection.index}")
        ctx.item_input_value("//Dispersion/##Dispersion gain", 3.0)
        self.picture(ctx, "edited")
        ctx.key_press(imgui.Key.mod_ctrl | imgui.Key.z)
        self.picture(ctx, "undone")
        ctx.key_press(imgui.Key.mod_ctrl | imgui.Key.y)
        self.picture(ctx, "redone")
        ctx.item_click("//Outliner/object 1/###row")
        ctx.yield_(2)
        self.seen.append(f"selected {self.session.state.selection.kind} {self.session.state.selection.index}")
        ctx.key_press(imgui.Key.f1)
        ctx.yield_(2)
        self.seen.append(f"shortcuts {self.session.state.preferences.panels.shortcuts}")


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference, share of the brightest value."""
    return float(np.abs(a - b).max() / a.max())


def main(scene: Path) -> None:
    """Run the flow and print what it saw."""
    flow = Flow(scene)
    glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL)
    glfw.init()
    glfw.window_hint(glfw.CONTEXT_CREATION_API, glfw.EGL_CONTEXT_API)
    params = hello_imgui.RunnerParams()
    params.app_window_params.window_geometry.size = SIZE
    params.ini_disable = True
    params.fps_idling.enable_idling = False
    params.imgui_window_params.default_imgui_window_type = hello_imgui.DefaultImGuiWindowType.no_default_window
    params.callbacks.post_init = flow.begin
    params.callbacks.pre_new_frame = flow.prepare
    params.callbacks.show_gui = flow.draw
    params.callbacks.before_exit = flow.end
    params.callbacks.load_additional_fonts = theme.set_up
    testing.run(test_function=flow.run, runner_params=params, add_ons_params=immapp.AddOnsParams(with_implot=True))
    start = flow.pictures["start"]
    print(
        json.dumps(
            {
                "seen": flow.seen,
                "rays": flow.rays,
                "gains": flow.gains,
                "gl_errors": flow.gl_errors,
                "from_start": {name: difference(start, picture) for name, picture in flow.pictures.items()},
                "redone_from_edited": difference(flow.pictures["edited"], flow.pictures["redone"]),
            }
        )
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
