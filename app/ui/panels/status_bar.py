"""The line at the bottom: what runs, how far it is, what is selected, and the export in progress."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui

from ...edit.requests import CancelJob
from ...edit.state import State
from ...render.viewer.stats import LiveStats
from .. import item_rects, layout, theme
from ..view_model import ViewModel
from . import numbers, rows, widgets

_RATES_EM = 14.0
"""For rate and frame time at the right end."""
SAYS_WHY_S = 3.0
"""Who waits longer wants to know for what."""


def height() -> float:
    """Height of the bar, interface pixels."""
    return imgui.get_frame_height() + theme.em(0.3)


def draw_status_bar(state: State, view_model: ViewModel) -> State:
    """Draw the bar along the lower edge of the window."""
    viewport = imgui.get_main_viewport()
    low = imgui.ImVec2(viewport.work_pos.x, viewport.work_pos.y + viewport.work_size.y - height())
    size, padding = imgui.ImVec2(viewport.work_size.x, height()), imgui.ImVec2(theme.em(0.5), theme.em(0.15))
    imgui.push_style_color(imgui.Col_.window_bg, theme.palette().raised)
    layout.begin_area("##status", low, size, padding, imgui.WindowFlags_.no_nav)
    imgui.align_text_to_frame_padding()
    state = _progress(state, view_model)
    _selection(state)
    if view_model.job is not None:
        state = _job(state, view_model)
    elif view_model.writing:
        imgui.same_line(0, theme.em(1.6))
        imgui.text_disabled(view_model.writing)
    _right_end(view_model)
    imgui.end()
    imgui.pop_style_color()
    return state


def _progress(state: State, view_model: ViewModel) -> State:
    stats, target = view_model.stats, max(state.preferences.target_photons, 1)
    imgui.push_style_color(imgui.Col_.button, (0.0, 0.0, 0.0, 0.0))
    pressed = imgui.button((icons.ICON_FA_PAUSE if state.playing else icons.ICON_FA_PLAY) + "##play")
    imgui.pop_style_color()
    rows.explain("Play or pause", "Pause the photons (Space)." if state.playing else "Let photons accumulate (Space).")
    if pressed:
        state = replace(state, playing=not state.playing)
    imgui.same_line()
    share = min(stats.photons / target, 1.0)
    imgui.push_style_color(
        imgui.Col_.plot_histogram, theme.palette().good if stats.converged else theme.palette().accent
    )
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() + theme.em(0.55))
    imgui.progress_bar(share, imgui.ImVec2(theme.em(7), theme.em(0.4)), "")
    imgui.pop_style_color()
    said = "beams, as fine as that many photons" if stats.only_beams else "photons"
    rows.explain("Progress", f"{stats.photons:,} of {target:,} {said}." if stats.photons else "No light yet.")
    imgui.same_line()
    imgui.text_unformatted(progress_words(stats, state.playing, view_model.engine_rests))
    return state


def progress_words(stats: LiveStats, is_playing: bool, rests: bool = False) -> str:
    """What is done, and how far it is: by polygons, by photons, or where nothing makes a caustic by camera samples.
    `rests`: an export has all the time."""
    if stats.differs == "scene" or stats.preparing:
        return preparing_words(stats)
    if not (stats.photons or stats.polygons or stats.camera_samples or stats.converged):
        return "Preparing …" if is_playing else "Paused"  # nothing is there to be counted
    word = "Done" if stats.converged else ("Waiting" if rests else "Accumulating") if is_playing else "Paused"
    if stats.only_beams:
        return f"{word}, {numbers.count(stats.polygons)} polygons"
    if stats.photons:
        return f"{word}, {numbers.count(stats.photons)} photons"
    if not stats.camera_samples:
        return word
    samples = round(stats.camera_samples)
    return f"{word}, {numbers.count(samples)} {'sample' if samples == 1 else 'samples'} a pixel, no caustics"


def preparing_words(stats: LiveStats) -> str:
    """That the scene is prepared; after a while also what that is at and how long it has taken so far."""
    if not stats.preparing or stats.preparing_s < SAYS_WHY_S:
        return "Preparing …"
    return f"Preparing: {stats.preparing} ({stats.preparing_s:.0f} s so far)"


def _selection(state: State) -> None:
    kind, index = state.selection.kind, state.selection.index
    found = state.scene.objects if kind == "object" else state.scene.lights if kind == "light" else ()
    if index < len(found):
        imgui.same_line(0, theme.em(1.6))
        imgui.text_disabled("Selected")
        imgui.same_line()
        imgui.text_unformatted(found[index].name)
        item_rects.note("Selected")


def _job(state: State, view_model: ViewModel) -> State:
    job = view_model.job
    if job is None:
        return state
    imgui.same_line(0, theme.em(1.6))
    imgui.text_unformatted(job.title)
    imgui.same_line()
    imgui.progress_bar(job.fraction, imgui.ImVec2(theme.em(9), 0.0), f"{job.fraction:.0%}")
    widgets.tooltip(job.text or job.title)
    imgui.same_line()
    label, tip = ("Discard", "Write nothing at all.") if job.is_stopped else ("Cancel", f"Stop; {job.when_stopped}.")
    if widgets.button(f"{label}##job", tip=tip):
        state = state.asking(CancelJob())
    # After the button, which would else move with the words.
    room = imgui.get_window_pos().x + imgui.get_window_width() - imgui.get_item_rect_max().x
    if job.text and room > imgui.calc_text_size(job.text).x + theme.em(_RATES_EM):
        imgui.same_line()
        imgui.text_disabled(job.text)
    return state


def _right_end(view_model: ViewModel) -> None:
    """Rate and frame time, flush with the window's edge, where there is room."""
    recent = view_model.frame_ms[-10:]
    parts = []
    if view_model.stats.photons_per_second > 0 and not view_model.stats.only_beams:
        parts.append(f"{numbers.count(view_model.stats.photons_per_second)} photons/s")
    if recent:
        parts.append(f"{numbers.milliseconds(sum(recent) / len(recent))} a frame")
    text = "    ".join(parts)
    x = imgui.get_window_width() - imgui.calc_text_size(text).x - theme.em(0.6)
    imgui.same_line()
    if text and x > imgui.get_cursor_pos_x() + theme.em(1):
        imgui.set_cursor_pos_x(x)
        imgui.text_disabled(text)
        rows.explain("Rate", "Photons per second of trace and splat time; mean duration of the last ten frames.")
    else:
        imgui.new_line()
