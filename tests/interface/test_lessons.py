"""A lesson opened from menu and start page, its rays labelled and read, and the ruler on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from spectrasplat.edit import measuring, requests
from spectrasplat.edit.lessons import lesson
from spectrasplat.edit.projection import View
from spectrasplat.edit.state import Selection
from spectrasplat.gpu.context import Context
from spectrasplat.ui.ray_labels import labelled
from spectrasplat.ui.ray_overlay import RayOverlay
from spectrasplat.ui.session import Session

from tests.interface.fake_engine import FakeEngine
from tests.interface.shell_rig import ShellRig


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
    session.show_lesson(lesson("minimum_deviation"))
    state = session.state
    assert state.selection == Selection("object", 0) and state.display.ray_overlay and state.preferences.panels.lesson
    assert session.document.path is None  # Save does not write to the program's own folder
    session.show_document(session.document)
    assert session.state.lesson == ""
    session.autosave.close()
    session.release()
    with ShellRig(gl, state) as rig:
        rig.open_panel(lesson=True)
        rig.click("Next: The rainbow drop")
        rig.frame(2)
        assert rig.asked[-1] == requests.OpenLesson("rainbow_drop")


def test_the_ruler_takes_hold_of_rays_and_measures_the_deviation(gl: Context) -> None:
    session = Session(gl, make_engine=FakeEngine)
    session.show_lesson(lesson("minimum_deviation"))
    state = replace(session.state, display=replace(session.state.display, ray_count=1, ray_wavelengths=1))
    session.autosave.close()
    session.release()
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
        view = View.of(rig.state.camera, picture.size[0] / picture.size[1])
        start, entry, out, _ = rays[0].points
        for point in (0.3 * start + 0.7 * entry, entry, out):
            (x, y), _ = view.project(point)
            rig.click(picture.at(float(x), float(y)))
        # At minimum deviation each face turns the ray by half of it.
        assert measuring.angle_deg(rig.state.measured) == pytest.approx(
            180.0 - 0.5 * readings[0].deviation_deg, abs=0.3
        )
        assert rig.find("Measured")


def test_few_of_many_wavelengths_are_labelled() -> None:
    assert labelled(3) == [0, 1, 2] and labelled(9) == [0, 4, 8]
    assert np.ptp(labelled(31)) == 30
