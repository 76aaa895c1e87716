"""The spectrum of a light: chosen by name, temperature, wavelength, lamp or file, and drawn in its colours."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...edit import edits, presets
from ...edit.lights import set_light_spectrum, spectrum_words
from ...edit.state import State
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.optics.spectrum import Spectrum, illuminant_names
from .. import item_rects, theme
from . import widgets
from .rows import begin_row
from .spectrum_strip import colour_of_nm

_KINDS = {
    "illuminant": "Standard illuminant",
    "blackbody": "Black body",
    "laser": "Laser line",
    "lines": "Spectral lines",
    "csv": "Measured, from file",
}

_LAMPS = {preset.name: preset.value for preset in presets.light_presets() if isinstance(preset.value, tuple)}
_FIRST = {"illuminant": "D65", "blackbody": 3200.0, "laser": 532.0, "lines": _LAMPS["Mercury lamp"]}
"""What another kind of spectrum begins with."""

_COMMON = ("D65", "D50", "A", "E", "LED-B1", "LED-B3", "LED-RGB1", "FL2", "FL11", "HP1")
_ABOUT = {
    "A": "A, tungsten lamp",
    "D50": "D50, horizon daylight",
    "D55": "D55, mid-morning daylight",
    "D65": "D65, noon daylight",
    "D75": "D75, north sky",
    "E": "E, equal energy",
    "FL2": "FL2, fluorescent, cool white",
    "FL11": "FL11, fluorescent, three bands",
    "HP1": "HP1, sodium, high pressure",
    "LED-B1": "LED-B1, warm white LED",
    "LED-B3": "LED-B3, neutral white LED",
    "LED-B5": "LED-B5, cold white LED",
    "LED-RGB1": "LED-RGB1, red, green and blue LEDs",
}


@dataclass
class _Memory:
    """The file that is being typed in."""

    path: str = ""
    wants_file: set[str] = field(default_factory=set)
    """Lights for which a file is to be chosen."""


_memory = _Memory()


def draw_spectrum_choice(state: State, index: int) -> State:
    """Rows that choose the spectrum of light `index`, and its plot. Its photometric power stays."""
    light = state.scene.lights[index]
    kind, value = spectrum_words(light.spectral_power)
    shown = "csv" if light.name in _memory.wants_file else kind
    kinds = _KINDS if kind != "table" else {**_KINDS, "table": "Measured"}
    tip = "Where the light's colours come from. Its power in the unit above stays the same."
    chosen = widgets.combo("Spectrum", kinds, shown, tip=tip)
    if chosen != shown:
        _memory.wants_file.discard(light.name)
        if chosen == "csv":
            _memory.wants_file.add(light.name)
            return state
        return _set(state, index, chosen, _FIRST[chosen]) if chosen in _FIRST else state
    if shown == "csv":
        state = _draw_file(state, index)
    elif kind == "illuminant":
        state = _draw_illuminant(state, index, str(value))
    elif kind == "blackbody":
        state = _draw_temperature(state, index, float(value))  # type: ignore[arg-type]
    elif kind == "laser":
        state = _draw_laser(state, index, float(value))  # type: ignore[arg-type]
    elif kind == "lines":
        state = _draw_lamp(state, index, value)  # type: ignore[arg-type]
    _draw_plot(state.scene.lights[index].spectral_power)
    return _draw_presets(state, index)


def _draw_presets(state: State, index: int) -> State:
    ready = {p.name: p for p in presets.light_presets()}
    tip = "Lamps, lasers and daylight by everyday names. The brightness stays."
    chosen = widgets.menu_button("Light presets…", {n: p.remark for n, p in ready.items()}, tip=tip)
    if chosen is None:
        return state
    name = state.scene.lights[index].name
    _memory.wants_file.discard(name)
    return edits.attempt(state, f"{chosen} for {name}", presets.apply_light, index, ready[chosen])


def _set(state: State, index: int, kind: str, value: object) -> State:
    label = f"Spectrum of {state.scene.lights[index].name}"
    return edits.attempt(state, label, set_light_spectrum, index, kind, value)


def _draw_illuminant(state: State, index: int, name: str) -> State:
    names = [*_COMMON, *(n for n in illuminant_names() if n not in _COMMON)]
    options = {n: _ABOUT.get(n, n) for n in names}
    chosen = widgets.combo("Illuminant", options, name, tip="CIE standard illuminants: daylight, lamps, LEDs.")
    return state if chosen == name else _set(state, index, "illuminant", chosen)


def _draw_temperature(state: State, index: int, before: float) -> State:
    tip = "Temperature of the black body: a candle has 1,900 K, a halogen lamp 3,200 K, the sun 5,800 K."
    kelvin = widgets.slider(
        "Temperature", before, 1000.0, 20000.0, unit="K", tip=tip, reset=3200.0, format="%.0f", logarithmic=True
    )
    return state if kelvin == before else _set(state, index, "blackbody", max(kelvin, 500.0))


def _draw_laser(state: State, index: int, before: float) -> State:
    tip = "The only wavelength that the light has. Helium–neon 632.8, frequency-doubled Nd:YAG 532, blue diode 450."
    wavelength_nm = widgets.slider("Wavelength", before, 380.0, 780.0, unit="nm", tip=tip, reset=532.0, format="%.1f")
    return state if wavelength_nm == before else _set(state, index, "laser", wavelength_nm)


def _draw_lamp(state: State, index: int, lines: tuple[tuple[float, float], ...]) -> State:
    current = next((name for name, rows in _LAMPS.items() if _same_lines(rows, lines)), f"{len(lines)} lines")
    tip = "Emission lines of a gas, or laser lines: each makes a caustic of its own, side by side."
    chosen = widgets.combo("Lines", list(_LAMPS), current, tip=tip)
    return state if chosen == current else _set(state, index, "lines", _LAMPS[chosen])


def _same_lines(rows: tuple[tuple[float, float], ...], lines: tuple[tuple[float, float], ...]) -> bool:
    """Whether they are the same up to their power."""
    if [nm for nm, _ in rows] != [nm for nm, _ in lines]:
        return False
    scale = lines[0][1] / rows[0][1]
    return all(math.isclose(p * scale, q, rel_tol=1e-6) for (_, p), (_, q) in zip(rows, lines, strict=True))


def _draw_file(state: State, index: int) -> State:
    begin_row("File")
    hint = "wavelength_nm, power in a .csv"
    flags = imgui.InputTextFlags_.enter_returns_true.value
    entered, _memory.path = imgui.input_text_with_hint("##spectrum file", hint, _memory.path, flags)
    item_rects.note("Spectrum file")
    widgets.tooltip("A text file with two columns, wavelength in nm and power; Enter reads it.")
    begin_row("")
    pressed = widgets.button("Read file", tip="Take the spectrum from this file.", enabled=bool(_memory.path.strip()))
    if not (entered or pressed):
        return state
    after = _set(state, index, "csv", Path(_memory.path.strip()).expanduser())
    if after.scene is not state.scene:
        _memory.wants_file.discard(state.scene.lights[index].name)
    return after


def _draw_plot(spectrum: Spectrum) -> None:
    """Relative power against wavelength in the colours themselves; lines as bars."""
    size = ImVec2(imgui.get_content_region_avail().x, theme.em(6.5))
    corner = imgui.get_cursor_screen_pos()
    imgui.dummy(size)
    item_rects.note("Light spectrum")
    mouse = imgui.get_mouse_pos()
    if imgui.is_item_hovered():
        _explain(spectrum, 380.0 + 400.0 * (mouse.x - corner.x) / size.x)
    drawing, colours = imgui.get_window_draw_list(), theme.palette()
    low, high = ImVec2(corner.x, corner.y), ImVec2(corner.x + size.x, corner.y + size.y - theme.em(1.3))
    drawing.add_rect_filled(low, high, theme.packed(colours.canvas if colours.is_dark else (1.0, 1.0, 1.0, 1.0)), 2.0)
    _draw_density(drawing, spectrum.density, low, high)
    _draw_lines(drawing, spectrum.lines, low, high)
    tint = theme.packed(colours.muted)
    for nm in (400, 500, 600, 700):
        x = low.x + (high.x - low.x) * (nm - 380.0) / 400.0
        text = f"{nm} nm"
        drawing.add_line(ImVec2(x, high.y), ImVec2(x, high.y + 3.0), tint)
        drawing.add_text(ImVec2(max(x - imgui.calc_text_size(text).x / 2, low.x), high.y + 3.0), tint, text)


def _draw_density(drawing: imgui.ImDrawList, density: np.ndarray, low: ImVec2, high: ImVec2) -> None:
    strongest = float(density.max())
    if strongest <= 0.0:
        return
    edges = np.linspace(380.0, 780.0, 101)
    height = 0.92 * (high.y - low.y) * np.interp(edges, VISIBLE_NM, density) / strongest
    x = low.x + (high.x - low.x) * (edges - 380.0) / 400.0
    top = [ImVec2(float(a), high.y - float(h)) for a, h in zip(x, height, strict=True)]
    base = [ImVec2(float(a), high.y) for a in x]
    smoothing = drawing.flags
    drawing.flags = smoothing & ~imgui.ImDrawFlags_.aa_fill.value  # smoothed edges would show as seams
    for i in range(100):
        drawing.add_quad_filled(base[i], top[i], top[i + 1], base[i + 1], colour_of_nm(edges[i] + 2.0))
    drawing.flags = smoothing


def _draw_lines(drawing: imgui.ImDrawList, lines: tuple[tuple[float, float], ...], low: ImVec2, high: ImVec2) -> None:
    strongest = max((power for _, power in lines), default=0.0)
    for nm, power in lines:
        if power <= 0.0:
            continue
        x = low.x + (high.x - low.x) * (nm - 380.0) / 400.0
        top = high.y - 0.92 * (high.y - low.y) * power / strongest
        drawing.add_line(ImVec2(x, high.y), ImVec2(x, top), colour_of_nm(nm), 2.5)


def _explain(spectrum: Spectrum, nm: float) -> None:
    near = min(spectrum.lines, key=lambda line: abs(line[0] - nm), default=None)
    if near is not None and abs(near[0] - nm) < 6.0:
        imgui.set_tooltip(
            f"Line at {near[0]:.2f} nm, {100 * near[1] / max(spectrum.power_w(), 1e-300):.3g} % of the power"
        )
        return
    density = float(np.interp(nm, VISIBLE_NM, spectrum.density))
    strongest = float(spectrum.density.max())
    share = 100 * density / strongest if strongest > 0.0 else 0.0
    imgui.set_tooltip(f"{nm:.0f} nm: {share:.3g} % of the strongest\nRelative spectral power")
