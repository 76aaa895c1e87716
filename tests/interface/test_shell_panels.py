"""The shell's own panels: what a mouse does to the state, and that every panel draws at both sizes and themes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.edit import requests
from spectrasplat.edit.autosave import Note, Recovery
from spectrasplat.edit.matrices import decompose
from spectrasplat.edit.picking import PickHit
from spectrasplat.edit.state import Panels, Preferences, Selection
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Diffuse
from spectrasplat.render.viewer.stats import LiveStats
from spectrasplat.ui.panels.view_panel import SWEEP_NM_PER_S
from spectrasplat.ui.view_model import CursorInfo, HistoryEntry, JobInfo, LightHere, Message, SceneEntry, ViewModel

from tests.interface.panel_rig import scene_state
from tests.interface.shell_rig import ShellRig

SETTLED_TABS = 4
NM = np.arange(385.0, 780.0, 10.0)


def full_view_model() -> ViewModel:
    """Something in every fact that the shell's panels show."""
    stats = LiveStats(
        renderer="llvmpipe",
        device_advice="the processor draws although there is a GPU by AMD: unset LIBGL_ALWAYS_SOFTWARE",
        rays_traced=18_400_000,
        photons=12_345_678,
        photons_stored=1_000_000,
        photons_per_second=8e5,
        first_order=True,
        bytes=180 << 20,
        fallbacks={"no_footprint": 12},
        lost={"absorbed": 0.02},
        bands={"slit": 4},
    )
    return ViewModel(
        stats=stats,
        frame_ms=tuple(float(v) for v in range(10, 30)),
        pass_ms={"trace": 8.0, "splats": 5.0, "interface": 2.0},
        cursor=CursorInfo(
            (10, 10),
            (0.8, 0.4, 0.0),
            PickHit(1, (0, 0, 0), (0, 0, 1), 1.0, True),
            LightHere(NM, 1e-3 * np.exp(-(((NM - 560) / 60) ** 2)), 0.0, False, None),
        ),
        title="prism",
        history=tuple(HistoryEntry(label, i == 1) for i, label in enumerate(("Open", "Move prism", "Brush"))),
        scenes=tuple(
            SceneEntry(Path(f"/scenes/{name}.toml"), name, "Words about it.", None) for name in ("prism", "lens")
        ),
        job=JobInfo("Turntable", 0.4, "Frame 40 of 100"),
    )


@pytest.fixture
def rig(gl: Context) -> Iterator[ShellRig]:
    with ShellRig(gl, view_model=full_view_model()) as made:
        yield made


