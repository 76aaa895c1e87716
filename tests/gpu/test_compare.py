"""The reference in the viewer, composed with the picture; another method beside it."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.state import Compare, State
from spectrasplat.gpu.device_traits import Budget
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.reference.direct_light import seen_directly
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.ui.compare import Comparison

SIZE = (64, 36)


@pytest.fixture(scope="module")
def state() -> State:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    return State(scene, scene.camera, viewport_size=SIZE)


def small_engine(context) -> LiveEngine:
    return LiveEngine(context, Budget(8192, 1 << 14, 1 << 16, 1 << 24))


@pytest.fixture(scope="module")
def running(gl, state: State):
    engine = small_engine(gl)
    engine.target_photons = 200_000
    engine.set(state.live_inputs)
    until(lambda: engine.is_idle, lambda: engine.advance(0.1))
    yield engine
    engine.release()


@pytest.fixture
def comparison(gl, running):
    made = Comparison(gl, small_engine)
    yield made
    made.release()


def until(done, work, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, "it took too long"
        work()


def read(texture) -> np.ndarray:
    return np.frombuffer(texture.read(), np.float32).reshape(texture.height, texture.width, 4)[..., :3]


def test_pixels_behind_glass_are_known(state: State) -> None:
    seen = seen_directly(replace(state.scene, camera=state.camera), 160, 90)
    # The prism stands left of the middle and covers a few per cent of the picture.
    assert 0.005 < 1.0 - seen.mean() < 0.1
    rows, columns = np.nonzero(~seen)
    assert 30 < columns.mean() < 80 and 20 < rows.mean() < 60
    assert seen[:4].all() and seen[-30:].all()


@pytest.mark.slow
def test_the_reference_agrees_with_the_picture_and_stops_when_the_scene_changes(
    gl, state: State, running: LiveEngine, comparison: Comparison
) -> None:
    compared = replace(state, compare=Compare(mode="wipe"))

    def thread():
        return comparison._thread

    until(
        lambda: comparison.picture is not None and thread().snapshot.relmse < 0.05,
        lambda: (comparison.advance(compared, running, 0.02), time.sleep(0.02)),
    )
    until(
        lambda: (
            comparison._direct.is_done
            and comparison._composed_from == (thread().snapshot.number, comparison._direct.version)
        ),
        lambda: comparison.advance(compared, running, 0.02),
    )
    live, reference = read(running.picture), read(comparison.picture)
    directly = thread().snapshot.directly
    # Behind glass there is no reference: stripes say so.
    assert not np.array_equal(reference[~directly], live[~directly])
    assert reference[directly].sum() == pytest.approx(live[directly].sum(), rel=0.03)
    scale = live[directly].mean()
    assert np.median(np.abs(reference - live)[directly]) < 0.1 * scale
    assert "float64" in comparison.text and "not compared" in comparison.text

    moved = replace(compared, camera=replace(state.camera, vertical_fov_deg=25.0))
    comparison.advance(moved, running, 0.02)
    assert comparison.is_stale and comparison.picture is not None
    time.sleep(0.8)  # the round it was in ends
    number = thread().snapshot.number
    time.sleep(0.8)
    assert thread().snapshot.number == number and not comparison.is_busy
    comparison.restart()
    comparison.advance(moved, running, 0.02)
    assert not comparison.is_stale and comparison.picture is None and comparison.is_busy


@pytest.mark.slow
def test_another_method_runs_beside_in_its_own_engine(
    gl, state: State, running: LiveEngine, comparison: Comparison
) -> None:
    compared = replace(state, compare=Compare(mode="hold", method="stochastic-even"))
    until(
        lambda: (comparison.progress or 0.0) > 0.05 and comparison.picture is not None,
        lambda: comparison.advance(compared, running, 0.05),
    )
    live, other = read(running.picture), read(comparison.picture)
    assert other.shape == live.shape and not np.array_equal(other, live)
    assert other.sum() == pytest.approx(live.sum(), rel=0.1)
    assert "Even random wavelengths" in comparison.text
    rays = running.stats.rays_traced
    comparison.advance(replace(state, compare=Compare()), running, 0.05)
    assert comparison.picture is None and running.stats.rays_traced == rays and not comparison.is_busy


def test_without_a_reference_another_method_stands_in(
    gl, state: State, running: LiveEngine, comparison: Comparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    from spectrasplat.base.errors import UserError
    from spectrasplat.reference import photon_reference

    def missing(*_args, **_kwargs) -> None:
        raise UserError("the reference renderer needs numba")

    monkeypatch.setattr(photon_reference, "ReferenceRun", missing)
    compared = replace(state, compare=Compare(mode="wipe"))
    until(
        lambda: comparison.picture is not None and "no reference" in comparison.text,
        lambda: comparison.advance(compared, running, 0.05),
    )
    assert "needs numba" in comparison.text and "Even random wavelengths" in comparison.text
