"""Spectra as beam polygons see them: running integrals over the spectral coordinate x, by channel of the map.

A polygon's band of the continuous spectrum lights a place over an interval of x, and its colour is the difference of
two values of the running integral. An emission line is a table of two values, nothing and all of its energy, so that
the shader knows no lines: a band that goes from the one to the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..model.optics.spectral_tables import SpectralAxis
from ..model.optics.spectrum import Spectrum
from .map_channels import MapChannels
from .splat_tables import FoldedSpectrum

if TYPE_CHECKING:
    import moderngl

SAMPLES = 4097
"""Of a running integral, equally spaced over x in [0, 1]."""
LINE_TOLERANCE = 1e-6
"""How far in x a polygon of no band width may lie from its emission line."""


@dataclass(frozen=True)
class CurveParts:
    """Which part of which table belongs to each of n polygons."""

    first: np.ndarray
    """uint32 (n,), first value of the table of target 0."""
    stride: np.ndarray
    """uint32 (n,), values from one target's table to the next."""
    place: np.ndarray
    """float64 (n, 2), where the band begins and ends, in samples of the table."""


@dataclass(frozen=True)
class BeamTables:
    """GPU tables of every light under every reflectance class."""

    buffer: moderngl.Buffer
    """vec4: `SAMPLES` a (light, class, target), then two a (line, class, target) light by light."""
    targets: int
    classes: int
    values: np.ndarray
    """float64 (values, 4), what the buffer holds."""
    line_x: tuple[np.ndarray, ...]
    """By light: x of its emission lines."""
    line_first: np.ndarray
    """int64 (lights,), first value of each light's lines."""

    @classmethod
    def build(
        cls,
        ctx: moderngl.Context,
        axis: SpectralAxis,
        lights: Sequence[Spectrum],
        reflectances: Sequence[np.ndarray | None],
        channels: MapChannels = MapChannels(),
    ) -> BeamTables:
        """Tables for the lights' spectra under each reflectance (401,) or None."""
        targets, x = channels.targets, np.linspace(0.0, 1.0, SAMPLES)
        smooth, lines, line_x, line_counts = [], [], [], []
        for light in lights:
            of_light = [FoldedSpectrum.of(axis, light, reflectance, channels) for reflectance in reflectances]
            for source in of_light:
                smooth.append(source.smooth.at(x).reshape(SAMPLES, targets, 4).transpose(1, 0, 2).reshape(-1, 4))
            energy = np.stack([source.line_energy for source in of_light], axis=1)  # (lines, classes, columns)
            pairs = np.zeros((*energy.shape[:2], targets, 2, 4))
            pairs[..., 1, :] = energy.reshape(*energy.shape[:2], targets, 4)
            lines.append(pairs.reshape(-1, 4))
            line_x.append(of_light[0].line_x)
            line_counts.append(len(lines[-1]))
        values = np.concatenate([*smooth, *lines])
        first = sum(map(len, smooth)) + np.cumsum([0, *line_counts])[:-1]
        buffer = ctx.buffer(np.ascontiguousarray(values, np.float32))
        return cls(buffer, targets, len(reflectances), values, tuple(line_x), first)

    def parts(self, light: np.ndarray, reflectance_class: np.ndarray, x_lo: np.ndarray, x_hi: np.ndarray) -> CurveParts:
        """Of polygons (n,) each; raises ValueError where a band of no width is no line of its light."""
        is_line = x_hi <= x_lo
        first = (light.astype(np.int64) * self.classes + reflectance_class) * self.targets * SAMPLES
        place = np.stack([x_lo, x_hi], axis=1) * (SAMPLES - 1)
        place[is_line] = 0.0, 1.0
        for index in np.unique(light[is_line]):
            chosen = np.flatnonzero(is_line & (light == index))
            known = self.line_x[index]
            apart = np.abs(x_lo[chosen, None] - known)
            line = apart.argmin(axis=1) if len(known) else np.zeros(len(chosen), int)
            if not len(known) or np.any(apart[np.arange(len(chosen)), line] > LINE_TOLERANCE):
                raise ValueError(f"a beam of light {index} has no band width, and lies at none of its emission lines")
            of_line = (line * self.classes + reflectance_class[chosen]) * self.targets * 2
            first[chosen] = self.line_first[index] + of_line
        return CurveParts(first.astype(np.uint32), np.where(is_line, 2, SAMPLES).astype(np.uint32), place)

    def release(self) -> None:
        """Free the buffer."""
        self.buffer.release()
