"""How the picture is shown and made: exposure, tone, false colour, one wavelength, rays, sampling, camera."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from imgui_bundle import imgui

from ...base.colour_maps import FALSE_COLOUR, sample
from ...edit import edits
from ...edit.camera_controls import focus_at
from ...edit.state import SOLO_START_NM, Display, State, ToneCurve
from ...model.scene_render import MAX_GLARE
from .. import theme
from ..view_model import ViewModel
from . import rows, spectrum_strip, widgets
from .camera_rows import draw_camera_rows
from .methods import MENU_METHODS, METHOD_NAMES, METHOD_TIPS

SWEEP_NM = (400.0, 700.0)
"""What the sweep runs through: where the eye sees something."""
SWEEP_NM_PER_S = 45.0
_TONES: dict[ToneCurve, str] = {
    "spectrasplat": "SpectraSplat",
    "aces": "ACES",
    "reinhard": "Reinhard",
    "linear": "Linear, clipped",
}
_TARGETS = {str(n * 1_000_000): f"{n} million" for n in (1, 4, 16, 32, 64, 128, 256, 512, 1024)}

_sweeping = {"on": False}
"""Whether the sweep runs: memory of the interface, like a scroll position."""
_LEGEND_STEPS = 48


def draw_view(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    state = _sweep(state, view_model)
    if widgets.section("Exposure and tone"):
        state = _exposure(state, view_model)
    if widgets.section("Single wavelength"):
        state = _solo(state)
    if widgets.section("Overlays"):
        state = replace(state, display=_overlays(state.display))
    if widgets.section("Sampling"):
        state = _sampling(state)
    if widgets.section("Camera"):
        state = _camera(state)
    return state


def _exposure(state: State, view_model: ViewModel) -> State:
    display, render = state.display, state.scene.render
    in_use = view_model.exposure_ev if display.auto_exposure else display.exposure_ev
    tip = "Brightness of the picture in stops. Moving it turns the automatic off."
    stops = widgets.slider("Exposure", in_use, -16.0, 16.0, unit="EV", format="%+.2f", reset=0.0, tip=tip)
    if stops != in_use:
        display = replace(display, exposure_ev=stops, auto_exposure=False)
    tip = "Let the exposure follow the picture (Shift+E)."
    is_auto = widgets.toggle("Automatic", display.auto_exposure, tip=tip)
    if is_auto != display.auto_exposure:
        display = replace(display, auto_exposure=is_auto, exposure_ev=in_use)
    tip = "Share of the light that the lens scatters, as a halo round what is bright; linear files never have it."
    before = 100.0 * render.glare
    glare = widgets.slider("Glare", before, 0.0, 100.0 * MAX_GLARE, unit="%", format="%.1f", reset=0.0, tip=tip)
    if glare != before:
        state = edits.render_changed(state, "Glare", glare=glare / 100.0)
    tip = (
        "Edges of what is overexposed without steps: pixels show how much of them it covers. Linear files never have "
        "it."
    )
    antialias = widgets.toggle("Antialias highlights", render.antialias_highlights, tip=tip)
    state = edits.render_changed(state, "Highlights", antialias_highlights=antialias)
    tip = (
        "How light beyond display white is shown. SpectraSplat keeps hues of spectral colours; Linear clips each "
        "channel."
    )
    tone = widgets.combo("Tone curve", _TONES, display.tone, tip=tip)
    tip = "Show luminance on a logarithmic colour scale instead of colours (X)."
    is_false = widgets.toggle("False colour", display.false_colour, tip=tip)
    display = replace(display, tone=tone, false_colour=is_false)
    if is_false:
        display = _false_colour(display, in_use)
    return replace(state, display=display)


def _false_colour(display: Display, exposure_ev: float) -> Display:
    low, high = display.false_colour_stops
    tip = "Lower end of the scale, stops about display white."
    new_low = widgets.slider("Scale from", low, -20.0, 19.0, unit="stops", format="%+.1f", reset=-8.0, tip=tip)
    tip = "Upper end of the scale, stops about display white."
    new_high = widgets.slider("Scale to", high, -19.0, 20.0, unit="stops", format="%+.1f", reset=4.0, tip=tip)
    if new_high != high:
        new_low = min(new_low, new_high - 1.0)
    else:
        new_high = max(high, new_low + 1.0)
    _legend((new_low, new_high), exposure_ev)
    return replace(display, false_colour_stops=(new_low, new_high))


def _legend(stops: tuple[float, float], exposure_ev: float) -> None:
    """A bar of the false colours, as wide as the window, its ends labelled in stops about display white; `exposure_ev`
    turns a stop into a luminance for the tooltip."""
    low, high = stops
    width, height = imgui.get_content_region_avail().x, theme.em(0.9)
    start = imgui.get_cursor_screen_pos()
    imgui.invisible_button("##false colour", imgui.ImVec2(width, height))
    share = (imgui.get_mouse_pos().x - start.x) / max(width, 1.0)
    stop = low + min(max(share, 0.0), 1.0) * (high - low)
    luminance = 2.0 ** float(np.clip(stop - exposure_ev, -60.0, 60.0))
    rows.explain("False colour bar", f"{stop:+.1f} stops about display white: {luminance:.4g} lm/(sr unit²).")
    corner = imgui.ImVec2(start.x + width, start.y + height)
    spectrum_strip.draw_gradient(imgui.get_window_draw_list(), start, corner, _legend_colours())
    _legend_labels(low, high, width)


def _legend_labels(low: float, high: float, width: float) -> None:
    left = imgui.get_cursor_pos_x()
    imgui.text_disabled(f"{low:+.1f}")
    if low < 0.0 < high:
        _legend_label(left, width, -low / (high - low), "display white" if width > theme.em(14) else "0")
    _legend_label(left, width, 1.0, f"{high:+.1f}")


def _legend_label(left: float, width: float, share: float, text: str) -> None:
    """A label centred at `share` of the bar, kept within it."""
    length = imgui.calc_text_size(text).x
    imgui.same_line(left + min(max(share * width - length / 2, 0.0), width - length))
    imgui.text_disabled(text)


@cache
def _legend_colours() -> tuple[int, ...]:
    scale = sample(FALSE_COLOUR, np.linspace(0.0, 1.0, _LEGEND_STEPS + 1)).astype(float)
    return tuple(theme.packed((r, g, b, 1.0)) for r, g, b in scale.tolist())


def _solo(state: State) -> State:
    tip = "The light of a single wavelength, as through a narrow filter (L)."
    is_on = widgets.toggle("Show one wavelength only", state.solo_nm is not None, tip=tip)
    if is_on != (state.solo_nm is not None):
        _sweeping["on"] = False
        state = replace(state, solo_nm=SOLO_START_NM if is_on else None)
    shown = state.solo_nm
    tip = "Drag along the spectrum to decompose the caustic, wavelength by wavelength."
    picked = spectrum_strip.strip("Spectrum strip", shown, tip=tip)
    if picked is not None:
        tip = "Vacuum wavelength of the light shown."
        picked = widgets.slider(
            "Wavelength", picked, 380.0, 780.0, unit="nm", format="%.1f", reset=SOLO_START_NM, tip=tip
        )
    if picked != shown:
        _sweeping["on"] = False
    label = "Stop sweep" if _sweeping["on"] else "Sweep"
    tip = "Run through the spectrum from violet to red, again and again."
    if widgets.button(f"{label}###sweep", tip=tip, width=-1):
        _sweeping["on"] = not _sweeping["on"]
    return replace(state, solo_nm=picked)


def _sweep(state: State, view_model: ViewModel) -> State:
    if not _sweeping["on"]:
        return state
    widgets.hold()
    low, high = SWEEP_NM
    now = state.solo_nm if state.solo_nm is not None else low
    # A long frame (a dialogue, a slow machine) must not skip colours.
    moved = now - low + SWEEP_NM_PER_S * min(view_model.delta_s, 0.1)
    return replace(state, solo_nm=low + moved % (high - low))


def _overlays(display: Display) -> Display:
    tip = "Enlarge the pixels under the cursor and show their values (M)."
    magnifier = widgets.toggle("Magnifier", display.magnifier, tip=tip)
    tip = "Draw a fan of rays through the selected object, coloured by wavelength (R)."
    rays = widgets.toggle("Ray overlay", display.ray_overlay, tip=tip)
    display = replace(display, magnifier=magnifier, ray_overlay=rays)
    if not rays:
        return display
    tip = "How many rays the fan has across the object."
    count = widgets.whole("Rays", display.ray_count, 1, 25, tip=tip, reset=5)
    tip = "Into how many wavelengths each ray is split, from 400 to 700 nm."
    wavelengths = widgets.whole("Wavelengths", display.ray_wavelengths, 1, 31, tip=tip, reset=9)
    tip = "Write wavelength and deviation next to the rays, and mark their foci."
    labels = widgets.toggle("Ray labels", display.ray_labels, tip=tip)
    return replace(display, ray_count=count, ray_wavelengths=wavelengths, ray_labels=labels)


def _sampling(state: State) -> State:
    preferences = state.preferences
    offered = MENU_METHODS | {state.method: METHOD_NAMES[state.method]}
    method = widgets.combo("Method", offered, state.method, tip=METHOD_TIPS[state.method])
    tip = "Width of a photon's footprint in spacings of the photon lattice: less is sharper and noisier."
    smoothing = widgets.slider("Smoothing", state.smoothing, 0.2, 1.5, unit="", format="%.2f", reset=0.45, tip=tip)
    targets = dict(_TARGETS)
    targets.setdefault(str(preferences.target_photons), f"{preferences.target_photons / 1e6:g} million")
    tip = "Photons to accumulate. Then nothing is computed until something changes."
    target = widgets.combo("Stop at", targets, str(preferences.target_photons), tip=tip)
    tip = "After a dispersion edit, trace again with the new glass as soon as nothing is dragged any more."
    refine = widgets.toggle("Refine when still", preferences.refine_when_still, tip=tip)
    preferences = replace(preferences, target_photons=int(target), refine_when_still=refine)
    return replace(state, method=method, smoothing=smoothing, preferences=preferences)


def _camera(state: State) -> State:
    camera, selected = draw_camera_rows(state.camera), state.selection
    may_focus = selected.kind == "object" and selected.index < len(state.scene.objects)
    tip = "Click a thing in the picture, then this: it is in focus."
    if camera.lens_radius > 0.0 and widgets.button("Focus on the selected", tip=tip, enabled=may_focus):
        camera = focus_at(camera, state.scene.objects[selected.index].world_bounds.mean(axis=0))
    if widgets.button("Scene's own view", tip="Back to the camera that the scene was saved with (0).", width=-1):
        camera = state.scene.camera
    return replace(state, camera=camera)
