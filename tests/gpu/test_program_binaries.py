"""Programs that the driver compiles ahead, and the binaries that spare a later start compiling: on a GPU's traits."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base import paths
from spectrasplat.edit.live_inputs import LiveInputs
from spectrasplat.edit.state import State
from spectrasplat.gpu import context as context_module
from spectrasplat.gpu import linker, shader
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits, assumed
from spectrasplat.gpu.linker import BINARIES, Pending, linker_of
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.render.viewer.building import COMPILING
from spectrasplat.render.viewer.engine import LiveEngine

DOUBLE = """#version 430 core
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Values { float value[]; };
uniform float factor;
void main() { value[gl_GlobalInvocationID.x] *= factor; }
"""
VERTEX = "#version 430 core\nin vec2 place;\nvoid main() { gl_Position = vec4(place, 0.0, 1.0); }\n"
SLOW = """#version 430 core
layout(local_size_x = 8) in;
layout(std430, binding = 0) buffer Values { float value[]; };
void main() {
    float x = value[gl_GlobalInvocationID.x];
    for (int i = 0; i < 60000; ++i) x = sin(x + 1.0);
    value[gl_GlobalInvocationID.x] = x;
}
"""
FRAGMENT = "#version 430 core\nout vec4 colour;\nuniform vec4 paint;\nvoid main() { colour = paint; }\n"
SECOND_START = """
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.bench.programs import compiled_programs
from spectrasplat.gpu.context import create_context
from spectrasplat.gpu.linker import linker_of
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings

with create_context() as context:
    gl, calls = linker_of(context.ctx).gl, []
    compile, link = gl.CompileShader, gl.LinkProgram
    gl.CompileShader = lambda shader: calls.append("compiled") or compile(shader)
    gl.LinkProgram = lambda program: calls.append("linked") or link(program)
    programs = compiled_programs(context, load_scene(shipped_scenes()["prism"]), RenderSettings(max_depth=16))
    print(len(programs), calls.count("compiled"), calls.count("linked"))
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(paths, "cache_dir", lambda: tmp_path)
    return tmp_path / "programs"


@pytest.fixture
def ahead() -> Iterator[Context]:
    """A context that compiles ahead and keeps binaries, as a GPU's does."""
    with assumed(DeviceTraits()), create_context() as context:
        if not linker_of(context.ctx)._device:
            pytest.skip("this driver gives no binaries, as Mesa's without its cache")
        yield context


def doubling(context: Context, at_once: bool = True):
    return linker_of(context.ctx).program(context.ctx, (DOUBLE,), RuntimeError, at_once)


def finished(engine: LiveEngine, wanted: LiveInputs) -> None:
    engine.set(wanted)
    while not engine.is_idle:
        engine.advance(0.25)
        assert engine.problem is None


