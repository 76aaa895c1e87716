"""The rays of the overlay in numbers: deviation, minimum deviation, focal lengths, by wavelength."""

from __future__ import annotations

from collections.abc import Sequence

from imgui_bundle import imgui

from ...edit.state import State
from ..ray_readings import RayReading
from ..view_model import ViewModel
from . import widgets
from .wavelength_table import draw_wavelength_table

_COLUMNS = {
    "nm": "Vacuum wavelength.",
    "n": "Refractive index of the glass.",
    "Deviation": "Angle between the middle ray before and behind the glass; with inner reflections the least turn of "
    "all rays.",
    "Minimum": "Minimum deviation of a prism with these two faces: 2 asin(n sin(A/2)) - A, for rays in its principal "
    "section.",
    "Focal length": "Of a thin bundle of parallel light about the middle ray; negative where the focus is virtual.",
    "Behind": "From the last surface to the focus, along the middle ray; scene units.",
}


def draw_rays_panel(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    if not state.display.ray_overlay:
        if widgets.button("Draw rays", tip="Draw a fan of rays through the selected object (R)."):
            state = state.with_display(ray_overlay=True)
        return state
    tip = "How often rays are reflected within the glass before they leave it: 1 and 2 in a drop make the rainbows."
    reflections = widgets.whole("Inner reflections", state.display.ray_reflections, 0, 4, reset=0, tip=tip)
    state = state.with_display(ray_reflections=reflections)
    if not view_model.readings:
        widgets.hint("No ray of this light meets the selected object. Select an object of glass, or another light.")
        return state
    if state.display.ray_reflections:
        imgui.text_wrapped(_bow(view_model.readings))
    apex = view_model.readings[0].apex_deg
    if apex is not None:
        imgui.text_unformatted(f"Prism: the faces that the rays go through make {apex:.2f}°.")
    rows = [(reading.wavelength_nm, texts(reading)) for reading in view_model.readings]
    draw_wavelength_table("Rays", _COLUMNS, rows)
    return state


def _bow(readings: Sequence[RayReading]) -> str:
    ends = ((abs((r.deviation_deg + 180.0) % 360.0 - 180.0), r.wavelength_nm) for r in (readings[0], readings[-1]))
    bow = " and ".join(f"{180.0 - turn:.1f}° ({nm:.0f} nm)" for turn, nm in ends)
    return f"Rays crowd where they turn least: a bow at {bow} from the point opposite the light."


def texts(reading: RayReading) -> tuple[str, ...]:
    """The columns after the wavelength; a dash where there is no such number."""
    return (
        _or_dash(reading.index, "{:.5f}"),
        f"{reading.deviation_deg:.3f}°",
        _or_dash(reading.least_deg, "{:.3f}°"),
        _or_dash(reading.focal_length, "{:.4f}"),
        _or_dash(reading.focus_distance, "{:.4f}"),
    )


def _or_dash(value: float | None, form: str) -> str:
    return "–" if value is None else form.format(value)
