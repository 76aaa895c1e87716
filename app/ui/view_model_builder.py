"""What the panels may know in a frame, gathered from the session."""

from __future__ import annotations

from ..base.memory import resident_bytes
from .session import Session
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
        beside=None if picture.beside is None else (picture.beside[0].glo, picture.beside[1].glo),
        picture_size=(0, 0) if shown is None else shown.size,
        frame_ms=tuple(session.frame_ms),
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
        recovery=None if session.recovery is None else session.recovery.path,
        recovery_title="" if session.recovery is None else session.recovery.note.title,
        recovery_time="" if session.recovery is None else session.recovery.written,
        asks_to_quit=session.asks_to_quit,
        asks_about_export=session.asks_about_export,
        reference_progress=comparison.progress,
        compare_text=comparison.text,
        compare_label=comparison.label,
        compared_rgb=None if session.state.hover is None else comparison.pixel(session.state.hover),
        histogram=comparison.histogram,
        compare_ready=comparison.picture is not None,
        compare_stale=comparison.is_stale,
        rays=session.jobs.overlay.rays,
        readings=session.jobs.overlay.readings,
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
        "splat": stats.splat_s,
        "camera": stats.camera_s,
        "display": session.picture.display_s,
        "interface": session.interface_s,
    }
    return {name: 1000.0 * value for name, value in seconds.items()}
