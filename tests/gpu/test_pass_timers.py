"""Timer queries: used where they tell the truth, and never on a software renderer."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.gpu import pass_timers
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.pass_timers import PassTimers
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.render.still import render


class Query:
    """A timer that says what it is told to."""

    is_known = False

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds

    def __enter__(self) -> None: ...

    def __exit__(self, *_exception: object) -> None: ...


class Device:
    def buffer(self, reserve: int) -> Device:
        return self

    def copy_buffer(self, *_buffers: object) -> None:
        time.sleep(0.001)

    def finish(self) -> None: ...

    def release(self) -> None: ...


def timers_of(monkeypatch: pytest.MonkeyPatch, seconds: float, *how: bool) -> PassTimers:
    monkeypatch.setattr(pass_timers, "linker_of", lambda _: SimpleNamespace(gl=seconds))
    monkeypatch.setattr(pass_timers, "Query", Query)
    return PassTimers(Device(), *how)  # type: ignore[arg-type]


@pytest.mark.parametrize(("seconds", "works"), [(5e-3, True), (0.0, False), (1e3, False)])
def test_timers_are_believed_where_they_can_be_right(seconds: float, works: bool, monkeypatch) -> None:
    timers = timers_of(monkeypatch, seconds, True)
    assert timers.work is works
    before = dict(timers.seconds)
    for _ in range(2):
        with timers.timing("trace"):
            pass
    assert timers.since(before) == ({"trace": pytest.approx(0.01)} if works else {})


@pytest.mark.parametrize(("runs_at_once", "finishes"), [(True, 0), (False, 1)])
def test_without_timers_the_wall_clock_is_read(runs_at_once: bool, finishes: int, monkeypatch) -> None:
    waited, told = [], []
    monkeypatch.setattr(Device, "finish", lambda self: waited.append(1))
    timers = timers_of(monkeypatch, 0.0, False, runs_at_once)
    with timers.timing("camera", told.append):
        time.sleep(0.002)
    assert len(told) == 1 and told[0] > 0.001
    assert len(waited) == finishes


def test_a_software_renderer_has_none(gl) -> None:
    assert not gl.timers.work
    with gl.timers.timing("camera"):
        pass
    assert gl.timers.seconds == {}


def test_real_queries_are_read(gl, monkeypatch) -> None:
    """Whatever they say: that the calls are right."""
    monkeypatch.setattr(pass_timers.PassTimers, "_tells_truth", lambda self: True)
    timers = PassTimers(gl.ctx, True)
    source, target = (gl.ctx.buffer(reserve=1 << 16) for _ in range(2))
    told: list[float] = []
    for block in range(6):
        with timers.timing("copy", told.append), timers.timing("inner"):
            gl.ctx.copy_buffer(target, source)
        assert len(told) <= block, "nobody waits"
    gl.finish()
    timers.hear()
    assert len(told) == 6
    assert timers.since({}) == {"copy": pytest.approx(sum(told))} and len(told) == 6
    source.release()
    target.release()


@pytest.mark.slow
def test_every_pass_of_a_frame_is_timed(monkeypatch) -> None:
    """By whatever the queries say: beams, photons' tracing and splats, the environment's light, the camera."""
    monkeypatch.setattr(pass_timers.PassTimers, "_tells_truth", lambda self: True)
    monkeypatch.setattr(Context, "is_software", property(lambda self: False))
    scene = load_scene(assets_dir() / "scenes" / "default.toml")
    with create_context() as context:
        render(scene, RenderSettings(width=48, height=27, photons=2000), context=context)
        assert {"beams", "trace", "splat", "environment", "camera"} <= set(context.timers.seconds)
