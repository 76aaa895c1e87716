"""What a frame costs and what the photons are doing: times by pass, rates, memory, everything that was dropped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from imgui_bundle import imgui, implot

from ...edit.requests import Retrace
from ...edit.state import State
from ...render.viewer.stats import LiveStats
from .. import theme
from ..view_model import ViewModel
from . import numbers, rows, widgets

PASSES = {
    "trace": "Photons through the glass, to the receivers.",
    "splats": "Photons into the caustic maps.",
    "resolve": "Caustic maps summed up for the camera.",
    "camera": "Camera samples: what the picture shows, through glass and mirrors.",
    "display": "Exposure, tone curve and comparison.",
    "interface": "Panels and plots.",
}
"""Pass -> what it does."""


_COUNTERS = {
    "deposited": ("In the caustic", "Reached a receiver through glass or by a mirror, and is in the caustic maps."),
    "direct": ("Direct light", "Reached a receiver straight from the light; the picture adds it by itself."),
    "absorbed": ("Absorbed", "Ended in coloured glass, a mirror or a black surface."),
    "escaped": ("Left the scene", "Met nothing any more."),
    "lost_depth": ("Path too long", "Given up after the scene's largest number of refractions and reflections."),
    "lost_numeric": ("Not a number", "Lost to arithmetic; anything but zero here is a fault."),
    "beams": ("Left to beams", "Met flat facets first, whose light is followed as beams instead of photons."),
    "footprint_dropped": (
        "Footprint dropped",
        "The derivatives of the path overflowed: the photon keeps its light and becomes a point.",
    ),
    "shading_normal": (
        "Flat normal used",
        "The smooth normal would have sent light to the wrong side: the facet's own was taken.",
    ),
    "band_cut": (
        "Spectrum split",
        "Part of a photon's spectrum is totally reflected: the photon was split in two there.",
    ),
    "columns_dropped": ("Derivatives dropped", "They overflowed on a camera ray's path: it continues as a single ray."),
    "depth_reached": ("Path too long", "Camera rays caught inside glass: what is left of them sees the environment."),
    "stack_full": (
        "No room to split",
        "Glass split a camera ray more often than there is room for: one part was chosen by chance.",
    ),
    "band_uncut": (
        "Spectrum not split",
        "Part of a camera ray's band is totally reflected, but too near its end or too far for its place to be found.",
    ),
    "loops_ended": ("Path cut short", "Loops ended before the camera's rays did; anything but zero here is a fault."),
    "queue_overflow": ("Queue full", "Photons that found no room among those in flight."),
}
"""What the engine counts -> its name on the screen, and what it means."""


def draw_timing(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    state = _first_order(state, view_model.stats)
    is_wide = imgui.get_content_region_avail().x > theme.em(34)
    height = max(imgui.get_content_region_avail().y, theme.em(7)) if is_wide else theme.em(7)
    if imgui.begin_table("##columns", 3 if is_wide else 1, imgui.TableFlags_.sizing_stretch_same):
        imgui.table_next_column()
        _frame_plot(state, view_model, height)
        imgui.table_next_column()
        _passes(view_model)
        imgui.table_next_column()
        _numbers(state, view_model)
        imgui.end_table()
    return state


def _first_order(state: State, stats: LiveStats) -> State:
    if not stats.first_order:
        return state
    imgui.align_text_to_frame_padding()
    with theme.coloured(theme.palette().warning):
        imgui.text_unformatted("The picture follows the dispersion edit to first order.")
    widgets.tooltip("The stored photons were traced with another dispersion and moved along their spectral derivative.")
    imgui.same_line()
    if widgets.button("Retrace", tip="Trace photons anew with the present glass (Ctrl+R)."):
        state = state.asking(Retrace())
    return state


def _frame_plot(state: State, view_model: ViewModel, height: float) -> None:
    times = np.asarray(view_model.frame_ms[-240:], float)
    latest, wanted = float(times[-10:].mean()) if times.size else 0.0, view_model.wanted_hz
    rate = f"{1000 / latest:.0f} frames/s" if latest > 0 else "no frame yet"
    if state.interacting or not view_model.stats.is_software:  # which takes its time while nothing moves
        rate += f", {wanted:.0f} wanted"
    imgui.text_unformatted(f"Frame  {numbers.milliseconds(latest)}")
    rows.explain(
        "Frame time",
        "Mean duration of the last ten frames, milliseconds, and the rate that frames are cut down to hold.",
    )
    imgui.same_line()
    imgui.text_disabled(rate)
    flags = implot.Flags_.no_legend | implot.Flags_.no_inputs | implot.Flags_.no_menus | implot.Flags_.no_mouse_text
    size = imgui.ImVec2(-1, max(height - imgui.get_text_line_height_with_spacing(), theme.em(4)))
    if not implot.begin_plot("##frame time", size, flags):
        return
    implot.setup_axes(
        "", "ms", implot.AxisFlags_.no_tick_labels | implot.AxisFlags_.no_tick_marks, implot.AxisFlags_.no_highlight
    )
    top = max(20.0, float(np.percentile(times, 98)) * 1.3) if times.size else 20.0
    implot.setup_axes_limits(0, 239, 0, top, implot.Cond_.always)
    muted = imgui.ImVec4(*theme.palette().muted)
    implot.plot_inf_lines(
        "##limits",
        np.array([1000 / wanted, 50.0]),
        implot.Spec(line_color=muted, flags=implot.InfLinesFlags_.horizontal),
    )
    if times.size:
        start = 240 - times.size
        accent = imgui.ImVec4(*theme.palette().accent)
        implot.plot_line(
            "##frame", np.arange(start, 240, dtype=float), times, implot.Spec(line_color=accent, line_weight=1.5)
        )
    implot.end_plot()
    rows.explain(
        "Frame plot",
        f"Durations of the last 240 frames in milliseconds. Lines: {1000 / wanted:.1f} ms ({wanted:.0f} frames/s) and "
        "50 ms.",
    )


def _passes(view_model: ViewModel) -> None:
    imgui.text_unformatted("By pass")
    rows.explain(
        "By pass",
        "Time of each pass in the last frame, milliseconds: GPU timers, or the wall clock on a software renderer.",
    )
    if not view_model.pass_ms:
        widgets.hint("Nothing was computed in the last frame.")
        return
    longest = max(max(view_model.pass_ms.values()), 1e-6)
    if not imgui.begin_table("##passes", 3, imgui.TableFlags_.sizing_fixed_fit):
        return
    imgui.table_setup_column("pass")
    imgui.table_setup_column("bar", imgui.TableColumnFlags_.width_stretch)
    imgui.table_setup_column("ms")
    for name, spent in view_model.pass_ms.items():
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted(name.capitalize())
        rows.explain(name.capitalize(), PASSES[name])
        imgui.table_next_column()
        _bar(spent / longest)
        imgui.table_next_column()
        _right_aligned(numbers.milliseconds(spent), theme.em(4.2))
    imgui.end_table()


def _bar(share: float) -> None:
    width, height = imgui.get_content_region_avail().x, imgui.get_text_line_height()
    low = imgui.get_cursor_screen_pos()
    high = imgui.ImVec2(low.x + max(width * min(share, 1.0), 1.0), low.y + height * 0.8)
    imgui.get_window_draw_list().add_rect_filled(
        imgui.ImVec2(low.x, low.y + height * 0.25), high, theme.packed(theme.palette().accent, 0.8), 2.0
    )
    imgui.dummy(imgui.ImVec2(width, height))


def _right_aligned(text: str, width: float) -> None:
    room = max(width - imgui.calc_text_size(text).x, 0.0)
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + room)
    imgui.text_unformatted(text)


def counts_of(state: State, view_model: ViewModel) -> list[tuple[str, str, str]]:
    """What the panel counts: names, values as they are shown, and what they mean."""
    stats, target = view_model.stats, state.preferences.target_photons
    lines = [
        (
            "Photons",
            f"{numbers.count(stats.photons)} of {numbers.count(target)}" if stats.photons else "none yet",
            "Emitted photons that the shown map holds, and where it stops.",
        ),
        (
            "A frame",
            f"{numbers.count(stats.frame_photons)} photons" if stats.frame_photons else "none yet",
            (
                "Photons that were traced, or shown otherwise, in the last frame that had any. A GPU gets as many as "
                "leave the frame rate as it is wanted."
            ),
        ),
        (
            "A second",
            f"{numbers.count(stats.photons_per_second)} photons",
            "Emitted photons per second of trace and splat time.",
        ),
        (
            "Beams",
            numbers.count(stats.beams),
            (
                "Light followed from facet to facet as beams, in the last search. Where they carry all light, photons "
                "only say how finely they are followed."
            ),
        ),
        ("Polygons", numbers.count(stats.polygons), "What the beams lit on flat receivers."),
        (
            "Stored",
            numbers.count(stats.photons_stored),
            "Photon records kept, to be splatted again after an edit of dispersion.",
        ),
        (
            "Rays traced",
            numbers.count(stats.rays_traced),
            "Rays emitted since the start. Stands still when photons are only splatted again.",
        ),
        (
            "Samples",
            _samples(stats),
            (
                "Camera samples of the shown picture; where glass disperses, bands of the spectrum that they are "
                "divided over."
            ),
        ),
        (
            "Resolution",
            f"{stats.resolution_scale:.0%}",
            "Side of the shown picture over the viewport's: less while something moves.",
        ),
        (
            "Maps, photons",
            numbers.size(stats.bytes),
            "Held on the device by maps, photons and scene; a software renderer holds them in the process.",
        ),
    ]
    if view_model.process_bytes:
        lines.append(("Process", numbers.size(view_model.process_bytes), "Resident memory of the whole program, now."))
    return lines


def _numbers(state: State, view_model: ViewModel) -> None:
    stats = view_model.stats
    _table("##numbers", counts_of(state, view_model))
    bands = [(name, f"{n} bands", "Spectral bands of this light.") for name, n in sorted(stats.bands.items())]
    of_camera = "Camera rays that were simplified, since the scene was last made."
    for title, tip, rows_ in (
        ("Fall-backs", "Photons that were simplified.", _counted(stats.fallbacks, numbers.count)),
        ("Camera rays' fall-backs", of_camera, _counted(stats.camera_fallbacks, numbers.count)),
        ("Where light ended", "Shares of the emitted flux.", _counted(stats.lost, numbers.percent)),
        ("Spectral bands", "How finely each light's spectrum is divided.", bands),
    ):
        if rows_:
            imgui.separator_text(title)
            widgets.tooltip(tip)
            _table(f"##{title}", rows_)
    if stats.renderer:
        widgets.hint(stats.renderer + (" (software)" if stats.is_software else ""))
        widgets.tooltip("What draws: the graphics driver's name.")
    if stats.device_advice:
        widgets.hint("A better GPU may be there.")
        widgets.tooltip(f"{stats.device_advice[:1].upper()}{stats.device_advice[1:]}.")


def _samples(stats: LiveStats) -> str:
    bands = f", {stats.camera_bands} bands" if stats.camera_bands > 1 else ""
    return f"{stats.camera_samples:.0f} a pixel{bands}"


def _table(identity: str, lines: list[tuple[str, str, str]]) -> None:
    if not imgui.begin_table(identity, 2, imgui.TableFlags_.sizing_stretch_prop):
        return
    for label, value, tip in lines:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_disabled(label)
        rows.explain(label, tip)
        imgui.table_next_column()
        imgui.text_unformatted(value)
        widgets.tooltip(tip)
    imgui.end_table()


def _counted(counters: Mapping[str, Any], text: Callable[[Any], str]) -> list[tuple[str, str, str]]:
    """Rows for the counters that are not 0."""
    unknown = [(key.replace("_", " ").capitalize(), "Counted, never hidden.") for key in counters]
    shown = [_COUNTERS.get(key, other) for key, other in zip(counters, unknown, strict=True)]
    return [(name, text(n), tip) for (name, tip), n in zip(shown, counters.values(), strict=True) if n]
