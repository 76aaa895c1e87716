"""Undo and redo: every edit once, a drag as one step, and whether anything is unsaved."""

from __future__ import annotations

from dataclasses import replace

import pytest
from spectrasplat.edit.history import MAX_STEPS, History
from spectrasplat.model.geometry import primitives
from spectrasplat.model.scene import Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.scene_defaults import default_light

START = Scene(
    "s", Camera((0, -3, 1), (0, 0, 0)), (default_light(),), (SceneObject("floor", primitives.plane(), Diffuse()),)
)


def scene(grey: float) -> Scene:
    return replace(START, background_rgb=(grey, grey, grey))


def labels(history: History) -> list[str]:
    return [entry.label for entry in history.entries]


def test_undo_and_redo_walk_the_steps_and_say_their_names() -> None:
    history = History(START)
    a, b = scene(0.1), scene(0.2)
    history.push("Move prism", a)
    history.push("Rename prism", b)
    assert (history.undo_label, history.redo_label) == ("Rename prism", None)
    assert history.undo() is a and history.redo_label == "Rename prism"
    assert history.undo() is START and history.undo_label is None
    assert history.undo() is START
    assert history.redo() is a and history.redo() is b and history.redo() is b
    assert [entry.is_present for entry in history.entries] == [False, False, True]


def test_an_edit_after_undo_forgets_what_was_undone() -> None:
    history = History(START)
    history.push("A", scene(0.1))
    history.push("B", scene(0.2))
    history.undo()
    history.push("C", scene(0.3))
    assert labels(history) == ["Open", "A", "C"] and history.redo_label is None


def test_a_drag_is_one_step_and_two_drags_are_two() -> None:
    history = History(START)
    for grey in (0.1, 0.2, 0.3):
        history.push("Move prism", scene(grey), merge=True)
    assert labels(history) == ["Open", "Move prism"]
    history.settle()
    second = scene(0.5)
    history.push("Move prism", scene(0.4), merge=True)
    history.push("Move prism", second, merge=True)
    history.push("Turn prism", scene(0.6), merge=True)
    assert labels(history) == ["Open", "Move prism", "Move prism", "Turn prism"]
    assert history.undo() is second
    history.push("Move prism", scene(0.7), merge=True)  # after undo, a new drag is a new step
    assert labels(history) == ["Open", "Move prism", "Move prism", "Move prism"]


def test_edits_without_drag_never_merge_and_the_same_scene_is_no_step() -> None:
    history = History(START)
    history.push("A", scene(0.1))
    history.push("A", scene(0.2))
    history.push("A", history.present)
    assert labels(history) == ["Open", "A", "A"]


def test_go_to_any_entry_and_no_other() -> None:
    history = History(START)
    scenes = [scene(i / 10) for i in range(5)]
    for i, each in enumerate(scenes):
        history.push(str(i), each)
    assert history.go_to(2) is scenes[1] and history.redo_label == "2"
    assert history.go_to(5) is scenes[4]
    with pytest.raises(IndexError):
        history.go_to(6)
    with pytest.raises(IndexError):
        history.go_to(-1)


def test_unsaved_follows_the_saved_step() -> None:
    history = History(START)
    assert not history.unsaved
    history.push("A", scene(0.1), merge=True)
    assert history.unsaved
    history.mark_saved()
    history.push("A", scene(0.2), merge=True)  # saving ended the drag: the saved step is still there
    assert history.unsaved
    history.undo()
    assert not history.unsaved
    history.undo()
    assert history.unsaved
    history.mark_unsaved()
    history.redo()
    assert history.unsaved


def test_the_oldest_steps_go_when_there_are_too_many() -> None:
    history = History(START)
    for i in range(MAX_STEPS + 20):
        history.push(str(i), scene(i / 1000))
    assert len(history.entries) == MAX_STEPS + 1 and history.entries[-1].is_present
    for _ in range(MAX_STEPS + 5):
        history.undo()
    assert history.entries[0].label == "19" and history.undo_label is None and history.unsaved
