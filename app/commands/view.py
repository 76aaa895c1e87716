"""The commands that open the window, `view` and `lesson`: no work is lost on the way out."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.interrupts import Interruption, interrupt_flag
from . import table
from .printing import show
from .scenes import find_scene
from .table import View

if TYPE_CHECKING:
    from ..edit.lessons import Lesson
    from ..edit.preferences import WindowPlace
    from ..ui.session import Session
    from ..ui.viewer import Viewer
    from ..ui.window import Window

DEFAULT_AFTER_S = 10.0
LONGEST_WAIT_S = 120.0
"""For the first picture."""
_ENGINE_WAIT_S = 5.0


def has_display() -> bool:
    """Whether a window can be expected to open here."""
    return sys.platform in ("win32", "darwin") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def view(options: View, at: Lesson | None = None) -> int:
    """Open the viewer, `at` a lesson, until it is closed; returns the exit code. Raises `UserError`."""
    if options.after is not None and options.screenshot is None:
        raise UserError("--after says when the --screenshot is taken: give that too")
    if options.screenshot is not None:
        _check_screenshot(options.screenshot)
    scene = None if options.scene is None else find_scene(options.scene)

    # What needs a display comes last, so that a wrong option is reported on any machine.
    from ..edit.preferences import load_settings
    from ..ui.window import Window

    settings, _ = load_settings()
    place = settings.window if options.size is None else replace(settings.window, size=options.size, maximised=False)
    with Window(place) as window, interrupt_flag() as interrupted:
        _run(window, scene, options, interrupted, at)
    return interrupted.exit_code


def lesson(options: table.Lesson) -> int:
    """List the lessons, or open the one that is named; returns the exit code. Raises `UserError`."""
    from ..edit import lessons

    if options.name is not None:
        return view(View(scene=None), lessons.lesson(options.name))
    known = lessons.lessons()
    width = max(len(each.name) for each in known)
    lines = [f"{each.name:<{width}}  {each.title}" for each in known]
    show("\n".join([*lines, "", f"Open one: spectrasplat lesson {known[0].name}"]))
    return 0


def _run(window: Window, scene: Path | None, options: View, interrupted: Interruption, at: Lesson | None) -> None:
    from ..ui import layout
    from ..ui.session import Session
    from ..ui.viewer import Viewer

    session = Session(window.context, scene, window.engine, opening=options.opening, open_thread=window.open_thread)
    if options.theme is not None:
        preferences = replace(session.state.preferences, theme=options.theme)
        session.state = replace(session.state, preferences=preferences)
    if at is not None:
        session.show_lesson(at)
    elif scene is None and options.screenshot is None:
        session.welcome()
    viewer = Viewer(session, refresh_s=window.refresh_s)
    session.input_waits = window.input_waits
    layout.load()
    try:
        if options.screenshot is None:
            window.run(viewer, until=interrupted)
        else:
            _take_screenshot(window, viewer, session, options.screenshot, options.after or DEFAULT_AFTER_S, interrupted)
    except Exception as error:
        raise _rescued(session, error) from error
    place = _place(window, session.settings.window)
    window.hide()
    if interrupted():
        # Nobody can be asked: what is unsaved stays and is offered at the next start.
        if session.document.unsaved:
            session.autosave.write_now(session.document.scene, session.document.title, session.document.source)
        session.jobs.finish_export()
        _tell(session.jobs.notes, session.release())
        return
    if options.screenshot is None:
        layout.save()
        session.settings = replace(session.settings, window=place)
        _tell((), session.close())
    else:
        session.autosave.close()
        session.release()


def _tell(notes: Iterable[tuple[str, bool]], unwritten: list[str]) -> None:
    """What became of exports after the window was closed. Raises `UserError` for what could not be written."""
    problems = [text for text, is_error in notes if is_error] + unwritten
    for text, is_error in notes:
        if not is_error:
            print(text)
    if problems:
        raise UserError("; ".join(problems))


def _take_screenshot(
    window: Window, viewer: Viewer, session: Session, path: Path, after_s: float, interrupted: Interruption
) -> None:
    """Let the picture gather light for `after_s` seconds, then write the window to `path`.

    They count from the first picture on: a driver may compile for longer than that. What has none is written as it is
    after `LONGEST_WAIT_S`.
    """
    from PIL import Image

    from ..base.atomic import atomic_output

    begun = time.monotonic()
    first: list[float] = []

    def is_due() -> bool:
        now, engine = time.monotonic(), session.picture.engine
        # The start page has no engine.
        waits_until = begun + (LONGEST_WAIT_S if engine is not None else _ENGINE_WAIT_S)
        if not first and ((engine is not None and engine.picture is not None) or now > waits_until):
            first.append(now)
        return interrupted() or (bool(first) and now >= first[0] + after_s)

    window.run(viewer, until=is_due)
    if interrupted():
        return
    with atomic_output(path) as temporary:
        Image.fromarray(window.screenshot()).save(temporary)
    print(path.resolve())


def _rescued(session: Session, error: Exception) -> UserError:
    """The window cannot go on: keep the work, and say where."""
    session.save_from_crash("drawing the interface", error)
    kept = " Your work is kept and offered at the next start." if session.document.unsaved else ""
    what = " ".join(str(error).split()) or type(error).__name__
    from ..edit.preferences import config_dir

    return UserError(
        f"the window had to close ({type(error).__name__}: {what[:200]}).{kept} Details are in "
        f"{config_dir() / 'crash.log'}"
    )


def _place(window: Window, before: WindowPlace) -> WindowPlace:
    """Where the window is; a maximised one remembers the size it had before."""
    place = window.place
    return replace(before, maximised=True) if place.maximised else place


def _check_screenshot(path: Path) -> None:
    from ..base.atomic import check_writable

    if path.suffix.lower() != ".png":
        raise UserError(f"--screenshot {path} must end in .png; 'spectrasplat render' writes .exr")
    check_writable(path)
