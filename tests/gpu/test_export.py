"""Screenshots, maps and animations as the viewer's jobs: in small steps, cancelled, refused."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base import tone_map
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import read_image
from spectrasplat.base.paths import assets_dir
from spectrasplat.edit.requests import Animate, Bake, Screenshot
from spectrasplat.edit.state import Display as DisplaySettings
from spectrasplat.edit.state import Key, State
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.passes.display import Display
from spectrasplat.ui.export import Exports
from spectrasplat.ui.screenshot import Shown

SIZE = (64, 36)


@pytest.fixture(scope="module")
def state() -> State:
    scene = load_scene(assets_dir() / "scenes" / "prism.toml")
    return State(scene, scene.camera, viewport_size=SIZE)


@pytest.fixture
def exports(gl):
    made = Exports(gl)
    yield made
    made.release()


@pytest.fixture
def shown(gl):
    """A picture of a gradient, as the window shows it."""
    rgb = np.linspace(0.0, 2.0, SIZE[0] * SIZE[1] * 4, dtype=np.float32).reshape(SIZE[1], SIZE[0], 4)
    radiance = gl.ctx.texture(SIZE, 4, rgb.tobytes(), dtype="f4")
    display = Display(gl)
    yield Shown(display.run(radiance, DisplaySettings(), 0.5, SIZE), radiance, 0.5)
    display.release()
    radiance.release()


def finished(exports: Exports) -> tuple[str, list[float]]:
    shares = []
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        told = exports.step(0.01)
        if told is not None:
            return told, shares
        assert exports.is_busy
        if exports.job is not None:
            shares.append(exports.job.fraction)
    raise AssertionError("it never ends")


def test_a_png_is_what_is_on_the_screen_and_an_exr_what_is_behind_it(
    exports: Exports, state: State, shown: Shown, tmp_path: Path
) -> None:
    from PIL import Image

    exports.begin(Screenshot(tmp_path / "a.png"), state, shown)
    exports.begin(Screenshot(tmp_path / "a.exr"), state, shown)  # as many as one likes
    assert [finished(exports)[0] for _ in range(2)] == [f"Saved {name} in {tmp_path}." for name in ("a.png", "a.exr")]
    assert not exports.is_busy
    codes = np.asarray(Image.open(tmp_path / "a.png"))
    linear = np.frombuffer(shown.radiance.read(), np.float32).reshape(SIZE[1], SIZE[0], 4)[..., :3]
    assert np.abs(codes.astype(int) - tone_map.tone_map_8bit(linear, 0.5)).max() <= 1
    assert np.array_equal(read_image(tmp_path / "a.exr").rgb, linear)
    with pytest.raises(UserError, match="picture format"):
        exports.begin(Screenshot(tmp_path / "a.gif"), state, shown)


def test_a_map_and_its_place(exports: Exports, state: State, shown: Shown, tmp_path: Path) -> None:
    exports.begin(Bake(tmp_path / "m.exr", "table", (48, 32), 20_000), state, shown)
    assert "m.json" in finished(exports)[0]
    assert read_image(tmp_path / "m.exr").rgb.shape == (32, 48, 3)
    assert json.loads((tmp_path / "m.json").read_text())["receiver"] == "table"


@pytest.mark.slow
def test_an_animation_looks_as_the_window_and_can_be_cancelled(
    exports: Exports, state: State, shown: Shown, tmp_path: Path
) -> None:
    from dataclasses import replace

    from PIL import Image

    false = replace(
        state,
        display=DisplaySettings(false_colour=True),
        animation=(Key(0.0, "camera.fov_deg", 30.0), Key(1.0, "camera.fov_deg", 40.0)),
    )
    request = Animate(tmp_path / "frames", "keys", 2, 2.0, SIZE, 10_000, 1)
    exports.begin(request, false, shown)
    told, _ = finished(exports)
    assert told == "Saved frames, 2 frames."
    first, second = (np.asarray(Image.open(tmp_path / "frames" / f"000{i}.png")) for i in range(2))
    assert not np.array_equal(first, second)
    # Turbo: the dim table is a saturated colour, not grey.
    assert np.ptp(np.median(first.reshape(-1, 3), axis=0)) > 40
    exports.begin(replace(request, path=tmp_path / "more", kind="turntable", frames=40), state, shown)
    while exports.job is not None and exports.job.fraction < 0.1:
        exports.step(0.02)
    assert exports.job is not None and exports.job.text.startswith("Frame ")
    with pytest.raises(UserError, match="running already"):
        exports.begin(Bake(tmp_path / "m.exr", "table"), state, shown)
    assert "stay" in (exports.cancel() or "")
    assert exports.job is None and len(list((tmp_path / "more").glob("*.png"))) >= 3


def test_a_movie_cancelled_before_its_first_frame_leaves_nothing(
    exports: Exports, state: State, shown: Shown, tmp_path: Path
) -> None:
    exports.begin(Animate(tmp_path / "a.mp4"), state, shown)
    assert len(list(tmp_path.iterdir())) == 1  # ffmpeg's temporary file
    exports.cancel()
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_done_is_said_at_once(exports: Exports, state: State, shown: Shown, tmp_path: Path) -> None:
    for request, told in (
        (Animate(tmp_path / "a.mp4", "keys"), "nothing to animate"),
        (Animate(tmp_path / "a.avi"), "use .mp4"),
        (Animate(tmp_path / "a.mp4", size=(99_999, 9)), "out of range"),
        (Bake(tmp_path / "a.exr", "nobody"), "no receiver"),
        (Screenshot(tmp_path / "gone" / "a.exr"), "does not exist"),
    ):
        with pytest.raises(UserError, match=told):
            exports.begin(request, state, shown)
        assert exports.job is None
    assert list(tmp_path.iterdir()) == []