@pytest.mark.parametrize(("size", "theme"), [((1280, 720), "dark"), ((1920, 1080), "light"), ((640, 400), "dark")])
def test_every_panel_draws(gl: Context, size: tuple[int, int], theme: str) -> None:
    state = replace(scene_state(), preferences=Preferences(theme=theme))  # type: ignore[arg-type]
    with ShellRig(gl, state, full_view_model(), size) as rig:
        everything = {field.name: field.name != "start_page" for field in fields(Panels)}
        rig.open_panel(**everything)
        rig.frame(SETTLED_TABS)
        shown = {label for label in rig.items.items if label.startswith("Window: ")}
        assert {"Window: Inspector", "Window: Timing", "Window: Compare", "Window: Abbe"} <= shown
        ground = rig.screenshot()[size[1] // 2, 4].mean()
        assert ground < 60 if theme == "dark" else ground > 180


def test_inspector_moves_and_makes_diffuse(rig: ShellRig) -> None:
    rig.show_tab("Inspector")
    before = rig.state.scene.objects[0].object_to_world[:3, 3].copy()
    field = rig.find("Position")
    rig.drag(field.at(0.15), (field.at(0.15)[0] + 60, field.centre[1]))
    after = rig.state.scene.objects[0].object_to_world[:3, 3]
    assert after[0] > before[0] and np.array_equal(after[1:], before[1:])
    assert rig.state.edit_label == "Move prism"
    rig.click("Kind")
    rig.click("Diffuse")
    assert isinstance(rig.state.scene.objects[0].material, Diffuse)


def test_scale_keeps_proportions(rig: ShellRig) -> None:
    rig.show_tab("Inspector")
    field = rig.find("Scale")
    rig.drag(field.at(0.15), (field.at(0.15)[0] + 40, field.centre[1]))
    scale = decompose(rig.state.scene.objects[0].object_to_world)[2]
    assert scale[0] > 1.1
    np.testing.assert_allclose(scale, scale[0], rtol=1e-6)


def test_outliner_selects_frames_renames(rig: ShellRig) -> None:
    rig.click("table")
    assert rig.state.selection == Selection("object", 1)
    rig.click("Outliner/slit", count=2)
    assert rig.state.selection == Selection("light", 0)
    assert requests.FrameSelection() in rig.asked
    rig.click("table")
    rig.key(imgui.Key.f2)
    rig.frame(2)
    rig.type("desk")
    rig.key(imgui.Key.enter)
    assert rig.state.scene.objects[1].name == "desk"
    assert rig.state.edit_label == "Rename table"


def test_outliner_context_menu_duplicates(rig: ShellRig) -> None:
    rig.click("prism", button=1)
    rig.frame(2)
    rig.click("Context: Duplicate")
    assert len(rig.state.scene.objects) == 3
    assert rig.state.selection == Selection("object", 2)


def test_exposure_slider_takes_over_from_automatic(rig: ShellRig) -> None:
    rig.show_tab("View")
    assert rig.state.display.auto_exposure
    rig.drag_slider("Exposure", 0.5, 0.75)
    assert not rig.state.display.auto_exposure
    assert rig.state.display.exposure_ev == pytest.approx(8.0, abs=1.0)
    rig.click("Exposure", count=2)
    assert rig.state.display.exposure_ev == 0.0


def test_glare_and_highlights_belong_to_the_scene(rig: ShellRig) -> None:
    rig.show_tab("View")
    rig.drag_slider("Glare", 0.0, 0.5)
    assert rig.state.scene.render.glare == pytest.approx(0.25, abs=0.03)
    rig.click("Glare", count=2)
    assert rig.state.scene.render.glare == 0.0 and rig.state.scene.render.antialias_highlights
    rig.click("Antialias highlights")
    assert not rig.state.scene.render.antialias_highlights


def test_solo_strip_picks_and_sweep_runs_until_touched(rig: ShellRig) -> None:
    rig.show_tab("View")
    strip = rig.find("Spectrum strip")
    rig.click(strip.at(0.5))
    assert rig.state.solo_nm == pytest.approx(580.0, abs=3.0)
    rig.click("Sweep")
    first = rig.state.solo_nm
    rig.frame(20)
    assert first is not None and rig.state.solo_nm is not None
    assert rig.state.solo_nm - first == pytest.approx(SWEEP_NM_PER_S * 20 * rig.view_model.delta_s, rel=1e-6)
    assert rig.state.interacting
    rig.click(rig.find("Spectrum strip").at(0.25))
    still = rig.state.solo_nm
    rig.frame(5)
    assert rig.state.solo_nm == still == pytest.approx(480.0, abs=3.0)


def test_start_page_opens_a_card_and_closes(rig: ShellRig) -> None:
    rig.open_panel(start_page=True)
    rig.click("lens")
    assert rig.asked == [requests.Open(Path("/scenes/lens.toml"))]
    assert not rig.state.preferences.panels.start_page


def test_start_page_hides_no_edits_and_closes_by_esc(rig: ShellRig) -> None:
    rig.open_panel(start_page=True)
    rig.key(imgui.Key.delete)
    assert len(rig.state.scene.objects) == 2 and not rig.asked
    rig.key(imgui.Key.escape)
    assert not rig.state.preferences.panels.start_page


def test_start_page_offers_the_recovery(rig: ShellRig) -> None:
    rig.view_model = replace(rig.view_model, recovery=Recovery(Path("autosave.toml"), Note(1, "prism", None, 0.0)))
    rig.open_panel(start_page=True)
    rig.click("Recover")
    assert rig.asked == [requests.Recover()]


def test_errors_are_over_no_button_and_shader_errors_have_a_window(rig: ShellRig) -> None:
    rig.view_model = replace(
        rig.view_model, messages=(Message("The disk is full.", True, 9.0),), shader_error="camera.comp:12: oh"
    )
    rig.frame(3)
    close, picture = rig.find("Close message 0"), rig.find("Picture")
    (left, top), (right, bottom) = picture.at(0, 0), picture.at(1, 1)
    assert left < close.centre[0] < right and top < close.centre[1] < bottom
    rig.click("Close message 0")
    assert rig.asked[-1] == requests.DismissMessage("The disk is full.")
    rig.click("Compile again")
    assert rig.asked[-1] == requests.ReloadShaders()


@pytest.mark.parametrize("is_kept", [True, False])
def test_a_row_takes_a_click_that_comes_with_its_move_in_one_frame(gl: Context, is_kept: bool) -> None:
    """Frames longer than a click: the window puts the press off to the next frame. Without, imgui drops it on rows that
    have an eye and a lock on them."""
    rig = ShellRig(gl)
    rig.state = replace(rig.state, selection=Selection())
    rig.frame(2)
    row = rig.find("table").at(0.1)
    rig.put_mouse(row)
    if is_kept:
        rig._host.keep_for_next_frame()
    imgui.get_io().add_mouse_button_event(0, True)
    imgui.get_io().add_mouse_button_event(0, False)
    rig.frame(4)
    assert (rig.state.selection.kind == "object") == is_kept
