"""The spectral tables of pictures in motion, written by the device: after an edit of a glass only the ends of the bands
and where x lies are uploaded. Without bins, in the float32 of the shaders; `SplatTables.build` is exact."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from ..features.program_switches import Defines
from ..model.optics.colorimetry import VISIBLE_NM
from ..model.optics.spectral_tables import SpectralAxis
from ..model.optics.spectrum import Spectrum
from . import shader
from .growing import filled
from .map_channels import MapChannels
from .running_sums import RunningSums, SumRow
from .splat_tables import (
    CUMULATIVE_SAMPLES,
    CUT,
    DENSITY_CELLS,
    FINEST,
    LEAST_WIDTH,
    MOST_LAYERS,
    SIGMAS,
    SplatTables,
    cells_of_row,
    table_texture,
)

_SPAN = np.dtype([("ends", "f4", 2), ("row", "u4"), ("there", "u4")])
_GROUP = 64


class DeviceTables:
    """Owns what the lights' spectra under each reflectance decide; the tables are the caller's."""

    def __init__(
        self, ctx: moderngl.Context, lights: Sequence[Spectrum], reflectances: Sequence[np.ndarray | None]
    ) -> None:
        self._ctx, self._shape = ctx, (len(lights), len(reflectances))
        channels, rows = MapChannels(), []
        for light in lights:
            line_nm = np.array(light.lines, float).reshape(-1, 2)[:, 0]
            for reflectance in reflectances:
                folded = np.ones(len(VISIBLE_NM)) if reflectance is None else np.asarray(reflectance, float)
                at_lines = channels.line_weights(line_nm) * np.interp(line_nm, VISIBLE_NM, folded)[:, None]
                rows.append(SumRow.of(light, channels.cell_weights() * folded[:, None], at_lines))
        self._sums = RunningSums(ctx, rows)
        self._spans: moderngl.Buffer | None = None
        self._widths = ctx.buffer(np.array([(sigma, cells_of_row(sigma)) for sigma in SIGMAS], "f4"))
        of_bands: Defines = {"WIDTH": LEAST_WIDTH, "FINEST": FINEST, "CUT": CUT}
        of_curves: Defines = {"SAMPLES": CUMULATIVE_SAMPLES, "CELLS": DENSITY_CELLS}
        self._bands = shader.compute(ctx, "light/splat_tables.comp", self._sums.defines | of_bands)
        self._curves = shader.compute(ctx, "light/splat_curves.comp", self._sums.defines | of_curves)

    def tables(
        self, axis: SpectralAxis, bands: Sequence[Sequence[tuple[float, float]]], into: SplatTables | None
    ) -> SplatTables:
        """As of `SplatTables.build`, `LEAST_WIDTH` samples wide."""
        lights, classes = self._shape
        count = max(len(of_light) for of_light in bands)
        spans = np.zeros((lights, classes, count), _SPAN)
        for i, of_light in enumerate(bands):
            spans["ends"][i, :, : len(of_light)], spans["there"][i, :, : len(of_light)] = of_light, 1
        spans["row"] = np.arange(lights * classes).reshape(lights, classes, 1)
        self._spans = filled(self._ctx, self._spans, spans)
        if into is None or (into.classes, into.bands, into.first_power) != (classes, count, spans.size):
            shader.release(into)
            into = self._empty(spans.size, count)
        self._ctx.memory_barrier()
        self._sums.bind(axis)
        for binding, buffer in enumerate((self._spans, self._widths, into.band_buffer, into.integral_buffer), start=2):
            buffer.bind_to_storage_buffer(binding)
        into.texture.bind_to_image(0, read=False, write=True)
        self._bands.run(len(SIGMAS), spans.size)
        for binding, buffer in enumerate((into.band_buffer, into.density_buffer, into.cumulative_buffer), start=2):
            buffer.bind_to_storage_buffer(binding)
        self._curves["first_power"].value = 4 * into.first_power
        self._curves.run(-(-CUMULATIVE_SAMPLES // _GROUP), lights * classes)
        self._ctx.memory_barrier()
        return into

    def _empty(self, spectra: int, bands: int) -> SplatTables:
        ctx, rows = self._ctx, self._shape[0] * self._shape[1]
        layers = min(spectra, MOST_LAYERS)
        stacked = -(-spectra // layers)
        powers = -(-rows * CUMULATIVE_SAMPLES // 4)
        return SplatTables(
            table_texture(ctx, (LEAST_WIDTH, stacked * len(SIGMAS), layers)),
            ctx.buffer(reserve=16 * (spectra + powers)),
            ctx.buffer(reserve=48 * spectra),
            ctx.buffer(reserve=16 * rows * DENSITY_CELLS),
            ctx.buffer(reserve=16 * rows * CUMULATIVE_SAMPLES),
            first_power=spectra,
            classes=self._shape[1],
            bands=bands,
            targets=1,
            rows=len(SIGMAS),
            width=LEAST_WIDTH,
            layers=layers,
            stacked=stacked,
        )

    def release(self) -> None:
        """Free everything but the tables."""
        shader.release(self._sums, self._spans, self._widths, self._bands, self._curves)
