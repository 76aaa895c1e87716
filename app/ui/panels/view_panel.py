"""How the picture is shown and made: exposure, tone, false colour, one wavelength, rays, sampling, camera."""

from __future__ import annotations

from dataclasses import replace

from ...edit import edits
from ...edit.camera_controls import focus_at
from ...edit.state import Display, Preferences, State, ToneCurve
from ...model.contacts import world_bounds
from ...model.scene_render import MAX_GLARE
from .. import view_commands
from ..view_model import ViewModel
from . import false_colour, spectrum_strip, widgets
from .camera_rows import draw_camera_rows
from .methods import MENU_METHODS, METHOD_NAMES, METHOD_TIPS

SWEEP_NM = (400.0, 700.0)
"""What the sweep runs through: where the eye sees something."""
SWEEP_NM_PER_S = 45.0
"""Speed of the sweep through the spectrum."""
_TONES: dict[ToneCurve, str] = {
    "spectrasplat": "SpectraSplat",
    "aces": "ACES",
    "reinhard": "Reinhard",
    "linear": "Linear, clipped",
}
_TARGETS = {str(n * 1_000_000): f"{n} million" for n in (1, 4, 16, 32, 64, 128, 256, 512, 1024)}

_sweeping = {"on": False}
"""Whether the sweep runs: memory of the interface, like a scroll position."""


