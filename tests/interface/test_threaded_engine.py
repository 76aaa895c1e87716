"""The engine on a thread of its own: the window is drawn and hears of keys while the driver compiles."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.not_yet import NOT_YET
from spectrasplat.edit.document import Document
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.state import State
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.context_thread import ContextThread
from spectrasplat.render.viewer.building import COMPILING
from spectrasplat.render.viewer.dirty_level import DirtyLevel
from spectrasplat.render.viewer.stats import LiveStats
from spectrasplat.render.viewer.threaded_engine import ThreadedEngine
from spectrasplat.ui.session import IDLE_S, LAYOUT_FRAMES, Session
from spectrasplat.ui.viewer import Viewer, headless_viewer

from tests.interface.fake_engine import FakeEngine
from tests.interface.test_window import run

COMPILES_S = 1.6


class SlowEngine(FakeEngine):
    """Its first work takes as long as a driver that compiles."""

    building_at, differs = "", "light"

    def advance(self, budget_s: float, interacting: bool = False) -> None:
        if not self.advanced:
            time.sleep(COMPILES_S)
        self.advanced += 1
        if self.fails is not None:
            raise self.fails
        self.picture_version += 1
        self.stats = LiveStats(photons=1000 * self.advanced)


@pytest.fixture
def engine(gl: Context) -> ThreadedEngine:
    return ThreadedEngine(gl, ContextThread(lambda: gl, lambda: None), SlowEngine)  # type: ignore[arg-type, return-value]


def wanted() -> LiveInputs:
    scene = Document.new().scene
    return State(scene, scene.camera).live_inputs


def test_work_that_overruns_lets_the_window_be_drawn(engine: ThreadedEngine) -> None:
    inputs = wanted()
    assert engine.set(inputs) == DirtyLevel.CAMERA
    started, frames, said = time.perf_counter(), 0, LiveStats()
    engine.advance(0.04)
    while engine.is_busy:
        said = engine.stats
        assert engine.picture is None and engine.stored_photons() is engine.caustic_spectrum(0, np.zeros(3)) is NOT_YET
        assert engine.set(replace(inputs, width=7)) == DirtyLevel.NOTHING
        engine.advance(0.04)
        frames += 1
    took = time.perf_counter() - started
    assert took == pytest.approx(COMPILES_S, abs=0.5)
    assert frames > 5 * took
    assert said.preparing == COMPILING and said.preparing_s > 1.0 and not said.converged and said.differs == "light"
    assert engine.stats.photons == 1000 and not engine.stats.preparing
    engine.advance(0.04)
    assert engine.stats.photons == 2000  # what is quick has news at once
    engine.release()
    engine.release()


def test_what_goes_wrong_on_the_thread_is_raised_where_the_window_is(engine: ThreadedEngine) -> None:
    engine._engine.fails = RuntimeError("lost")  # type: ignore[attr-defined]
    engine.set(wanted())
    with pytest.raises(RuntimeError, match="lost"):
        for _ in range(100):
            engine.advance(0.04)
    engine.release()


DRAWN_WHILE_THE_DRIVER_COMPILES = """
import time
from pathlib import Path
import numpy as np
from spectrasplat.gpu import shader
from spectrasplat.render.viewer.stats import LiveStats
from spectrasplat.render.viewer.threaded_engine import ThreadedEngine
from spectrasplat.ui.window import Window

LINES = "".join(f"if (k == {i}u) x[{i}] = sin(x[{i + 1}] * {i}.5) + pow(x[{i + 2}], {i}.1);" for i in range(150))

