"""Running integrals of spectra over the spectral coordinate, as the device evaluates them: after an edit of a glass
only x of the nanometre cells' edges and of the emission lines is uploaded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import moderngl
import numpy as np

from ..features.program_switches import Defines
from ..model.optics.spectral_tables import CELL_EDGES_NM, SpectralAxis
from ..model.optics.spectrum import Spectrum
from . import shader

BIND_KNOTS, BIND_SUMS = 0, 1
KNOTS = len(CELL_EDGES_NM)


@dataclass(frozen=True)
class SumRow:
    """What one running integral is of, in four channels."""

    cells: np.ndarray
    """float64 (401, 4), energy of each nanometre cell."""
    line_nm: np.ndarray
    lines: np.ndarray
    """float64 (lines, 4), energy of each emission line."""

    @staticmethod
    def of(spectrum: Spectrum, cells: np.ndarray, at_lines: np.ndarray) -> SumRow:
        """`spectrum` times weights of its cells (401, 4) and of its lines (lines, 4)."""
        line_nm, power = np.array(spectrum.lines, float).reshape(-1, 2).T
        return SumRow(spectrum.density[:, None] * cells, line_nm, power[:, None] * at_lines)


class RunningSums:
    """Owns the rows and the knots; shaders read them by `lib/running_sums.glsl`."""

    def __init__(self, ctx: moderngl.Context, rows: Sequence[SumRow]) -> None:
        self._line_nm = np.unique(np.concatenate([row.line_nm for row in rows]))
        sums = np.zeros((len(rows), KNOTS + len(self._line_nm), 4), np.float32)
        for values, row in zip(sums, rows, strict=True):
            values[1:KNOTS] = np.cumsum(row.cells, axis=0)
            np.add.at(values, KNOTS + np.searchsorted(self._line_nm, row.line_nm), row.lines)
        self._sums = ctx.buffer(sums)
        self._knots = ctx.buffer(reserve=4 * sums.shape[1])
        self.defines: Defines = {
            "BIND_KNOTS": BIND_KNOTS,
            "BIND_SUMS": BIND_SUMS,
            "SUM_KNOTS": KNOTS,
            "SUM_LINES": len(self._line_nm),
        }

    def bind(self, axis: SpectralAxis) -> None:
        """To the places that shaders read, over x of `axis`."""
        self._knots.write(np.concatenate([axis.cell_edges_x, axis.x_of_lines(self._line_nm)]).astype("f4"))
        self._knots.bind_to_storage_buffer(BIND_KNOTS)
        self._sums.bind_to_storage_buffer(BIND_SUMS)

    def release(self) -> None:
        """Free both."""
        shader.release(self._sums, self._knots)
