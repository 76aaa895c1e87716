"""What the channels of a picture mean: linear Rec.709, or watts in spectral bins.

The camera's shader adds up channels and knows nothing else about them. Here is what a watt of each wavelength adds to
them, and how the sums that come back become linear Rec.709.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..gpu.map_channels import MapChannels
from ..model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, rgb_basis, xyz_to_rgb709


@dataclass(frozen=True)
class Channels:
    """Linear Rec.709 (`edges_nm` None, radiance in lm/(sr unit²)), or bins (W/(sr unit²) in each)."""

    edges_nm: tuple[float, ...] | None = None
    """Ascending edges of the bins."""

    @property
    def count(self) -> int:
        """Channels in use."""
        return 3 if self.edges_nm is None else len(self.edges_nm) - 1

    @property
    def targets(self) -> int:
        """Groups of four channels, as the caustic map has them."""
        return -(-self.count // 4)

    def observer(self) -> np.ndarray:
        """What a watt at each nanometre adds to each channel: float64 (401, 4·targets)."""
        weights = np.zeros((len(VISIBLE_NM), 4 * self.targets))
        weights[:, : self.count] = xyz_to_rgb709(K_M * cmf_xyz()) if self.edges_nm is None else self._cell_shares()
        return weights

    def of_reflectance(self, rgb: tuple[float, float, float]) -> np.ndarray:
        """Factors (4·targets,) of a surface with linear Rec.709 reflectance `rgb`."""
        return self._padded(
            np.asarray(rgb, float) if self.edges_nm is None else self._mean(rgb_basis() @ np.asarray(rgb, float))
        )

    def to_rgb709(self, values: np.ndarray) -> np.ndarray:
        """(…, ≥ count) channel sums → linear Rec.709 float32 (…, 3), negatives kept."""
        used = values[..., : self.count]
        if self.edges_nm is None:
            return np.ascontiguousarray(used, np.float32)
        return self.to_spectral(values) @ self._rgb_of_bins()

    def to_spectral(self, values: np.ndarray) -> np.ndarray:
        """(…, ≥ count) channel sums → float32 (…, bins)."""
        return np.ascontiguousarray(values[..., : self.count], np.float32)

    def _rgb_of_bins(self) -> np.ndarray:
        """Linear Rec.709 of a watt spread evenly over each bin: float32 (bins, 3)."""
        xyz = np.stack([self._mean(column) for column in K_M * cmf_xyz().T], axis=-1)
        return xyz_to_rgb709(xyz).astype(np.float32)

    def _cell_shares(self) -> np.ndarray:
        """Share of each nanometre cell in each bin, (401, bins)."""
        return MapChannels(self.edges_nm).cell_weights()[:, : self.count]

    def _mean(self, spectral: np.ndarray) -> np.ndarray:
        """Mean over each bin of a function on `VISIBLE_NM`."""
        shares = self._cell_shares()
        return (spectral @ shares) / np.maximum(shares.sum(axis=0), 1e-12)

    def _padded(self, values: np.ndarray) -> np.ndarray:
        padded = np.zeros(4 * self.targets)
        padded[: len(values)] = values
        return padded
