"""What the channels of a caustic map mean.

A picture in colour needs the map's XYZ only, unless the camera sees it through glass that disperses: then every
wavelength is looked up at another place, and the map holds coarse spectra beside XYZ. Their bins overlap by half
(tents), so that a pure colour between two of them is a mixture of both and no step shows. A spectral picture has
its own bins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz
from ..model.optics.spectral_tables import SpectralAxis
from ..model.optics.spectrum import Spectrum, cmf_at
from ..model.scene import Light


@dataclass(frozen=True)
class MapChannels:
    """XYZ and W; the same with spectral tents after them; or bins with edges."""

    edges_nm: tuple[float, ...] | None = None
    """Ascending edges of the bins of a spectral picture."""
    tents_nm: tuple[float, ...] = ()
    """Ascending peaks of the tents that follow XYZ and W; the first and the last one's flat sides reach on."""

    @property
    def count(self) -> int:
        """Spectral channels: bins or tents."""
        return len(self.edges_nm) - 1 if self.edges_nm is not None else len(self.tents_nm)

    @property
    def bins(self) -> int | None:
        """Bins of a spectral picture."""
        return self.count if self.edges_nm is not None else None

    @property
    def first_target(self) -> int:
        """Target of the first spectral channel."""
        return 0 if self.edges_nm is not None else 1

    @property
    def targets(self) -> int:
        """RGBA32F targets of the map."""
        return self.first_target + -(-self.count // 4)

    @property
    def power(self) -> slice:
        """Channels whose sum is radiant power, W."""
        return slice(3, 4) if self.edges_nm is None else slice(None)

    @property
    def columns(self) -> int:
        """Channels of the map, unused ones counted."""
        return 4 * self.targets

    def cell_weights(self) -> np.ndarray:
        """What each nanometre cell adds to each channel: float64 (401, columns)."""
        if self.edges_nm is not None:
            weights = np.zeros((len(VISIBLE_NM), self.columns))
            low, high = np.maximum(VISIBLE_NM - 0.5, VISIBLE_NM[0]), np.minimum(VISIBLE_NM + 0.5, VISIBLE_NM[-1])
            edges = np.asarray(self.edges_nm, np.float64)
            overlap = np.minimum(high[:, None], edges[1:]) - np.maximum(low[:, None], edges[:-1])
            weights[:, : self.count] = np.clip(overlap, 0.0, None) / (high - low)[:, None]
            return weights
        return self._padded(np.column_stack([K_M * cmf_xyz(), np.ones(len(VISIBLE_NM))]), VISIBLE_NM)

    def line_weights(self, line_nm: np.ndarray) -> np.ndarray:
        """Weights at exact wavelengths: (lines, columns)."""
        if self.edges_nm is None:
            return self._padded(np.column_stack([K_M * cmf_at(line_nm), np.ones(len(line_nm))]), line_nm)
        edges = np.asarray(self.edges_nm, np.float64)
        weights = np.zeros((len(line_nm), self.columns))
        at = np.searchsorted(edges, line_nm, side="right") - 1
        at = np.where(line_nm == edges[-1], len(edges) - 2, at)
        inside = (at >= 0) & (at < len(edges) - 1)
        weights[np.flatnonzero(inside), at[inside]] = 1.0
        return weights

    def coordinate(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Where on the row of spectral channels wavelengths lie: channel k is touched from k − 1 (tents; bins: k) to
        k + 1."""
        marks = self.edges_nm if self.edges_nm is not None else self.tents_nm
        if len(marks) < 2:
            return np.zeros_like(wavelength_nm)
        return np.interp(wavelength_nm, marks, np.arange(len(marks)))

    def spectra(self, lights: Sequence[Light]) -> list[Spectrum]:
        """Spectral density of one watt in each spectral channel: the lights' own, within it."""
        power = (
            np.sum([light.spectral_power.density for light in lights], axis=0) if lights else np.zeros(len(VISIBLE_NM))
        )
        lines = [line for light in lights for line in light.spectral_power.lines]
        line_nm, line_power = np.array(lines, float).reshape(-1, 2).T
        first = 4 * self.first_target
        cells, at_lines = (
            self.cell_weights()[:, first : first + self.count],
            self.line_weights(line_nm)[:, first : first + self.count],
        )
        spectra = []
        for k in range(self.count):
            density, weights = power * cells[:, k], line_power * at_lines[:, k]
            total = float(density.sum() + weights.sum())
            if total <= 0.0:
                density, weights, total = cells[:, k], np.zeros(len(line_nm)), max(float(cells[:, k].sum()), 1e-30)
            kept = tuple((float(nm), float(w / total)) for nm, w in zip(line_nm, weights, strict=True) if w > 0.0)
            spectra.append(Spectrum(density / total, kept))
        return spectra

    def _padded(self, xyzw: np.ndarray, nm: np.ndarray) -> np.ndarray:
        weights = np.zeros((len(nm), self.columns))
        weights[:, :4] = xyzw
        for k in range(self.count):
            weights[:, 4 + k] = np.interp(nm, self.tents_nm, np.eye(self.count)[k])
        return weights


def tents(axis: SpectralAxis, count: int) -> MapChannels:
    """XYZ, W and `count` tents, evenly spaced where the indices change."""
    return MapChannels(tents_nm=tuple(float(nm) for nm in axis.nm_of_samples(count)))