def draw_view(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    state = _sweep(state, view_model)
    if widgets.section("Exposure and tone"):
        state = _exposure(state, view_model)
    if widgets.section("Single wavelength"):
        state = _solo(state)
    if widgets.section("Overlays"):
        state = _overlays(state)
    if widgets.section("Sampling"):
        state = _sampling(state)
    if widgets.section("Camera"):
        state = _camera(state)
    return state


def _exposure(state: State, view_model: ViewModel) -> State:
    display = state.display
    in_use = view_model.exposure_ev if display.auto_exposure else display.exposure_ev
    changed, stops, active = widgets.slider(
        "Exposure",
        in_use,
        -16.0,
        16.0,
        unit="EV",
        format="%+.2f",
        reset=0.0,
        tip="Brightness of the picture in stops. Moving it turns the automatic off.",
    )
    if changed:
        display = replace(display, exposure_ev=stops, auto_exposure=False)
    toggled, is_auto = widgets.toggle(
        "Automatic", display.auto_exposure, tip="Let the exposure follow the picture (Shift+E)."
    )
    if toggled:
        display = replace(display, auto_exposure=is_auto, exposure_ev=in_use)
    scattered, glare, active_glare = widgets.slider(
        "Glare",
        100.0 * state.scene.render.glare,
        0.0,
        100.0 * MAX_GLARE,
        unit="%",
        format="%.1f",
        reset=0.0,
        tip="Share of the light that the lens scatters, as a halo round what is bright; linear files never have it.",
    )
    if scattered:
        state = edits.attempt(state, "Glare", edits.set_render_defaults, glare=glare / 100.0)
    active = active or active_glare
    toggled, antialias = widgets.toggle(
        "Antialias highlights",
        state.scene.render.antialias_highlights,
        tip="Edges of what is overexposed without steps: pixels show how much of them it covers. Linear files never "
        "have it.",
    )
    if toggled:
        state = edits.attempt(state, "Highlights", edits.set_render_defaults, antialias_highlights=antialias)
    _, tone = widgets.combo(
        "Tone curve",
        _TONES,
        display.tone,
        tip="How light beyond display white is shown. SpectraSplat keeps hues of spectral colours; Linear clips each "
        "channel.",
    )
    _, is_false = widgets.toggle(
        "False colour", display.false_colour, tip="Show luminance on a logarithmic colour scale instead of colours (X)."
    )
    display = replace(display, tone=tone, false_colour=is_false)
    if display.false_colour:
        display, moved = _false_colour(display, in_use)
        active = active or moved
    return widgets.holding(replace(state, display=display), active)


def _false_colour(display: Display, exposure_ev: float) -> tuple[Display, bool]:
    low, high = display.false_colour_stops
    moved_low, new_low, active_low = widgets.slider(
        "Scale from",
        low,
        -20.0,
        19.0,
        unit="stops",
        format="%+.1f",
        reset=-8.0,
        tip="Lower end of the scale, stops about display white.",
    )
    moved_high, new_high, active_high = widgets.slider(
        "Scale to",
        high,
        -19.0,
        20.0,
        unit="stops",
        format="%+.1f",
        reset=4.0,
        tip="Upper end of the scale, stops about display white.",
    )
    if moved_low:
        high = max(high, new_low + 1.0)
    if moved_high:
        new_low = min(new_low, new_high - 1.0)
        high = new_high
    display = replace(display, false_colour_stops=(new_low, high))
    false_colour.legend(display.false_colour_stops, exposure_ev)
    return display, active_low or active_high


def _solo(state: State) -> State:
    changed, is_on = widgets.toggle(
        "Show one wavelength only",
        state.solo_nm is not None,
        tip="The light of a single wavelength, as through a narrow filter (L).",
    )
    if changed:
        _sweeping["on"] = False
        state = replace(state, solo_nm=view_commands.SOLO_START_NM if is_on else None)
    moved, picked, active = spectrum_strip.strip(
        "Spectrum strip",
        state.solo_nm,
        tip="Drag along the spectrum to decompose the caustic, wavelength by wavelength.",
    )
    if moved:
        state = replace(state, solo_nm=picked)
    if state.solo_nm is not None:
        typed, wavelength, typing = widgets.slider(
            "Wavelength",
            state.solo_nm,
            380.0,
            780.0,
            unit="nm",
            format="%.1f",
            reset=view_commands.SOLO_START_NM,
            tip="Vacuum wavelength of the light shown.",
        )
        active = active or typing
        if typed:
            state = replace(state, solo_nm=wavelength)
    if active:
        _sweeping["on"] = False
    label = "Stop sweep" if _sweeping["on"] else "Sweep"
    if widgets.button(
        f"{label}###sweep", tip="Run through the spectrum from violet to red, again and again.", width=-1
    ):
        _sweeping["on"] = not _sweeping["on"]
    return widgets.holding(state, active)


def _sweep(state: State, view_model: ViewModel) -> State:
    if not _sweeping["on"]:
        return state
    low, high = SWEEP_NM
    now = state.solo_nm if state.solo_nm is not None else low
    # A long frame (a dialogue, a slow machine) must not skip colours.
    moved = now - low + SWEEP_NM_PER_S * min(view_model.delta_s, 0.1)
    return widgets.holding(replace(state, solo_nm=low + moved % (high - low)), True)


def _overlays(state: State) -> State:
    display = state.display
    _, magnifier = widgets.toggle(
        "Magnifier", display.magnifier, tip="Enlarge the pixels under the cursor and show their values (M)."
    )
    _, rays = widgets.toggle(
        "Ray overlay",
        display.ray_overlay,
        tip="Draw a fan of rays through the selected object, coloured by wavelength (R).",
    )
    display = replace(display, magnifier=magnifier, ray_overlay=rays)
    if display.ray_overlay:
        _, count, _ = widgets.slider(
            "Rays",
            display.ray_count,
            1,
            25,
            unit="",
            format="%.0f",
            reset=5,
            tip="How many rays the fan has across the object.",
        )
        _, wavelengths, _ = widgets.slider(
            "Wavelengths",
            display.ray_wavelengths,
            1,
            31,
            unit="",
            format="%.0f",
            reset=9,
            tip="Into how many wavelengths each ray is split, from 400 to 700 nm.",
        )
        _, labels = widgets.toggle(
            "Ray labels", display.ray_labels, tip="Write wavelength and deviation beside the rays, and mark their foci."
        )
        display = replace(display, ray_count=round(count), ray_wavelengths=round(wavelengths), ray_labels=labels)
    return replace(state, display=display)


def _sampling(state: State) -> State:
    offered = MENU_METHODS | {state.method: METHOD_NAMES[state.method]}
    tip = METHOD_TIPS.get(state.method, "How wavelengths are sampled.")
    _, method = widgets.combo("Method", offered, state.method, tip=tip)
    changed, smoothing, active = widgets.slider(
        "Smoothing",
        state.smoothing,
        0.2,
        1.5,
        unit="",
        format="%.2f",
        reset=0.45,
        tip="Width of a photon's footprint in spacings of the photon lattice: less is sharper and noisier.",
    )
    state = replace(state, method=method, smoothing=smoothing if changed else state.smoothing)
    preferences: Preferences = state.preferences
    targets = dict(_TARGETS)
    targets.setdefault(str(preferences.target_photons), f"{preferences.target_photons / 1e6:g} million")
    _, target = widgets.combo(
        "Stop at",
        targets,
        str(preferences.target_photons),
        tip="Photons to accumulate. Then nothing is computed until something changes.",
    )
    _, refine = widgets.toggle(
        "Refine when still",
        preferences.refine_when_still,
        tip="After a dispersion edit, trace again with the new glass as soon as nothing is dragged any more.",
    )
    preferences = replace(preferences, target_photons=int(target), refine_when_still=refine)
    return widgets.holding(replace(state, preferences=preferences), active)


def _camera(state: State) -> State:
    camera, active = draw_camera_rows(state.camera)
    selected = state.selection
    may_focus = selected.kind == "object" and selected.index < len(state.scene.objects)
    if camera.lens_radius > 0.0 and widgets.button(
        "Focus on the selected", tip="Click a thing in the picture, then this: it is in focus.", enabled=may_focus
    ):
        low, high = world_bounds(state.scene.objects[selected.index])
        camera = focus_at(camera, 0.5 * (low + high))
    if widgets.button("Scene's own view", tip="Back to the camera that the scene was saved with (0).", width=-1):
        camera = state.scene.camera
    return widgets.holding(replace(state, camera=camera), active)
