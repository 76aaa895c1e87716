"""Render… in the window: what the panel asks for, what is written, how long it says it takes; scrubbing."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image
from spectrasplat.base.errors import UserError
from spectrasplat.edit import requests
from spectrasplat.edit.drawn import Drawn, scrubbed
from spectrasplat.edit.state import Key, State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.export import Exports
from spectrasplat.ui.export_job import left_words
from spectrasplat.ui.panels import export_panel, file_browser, keys_editor
from spectrasplat.ui.panels.export_panel import draw_export
from spectrasplat.ui.screenshot import Shown
from spectrasplat.ui.view_model import ViewModel

from tests.interface.panel_rig import PanelRig, scene_state

GAIN = "objects.prism.dispersion_gain"


def with_browser(state: State, view_model: ViewModel) -> State:
    state = draw_export(state, view_model)
    return file_browser.draw(state, view_model)


@pytest.fixture
def rig(gl: Context, tmp_path: Path):
    export_panel.reset()
    file_browser.close()
    with PanelRig(gl, with_browser, scene_state(), (900, 1100)) as made:
        made.view_model = ViewModel(path=tmp_path / "scene.toml", title="scene.toml")
        made.frame(2)
        yield made
    file_browser.close()
    export_panel.reset()


def test_the_panel_asks_for_what_was_chosen(rig: PanelRig, tmp_path: Path) -> None:
    rig.click("Samples")
    rig.click("16")
    rig.click("Caustics alone too")
    rig.click("Render…")
    rig.click("Save")
    wanted = requests.RenderPicture(tmp_path / "scene.png", (960, 540), 4_000_000, None, 16, True, None)
    assert rig.state.requests == (wanted,)
    rig.state = replace(rig.state, requests=())
    rig.click("Until")
    rig.click("A time")
    assert "Caustics alone too" not in rig.items.items
    rig.click("Render…")
    rig.click("Save")
    wanted = requests.RenderPicture(tmp_path / "scene.png", (960, 540), None, 60.0, 16, False, None)
    assert rig.state.requests == (wanted,)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("a.tiff", "a.tiff: no .tiff is written here; end the name in .png, .jpg, .webp, .exr or .npy."),
        ("gone/a.png", "There is no folder"),
    ],
)
def test_a_bad_name_is_told_before_anything_is_rendered(rig: PanelRig, typed: str, said: str) -> None:
    rig.click("Render…")
    rig.frame(2)
    rig.key(imgui.Key.a, [imgui.Key.mod_ctrl])
    rig.type(typed)
    rig.click("Save")
    rig.frame(2)
    assert rig.state.requests == () and said in file_browser._browser.error
    assert file_browser.is_open("Render")


def test_a_point_in_a_name_is_no_ending(rig: PanelRig, tmp_path: Path) -> None:
    rig.click("Render…")
    rig.frame(2)
    rig.key(imgui.Key.a, [imgui.Key.mod_ctrl])
    rig.type("take.2")
    rig.click("Save")
    assert rig.state.requests[0].path == tmp_path / "take.2.png"


def shown(gl: Context) -> Shown:
    radiance = gl.ctx.texture((8, 4), 4, dtype="f4")
    return Shown(gl.ctx.texture((8, 4), 4), radiance, 0.0, 1)


def test_a_picture_and_its_caustics_are_written_whole(gl: Context, tmp_path: Path) -> None:
    exports, state = Exports(gl), scene_state()
    path = tmp_path / "a.png"
    exports.begin(requests.RenderPicture(path, (96, 54), 20_000, None, 1, caustic=True), state, shown(gl))
    assert exports.is_rendering
    note, fractions = None, []
    while note is None:
        assert exports.job is not None and not path.exists()
        fractions.append(exports.job.fraction)
        note = exports.step(0.1)
    assert note.startswith("Rendered a.png.") and fractions == sorted(fractions)
    beauty, caustic = (np.asarray(Image.open(p)) for p in (path, tmp_path / "a_caustic.png"))
    assert beauty.shape == caustic.shape == (54, 96, 3)
    assert beauty.mean() > caustic.mean() and caustic.max() > 0


def test_cancelling_a_picture_keeps_what_is_done_and_again_drops_it(gl: Context, tmp_path: Path) -> None:
    exports, state = Exports(gl), scene_state()
    path = tmp_path / "a.png"
    request = requests.RenderPicture(path, (96, 54), 64_000_000, None, 256)
    exports.begin(request, state, shown(gl))
    exports.step(0.1)
    assert exports.stop() is None and exports.job is not None and exports.job.is_stopped
    assert exports.job.text == "Finishing with what is done so far"
    note = None
    while note is None:
        note = exports.step(0.1)
    assert note.startswith("Rendered a.png. It was stopped early") and np.asarray(Image.open(path)).max() > 0
    path.unlink()
    exports.begin(request, state, shown(gl))
    exports.step(0.0)
    assert exports.stop() is None
    assert (exports.stop() or "").startswith("Nothing was written") and exports.job is None and not path.exists()


def test_what_cannot_be_rendered_is_refused_at_once(gl: Context, tmp_path: Path) -> None:
    exports, state = Exports(gl), scene_state()
    with pytest.raises(UserError, match=r"\.exr"):
        exports.begin(requests.RenderPicture(tmp_path / "a.png", (96, 54), bins=20), state, shown(gl))
    with pytest.raises(UserError, match="number of photons"):
        exports.begin(requests.RenderPicture(tmp_path / "a.png", (96, 54), None, 5.0, caustic=True), state, shown(gl))
    assert exports.job is None


def test_the_end_is_told_by_the_clock() -> None:
    now = datetime(2026, 11, 23, 14, 0, 0, tzinfo=UTC)
    assert left_words(41.0, now) == "about 41 s left, until 14:00"
    assert left_words(600.0, now) == "about 10 min left, until 14:10"


def test_scrubbing_shows_the_animation_and_edits_nothing() -> None:
    state = replace(scene_state(), animation=(Key(0.0, GAIN, 0.0), Key(2.0, GAIN, 3.0)))
    preview = Drawn()
    assert preview.of(state) is state
    state = scrubbed(state, 2.0)
    drawn = preview.of(state)
    assert drawn.scene.objects[0].material.dispersion.gain == pytest.approx(3.0)
    assert state.scene.objects[0].material.dispersion.gain == pytest.approx(1.0)
    assert preview.of(state).scene is drawn.scene  # nothing moves: nothing is done again
    assert preview.of(scrubbed(state, 1.0)).scene.objects[0].material.dispersion.gain == pytest.approx(1.5)
    gone = replace(state, animation=(Key(0.0, "objects.vase.dispersion_gain", 0.0), *state.animation))
    assert preview.of(gone) is gone


def test_the_preview_is_dragged_along_and_ended(gl: Context) -> None:
    state = replace(scene_state(), animation=(Key(0.0, GAIN, 0.0), Key(2.0, GAIN, 3.0)))
    with PanelRig(gl, keys_editor.draw_keys, state) as rig:
        rig.drag_slider("Preview", 0.1, 0.5)
        assert rig.state.preview_s == pytest.approx(1.0, abs=0.1)
        rig.click("End preview")
        assert rig.state.preview_s is None
