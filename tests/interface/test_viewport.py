"""The viewport with a synthetic mouse and a view model that the test sets: camera, selecting, gizmo, brush, pull,
toolbar, wipe."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.edit import camera_controls
from spectrasplat.edit.picking import PickHit, pick_in
from spectrasplat.edit.requests import BeginPull, Notice, SelectAt
from spectrasplat.edit.state import Brush, Compare, Pull, Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.model.scene import Diffuse
from spectrasplat.passes.ray_line import RayLine
from spectrasplat.render.viewer.stats import LiveStats
from spectrasplat.ui import viewport, viewport_tools
from spectrasplat.ui.headless import HeadlessInterface
from spectrasplat.ui.view_model import CursorInfo, ViewModel

from tests.interface.panel_rig import receiver_of, scene_state

SIZE = (640, 400)
KEY = imgui.Key


class ViewportRig(HeadlessInterface):
    """The viewport in a bare window; the cursor lies on the receiver wherever it is over it, as the host would find."""

    def __init__(self, gl: Context, state: State | None = None) -> None:
        self.state = state or scene_state()
        self.view_model = ViewModel()
        self.asked: list = []
        self.labels: list[str] = []
        self.held_frames = 0
        self._colour = gl.ctx.texture((2, 2), 4, bytes([40, 80, 120, 255] * 4))
        viewport.reset()
        super().__init__(gl, self._draw_window, SIZE)
        self.frame(3)

    def release(self) -> None:
        super().release()
        self._colour.release()

    def _draw_window(self) -> None:
        imgui.set_next_window_pos((0, 0))
        imgui.set_next_window_size(SIZE)
        imgui.push_style_var(imgui.StyleVar_.window_padding, (0, 0))
        imgui.begin("Viewport", None, imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_resize)
        imgui.pop_style_var()
        before = replace(self.state, interacting=False, hover=None, requests=())
        view_model = replace(
            self.view_model, picture=self._colour.glo, cursor=CursorInfo((0, 0), (1.0, 1.0, 1.0), self.under())
        )
        self.state = viewport.draw_viewport(before, view_model)
        if self.state.scene is not before.scene:
            self.labels.append(self.state.edit_label)
        self.asked += self.state.requests
        self.held_frames += self.state.interacting
        imgui.end()

    def under(self) -> PickHit | None:
        """What the host found where the cursor was in the last frame."""
        return None if self.state.hover is None else pick_in(self.state, *self.state.hover)

    def at(self, point) -> tuple[float, float]:
        """Where a world point is on the screen."""
        (x, y), _ = self.state.view.project(np.asarray(point, float))
        return self.find("Picture").at(float(x), float(y))


@pytest.fixture
def rig(gl) -> Iterator[ViewportRig]:
    with ViewportRig(gl) as rig:
        yield rig


CENTRE = (0.5 * SIZE[0] + 40, 0.5 * SIZE[1] + 30)


def test_the_picture_fills_the_window_and_says_its_size(rig) -> None:
    assert rig.find("Picture").size == SIZE
    assert rig.state.viewport_size == SIZE
    assert rig.screenshot()[SIZE[1] // 2, SIZE[0] - 20].tolist() == [40, 80, 120]
    rig.view_model = replace(rig.view_model, framebuffer_scale=2.0)
    rig.frame()
    assert rig.state.viewport_size == (2 * SIZE[0], 2 * SIZE[1])
    assert viewport.picture_size(3.0, 101.3, 1.0) == (64, 102)


def test_hover_is_told_over_the_picture_and_not_over_buttons(rig) -> None:
    rig.move((160, 100))
    assert rig.state.hover == pytest.approx((0.25, 0.25))
    rig.move("Select")
    rig.frame()
    assert rig.state.hover is None


def test_a_click_selects_and_a_drag_does_not(rig) -> None:
    rig.click((320, 100))
    rig.drag((320, 100), (400, 160))
    rig.click((160, 300), keys=[KEY.mod_ctrl])
    assert rig.asked == [SelectAt(0.5, 0.25), SelectAt(0.25, 0.75, itself=True)]


@pytest.mark.parametrize("button, keys", [(2, ()), (0, (KEY.mod_alt,))])
def test_middle_drag_orbits_round_what_lies_under_the_cursor(rig, button, keys) -> None:
    rig.move(CENTRE)
    rig.frame()
    pivot = rig.under().position
    before = rig.state.camera
    rig.drag(CENTRE, (CENTRE[0] + 60, CENTRE[1] + 20), button=button, keys=keys)
    expected = camera_controls.orbit(before, 60 / SIZE[1], 20 / SIZE[1], pivot)
    assert rig.state.camera.position == pytest.approx(expected.position, rel=1e-3)
    assert rig.held_frames > 4
    assert rig.asked == []


def test_shift_middle_drag_keeps_the_point_under_the_cursor(rig) -> None:
    rig.move(CENTRE)
    rig.frame()
    point = rig.under().position
    rig.drag(CENTRE, (CENTRE[0] - 90, CENTRE[1] + 40), button=2, keys=[KEY.mod_shift])
    assert rig.at(point) == pytest.approx((CENTRE[0] - 90, CENTRE[1] + 40), abs=0.5)


def test_the_wheel_zooms_to_the_cursor(rig) -> None:
    rig.move(CENTRE)
    rig.frame()
    point, before = (
        np.array(rig.under().position),
        np.linalg.norm(np.subtract(rig.state.camera.position, rig.under().position)),
    )
    rig.wheel(CENTRE, 3.0)
    assert rig.at(point) == pytest.approx(CENTRE, abs=0.5)
    after = np.linalg.norm(point - rig.state.camera.position)
    assert after == pytest.approx(before * camera_controls.ZOOM_STEP**3, rel=1e-3)


def test_flying_needs_the_right_button(rig) -> None:
    before, forward = np.array(rig.state.camera.position), rig.state.view.forward
    rig.move(CENTRE)
    with rig.held([KEY.w]):
        rig.frame(3)
    assert rig.state.camera.position == tuple(before)
    rig.press(1)
    with rig.held([KEY.w]):
        rig.frame(5)
        slow = np.array(rig.state.camera.position)
        with rig.held([KEY.mod_shift]):
            rig.frame(5)
    rig.let_go(1)
    assert (slow - before) @ forward > 0.1
    assert (np.array(rig.state.camera.position) - slow) @ forward > 2.0 * (slow - before) @ forward
    still = rig.state.camera
    rig.frame(3)
    assert rig.state.camera == still


def test_an_axis_in_the_corner_turns_the_view(rig) -> None:
    rig.click("View from +X")
    assert rig.state.view.forward == pytest.approx([-1, 0, 0], abs=1e-9)
    rig.click("View from +Z")
    assert rig.state.view.forward[2] == pytest.approx(-1.0, abs=1e-3)
    assert rig.asked == []


def test_the_toolbar_sets_tools_and_switches(rig) -> None:
    for name, tool in (
        ("Move", "move"),
        ("Rotate", "rotate"),
        ("Scale", "scale"),
        ("Dispersion brush", "brush"),
        ("Pull a colour", "pull"),
        ("Select", "select"),
    ):
        rig.click(name)
        assert rig.state.tool == tool
    rig.click("Pause")
    assert not rig.state.playing
    rig.click("Play")
    rig.click("Physical picture")
    assert rig.state.playing and rig.state.physical


def looking_along_y(state: State, orthographic: bool) -> State:
    camera = replace(
        state.camera,
        position=(0.0, -8.0, 0.6),
        target=(0.0, 0.0, 0.6),
        kind="orthographic" if orthographic else "pinhole",
        vertical_extent=4.0,
    )
    return replace(state, camera=camera, tool="move")


@pytest.mark.parametrize("orthographic", [False, True], ids=["pinhole", "orthographic"])
def test_the_gizmo_moves_the_prism_with_the_mouse(gl, orthographic) -> None:
    with ViewportRig(gl, looking_along_y(scene_state(), orthographic)) as rig:
        before = rig.state.scene.objects[0].object_to_world
        x, y = rig.find("Gizmo").centre
        middle = rig.state.view.depth(_middle(rig.state, 0))
        rig.move((x + 35, y))
        rig.frame(2)
        rig.drag((x + 35, y), (x + 95, y), steps=5)
        moved = rig.state.scene.objects[0].object_to_world - before
        unit = rig.state.view.height_at(float(middle)) / SIZE[1]
        assert moved[:3, 3] == pytest.approx([60 * unit, 0, 0], abs=1.5 * unit)
        assert moved[:3, :3] == pytest.approx(0.0, abs=1e-12)
        assert set(rig.labels) == {"Move prism"}
        assert rig.held_frames >= 5
        assert rig.asked == []  # no click reached the picture


def test_the_gizmo_snaps_with_ctrl_and_scales_about_the_middle(gl) -> None:
    with ViewportRig(gl, looking_along_y(scene_state(), False)) as rig:
        x, y = rig.find("Gizmo").centre
        rig.move((x + 35, y))
        rig.frame(2)
        with rig.held([KEY.mod_ctrl]):
            rig.drag((x + 35, y), (x + 97, y), steps=5)
        moved = rig.state.scene.objects[0].object_to_world[0, 3] - scene_state().scene.objects[0].object_to_world[0, 3]
        assert moved > 0 and moved / 0.1 == pytest.approx(round(moved / 0.1), abs=1e-4)
        rig.state = replace(rig.state, tool="scale")
        middle = _middle(rig.state, 0)
        rig.move((x + 60, y))
        rig.frame(3)
        x, y = rig.find("Gizmo").centre
        rig.drag((x, y), (x + 60, y), steps=5)  # the middle scales evenly
        assert set(rig.labels) == {"Move prism", "Scale prism"}
        assert _middle(rig.state, 0) == pytest.approx(middle, abs=1e-6)
        factor = np.linalg.det(rig.state.scene.objects[0].object_to_world[:3, :3]) / np.linalg.det(
            scene_state().scene.objects[0].object_to_world[:3, :3]
        )
        assert factor > 1.2


def _middle(state: State, index: int) -> np.ndarray:
    return state.scene.objects[index].world_bounds.mean(axis=0)


def test_the_gizmo_moves_a_light_that_is_clicked(gl) -> None:
    state = looking_along_y(scene_state(), False)
    lamp = replace(state.scene.lights[0], position=(-1.5, 0.0, 1.0))
    state = replace(state, scene=replace(state.scene, lights=(lamp, *state.scene.lights[1:])))
    with ViewportRig(gl, state) as rig:
        rig.click(f"Light: {lamp.name}")
        assert rig.state.selection == Selection("light", 0)
        x, y = rig.find("Gizmo").centre
        rig.move((x, y - 35))
        rig.frame(2)
        rig.drag((x, y - 35), (x, y - 75), steps=5)
        unit = rig.state.view.height_at(8.0) / SIZE[1]
        assert np.subtract(rig.state.scene.lights[0].position, lamp.position) == pytest.approx(
            [0, 0, 40 * unit], abs=1.5 * unit
        )
        assert rig.labels[-1] == f"Move {lamp.name}"
        assert rig.state.scene.lights[0].direction == pytest.approx(lamp.direction)


def brushing(gl) -> ViewportRig:
    state = replace(scene_state(), tool="brush", physical=True, brush=Brush(radius=0.3, strength=1.0))
    return ViewportRig(gl, state)


def test_the_brush_paints_a_stroke_on_the_receiver(gl) -> None:
    with brushing(gl) as rig:
        floor = receiver_of(rig.state)
        rig.drag(CENTRE, (CENTRE[0] + 120, CENTRE[1]), steps=10)
        dabs = rig.state.scene.objects[floor].local_dispersion
        assert 3 < len(dabs) < 40
        assert all(dab.log2_gain > 0 for dab in dabs)
        assert rig.labels and set(rig.labels) == {"Brush dispersion"}
        assert not rig.state.physical  # what is painted is seen
        first = rig.at((rig.state.scene.objects[floor].object_to_world @ (*dabs[0].position, 1.0))[:3])
        assert first == pytest.approx(CENTRE, abs=3.0)
        count = len(dabs)
        rig.frame(3)
        assert len(rig.state.scene.objects[floor].local_dispersion) == count
        assert isinstance(rig.state.scene.objects[floor].material, Diffuse)


def test_the_brush_refuses_what_is_no_receiver(gl) -> None:
    with brushing(gl) as rig:
        item = rig.state.scene.objects[0]
        place = rig.at((item.mesh.vertices @ item.object_to_world[:3, :3].T + item.object_to_world[:3, 3]).mean(axis=0))
        rig.drag(place, (place[0] + 5, place[1]))
        assert rig.labels == []
        assert [type(request) for request in rig.asked] == [Notice]


def held_colour(rig: ViewportRig, local: bool = False) -> Pull:
    start = rig.state.view.on_plane(0.5, 0.7, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    return Pull(0, receiver_of(rig.state), tuple(start), tuple(start - [0.4, 0, 0]), (1.0, 0.0, 0.0), 450.0, 1.0, local)


@pytest.mark.parametrize("local", [False, True], ids=["glass", "local"])
def test_pulling_a_colour_moves_it_under_the_cursor(gl, local) -> None:
    with ViewportRig(gl, replace(scene_state(), tool="pull", brush=Brush(radius=0.3))) as rig:
        pull = held_colour(rig, local)
        place = rig.at(pull.start)
        with rig.held([KEY.mod_shift] if local else []):
            rig.move(place)
            rig.press()
            assert [type(r) for r in rig.asked] == [BeginPull]
            assert rig.asked[0].local is local
            rig.state = replace(rig.state, pull=pull)
            goal = np.array(pull.reference) + [1.0, 0.0, 0.0]
            rig.move(rig.at(goal))
            rig.frame(2)
        item = rig.state.scene.objects[pull.receiver_index]
        if local:
            from spectrasplat.model.local_dispersion import gain_at

            assert set(rig.labels) == {"Pull colour locally"}
            own = np.linalg.solve(item.object_to_world, np.append(pull.reference, 1.0))[:3]
            assert gain_at(item.local_dispersion, own[None])[0] == pytest.approx(2.5, rel=0.02)
        else:
            assert set(rig.labels) == {"Pull colour of prism"}
            assert rig.state.scene.objects[0].material.dispersion.gain == pytest.approx(2.5, rel=0.02)
        rig.let_go()
        assert rig.state.pull is None


def test_a_pull_that_came_too_late_is_dropped(gl) -> None:
    with ViewportRig(gl, replace(scene_state(), tool="pull")) as rig:
        rig.click(CENTRE)
        rig.state = replace(rig.state, pull=held_colour(rig))
        rig.frame()
        assert rig.state.pull is None
        assert rig.labels == []


def test_the_wipe_is_dragged_by_its_line(rig) -> None:
    rig.state = replace(rig.state, compare=replace(rig.state.compare, mode="wipe", wipe=0.5))
    rig.drag((320, 300), (448, 300))
    assert rig.state.compare.wipe == pytest.approx(0.7, abs=0.01)
    assert rig.asked == []
    rig.drag((200, 300), (260, 300))
    assert rig.state.compare.wipe == pytest.approx(0.7, abs=0.01)


def test_badges_say_what_the_picture_is_not(gl) -> None:
    with brushing(gl) as rig:
        assert "Not physical: local gain" not in rig.items.items
        rig.drag(CENTRE, (CENTRE[0] + 30, CENTRE[1]))
        assert rig.find("Not physical: local gain")
        rig.state = replace(rig.state, physical=True)
        rig.view_model = replace(rig.view_model, stats=LiveStats(first_order=True))
        rig.frame()
        assert "Not physical: local gain" not in rig.items.items
        assert rig.find("Physical: local gain left out") and rig.find("First order")


def test_rays_are_drawn_in_their_colour_and_behind_the_camera_not_at_all(rig) -> None:
    a, b = (rig.state.view.on_plane(x, 0.85, np.zeros(3), np.array([0.0, 0.0, 1.0])) for x in (0.3, 0.7))
    behind = np.asarray(rig.state.camera.position) - 3.0 * rig.state.view.forward
    rig.state = replace(rig.state, display=replace(rig.state.display, ray_overlay=True))
    rig.view_model = replace(
        rig.view_model,
        rays=(RayLine(650.0, np.stack([a, b])), RayLine(550.0, np.stack([behind, behind + [0.1, 0, 0]]))),
    )
    rig.move((5, 395))
    rig.frame()
    red, green, blue = rig.screenshot()[int(0.85 * SIZE[1]), SIZE[0] // 2].astype(int)
    assert red > 150 and green < 100 and blue < 100
    rig.view_model = replace(rig.view_model, rays=(RayLine(550.0, np.stack([b, behind])),))
    rig.frame()  # cut where it passes the camera
    assert (rig.screenshot()[..., 1].astype(int) - rig.screenshot()[..., 0] > 100).any()


def test_a_comparison_that_is_not_there_yet_is_told() -> None:
    state = replace(scene_state(), compare=Compare(mode="wipe"))
    told = [badge.text for badge in viewport_tools.badges(state, ViewModel())]
    assert "Nothing to compare with yet" in told
    told = [badge.text for badge in viewport_tools.badges(state, ViewModel(compare_ready=True))]
    assert "Nothing to compare with yet" not in told


def test_a_badge_says_that_picture_and_scene_differ() -> None:
    state = scene_state()
    for differs, text in (("scene", "Preparing …"), ("light", "Light is being traced …")):
        shown = ViewModel(stats=LiveStats(differs=differs), picture=1)
        assert text in [badge.text for badge in viewport_tools.badges(state, shown)]
        # Where no picture is, its place says so.
        assert not viewport_tools.badges(state, replace(shown, picture=None))
    assert not {"Preparing …", "Light is being traced …"} & {
        badge.text for badge in viewport_tools.badges(state, ViewModel(stats=LiveStats()))
    }
