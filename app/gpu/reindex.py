"""Photons by index instead of by wavelength: what an edited glass sends along the paths that were traced.

Where one glass alone disperses, a path is a function of its index. Photons of a band stand for an interval of it; after
an edit of n(λ) the same interval belongs to other wavelengths, and those are what its photons carry then. Positions
stay as exact as they were traced, bands keep meeting each other, and nothing is extrapolated except where the edited
glass reaches indices that no band had. A local gain (the brush) is an edit of n(λ) that differs from place to place.

The coordinate of the spectral tables is then y, affine in the index of the glass that is shown: 0 at 380 nm, 1 at 780
nm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import moderngl
import numpy as np

from ..model.optics.glass import LINE_D_NM, Dispersion, with_gain
from ..model.optics.spectral_tables import SpectralAxis
from ..model.optics.spectrum import Spectrum
from .growing import filled

Spans = list[list[tuple[float, float]]]
"""Ends of each light's bands in some spectral coordinate, ascending."""

MIN_GAIN = 1e-4
"""A glass without dispersion is shown with so much of the traced one's: one index would be no interval."""
_BIND_BANDS = 11


@dataclass(frozen=True)
class Reindexing:
    """The coordinate y of the glass that is shown, by the index n of the path: y = offset + scale · n."""

    axis: SpectralAxis
    """y by the wavelength; it may be constant where n is."""
    offset: float
    scale: float
    y_reference: float
    """y of the d line."""
    traced: Dispersion

    @classmethod
    def of(cls, traced: Dispersion, shown: Dispersion) -> Reindexing | None:
        """For paths that were traced through `traced`; None where n of either is no monotone function of λ, or they run
        opposite ways."""
        if not shown.is_dispersive:
            shown = with_gain(traced, MIN_GAIN * traced.gain)
        axes = [SpectralAxis.build([glass]) for glass in (traced, shown)]
        if any(len(turning) > 2 for axis in axes for turning in axis.turning_nm):
            return None
        ends = np.array([380.0, 780.0])
        n, n_new = traced.index(ends), shown.index(ends)
        span = float(n_new[1] - n_new[0])
        if span * (n[1] - n[0]) <= 0.0:
            return None
        axis = replace(axes[1], fill=0.0) if axes[1].fill else axes[1]
        return cls(axis, -float(n_new[0]) / span, 1.0 / span, float(axis.x_of_nm(LINE_D_NM)), traced)

    def y(self, n: float) -> float:
        """Coordinate of an index."""
        return self.offset + self.scale * n

    def supports(self, lights: Sequence[Spectrum]) -> list[tuple[float, float]]:
        """y of the ends of each light's spectrum."""
        ends = [light.support_nm() for light in lights]
        nm = [(lo, hi) if hi - lo < 1e-6 else (max(lo - 0.5, 380.0), min(hi + 0.5, 780.0)) for lo, hi in ends]
        return [(float(lo), float(hi)) for lo, hi in self.axis.x_of_nm(np.array(nm).reshape(-1, 2))]

    def spans(self, traced: Spans, axis: SpectralAxis, supports: Sequence[tuple[float, float]]) -> Spans:
        """The bands' intervals of y, cut to their light's spectrum (`supports`), the outermost stretched to its ends.

        `traced`: in the coordinate of `axis`, photons' own. A band wholly beyond the spectrum keeps its interval, in
        which there is no light.
        """
        edges = np.array([edge for bands in traced for edge in bands])
        indices = iter(self.offset + self.scale * self.traced.index(axis.nm_of_x(edges)))
        shown: Spans = []
        for bands, (low, high) in zip(traced, supports, strict=True):
            row = []
            for k, (lo, hi) in enumerate(bands):
                a, b = (float(y) for y in next(indices))
                if hi - lo < 1e-9:
                    row.append((low, high))
                    continue
                a = low if k == 0 and (b > low) else a
                b = high if k == len(bands) - 1 and (a < high) else b
                overlaps = a < high and b > low
                row.append((max(a, low), min(b, high)) if overlaps else (a, b))
            shown.append(row)
        return shown


class ReindexBuffer:
    """What footprint.comp needs to know of every band: two vec4 a table."""

    def __init__(
        self,
        ctx: moderngl.Context,
        reindexing: Reindexing,
        traced: Spans,
        supports: Sequence[tuple[float, float]],
        classes: int,
        into: ReindexBuffer | None = None,
    ) -> None:
        """`classes`: reflectance classes of the tables; bands are padded to the light that has most, as the tables
        are. `into`: one that is of no use any more, whose buffer becomes this one's."""
        count = max(len(bands) for bands in traced)
        rows = np.zeros((len(traced), classes, count, 2, 4), np.float32)
        for i, (bands, support) in enumerate(zip(traced, supports, strict=True)):
            for k, ends in enumerate(bands):
                rows[i, :, k, 0] = (*ends, *support)
                rows[i, :, k, 1, :2] = (k == 0, k == len(bands) - 1)
        self.reindexing = reindexing
        self._buffer: moderngl.Buffer = filled(ctx, None if into is None else into._buffer, rows)

    def bind(self) -> None:
        """To the place that footprint.comp reads."""
        self._buffer.bind_to_storage_buffer(_BIND_BANDS)

    def release(self) -> None:
        """Free the buffer."""
        self._buffer.release()
