"""Spectra as beam polygons see them: running integrals over the spectral coordinate x, by channel of the map.

A polygon's band of the continuous spectrum lights a place over an interval of x, and its colour is the difference of
two values of the running integral. An emission line is a table of two values, nothing and all of its energy, so that
the shader knows no lines: a band that goes from the one to the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from ..model.optics.spectral_tables import SpectralAxis
from ..model.optics.spectrum import Spectrum
from .map_channels import MapChannels
from .splat_tables import FoldedSpectrum

SAMPLES = 4097
"""Samples of a running integral, equally spaced over x in [0, 1]."""
WIDTH = SAMPLES + 1
"""Width of the texture: a sample at the end of a curve has a neighbour."""
PAIRS = SAMPLES // 2
"""Emission lines in a row."""
LINE_TOLERANCE = 1e-6
"""How far in x a polygon of no band width may be from its emission line."""


@dataclass(frozen=True)
class CurveParts:
    """Which part of which curve belongs to each of n polygons."""

    row: np.ndarray
    """int64 (n,), the curve of target 0; those of the other targets follow."""
    place: np.ndarray
    """float64 (n, 2), where the band begins and ends, in samples of the row."""


@dataclass(frozen=True)
class BeamTables:
    """GPU tables of every light under every reflectance class."""

    texture: moderngl.Texture
    """RGBA32F, `WIDTH` samples a row: a row a (light, class, target), then those of the lines, `PAIRS` side by side."""
    targets: int
    classes: int
    lights: int
    line_x: tuple[np.ndarray, ...]
    """By light: x of its emission lines."""

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
        folded = [[FoldedSpectrum.of(axis, light, each, channels) for each in reflectances] for light in lights]
        curves = np.stack([source.smooth.at(x) for of_light in folded for source in of_light])
        curves = np.pad(curves, ((0, 0), (0, WIDTH - SAMPLES), (0, 0)), mode="edge")
        # (lines, classes, columns): line by line, light after light.
        energy = np.concatenate([np.stack([source.line_energy for source in of_light], 1) for of_light in folded])
        pairs = np.zeros((-(-energy.shape[0] * energy.shape[1] // PAIRS) * PAIRS, 2, channels.columns))
        pairs[: energy.shape[0] * energy.shape[1], 1] = energy.reshape(-1, channels.columns)
        pairs = np.pad(pairs.reshape(-1, 2 * PAIRS, channels.columns), ((0, 0), (0, WIDTH - 2 * PAIRS), (0, 0)))
        rows = np.concatenate([curves, pairs]).reshape(-1, WIDTH, targets, 4).transpose(0, 2, 1, 3)
        texels = np.ascontiguousarray(rows.reshape(-1, WIDTH, 4), np.float32)
        texture = ctx.texture((WIDTH, len(texels)), 4, texels, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return cls(texture, targets, len(reflectances), len(lights), tuple(f[0].line_x for f in folded))

    def parts(self, light: np.ndarray, reflectance_class: int, x_lo: np.ndarray, x_hi: np.ndarray) -> CurveParts:
        """Parts of curves for polygons (n,); raises ValueError where a band of no width is no line of its light."""
        is_line = x_hi <= x_lo
        row = light.astype(np.int64) * self.classes + reflectance_class
        place = np.stack([x_lo, x_hi], axis=1) * (SAMPLES - 1)
        for index in np.unique(light[is_line]):
            chosen = np.flatnonzero(is_line & (light == index))
            apart = np.abs(x_lo[chosen, None] - self.line_x[index])
            if not apart.size or apart.min(axis=1).max() > LINE_TOLERANCE:
                raise ValueError(f"a beam of light {index} has no band width, and lies at none of its emission lines")
            line = apart.argmin(axis=1) + sum(map(len, self.line_x[:index]))
            pair = line * self.classes + reflectance_class
            row[chosen] = self.lights * self.classes + pair // PAIRS
            place[chosen] = (2 * (pair % PAIRS))[:, None] + np.array([0.0, 1.0])
        return CurveParts(row * self.targets, place)

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()
