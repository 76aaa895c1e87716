"""The dispersion panel, the picker, the Abbe diagram and the curve: what the mouse does to the glass."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.edit.state import Selection
from spectrasplat.gpu.context import Context
from spectrasplat.model.optics import catalogue, glass
from spectrasplat.model.optics.glass import LINE_D_NM, Dispersion
from spectrasplat.model.scene import Diffuse
from spectrasplat.ui.panels import abbe, dispersion, glass_picker, index_curve
from spectrasplat.ui.panels.abbe import N_D_RANGE, V_D_RANGE, draw_abbe
from spectrasplat.ui.panels.dispersion import draw_dispersion
from spectrasplat.ui.panels.glass_values import CONTROL_NM, own_numbers, with_point
from spectrasplat.ui.panels.index_curve import draw_index_curve

from tests.interface.panel_rig import PanelRig, scene_state

N_SF11 = "Schott N-SF11"


@pytest.fixture(autouse=True)
def fresh_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a panel remembers of how it is looked at is not carried from test to test."""
    for module in (abbe, dispersion, glass_picker, index_curve):
        monkeypatch.setattr(module, "_memory", module._Memory())


@pytest.fixture
def panel(gl: Context) -> Iterator[PanelRig]:
    with PanelRig(gl, draw_dispersion, scene_state()) as rig:
        yield rig


def test_gain_slider_keeps_the_glass_and_n_d(panel: PanelRig) -> None:
    n_d = panel.glass.n_d
    panel.drag_slider("Dispersion gain", 0.13, 0.5)
    assert panel.was_held
    assert panel.glass.gain == pytest.approx(5.0, abs=0.4)
    assert (panel.glass.name, panel.glass.n_d) == (N_SF11, n_d)
    assert panel.labels == ["Dispersion gain of prism"]
    assert not panel.state.interacting


def test_double_click_brings_the_natural_gain_back(panel: PanelRig) -> None:
    panel.drag_slider("Dispersion gain", 0.13, 0.7)
    panel.click("Dispersion gain", count=2)
    assert panel.glass == catalogue.find(N_SF11)


def test_typing_goes_with_ctrl_click(panel: PanelRig) -> None:
    panel.type_into("Index n_d", "1.62")
    assert own_numbers(panel.glass) == (1.62, pytest.approx(25.68, abs=0.01))
    assert panel.glass.name == f"{N_SF11} (edited)"
    panel.type_into("Abbe number V_d", "40")
    assert own_numbers(panel.glass) == (1.62, 40.0)
    panel.type_into("Abbe number V_d", "-30")  # anomalous dispersion can only be typed
    assert panel.glass.V_d == pytest.approx(-30.0, abs=0.01)


def test_abbe_slider_is_even_in_its_reciprocal_and_ends_without_dispersion(panel: PanelRig) -> None:
    panel.click(panel.find("Abbe number V_d").at(0.5))
    assert 1.0 / own_numbers(panel.glass)[1] == pytest.approx(1.0 / 16.0, rel=0.03)
    panel.frame(30)  # else the two presses are a double click
    panel.drag_slider("Abbe number V_d", 0.5, 1.2)
    assert math.isinf(own_numbers(panel.glass)[1])
    assert not panel.glass.is_dispersive
    panel.frame(30)
    panel.click("Abbe number V_d", count=2)
    assert panel.glass.V_d == pytest.approx(25.68, abs=0.01)


def test_as_sold_undoes_every_edit(panel: PanelRig) -> None:
    panel.type_into("Dispersion gain", "2")
    panel.type_into("Abbe number V_d", "50")
    panel.click("As sold")
    assert panel.glass == catalogue.find(N_SF11)
    assert panel.labels[-1] == f"{N_SF11} as sold"


def test_a_preset_is_a_glass_by_its_everyday_name(panel: PanelRig) -> None:
    panel.click("Presets…")
    panel.frame(2)
    panel.click("Diamond")
    assert panel.glass == catalogue.find("diamond")
    assert panel.labels == ["Diamond for prism"]


def test_copy_and_paste_between_objects(gl: Context) -> None:
    with PanelRig(gl, draw_dispersion, scene_state("achromat")) as rig:
        first = rig.state.scene.objects[rig.state.selection.index].material
        rig.click("Copy material")
        other = next(
            i for i, o in enumerate(rig.state.scene.objects) if type(o.material) is type(first) and o.material != first
        )
        rig.state = replace(rig.state, selection=Selection("object", other))
        rig.frame(2)
        rig.click("Paste material")
        assert rig.state.scene.objects[other].material == first
        assert rig.labels == [f"Paste material on {rig.state.scene.objects[other].name}"]


def test_other_selections_get_a_hint_and_no_controls(gl: Context) -> None:
    for kind in (Diffuse, "light"):
        with PanelRig(gl, draw_dispersion, scene_state(select=kind)) as rig:
            assert rig.items.items == {}


def test_picker_finds_by_words_and_takes_by_enter(panel: PanelRig) -> None:
    panel.click("Choose glass…")
    panel.frame(2)
    panel.type("schott bk7")
    panel.frame(2)
    panel.key(imgui.Key.down_arrow)
    second = glass_picker.matching("schott bk7", "All makers", None)[1]
    panel.key(imgui.Key.enter)
    assert panel.glass == second.dispersion
    assert panel.labels == [f"Glass of prism: {second.name}"]
    assert "Search glasses" not in panel.items.items  # the popup has closed


