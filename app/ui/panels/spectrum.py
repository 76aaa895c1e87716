"""The spectrum of the caustic under the cursor, in its own colours, with its chromaticity and dominant wavelength."""

from __future__ import annotations

import numpy as np
from imgui_bundle import imgui, implot

from ...base.not_yet import NOT_YET
from ...edit.chromaticity import ColourInfo, colour_info, ready
from ...edit.state import State
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.scene import Scene
from .. import theme
from ..view_model import CursorInfo, ViewModel
from . import numbers, rows, spectrum_strip, widgets
from .numbers import named

_TOO_FEW = "Too few photons have landed here for the caustic's spectrum; wait, or point where it is brighter."


def draw_spectrum(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents."""
    cursor = view_model.cursor
    if cursor is None:
        widgets.hint("Point at a receiver in the picture to see the spectrum of the light that falls there.")
        return state
    light, is_ready = cursor.light, ready()
    colour = None
    if is_ready and light is not None:
        colour = colour_info(light.wavelength_nm, light.irradiance, _source(state.scene))
    _draw_numbers(state, cursor, colour)
    if cursor.hit is None:
        widgets.hint("Nothing but background is under the cursor.")
    elif not cursor.hit.is_receiver:
        widgets.hint("The surface under the cursor is no receiver: caustics are recorded on diffuse objects only.")
    elif light is None:
        widgets.hint(f"The light here is {NOT_YET.value} …")
    elif colour is None and (is_ready or not light.irradiance.any()):
        widgets.hint(_TOO_FEW if light.too_few_photons else "No light falls here.")
    else:
        if light.too_few_photons:
            widgets.hint(_TOO_FEW)
        _plot(light.wavelength_nm, light.irradiance)
    return state


def _source(scene: Scene) -> np.ndarray:
    """The spectrum of all lamps together, on `VISIBLE_NM`."""
    edges = np.append(VISIBLE_NM - 0.5, VISIBLE_NM[-1] + 0.5)
    return np.sum([light.spectral_power.binned(edges) for light in scene.lights], axis=0)


def _numbers_of(cursor: CursorInfo, colour: ColourInfo | None) -> list[tuple[str, str, str]]:
    """Names, values and what they mean."""
    light = cursor.light
    radiance = "…" if cursor.rgb is None else "  ".join(f"{c:.3g}" for c in cursor.rgb)
    parts = [("Radiance", radiance, "Linear Rec.709 radiance of the pixel, lm/(sr unit²).")]
    if colour is not None:
        tip = "Luminous flux per area of the receiver: caustic and direct light."
        if light is not None and light.direct_illuminance is None:
            tip = "Luminous flux of the caustic per area of the receiver; direct light is still being found."
        parts.append(("Illuminance", f"{colour.illuminance:.4g} lm/unit²", tip))
        parts.append(("x, y", f"{colour.x:.4f}, {colour.y:.4f}", "CIE 1931 chromaticity of the caustic's light."))
        tip = "Wavelength of the spectral colour of the same hue, from D65; c: of the opposite hue."
        parts.append(("Dominant", _dominant_text(colour), tip))
        tip = "Excitation purity: 100 % is a spectral colour, 0 % is white."
        parts.append(("Purity", numbers.percent(colour.purity), tip))
        kelvin = "–" if colour.temperature_k is None else numbers.kelvin(colour.temperature_k)
        tip = "Correlated colour temperature: of the black body that is most alike; none for strong colours."
        parts.append(("Temperature", kelvin, tip))
    if light is not None and light.direct_illuminance is not None:
        text = f"{light.direct_illuminance:.4g} lm/unit²"
        parts.append(("Direct", text, "Of the illuminance, straight from lights."))
    if light is not None and not light.too_few_photons and light.error > 0.0:
        text = f"{light.wavelength_nm[1] - light.wavelength_nm[0]:.0f} nm, ±{numbers.percent(light.error)}"
        tip = "Width of a bin, by the number of photons, and the standard error of the caustic in one."
        parts.append(("Resolution", text, tip))
    return parts


def _draw_numbers(state: State, cursor: CursorInfo, colour: ColourInfo | None) -> None:
    parts = _numbers_of(cursor, colour)
    if cursor.hit is not None and cursor.hit.object_index < len(state.scene.objects):
        name = state.scene.objects[cursor.hit.object_index].name
        parts.insert(0, ("On", name, "The first surface under the cursor."))
    room = imgui.get_content_region_avail().x
    gap, used = theme.em(1.2), 0.0
    for label, text, tip in ((label, named(text), tip) for label, text, tip in parts):
        width = imgui.calc_text_size(f"{label}  {text}").x + gap
        if used and used + width <= room:
            imgui.same_line(0, gap)
        else:
            used = 0.0
        used += width
        imgui.begin_group()
        imgui.text_disabled(label)
        imgui.same_line(0, theme.em(0.5))
        imgui.text_unformatted(text)
        imgui.end_group()
        rows.explain(label, tip)


def _dominant_text(colour: ColourInfo) -> str:
    if colour.dominant_nm is None:
        return "none (white)"
    return f"{colour.dominant_nm:.0f} nm" + (" c" if colour.is_complementary else "")


def _plot(wavelengths_nm: np.ndarray, spectrum: np.ndarray) -> None:
    flags = implot.Flags_.no_legend | implot.Flags_.no_menus
    height = max(imgui.get_content_region_avail().y, theme.em(7))
    if not implot.begin_plot("##spectrum", imgui.ImVec2(-1, height), flags):
        return
    scaled, unit = _scaled(spectrum)
    across, upward = axis_labels(named(f"{unit}/unit²/nm"), height)
    implot.setup_axes(across, upward, implot.AxisFlags_.none, implot.AxisFlags_.none)
    implot.setup_axis_limits(implot.ImAxis_.x1, 380, 780, implot.Cond_.always)
    implot.setup_axis_limits(implot.ImAxis_.y1, 0, 1.1 * float(scaled.max()), implot.Cond_.always)
    implot.push_plot_clip_rect()
    # Bins as they are: how wide they are says how much is known.
    half = 0.5 * float(wavelengths_nm[1] - wavelengths_nm[0])
    edges = np.append(wavelengths_nm - half, wavelengths_nm[-1] + half)
    _fill(edges, scaled)
    implot.pop_plot_clip_rect()
    outline = imgui.ImVec4(*theme.palette().text[:3], 0.85)
    implot.plot_line(
        "##outline",
        np.repeat(edges, 2)[1:-1],
        np.repeat(scaled, 2),
        implot.Spec(line_color=outline, line_weight=1.2),
    )
    implot.end_plot()
    rows.explain("Spectrum plot", "")


def axis_labels(unit: str, height: float) -> tuple[str, str]:
    """Labels of wavelength and irradiance, in a plot of `height` pixels: where the upright one is longer than the axis,
    the other one has the unit."""
    upward = f"E ({unit})"
    if imgui.calc_text_size(upward).x > height - theme.em(3.5):
        return f"λ (nm), upward E ({unit})", ""
    return "λ (nm)", upward


def _scaled(spectrum: np.ndarray) -> tuple[np.ndarray, str]:
    """The values in W, mW, µW … so that the axis needs no powers of ten."""
    values = np.ascontiguousarray(spectrum, float)
    peak = float(values.max())
    for factor, unit in ((1.0, "W"), (1e3, "mW"), (1e6, "µW"), (1e9, "nW")):
        if peak * factor >= 0.1:
            return values * factor, unit
    return values * 1e12, "pW"


def _fill(edges_nm: np.ndarray, values: np.ndarray) -> None:
    """A bar of its own colour for every nanometre, a pixel wider than that: no seam must show between them."""
    drawing = implot.get_plot_draw_list()
    fine = np.arange(float(edges_nm[0]), float(edges_nm[-1]), 1.0)
    heights = values[np.searchsorted(edges_nm, fine + 0.5) - 1]
    for left, height in zip(fine.tolist(), heights.tolist(), strict=True):
        low, high = implot.plot_to_pixels(left, height), implot.plot_to_pixels(left + 1.0, 0.0)
        drawing.add_rect_filled(low, imgui.ImVec2(high.x + 1.0, high.y), spectrum_strip.colour_of_nm(left + 0.5))