class Compiling:
    stats, inputs, picture_version, building_at, picture = LiveStats(), None, 0, "", None
    def __init__(self, context):
        self.context = context
    def advance(self, budget_s, interacting):
        ctx = self.context.ctx
        text = (
            "#version 430 core\\nlayout(local_size_x=8) in; layout(std430, binding=0) buffer B { float x[]; };"
            "layout(rgba32f, binding=0) uniform writeonly image2D picture;"
            "void main() { uint k = gl_LocalInvocationIndex;" + LINES +
            "imageStore(picture, ivec2(k, 0), vec4(0.25)); }"
        )
        shader.paths = type("", (), {"shaders_dir": staticmethod(lambda: FOLDER)})
        (FOLDER / "long.comp").write_text(text[len("#version 430 core\\n"):])
        program = shader.compute(ctx, "long.comp")
        buffer, self.picture = ctx.buffer(reserve=8192), ctx.texture((8, 1), 4, dtype="f4")
        buffer.bind_to_storage_buffer(0)
        self.picture.bind_to_image(0, read=False, write=True)
        program.run(1)
        ctx.memory_barrier()
        assert ctx.error == "GL_NO_ERROR"
    def release(self):
        pass

FOLDER = Path.cwd()
with Window(visible=False) as window:
    engine = ThreadedEngine(window.context, window.open_thread("engine"), Compiling)
    began, gaps = time.perf_counter(), []
    before = began
    engine.advance(0.04)
    while engine.is_busy:
        engine.advance(0.04)
        gaps.append(time.perf_counter() - before)
        before = time.perf_counter()
    took = time.perf_counter() - began
    codes = np.frombuffer(engine.picture.read(), "f4")
    engine.release()
    print(len(gaps) > 5 * took - 2, max(gaps) < 0.5 * took, took > 0.8, set(codes.tolist()))
"""


def test_the_window_is_drawn_while_the_driver_compiles(
    tmp_path: Path, display: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A real driver, a program that it has never seen, and a texture that both contexts know."""
    monkeypatch.setenv("MESA_SHADER_CACHE_DIR", str(tmp_path / "cache"))
    done = run(tmp_path, display, "-c", DRAWN_WHILE_THE_DRIVER_COMPILES)
    assert done.stdout.strip() == "True True True {0.25}", done.stdout + done.stderr


def test_while_the_engine_is_busy_the_window_stays_awake_and_waits_for_the_scene(
    gl: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    session = Session(gl, make_engine=FakeEngine)
    session.jobs.gallery.release()
    session.state = replace(session.state, playing=False).with_panels(start_page=False)
    with headless_viewer(Viewer(session)) as interface:
        interface.frame(LAYOUT_FRAMES + 3)
        engine = session.picture.engine
        assert isinstance(engine, FakeEngine) and session.wait_s() == IDLE_S and session.picture.shown is not None
        picture, engine.picture, engine.is_busy = engine.picture, None, True
        session.show_document(Document.new())
        interface.frame(3)
        assert session.wait_s() == 0.0
        assert session.picture.awaits_scene  # nothing of it is drawn, whatever the stats of before say
        engine.picture, engine.is_busy = picture, False
        interface.frame()
        assert not session.picture.awaits_scene
    session.autosave.close()
    session.release()


def test_a_busy_engine_does_not_take_the_shown_texture_from_under_the_interface(
    gl: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The interface at 150 % resizes the viewport while the engine works; its picture comes back within a frame."""
    monkeypatch.setenv("SPECTRASPLAT_CONFIG", str(tmp_path / "config"))
    session = Session(gl, make_engine=FakeEngine)
    session.jobs.gallery.release()
    session.state = session.state.with_panels(start_page=False)
    with headless_viewer(Viewer(session)) as interface:
        interface.frame(LAYOUT_FRAMES + 3)
        engine, shown = session.picture.engine, session.picture.shown
        assert isinstance(engine, FakeEngine) and shown is not None
        advance, picture, engine.picture, engine.is_busy = engine.advance, engine.picture, None, True
        monkeypatch.setattr(engine, "advance", lambda *_: None)
        preferences = replace(session.state.preferences, ui_scale=1.5)
        session.state = replace(session.state, preferences=preferences)
        interface.frame(3)
        assert session.state.viewport_size != shown.size == session.picture.shown.size

        def back_again(*asked) -> None:
            engine.picture, engine.is_busy = engine.picture or picture, False
            advance(*asked)

        monkeypatch.setattr(engine, "advance", back_again)
        for _ in range(3):
            interface.frame()
            assert gl.ctx.error == "GL_NO_ERROR"
        assert session.picture.shown.size == session.state.viewport_size
    session.autosave.close()
    session.release()
