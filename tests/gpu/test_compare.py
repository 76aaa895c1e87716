"""What the viewer's picture is compared with: the reference, another method, another glass, a picture file."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from spectrasplat.base.image_io import write_image
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.state import Compare, Selection, State
from spectrasplat.gpu.device_traits import Budget
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.panorama_lights import with_panorama_lights
from spectrasplat.reference.direct_light import seen_directly
from spectrasplat.render.viewer.engine import LiveEngine
from spectrasplat.ui.compare import Comparison
from spectrasplat.ui.compared_with import GlassSwap, of_height, resized
from spectrasplat.ui.direct_picture import DirectPicture
from spectrasplat.ui.reference_thread import Snapshot

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
    engine.target_photons = 20_000
    engine.set(state.live_inputs)
    until(lambda: engine.picture is not None and engine.is_idle, lambda: engine.advance(0.1))
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


def idle_thread(snapshot: Snapshot | None = None, problem: str | None = None) -> SimpleNamespace:
    """In the place of a `ReferenceThread`; `calls` are those of it."""
    calls: list[str] = []
    named = {name: lambda *_more, name=name: calls.append(name) for name in ("resume", "pause", "stop")}
    return SimpleNamespace(snapshot=snapshot, problem=problem, is_done=False, fraction=0.0, calls=calls, **named)


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


def test_without_a_reference_a_sentence_says_why(state, running, comparison, monkeypatch) -> None:
    thread = idle_thread(problem="the camera has a lens")
    monkeypatch.setattr("spectrasplat.ui.compare.ReferenceThread", lambda *_more: thread)
    compared = replace(state, compare=Compare(mode="wipe"))
    for _ in range(3):
        comparison.advance(compared, running, 0.05)
    assert comparison.text == "There is nothing to compare with: the camera has a lens."
    assert comparison.picture is None and not comparison.is_busy and not comparison.is_waiting


def test_the_first_sample_is_shown_with_its_noise(state, running, comparison, monkeypatch) -> None:
    shape = (SIZE[1], SIZE[0])
    directly = np.ones(shape, bool)
    directly[:, :20] = False
    caustic = np.full((*shape, 3), 7.0, np.float32)
    first = Snapshot(1, caustic, directly, 500, 0.8)
    monkeypatch.setattr("spectrasplat.ui.compare.ReferenceThread", lambda *_more: idle_thread(first))
    compared = replace(state, compare=Compare(mode="wipe"))
    until(lambda: comparison.picture is not None, lambda: comparison.advance(compared, running, 0.05))
    assert first.photons < SIZE[0] * SIZE[1] / 4  # not one photon a pixel
    told = "relMSE of its caustics > 8.0e-01"
    while not comparison._direct.is_done:  # finer while the caustics, and their error, stay as they are
        assert comparison.label == f"Reference, {told}, direct light {comparison._direct.samples} of 32 samples"
        comparison.advance(compared, running, 0.01)
    assert comparison.label == f"Reference, {told}" and told in comparison.text
    shown, own = read(comparison.picture), read(running.picture)
    assert (shown[directly] >= 7.0).mean() > 0.97  # the black slit shows nothing
    # Nothing there is our own picture as it is: stripes leave a quarter of every other band.
    left, mine = shown[~directly], own[~directly]
    lit = mine.sum(axis=1) > 0
    assert 0.3 < np.isclose(left[lit], 0.25 * mine[lit], rtol=1e-4).all(axis=1).mean() < 0.7


def test_another_glass_is_traced_beside_this_one(state, running, comparison) -> None:
    compared = replace(state, compare=Compare(mode="wipe", method="glass", glass="N-BK7"))
    until(
        lambda: comparison.picture is not None and comparison.progress > 0.5,
        lambda: comparison.advance(compared, running, 0.05),
    )
    assert comparison.label == "N-BK7" and "N-BK7" in comparison.text
    assert not np.allclose(read(comparison.picture), read(running.picture), rtol=0.05)
    assert state.scene.objects[0].material.dispersion.name == "Schott N-SF11"
    before = read(comparison.picture)
    other = replace(compared, compare=replace(compared.compare, glass="F2"))
    comparison.advance(other, running, 0.0)
    # Until F2 is there, N-BK7's picture must not be called F2.
    assert comparison.label == "F2" and comparison.picture is None
    until(lambda: comparison.picture is not None, lambda: comparison.advance(other, running, 0.05))
    assert not np.array_equal(read(comparison.picture), before)


def test_the_other_glass_is_that_of_the_selected_solid_and_made_once() -> None:
    scene = load_scene(assets_dir() / "scenes" / "achromat.toml")
    swap = GlassSwap()
    other = swap.scene(scene, Selection("object", 1), "N-BK7")
    kept = [o.material is p.material for o, p in zip(other.objects, scene.objects, strict=True)]
    assert kept == [True, False, True, True]
    assert swap.scene(scene, Selection("object", 1), "N-BK7") is other
    assert swap.scene(scene, Selection(), "N-BK7").objects[1] is scene.objects[1]


def test_a_picture_file_has_its_values_under_the_cursor(state, running, comparison, tmp_path: Path) -> None:
    rgb = np.linspace(0.0, 3.0, SIZE[0] * SIZE[1] * 3, dtype=np.float32).reshape(SIZE[1], SIZE[0], 3)
    write_image(tmp_path / "other.exr", rgb)
    compared = replace(state, compare=Compare(mode="wipe", method="file", file=tmp_path / "other.exr"))
    comparison.advance(compared, running, 0.01)
    assert comparison.label == "other.exr" and comparison.picture is not None
    assert comparison.pixel((10.5 / SIZE[0], 5.5 / SIZE[1])) == pytest.approx(rgb[5, 10].tolist())
    gone = replace(compared, compare=replace(compared.compare, file=tmp_path / "gone.exr"))
    comparison.advance(gone, running, 0.01)
    assert comparison.picture is None and "No such file" in comparison.text


def test_a_picture_of_another_size_is_not_shown_and_begun_anew(state, running, comparison, monkeypatch) -> None:
    begun: list[tuple[int, int]] = []

    def begin(_scene, width: int, height: int) -> SimpleNamespace:
        begun.append((width, height))
        shape = (height, width)
        picture = np.ones((*shape, 3), np.float32)
        return idle_thread(Snapshot(1, picture, np.ones(shape, bool), 500, 0.8))

    monkeypatch.setattr("spectrasplat.ui.compare.ReferenceThread", begin)
    compared = replace(state, compare=Compare(mode="wipe"))
    until(lambda: comparison.picture is not None, lambda: comparison.advance(compared, running, 0.05))
    larger = replace(compared, viewport_size=(SIZE[0] + 20, SIZE[1]))
    comparison.advance(larger, running, 0.05)
    assert comparison.picture is None
    until(lambda: comparison.picture is not None, lambda: comparison.advance(larger, running, 0.05))
    assert begun == [SIZE, (SIZE[0] + 20, SIZE[1])]


def test_a_picture_of_another_size_is_no_chequer() -> None:
    """Nearest pixels shifted a ramp by up to half a pixel, which looked like an error of the picture."""
    ramp = np.linspace(0.0, 1.0, 41)[None, :, None] * np.ones((31, 1, 3))
    shown = resized(ramp.astype(np.float32), (53, 40))
    wanted = (((np.arange(53) + 0.5) * 41 / 53 - 0.5) / 40).clip(0.0, 1.0)
    assert shown.shape == (40, 53, 3)
    np.testing.assert_allclose(shown[20, :, 1], wanted, atol=1e-5)
    halved = resized(np.tile(np.float32([[[0.0] * 3], [[2.0] * 3]]), (10, 20, 1)), (10, 10))
    np.testing.assert_allclose(halved[2:-2, 2:-2], 1.0, atol=1e-5)


def test_a_picture_of_another_shape_keeps_its_proportions() -> None:
    column = np.arange(96, dtype=np.float32) - 47.5
    wide = np.repeat(np.tile(column[None, :, None], (54, 1, 1)), 3, axis=2)
    cut = of_height(wide, (54, 54))
    assert cut.shape == (54, 54, 3) and np.array_equal(cut[0, :, 0], column[21:75])
    padded = of_height(wide, (120, 54))
    assert np.array_equal(padded[5, 12:108, 0], column) and not padded[:, :12].any() and not padded[:, 108:].any()
    half = of_height(wide, (48, 27))
    assert half[10, 24, 0] == pytest.approx(1.0, abs=0.05)  # the middle stays the middle


def test_the_reference_has_the_light_of_the_environment(gl, tmp_path: Path) -> None:
    """A ball of clay under a sky: all light that there is, and a shadow, come from it."""
    path = tmp_path / "clay.toml"
    path.write_text(
        '[environment]\nkind = "gradient"\nzenith = [0.8, 0.85, 1.0]\nhorizon = [1.2, 0.95, 0.75]\nnadir = 0.3\n'
        '[[objects]]\nname = "ball"\nshape = "sphere"\nmaterial = { kind = "diffuse" }\n'
    )
    scene = load_scene(path)
    state = State(scene, scene.camera, viewport_size=SIZE)
    engine = small_engine(gl)
    engine.target_photons = 20_000
    engine.set(state.live_inputs)
    until(lambda: engine.picture is not None and engine.is_idle, lambda: engine.advance(0.1))
    direct = DirectPicture(gl, None, with_panorama_lights(scene), state.live_inputs)
    until(lambda: direct.is_done, lambda: direct.advance(0.1))
    live = read(engine.picture)
    assert np.median(np.abs(direct.rgb - live)) < 0.01 * live.mean()
    assert direct.rgb.sum() == pytest.approx(live.sum(), rel=0.02)
    direct.release()
    engine.release()


def test_without_time_the_processor_is_left_to_the_picture(state, running, comparison, monkeypatch) -> None:
    """Once there is something to compare with: until then it goes on."""
    thread = idle_thread()
    monkeypatch.setattr("spectrasplat.ui.compare.ReferenceThread", lambda *_more: thread)
    compared = replace(state, compare=Compare(mode="wipe"))
    comparison.advance(compared, running, 0.05)
    version = comparison._direct.version
    for _ in range(50):
        comparison.advance(compared, running, 0.0)
    assert set(thread.calls) == {"resume"} and comparison._direct.version == version
    height, width = SIZE[::-1]
    dark = np.zeros((height, width, 3), np.float32)
    thread.snapshot = Snapshot(1, dark, np.ones((height, width), bool), 10, 0.5)
    comparison.advance(compared, running, 0.0)
    assert thread.calls[-1] == "pause"
