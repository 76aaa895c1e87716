"""Ruler and protractor against known lengths and angles; lessons that can be opened."""

from __future__ import annotations

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.commands.lesson import lessons_text
from spectrasplat.edit import measuring
from spectrasplat.edit.lessons import lesson, lessons
from spectrasplat.edit.state import State
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Camera, Scene

EMPTY = Scene("none", Camera((0, -1, 0), (0, 0, 0)), (), ())


def test_three_points_give_two_lengths_and_the_angle_between() -> None:
    state = State(EMPTY, EMPTY.camera)
    for point in ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 2.0, 2.0)):
        state = measuring.with_point(state, point)
    assert measuring.lengths(state.measured) == pytest.approx([3.0, 8.0**0.5])
    assert measuring.angle_deg(state.measured) == pytest.approx(90.0)
    assert "90.00°" in measuring.words(state.measured)
    assert measuring.with_point(state, (1.0, 0.0, 0.0)).measured == ((1.0, 0.0, 0.0),)


def test_small_angles_are_exact() -> None:
    assert measuring.angle_deg(((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1e-7, 0.0))) == pytest.approx(
        5.7296e-6, rel=1e-4
    )
    assert measuring.angle_deg(((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))) is None


def test_there_are_six_lessons_each_with_a_scene_that_holds_what_it_is_about() -> None:
    assert len(lessons()) == 6
    for each in lessons():
        scene = load_scene(each.path)
        assert each.select in [item.name for item in scene.objects]
        assert len(each.steps) == 3 and 100 < len(each.words) < 400
        assert each.name in lessons_text() and each.title in lessons_text()


def test_an_unknown_lesson_is_refused_with_a_way_out() -> None:
    with pytest.raises(UserError, match="did you mean 'newton'"):
        lesson("newtn")
