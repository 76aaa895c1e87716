"""A lesson opened from menu and start page, its rays labelled and read, and the ruler on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.edit import measuring, requests
from spectrasplat.edit.lessons import lesson
from spectrasplat.edit.state import Selection, State
from spectrasplat.gpu.context import Context
from spectrasplat.ui.frame import run_frame, view_model_of
from spectrasplat.ui.ray_overlay import RayOverlay
from spectrasplat.ui.session import Session
from spectrasplat.ui.viewport import labelled

from tests.interface.fake_engine import FakeEngine
from tests.interface.shell_rig import ShellRig


def lesson_state(gl: Context, name: str) -> State:
    """What a session shows of a lesson."""
    session = Session(gl, make_engine=FakeEngine)
    session.show_lesson(lesson(name))
    state = session.state
    session.autosave.close()
    session.release()
    return state


def test_lessons_open_from_the_menu_and_the_start_page(gl: Context) -> None:
    with ShellRig(gl) as rig:
        rig.menu("Help", "Lessons", "Lesson: fire")
        assert rig.asked[-1] == requests.OpenLesson("fire")
        rig.open_panel(start_page=True)
        rig.click("Lesson: rainbow_drop")
        rig.frame(2)
        assert rig.asked[-1] == requests.OpenLesson("rainbow_drop")


def test_a_lesson_selects_what_it_is_about_and_says_the_next(gl: Context) -> None:
    session = Session(gl, make_engine=FakeEngine)
    panels = session.state.preferences.panels
    session.show_lesson(lesson("minimum_deviation"))
    state = session.state
    assert state.selection == Selection("object", 0) and state.display.ray_overlay and state.preferences.panels.lesson
    assert session.document.path is None  # Save does not write to the program's own folder
    # What was opened, chosen and set for it goes with it.
    session.state = replace(session.state, tool="measure").with_panels(abbe=True)
    session.state = session.state.with_display(auto_exposure=False, exposure_ev=5.0, ray_reflections=2)
    session.show_document(session.document)
    left, kept = session.state, State(session.state.scene, session.state.camera)
    assert (left.lesson, left.tool, left.display) == ("", kept.tool, kept.display)
    assert left.preferences.panels == panels
    session.autosave.close()
    session.release()
    with ShellRig(gl, state) as rig:
        rig.open_panel(lesson=True)
        rig.view_model = replace(rig.view_model, unsaved=True)  # what was tried out in a lesson is nobody's work
        rig.click("Next: The rainbow drop")
        rig.frame(2)
        assert rig.asked[-1] == requests.OpenLesson("rainbow_drop")


def test_nobody_is_asked_for_glass_where_a_grating_parts_the_light(gl: Context) -> None:
    with ShellRig(gl, lesson_state(gl, "spectrometer")) as rig:
        assert "Window: opened" not in rig.items.items


def test_no_other_scenes_picture_lies_below_a_lesson_that_is_being_prepared(gl: Context) -> None:
    """Its rays and outlines lay on what was there before, for as long as the scene took to be prepared."""
    session = Session(gl, make_engine=FakeEngine)
    session.state = replace(session.state, viewport_size=(64, 36)).with_panels(start_page=False)
    run = lambda: (session.prepare(), run_frame(session, lambda state, _: state))  # noqa: E731
    for _ in range(6):
        run()
    assert view_model_of(session).picture is not None
    engine = session.picture.engine
    session.show_lesson(lesson("achromat"))
    engine.stats = replace(engine.stats, shows_other=True)
    for _ in range(3):
        run()
        assert view_model_of(session).picture is None
    engine.stats = replace(engine.stats, shows_other=False)
    run()
    assert view_model_of(session).picture is not None
    # An edit of the scene that is shown keeps its picture while light is traced.
    engine.stats = replace(engine.stats, shows_other=True)
    run()
    assert view_model_of(session).picture is not None
    session.autosave.close()
    session.release()


def test_the_ruler_takes_hold_of_rays_and_measures_the_deviation(gl: Context) -> None:
    state = lesson_state(gl, "minimum_deviation").with_display(ray_count=1, ray_wavelengths=1)
    overlay = RayOverlay(gl)
    overlay.update(state)
    rays, readings = overlay.rays, overlay.readings
    overlay.release()
    with ShellRig(gl, state) as rig:
        rig.view_model = replace(rig.view_model, picture=None, rays=rays, readings=readings)
        rig.key(imgui.Key.k)
        rig.frame(2)
        assert rig.state.tool == "measure"
        picture = rig.find("Picture")
        view = rig.state.view
        start, entry, out, _ = rays[0].points
        for point in (0.3 * start + 0.7 * entry, entry, out):
            (x, y), _ = view.project(point)
            rig.click(picture.at(float(x), float(y)))
        # At minimum deviation each face turns the ray by half of it.
        assert measuring.angle_deg(rig.state.measured) == pytest.approx(
            180.0 - 0.5 * readings[0].deviation_deg, abs=0.3
        )
        assert rig.find("Measured")


@pytest.mark.parametrize(("reflections", "radius_deg"), [(1, (40.567, 42.019, 42.440)), (2, (53.620, 50.996, 50.238))])
def test_rays_that_make_the_rainbows_crowd_where_descartes_says(
    gl: Context, reflections: int, radius_deg: tuple
) -> None:
    """Radii of the bows at 400 nm, the d line and 700 nm: cos² i = (n² − 1)/(k (k + 2)) for k reflections."""
    state = lesson_state(gl, "rainbow_drop").with_display(ray_reflections=reflections, ray_wavelengths=1)
    overlay = RayOverlay(gl)
    for nm, radius in zip((400.0, 587.5618, 700.0), radius_deg, strict=True):
        overlay.update(replace(state, solo_nm=nm))
        turn = overlay.readings[0].deviation_deg
        assert abs(turn - 180.0) == pytest.approx(radius, abs=0.02)
        start, *_, wall = overlay.rays[-1].points  # which is shown
        assert len(overlay.rays[-1].points) == reflections + 4
        # The closed form of `rainbow_drop.toml` for a wall that is near: L tan a ± b / cos a.
        beside = np.hypot(*start[1:])
        sign = 1.0 if reflections == 1 else -1.0
        place = 2.0 * np.tan(np.radians(radius)) + sign * beside / np.cos(np.radians(radius))
        assert np.hypot(*wall[1:]) == pytest.approx(place, rel=2e-3)
    overlay.release()


def test_few_of_many_wavelengths_are_labelled() -> None:
    assert labelled(3) == [0, 1, 2] and labelled(9) == [0, 4, 8]
    assert np.ptp(labelled(31)) == 30
