"""The OpenGL context: what it tells, how it fails, and that OSMesa runs a compute shader."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import glcontext
import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.gpu import context as context_module
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.limits import NEEDED, Limits

DOUBLE = """
#version 430 core
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Values { float value[]; };
void main() { value[gl_GlobalInvocationID.x] *= 2.0; }
"""

OSMESA_SMOKE = f'''
import numpy as np
from spectrasplat.gpu.context import create_context
with create_context() as gl:
    values = gl.ctx.buffer(np.arange(256, dtype="f4").tobytes())
    values.bind_to_storage_buffer(0)
    gl.ctx.compute_shader("""{DOUBLE.strip()}""").run(4)
    gl.finish()
    gl.check("smoke")
    assert np.array_equal(np.frombuffer(values.read(), "f4"), 2.0 * np.arange(256, dtype="f4"))
    target = gl.ctx.texture((4, 4), 4, dtype="f4")
    gl.ctx.framebuffer([target]).clear(0.25, 0.5, 0.75, 1.0)
    assert np.allclose(np.frombuffer(target.read(), "f4").reshape(-1, 4), [0.25, 0.5, 0.75, 1.0])
    print(gl.backend, gl.is_software)
'''


def test_context_tells_version_and_limits(gl: Context) -> None:
    assert gl.ctx.version_code >= 430
    assert gl.limits.work_group_count[0] >= NEEDED.work_group_count[0]
    assert gl.limits.draw_buffers >= 8
    assert gl.limits.storage_block_bytes >= 1 << 24
    assert gl.is_software == ("llvmpipe" in gl.renderer or "softpipe" in gl.renderer)


def test_compute_shader_runs(gl: Context) -> None:
    values = np.linspace(-1.0, 1.0, 128, dtype="f4")
    buffer = gl.ctx.buffer(values.tobytes())
    program = gl.ctx.compute_shader(DOUBLE.strip())
    buffer.bind_to_storage_buffer(0)
    program.run(2)
    gl.finish()
    gl.check("the doubling shader")
    np.testing.assert_array_equal(np.frombuffer(buffer.read(), "f4"), 2.0 * values)


def test_check_reports_a_dispatch_past_the_limit_once(gl: Context) -> None:
    buffer = gl.ctx.buffer(np.ones(64, dtype="f4").tobytes())
    buffer.bind_to_storage_buffer(0)
    gl.ctx.compute_shader(DOUBLE.strip()).run(gl.limits.work_group_count[0] + 1)
    with pytest.raises(RuntimeError, match="GL_INVALID_VALUE in a far too large dispatch"):
        gl.check("a far too large dispatch")
    gl.check("nothing further")
    assert np.frombuffer(buffer.read(), "f4").sum() == 64.0  # and nothing had run


@pytest.mark.parametrize(
    ("renderer", "software"),
    [("llvmpipe (LLVM 15.0.6, 256 bits)", True), ("softpipe", True), ("NVIDIA H200/PCIe", False)],
)
def test_software_renderers_are_recognised(renderer: str, software: bool) -> None:
    class Fake:
        info = {"GL_RENDERER": renderer, "GL_VENDOR": "v", "GL_VERSION": "4.5"}
        extensions: frozenset[str] = frozenset()
        error = "GL_NO_ERROR"

    assert Context(Fake(), "egl").is_software is software  # type: ignore[arg-type]


def test_a_limit_the_driver_does_not_tell_counts_as_zero() -> None:
    limits = Limits.read({"GL_MAX_DRAW_BUFFERS": 8})
    assert limits.draw_buffers == 8
    assert limits.texture_px == 0
    assert limits.work_group_count == (0, 0, 0)


def test_osmesa_smoke() -> None:
    # In a process of its own: two libraries' current contexts would fight over one thread.
    if context_module._first_loadable(("libOSMesa.so.8", "libOSMesa.so.6")) is None:
        pytest.skip("libOSMesa is not installed here (Mesa dropped it with 25.1)")
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", OSMESA_SMOKE],
        cwd=root,
        env={**os.environ, "SPECTRASPLAT_BACKEND": "osmesa"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["osmesa", "True"]


class TestFailures:
    """Each way OpenGL can be missing ends in one sentence with the remedy."""

    def test_library_missing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(context_module, "_first_loadable", lambda names: None)
        with pytest.raises(UserError, match="libEGL.so.1 is not installed.*libgl1-mesa-dri"):
            create_context("egl")

    @pytest.mark.parametrize(
        ("raw", "told"),
        [
            ("eglCreateContext failed (0x3009)", "OpenGL 4.3 is needed and this driver has less"),
            ("Requested OpenGL version 430, got version 330", "this driver has less"),
            ("eglInitialize failed (0x3001)", "could not be started through EGL"),
        ],
    )
    def test_egl_refuses(self, monkeypatch: pytest.MonkeyPatch, raw: str, told: str) -> None:
        tried = []

        def refuse(**settings: object) -> None:
            tried.append(settings["device_index"])
            if len(tried) == 3:
                raise Exception("requested device index 2, but found 2 devices")
            raise Exception(raw)

        monkeypatch.setattr(glcontext, "get_backend_by_name", lambda _name: refuse)
        with pytest.raises(UserError, match=told) as caught:
            create_context("egl")
        assert tried == [0, 1, 2]  # every device had its chance
        assert raw in str(caught.value)
        assert "apt-get install libegl1 libgl1 libgl1-mesa-dri" in str(caught.value)

    def test_falls_back_to_osmesa_only_when_free_to(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def no_egl() -> Context:
            raise UserError("no EGL")

        sentinel = object()
        monkeypatch.delenv("SPECTRASPLAT_BACKEND", raising=False)
        monkeypatch.setattr(context_module, "_create_egl", no_egl)
        monkeypatch.setattr(context_module, "_create_osmesa", lambda: sentinel)
        assert create_context() is sentinel
        with pytest.raises(UserError, match="no EGL"):
            create_context("egl")
        monkeypatch.setenv("SPECTRASPLAT_BACKEND", "egl")
        with pytest.raises(UserError, match="no EGL"):
            create_context()

    def test_both_fail_gives_the_remedy_of_egl(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("SPECTRASPLAT_BACKEND", raising=False)
        monkeypatch.setattr(context_module, "_first_loadable", lambda names: None)
        monkeypatch.setattr("spectrasplat.gpu.osmesa.load_library", lambda: (_ for _ in ()).throw(OSError("not there")))
        with pytest.raises(UserError, match="libegl1 libgl1 libgl1-mesa-dri"):
            create_context()
        with pytest.raises(UserError, match=r"OSMesa failed \(not there\).*libosmesa6"):
            create_context("osmesa")

    def test_unknown_backend_in_the_environment(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("SPECTRASPLAT_BACKEND", "osmessa")
        with pytest.raises(UserError, match="SPECTRASPLAT_BACKEND is 'osmessa'.*'osmesa'"):
            create_context()

    def test_macos_is_told_why(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(sys, "platform", "darwin")
        with pytest.raises(UserError, match="macOS stops at OpenGL 4.1"):
            create_context()