def is_compiled_anew(context: Context, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether the driver gets the text; the program works in any case."""
    compiled = []
    link = linker_of(context.ctx)
    with monkeypatch.context() as patched:
        compile_shader = link.gl.CompileShader
        patched.setattr(link.gl, "CompileShader", lambda shader: compiled.append(shader) or compile_shader(shader))
        program = doubling(context)
    values = context.ctx.buffer(np.arange(64, dtype="f4").tobytes())
    values.bind_to_storage_buffer(0)
    program["factor"] = 2.0
    program.run(1)
    assert np.frombuffer(values.read(), "f4").tolist() == [2.0 * n for n in range(64)]
    values.release()
    program.release()
    return bool(compiled)


def test_whatever_waits_lets_other_threads_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(context_module, "adopting_context", partial(linker.adopting_context, unlocked=True))
    ticks, ends = [], threading.Event()

    def tick() -> None:
        while not ends.wait(1e-3):
            ticks.append(time.perf_counter())

    thread = threading.Thread(target=tick)
    with create_context() as context:
        values, groups = context.ctx.buffer(bytes(1 << 12)), context.ctx.buffer(np.array([64, 1, 1], "u4").tobytes())
        values.bind_to_storage_buffer(0)
        slow = linker_of(context.ctx).program(context.ctx, (SLOW,), RuntimeError, True)
        thread.start()
        started = time.perf_counter()
        for run in (partial(slow.run, 64), partial(slow.run_indirect, groups)):
            run()
            context.finish()
            run()
            values.read(4)
        took = time.perf_counter() - started
        ends.set()
        thread.join()
    assert len(ticks) > 50 and np.diff(ticks).max() < 0.2 * took


def test_a_second_start_compiles_nothing(tmp_path: Path) -> None:
    environment = os.environ | {"SPECTRASPLAT_DEVICE": "gpu", "XDG_CACHE_HOME": str(tmp_path / "cache")}

    def start() -> list[int]:
        command = [sys.executable, "-P", "-c", SECOND_START]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=True)
        return [int(word) for word in done.stdout.split()]

    programs, compiled, linked = start()
    assert programs > 10 and compiled >= programs and linked == programs
    assert start() == [programs, 0, 0]


def test_what_is_damaged_or_anothers_is_compiled(ahead: Context, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert is_compiled_anew(ahead, monkeypatch)
    assert not is_compiled_anew(ahead, monkeypatch)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], whole[:-9] + bytes(9), b"\0" * len(whole)):
        file.write_bytes(damaged)
        assert is_compiled_anew(ahead, monkeypatch)
        assert not is_compiled_anew(ahead, monkeypatch)
    BINARIES.save(file.stem, b"\x34\x12\0\0 what no driver takes back")
    assert is_compiled_anew(ahead, monkeypatch)
    assert ahead.ctx.error == "GL_NO_ERROR"
    link = linker_of(ahead.ctx)
    monkeypatch.setattr(link, "_device", ("another vendor", *link._device[1:]))
    assert is_compiled_anew(ahead, monkeypatch)
    assert len(list(folder.iterdir())) == 2


def test_a_folder_that_cannot_be_written_costs_only_time(
    ahead: Context, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.write_text("not a folder")
    assert is_compiled_anew(ahead, monkeypatch)
    assert is_compiled_anew(ahead, monkeypatch)


def test_nothing_waits_for_a_program_before_its_use(ahead: Context) -> None:
    link = linker_of(ahead.ctx)
    program = doubling(ahead, at_once=False)
    assert isinstance(program, Pending)
    assert link.compiled_by(time.perf_counter() + 60.0)
    assert program["factor"].value == 0.0
    assert not isinstance(program, Pending) and isinstance(program, linker.moderngl.ComputeShader)
    program.release()
    unused = doubling(ahead, at_once=False)
    unused.release()
    unused.release()
    assert link.compiled_by(0.0)
    drawing = link.program(ahead.ctx, (VERTEX, FRAGMENT), RuntimeError, at_once=False)
    texture = ahead.ctx.texture((4, 4), 4, dtype="f4")
    target = ahead.ctx.framebuffer([texture])
    corners = ahead.ctx.buffer(np.float32([-1, -1, 3, -1, -1, 3]).tobytes())
    array = ahead.ctx.vertex_array(drawing, [(corners, "2f", "place")])
    drawing["paint"] = (1.0, 2.0, 3.0, 4.0)
    target.use()
    array.render()
    assert np.frombuffer(texture.read(), "f4").reshape(16, 4).tolist() == 16 * [[1.0, 2.0, 3.0, 4.0]]
    assert ahead.ctx.error == "GL_NO_ERROR"


def test_a_viewer_goes_on_with_what_it_has_while_the_driver_compiles(
    ahead: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = linker_of(ahead.ctx)
    scene = load_scene(paths.shipped_scenes()["prism"])
    wanted = replace(State(scene, scene.camera).live_inputs, width=48, height=27)
    engine = LiveEngine(ahead, replace(ahead.traits.viewer, first_photons=512, largest_photons=512))
    engine.target_photons, engine.camera_samples = 1, 1
    finished(engine, wanted)
    shown, version = engine.picture, engine.picture_version
    with monkeypatch.context() as patched:
        patched.setattr(link, "_is_done", lambda made: False)
        engine.set(replace(wanted, method="hero"))
        for _ in range(6):  # waits for no program, or this would not end
            engine.advance(0.01)
        assert link._pending and engine.building_at == COMPILING
        assert engine.picture is shown and engine.picture_version == version
    finished(engine, replace(wanted, method="hero"))
    assert engine.picture_version > version
    engine.release()


def test_a_refusal_names_file_and_line_whenever_it_comes(
    ahead: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paths, "shaders_dir", lambda: tmp_path)
    (tmp_path / "bad.comp").write_text("layout(local_size_x = 1) in;\nvoid main() {\n    int n = oops;\n}\n")
    (tmp_path / "bad.vert").write_text("out vec3 a;\nvoid main() { a = vec3(1.0); gl_Position = vec4(1.0); }\n")
    (tmp_path / "bad.frag").write_text("in vec4 a;\nout vec4 o;\nvoid main() { o = a; }\n")
    program = shader.compute(ahead.ctx, "bad.comp")
    for _ in range(2):
        with pytest.raises(shader.ShaderError, match=r"bad\.comp does not compile:(.|\n)*bad\.comp:3"):
            program.run(1)
    with pytest.raises(shader.ShaderError, match=r"bad\.vert with bad\.frag does not compile"):
        shader.program(ahead.ctx, "bad.vert", "bad.frag").get("x", None)
    with shader.recorded(), pytest.raises(shader.ShaderError):
        shader.compute(ahead.ctx, "bad.comp")
