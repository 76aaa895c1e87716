"""One frame of the interface: panels, edits, requests, then the engine's work.

`run_frame` shows the panels what there is (`ViewModel`), takes the state they return, records what they
edited, carries their requests out and lets the engine work on it, so that the picture drawn in a
frame already shows the input of that frame. No window is needed; `window` and `headless` show it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from ..base.errors import UserError
from ..base.memory import resident_bytes
from ..edit import brush as brushes
from ..edit import requests
from ..edit.projection import View
from ..edit.state import State
from . import session_requests
from .live_picture import EngineError
from .message_box import brief, sentence, words
from .panels import dialogs
from .session import LAYOUT_FRAMES, Session
from .view_model import ViewModel


def view_model_of(session: Session) -> ViewModel:
    """The view model of the frame that begins."""
    picture, document = session.picture, session.document
    shown = picture.shown
    stats, comparison = picture.stats, session.jobs.comparison
    return ViewModel(
        stats=stats,
        shown=picture.seen,
        picture=None if shown is None or picture.awaits_scene else shown.glo,
        frame_ms=tuple(session.frame_ms),
        wanted_hz=session.wanted_hz,
        pass_ms=_pass_ms(session),
        process_bytes=resident_bytes() if session.state.preferences.panels.timing else 0,
        cursor=session.jobs.cursor.view_model,
        title=document.title,
        path=document.path,
        unsaved=document.unsaved,
        up=document.up,
        undo=document.history.undo_label,
        redo=document.history.redo_label,
        history=document.history.entries,
        recent=session.settings.existing_recent(),
        scenes=session.jobs.gallery.entries,
        messages=session.messages.messages(),
        shader_error=picture.shader_error,
        recovery=session.recovery,
        asks_to_quit=session.asks_to_quit,
        asks_about_export=session.asks_about_export,
        reference_progress=comparison.progress,
        compare_text=comparison.text,
        compare_label=comparison.label,
        compared_rgb=None if session.state.hover is None else comparison.pixel(session.state.hover),
        compare_ready=comparison.picture is not None,
        compare_stale=comparison.is_stale,
        rays=session.jobs.overlay.rays,
        readings=session.jobs.overlay.readings,
        found=session.jobs.exports.found.entries(),
        job=session.jobs.exports.job,
        engine_rests=session.jobs.engine_rests and session.jobs.exports.job is not None,
        writing=session.jobs.exports.writing,
        exposure_ev=picture.exposure_ev,
        delta_s=session.delta_s,
        framebuffer_scale=session.framebuffer_scale,
        interface_scale=session.interface_scale,
    )


def _pass_ms(session: Session) -> dict[str, float]:
    stats = session.picture.stats
    seconds = {
        "trace": stats.trace_s,
        "splats": stats.splat_s,
        "resolve": stats.resolve_s,
        "camera": stats.camera_s,
        "display": session.picture.display_s,
        "interface": session.interface_s,
    }
    return {name: 1000.0 * value for name, value in seconds.items() if name != "resolve" or not stats.is_software}


Draw = Callable[[State, ViewModel], State]
DEFAULT_BUDGET_S = 0.03
_MINOR = (requests.Notice, requests.DismissMessage, requests.SelectAt, requests.FrameSelection, requests.CancelQuit)
"""Requests after which errors stay on the screen."""


def run_frame(session: Session, draw: Draw, budget_s: float = DEFAULT_BUDGET_S, slice_s: float = math.inf) -> None:
    """Draw the interface with `draw`, within imgui's frame, and carry out what it asks; the engine works for about
    `budget_s`, but hardly longer than `slice_s` once there is input or another picture."""
    view_model = view_model_of(session)
    before = replace(session.state, interacting=False, hover=None, requests=())
    started = session.clock()
    after = _with_dropped(session, draw(before, view_model), view_model)
    session.interface_s = session.clock() - started
    _accept(session, before, after)
    for kind in tuple(session.awaited):
        _carry_out(session, kind, partial(session_requests.ask_again, session, kind))
    for request in after.requests:
        _carry_out(session, type(request), partial(session_requests.carry_out, session, request))
    if session.state.camera is not before.camera:
        views = (View.of(camera, 1.0) for camera in (before.camera, session.state.camera))
        session.state = replace(session.state, brush=brushes.followed(session.state.brush, *views))
    session.autosave.update(
        session.document.scene, session.document.title, session.document.source, session.document.unsaved
    )
    _report_once(session, "autosave", session.autosave.problem)
    _work(session, budget_s, slice_s)
    session.was_interacting = session.state.interacting


def _accept(session: Session, before: State, after: State) -> None:
    """Take over what the panels returned; an edited scene is a step of undo."""
    if after.also and (after.selection != before.selection or len(after.scene.objects) != len(before.scene.objects)):
        # Who selects something else means that alone, unless the rest was chosen with it.
        after = replace(after, also=() if after.also == before.also else after.also)
    session.state = replace(after, requests=())
    if after.scene is not before.scene:
        session.document.history.push(
            after.edit_label or "Edit", after.scene, merge=after.interacting or session.was_interacting
        )
        _succeeded(session)
    if not after.interacting:
        session.document.history.settle()
    if after.preferences != session.settings.preferences:
        session.settings = replace(session.settings, preferences=after.preferences)


def _carry_out(session: Session, kind: type, work: Callable[[], None]) -> None:
    """Do the work of a request of that kind; whatever fails becomes a sentence."""
    try:
        work()
        if not issubclass(kind, _MINOR) and kind not in session.awaited:
            _succeeded(session)
    except UserError as error:
        session.messages.show(sentence(str(error)), is_error=True)
    except Exception as error:  # noqa: BLE001 - a bug: the work and the window outlive it
        session.save_from_crash(kind.__name__, error)
        session.messages.show(
            f"{words(kind)} failed by a fault of the program ({brief(error)}); your work is kept.", is_error=True
        )


def _report_once(session: Session, of: str, problem: str | None) -> None:
    """Show the problem of the autosave or of the picture, when it begins."""
    if problem is not None and problem != session.reported.get(of):
        session.messages.show(sentence(problem), is_error=True)
    session.reported[of] = problem


def _succeeded(session: Session) -> None:
    if session.picture.engine is not None:
        session.messages.succeed()


def _work(session: Session, budget_s: float, slice_s: float) -> None:
    """Let the engine work and show its picture."""
    session.engine_s = session.jobs_s = 0.0
    if session.state.preferences.panels.start_page:  # which covers the picture, and behind which there is no layout yet
        session.frames = -LAYOUT_FRAMES  # it is made from nothing: its tabs take twice as long to find their widths
        _work_beside(session, budget_s, only_exports=True)
        return
    session.frames += 1
    if session.frames <= LAYOUT_FRAMES:
        return
    left = _work_beside(session, budget_s)
    started = session.clock()
    drawn = session.drawn.of(session.state)
    try:
        session.picture.advance(drawn, left, slice_s, session.input_waits)
    except EngineError as error:
        session.renderer_stopped(error)
        return
    finally:
        session.engine_s = session.clock() - started
    _report_once(session, "picture", None if session.picture.shader_error else session.picture.problem)
    now = session.clock()
    try:
        session.picture.show(session.state, now, session.delta_s, session.jobs.comparison)
        session.jobs.follow(session.state, drawn, session.picture, now)
        session.show_losses()
    except UserError as error:
        session.messages.show(sentence(str(error)), is_error=True)
    except Exception as error:  # noqa: BLE001 - a bug, or the device is lost
        session.picture.give_up()
        session.renderer_stopped(error)


def _work_beside(session: Session, budget_s: float, only_exports: bool = False) -> float:
    """Exports and comparison; returns the time that is left."""
    started = session.clock()
    try:
        if only_exports:
            session.jobs.export_on(budget_s)
            return budget_s
        return session.jobs.work(session.drawn.of(session.state), session.picture, budget_s)
    except Exception as error:  # noqa: BLE001 - a bug in a side line must not stop the picture
        session.jobs.exports.cancel()
        session.save_from_crash("exporting or comparing", error)
        session.messages.show(
            f"Comparing or exporting failed by a fault of the program ({brief(error)}).", is_error=True
        )
        session.state = replace(session.state, compare=replace(session.state.compare, mode="off"))
        return budget_s
    finally:
        session.jobs_s = session.clock() - started
        for text, is_error in session.jobs.notes:
            session.quits_after_export &= not is_error
            session.messages.show(sentence(text), is_error)
        session.jobs.notes.clear()


def _with_dropped(session: Session, state: State, view_model: ViewModel) -> State:
    if not session.dropped:
        return state
    path, session.dropped = session.dropped[0], []
    return dialogs.open_path(state, view_model, path)
