"""Wavelength and deviation beside the rays of the overlay, and crosses where they focus."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from imgui_bundle import ImVec2, imgui

from . import theme
from .overlay import Canvas
from .panels.spectral_colour import colour_of_nm
from .ray_readings import RayReading

MOST_LABELS = 5
"""With more wavelengths only some, the first and the last among them."""
_BORDER_EM = 0.6


def draw_ray_labels(canvas: Canvas, readings: Sequence[RayReading]) -> None:
    """Labels in a column next to the ends of the rays that are read, none over another; a small cross at each focus."""
    for reading in readings:
        if reading.focus is not None:
            _cross(canvas, canvas.pixels(np.asarray(reading.focus)), colour_of_nm(reading.wavelength_nm))
    chosen = [readings[i] for i in labelled(len(readings))]
    line = imgui.get_text_line_height() + theme.em(0.25)
    places = [(_end_of(canvas, reading.path), reading) for reading in chosen]
    lowest = -np.inf
    for (x, y), reading in sorted((each for each in places if np.isfinite(each[0]).all()), key=lambda each: each[0][1]):
        text = f"{reading.wavelength_nm:.0f} nm  {reading.deviation_deg:.2f}°"
        size, border = imgui.calc_text_size(text), theme.em(_BORDER_EM)
        left = min(max(x + border, canvas.left + border), canvas.left + canvas.width - size.x - border)
        top = max(min(max(y - 0.5 * size.y, canvas.top + border), canvas.top + canvas.height - size.y - border), lowest)
        lowest = top + line
        low, high = ImVec2(left - theme.em(0.2), top), ImVec2(left + size.x + theme.em(0.2), top + size.y)
        canvas.drawing.add_rect_filled(low, high, theme.packed((0.05, 0.05, 0.06, 0.78)), 3.0)
        canvas.drawing.add_rect_filled(low, ImVec2(low.x + theme.em(0.12), high.y), colour_of_nm(reading.wavelength_nm))
        canvas.drawing.add_text(ImVec2(left, top), theme.packed((0.95, 0.95, 0.95, 1.0)), text)


def labelled(count: int) -> list[int]:
    """Which of `count` wavelengths have a label."""
    if count <= MOST_LABELS:
        return list(range(count))
    return sorted({round(i * (count - 1) / 2) for i in range(3)})


def _end_of(canvas: Canvas, path: np.ndarray) -> np.ndarray:
    """Where a ray ends on the screen, as far as it is in the picture; NaN where none of it is."""
    segments = canvas.segments(path)
    if not len(segments):
        return np.full(2, np.nan)
    start, way = segments[-1, 0], segments[-1, 1] - segments[-1, 0]  # which reaches beyond the picture's borders
    low = np.array([canvas.left, canvas.top])
    border = np.where(way > 0.0, low + [canvas.width, canvas.height], low)
    share = (border - start) / np.where(way == 0.0, np.inf, way)
    return np.asarray(start + float(np.min(share, where=share > 0.0, initial=1.0)) * way)


def _cross(canvas: Canvas, place: np.ndarray, colour: int) -> None:
    if not np.isfinite(place).all():
        return
    x, y, reach = float(place[0]), float(place[1]), 5.0 * canvas.scale
    for dark in (True, False):
        tint, width = (theme.packed((0.0, 0.0, 0.0, 0.6)), 3.4) if dark else (colour, 1.6)
        canvas.drawing.add_line(ImVec2(x - reach, y), ImVec2(x + reach, y), tint, width)
        canvas.drawing.add_line(ImVec2(x, y - reach), ImVec2(x, y + reach), tint, width)