def test_another_glass_comes_without_the_gain_of_the_last(panel: PanelRig) -> None:
    panel.type_into("Dispersion gain", "2.5")
    panel.click("Choose glass…")
    panel.frame(2)
    panel.type("diamond")
    panel.frame(2)
    panel.click("diamond")
    assert panel.glass == catalogue.find("diamond")


def test_picker_filters_and_sorts() -> None:
    schott = glass_picker.matching("", "Schott", (3, True))
    assert {e.maker for e in schott} == {"Schott"}
    v_d = [e.dispersion.V_d for e in schott]
    assert len(v_d) > 100
    assert v_d == sorted(v_d, reverse=True)
    assert glass_picker.matching("nsf11", "All makers", None)[0].qualified_name == N_SF11


def _pixel(rig: PanelRig, n_d: float, v_d: float) -> tuple[float, float]:
    """Where a glass lies in the diagram: by the plot's own rectangle, found from two axes' ranges."""
    low, high = abbe._memory.corners
    x = low[0] + (high[0] - low[0]) * (V_D_RANGE[1] - v_d) / (V_D_RANGE[1] - V_D_RANGE[0])
    y = low[1] + (high[1] - low[1]) * (N_D_RANGE[1] - n_d) / (N_D_RANGE[1] - N_D_RANGE[0])
    return x, y


def max_isolated(maker: str) -> Dispersion:
    """The glass of a maker with the widest empty space about it in the diagram."""
    shown = [e.dispersion for e in catalogue.entries() if e.maker in (maker, "Materials")]
    places = np.array([(g.V_d / 85.0, g.n_d / 0.7) for g in shown if np.isfinite(g.V_d)])
    shown = [g for g in shown if np.isfinite(g.V_d)]

    def room(glass: Dispersion) -> float:
        if not (20 < glass.V_d < 95 and 1.42 < glass.n_d < 2.05 and glass.name.startswith(maker)):
            return 0.0
        return float(np.sort(np.hypot(*(places - (glass.V_d / 85.0, glass.n_d / 0.7)).T))[1])

    return max(shown, key=room)


def test_click_in_the_abbe_diagram_gives_that_glass(gl: Context) -> None:
    with PanelRig(gl, draw_abbe, scene_state(), (700, 600)) as rig:
        for maker in catalogue.MAKER_ORDER[2:]:
            rig.click(maker)
        chosen = max_isolated("Schott")
        rig.click(_pixel(rig, chosen.n_d, chosen.V_d))
        assert rig.glass == chosen
        assert rig.labels == [f"Glass of prism: {chosen.name.removeprefix('Schott ')}"]


def test_ctrl_drag_makes_a_model_glass_live(gl: Context) -> None:
    with PanelRig(gl, draw_abbe, scene_state(), (700, 600)) as rig:
        rig.drag(_pixel(rig, 1.9, 60.0), _pixel(rig, 1.7, 40.0), keys=[imgui.Key.mod_ctrl])
        n_d, v_d = own_numbers(rig.glass)
        assert (n_d, v_d) == (pytest.approx(1.7, abs=0.003), pytest.approx(40.0, abs=0.4))
        assert rig.was_held
        assert rig.labels == ["n_d and V_d of prism"]


def test_dragging_the_view_changes_no_glass(gl: Context) -> None:
    with PanelRig(gl, draw_abbe, scene_state(), (700, 600)) as rig:
        before = rig.state.scene
        rig.drag(_pixel(rig, 1.6, 60.0), _pixel(rig, 1.7, 50.0))
        assert rig.state.scene is before


def test_a_point_of_the_curve_follows_the_mouse_and_n_d_stays(gl: Context) -> None:
    with PanelRig(gl, draw_index_curve, scene_state()) as rig:
        before = rig.glass
        x, y = rig.find("n at 440 nm").centre
        rig.drag((x, y), (x, y - 20))
        assert rig.glass.kind == "table"
        assert rig.glass.name == f"{N_SF11} (shaped)"
        assert rig.glass.index(440.0) > before.index(440.0) + 1e-3
        assert rig.glass.n_d == pytest.approx(before.n_d, abs=1e-12)
        others = np.delete(np.array(CONTROL_NM), CONTROL_NM.index(440.0))
        assert rig.glass.index(others) == pytest.approx(before.index(others), abs=1e-9)
        assert rig.labels == ["Shape n(λ) of prism"]
        assert rig.was_held
        rig.click("Reset curve")
        assert rig.glass == before


def test_the_d_point_moves_only_when_it_is_not_kept(gl: Context) -> None:
    with PanelRig(gl, draw_index_curve, scene_state()) as rig:
        before = rig.glass
        x, y = rig.find("n at 588 nm").centre
        rig.drag((x, y), (x, y - 20))
        assert rig.glass == before
        rig.click("Keep n_d")
        rig.drag((x, y), (x, y - 20))
        assert rig.glass.n_d > before.n_d + 1e-3


def test_shaping_takes_the_gain_in() -> None:
    strong = glass.with_gain(catalogue.find("N-BK7"), 4.0)
    shaped = with_point(strong, 0, float(strong.index(380.0)) + 0.01, keep_n_d=True)
    inner = np.array(CONTROL_NM[1:])
    assert shaped.gain == 1.0
    assert shaped.index(inner) == pytest.approx(strong.index(inner), abs=1e-9)
    assert shaped.index(LINE_D_NM) == pytest.approx(strong.n_d, abs=1e-12)
