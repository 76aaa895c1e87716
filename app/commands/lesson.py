"""The lesson command: the lessons of the window, listed or opened."""

from __future__ import annotations

from collections.abc import Callable

from ..edit.lessons import lesson, lessons
from .view import ViewRequest, view_command


def lesson_command(name: str | None, show: Callable[[str], None]) -> int:
    """List the lessons with `show`, or open the one called `name`; returns the exit code. Raises `UserError`."""
    if name is None:
        show(lessons_text())
        return 0
    return view_command(ViewRequest(lesson=lesson(name)))


def lessons_text() -> str:
    """Names and titles, with how to open one."""
    width = max(len(each.name) for each in lessons())
    lines = [f"{each.name:<{width}}  {each.title}" for each in lessons()]
    return "\n".join([*lines, "", f"Open one: spectrasplat lesson {lessons()[0].name}"])
