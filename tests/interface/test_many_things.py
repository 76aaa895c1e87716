"""Several things selected, moved, copied, deleted; hidden and locked; World and Camera in the outliner; snapping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.edit import requests
from spectrasplat.edit.drawn import Drawn
from spectrasplat.edit.picking import PickHit
from spectrasplat.edit.selecting import chosen, everything
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.ui import viewport
from spectrasplat.ui.panels.inspector import draw_inspector
from spectrasplat.ui.session import Session

from tests.interface.fake_engine import FakeEngine
from tests.interface.panel_rig import PanelRig, scene_state
from tests.interface.shell_rig import ShellRig


@pytest.fixture
def state() -> State:
    return scene_state("achromat")


def test_ctrl_click_in_the_outliner_takes_one_more_and_delete_takes_all(gl: Context, state: State) -> None:
    with ShellRig(gl, state, size=(1440, 900)) as rig:
        rig.click("crown")
        rig.click("flint", keys=[imgui.Key.mod_ctrl])
        assert {each.index for each in everything(rig.state)} == {0, 1}
        rig.click("flint", keys=[imgui.Key.mod_ctrl])
        assert everything(rig.state) == (Selection("object", 0),)
        rig.click("left beam", keys=[imgui.Key.mod_ctrl])
        rig.key(imgui.Key.delete)
        rig.frame(2)
        assert [o.name for o in rig.state.scene.objects] == ["flint", "singlet", "table"]
        assert [light.name for light in rig.state.scene.lights] == ["right beam", "room"]
        assert rig.state.edit_label == "Delete 2 things" and rig.state.also == ()


def test_copies_are_selected_together(gl: Context, state: State) -> None:
    with ShellRig(gl, replace(state, selection=Selection("object", 0), also=(Selection("object", 1),))) as rig:
        rig.key(imgui.Key.d, [imgui.Key.mod_ctrl])
        rig.frame(2)
        names = [rig.state.scene.objects[each.index].name for each in everything(rig.state)]
        assert names == ["crown 2", "flint 2"] and rig.state.edit_label == "Duplicate 2 things"


def test_the_handles_move_all_that_is_selected(gl: Context, state: State) -> None:
    viewport.reset()
    state = replace(state, selection=Selection("object", 0), also=(Selection("object", 1),), tool="move")
    with ShellRig(gl, state, size=(1440, 900)) as rig:
        before = [item.object_to_world[:3, 3].copy() for item in rig.state.scene.objects]
        x, y = rig.find("Gizmo").centre
        rig.drag((x, y), (x + 60, y + 10))
        moved = [item.object_to_world[:3, 3] - old for item, old in zip(rig.state.scene.objects, before, strict=True)]
        assert np.linalg.norm(moved[0]) > 0.05 and moved[0] == pytest.approx(moved[1], abs=1e-9)
        assert not moved[2].any() and rig.state.edit_label == "Move crown and 1 more"


def test_snapping_moves_in_steps(gl: Context, state: State) -> None:
    viewport.reset()
    with ShellRig(gl, replace(state, selection=Selection("object", 0), tool="rotate"), size=(1440, 900)) as rig:
        assert not viewport.gizmo.is_snapping
        rig.click("Snapping")
        assert viewport.gizmo.is_snapping and viewport.gizmo._snap("move", 4.0) is not None
        with rig.held([imgui.Key.mod_ctrl]):
            assert viewport.gizmo._snap("move", 4.0) is None
    viewport.reset()


def test_what_is_hidden_is_left_out_of_the_picture_only(state: State) -> None:
    drawn = Drawn()
    hidden = replace(
        state, hidden=frozenset({("object", "crown"), ("light", "room")}), selection=Selection("object", 2)
    )
    shown = drawn.of(hidden)
    assert [o.name for o in shown.scene.objects] == ["flint", "singlet", "table"]
    assert [light.name for light in shown.scene.lights] == ["left beam", "right beam"]
    assert shown.selection == Selection("object", 1)  # the singlet
    assert drawn.of(hidden).scene is shown.scene and len(hidden.scene.objects) == 4
    nothing = replace(state, hidden=frozenset(("object", item.name) for item in state.scene.objects))
    assert drawn.of(nothing).scene.objects == state.scene.objects


def test_eye_and_lock_in_the_outliner(gl: Context, state: State) -> None:
    with ShellRig(gl, state, size=(1440, 900)) as rig:
        rig.move("singlet")
        rig.frame(2)
        rig.click("Hide singlet")
        rig.click("Lock singlet")
        assert rig.state.hidden == rig.state.locked == {("object", "singlet")}
        rig.click("Hide singlet")
        assert not rig.state.hidden


def test_what_is_locked_keeps_its_place(gl: Context) -> None:
    with PanelRig(gl, draw_inspector, scene_state("achromat")) as rig:
        key = ("object", rig.state.scene.objects[rig.state.selection.index].name)
        nothing: frozenset[tuple[str, str]] = frozenset()
        for locked in (frozenset({key}), nothing):
            rig.state = replace(rig.state, locked=locked)
            rig.frame(2)
            before = rig.state.scene
            row = rig.find("Position")
            rig.drag(row.at(0.1), row.at(0.25))
            assert (rig.state.scene is before) == bool(locked)


def test_what_is_locked_is_not_taken_in_the_picture(gl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(gl, make_engine=FakeEngine)
    hit = PickHit(0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, False)
    monkeypatch.setattr("spectrasplat.ui.session_requests.pick_in", lambda *_place: hit)
    from spectrasplat.ui.session_requests import carry_out

    name = session.state.scene.objects[0].name
    session.state = replace(session.state, locked=frozenset({("object", name)}))
    carry_out(session, requests.SelectAt(0.5, 0.5, itself=True))
    assert session.state.selection == Selection() and "locked" in session.messages.messages()[-1].text
    session.state = replace(session.state, locked=frozenset())
    carry_out(session, requests.SelectAt(0.5, 0.5, itself=True))
    assert session.state.selection == Selection("object", 0)
    session.autosave.close()
    session.release()


def test_world_and_camera_stand_in_the_outliner(gl: Context, state: State) -> None:
    with ShellRig(gl, state, size=(1440, 900)) as rig:
        rig.click("Camera")
        rig.frame(2)
        assert rig.state.selection == Selection("camera")
        rig.state = replace(rig.state, camera=replace(state.camera, position=(1.0, 2.0, 3.0)))
        rig.click("Put it here")
        rig.frame(2)
        assert rig.state.scene.camera.position == (1.0, 2.0, 3.0) and rig.state.edit_label == "Camera"
        # The view is the camera's now, and shows what is done to it; one from elsewhere stays.
        for elsewhere in (False, True):
            if elsewhere:
                rig.state = replace(rig.state, camera=replace(state.camera, position=(1.0, 2.0, 9.0)))
            before = rig.state.scene.camera.vertical_fov_deg
            x, y = rig.find("Field of view").centre
            rig.drag((x - 20, y), (x + 20, y))
            rig.frame(2)
            assert rig.state.scene.camera.vertical_fov_deg != before
            assert (rig.state.camera == rig.state.scene.camera) != elsewhere
        rig.click("World")
        rig.frame(2)
        assert rig.state.selection == Selection() and "Longest path" in rig.items.items
        assert rig.state.scene.render.bounces == 0
        x, y = rig.find("Bounces").centre
        rig.drag((x - 20, y), (x + 20, y))
        rig.frame(2)
        assert rig.state.scene.render.bounces > 0 and rig.state.edit_label == "Bounces"
        x, y = rig.find("Haze").centre
        rig.drag((x - 20, y), (x + 20, y))
        rig.frame(2)
        assert rig.state.scene.render.haze > 0 and "Haze anisotropy" in rig.items.items


def test_choosing_again_takes_away() -> None:
    state = scene_state("achromat")
    one, two = Selection("object", 0), Selection("object", 1)
    both = chosen(chosen(state, one), two, add=True)
    assert everything(both) == (two, one)
    assert everything(chosen(both, two, add=True)) == (one,)
    assert everything(chosen(both, one)) == (one,)
