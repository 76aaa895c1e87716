"""The lesson that is open: what it shows, what to try, and the way to the next."""

from __future__ import annotations

from imgui_bundle import imgui

from ...edit.lessons import Lesson, lessons
from ...edit.requests import OpenLesson
from ...edit.state import State
from .. import item_rects, theme
from ..view_model import ViewModel
from . import dialogs, widgets


def draw_lesson(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    index = next((i for i, each in enumerate(lessons()) if each.name == state.lesson), None)
    if index is None:
        widgets.hint("Choose a lesson:")
        return draw_lesson_items(state, view_model)
    lesson = lessons()[index]
    imgui.begin_child("##words", imgui.ImVec2(0, -imgui.get_frame_height_with_spacing()))
    with theme.heading():
        imgui.text_wrapped(lesson.title)
    imgui.text_wrapped(lesson.words)
    for number, step in enumerate(lesson.steps, 1):
        imgui.dummy(imgui.ImVec2(0, theme.em(0.15)))
        widgets.hint(f"{number}. {step}")
    imgui.end_child()
    following = lessons()[(index + 1) % len(lessons())]
    words = f"Next: {following.title}"
    if imgui.calc_text_size(words).x > imgui.get_content_region_avail().x - theme.em(0.8):
        words = "Next"
    if widgets.button(f"{words}###next lesson", tip=f"Open the next lesson: {following.title}.", width=-1):
        state = _open(state, view_model, following)
    return state


def draw_lesson_items(state: State, view_model: ViewModel) -> State:
    """A line to click for each lesson."""
    for lesson in lessons():
        pressed, _ = imgui.selectable(f"{lesson.title}##{lesson.name}", lesson.name == state.lesson)
        item_rects.note(f"Lesson: {lesson.name}")
        widgets.tooltip(lesson.words)
        if pressed:
            state = _open(state, view_model, lesson)
    return state


def _open(state: State, view_model: ViewModel, lesson: Lesson) -> State:
    """A lesson that was tried out is nobody's work: the next one comes without a question."""
    if state.lesson:
        return state.asking(OpenLesson(lesson.name)).with_panels(start_page=False)
    return dialogs.unless_unsaved(state, view_model, OpenLesson(lesson.name))
