"""How far a picture is from the reference: one number each for energy, noise, colour and perceived difference.

All but FLIP are taken on linear XYZ before tone mapping, pooled over pixels and channels. The reference is a
Monte Carlo picture itself, so what its own variance adds to a squared error is subtracted:
E[(I − R̂)²] = (I − R)² + var R̂. That the weight 1/(R̂² + ε) is noisy too is an effect of second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

EPSILON_SHARE = 1e-2
"""ε of relMSE = mean[(I−R)²/(R²+ε)] is this times mean(R)², the mean taken over lit pixels and all channels: it then
does not depend on how much darkness surrounds a caustic (nor does darkness itself outweigh it)."""
TRIMMED_SHARE = 1e-3
"""Share of the largest terms that relmse_trimmed leaves out."""
LIT_FLOOR = 1e-4
"""Pixels whose Y exceeds this times the largest are lit."""
LIT_SHARE = 0.1
"""Colour is judged where the reference's Y exceeds this times its mean."""
_GREY_UV = (0.19783, 0.46832)
"""u′v′ of D65, taken for black pixels, which have no colour."""
_FLIP_WHITE = 2.119
"""Luminance that FLIP's ACES curve shows at 85 %, from which FLIP counts its exposures (Andersson et al. 2021, sec.
3.2)."""
_HIGHLIGHT_QUANTILE = 0.999


def lit_mean(xyz: np.ndarray) -> float:
    """Mean over the lit pixels of (H, W, 3) and their channels; 0 for a black picture."""
    luminance = xyz[..., 1]
    lit = luminance > LIT_FLOOR * luminance.max()
    return float(xyz[lit].mean()) if lit.any() else 0.0


@dataclass(frozen=True)
class ReferencePicture:
    """A reference picture, with what relMSE needs of it."""

    xyz: np.ndarray
    """float64 (H, W, 3), linear XYZ."""
    variance: np.ndarray
    """float64 (H, W, 3), of `xyz` as an estimate; zeros when it is exact."""

    @cached_property
    def weight(self) -> np.ndarray:
        """1/(R² + ε), float64 (H, W, 3). All 1 for a black reference."""
        return self._weight(lit_mean(self.xyz))

    @cached_property
    def whole_weight(self) -> np.ndarray:
        """The same with ε from the mean of the whole picture, for relmse_whole."""
        return self._weight(float(self.xyz.mean()))

    def _weight(self, mean: float) -> np.ndarray:
        return 1.0 / (self.xyz**2 + EPSILON_SHARE * mean**2) if mean > 0.0 else np.ones_like(self.xyz)

    @cached_property
    def own_relmse(self) -> float:
        """mean[var R̂/(R̂² + ε)]: the relMSE that the reference itself has, and adds to every other."""
        return float(np.mean(self.weight * self.variance))


def relmse_raw(xyz: np.ndarray, reference_image: ReferencePicture) -> float:
    """mean[(I−R̂)²/(R̂²+ε)], the reference's variance left in."""
    return float(np.mean(reference_image.weight * (xyz - reference_image.xyz) ** 2))


def measure(xyz: np.ndarray, reference_image: ReferencePicture) -> dict[str, float]:
    """All measures of `xyz` (H, W, 3) that `results.Sample.metrics` lists, but FLIP.

    relmse, relmse_whole and nrmse are freed of the reference's variance and never below 0; smape = mean
    |I−R|/(|I|+|R|+√ε), from 0 to 1; chroma = mean distance in CIE 1976 u′v′ over lit pixels.
    """
    difference = xyz - reference_image.xyz
    terms = reference_image.weight * difference**2
    noise = reference_image.weight * reference_image.variance
    raw = float(terms.mean())
    mean = float(reference_image.xyz.mean())
    square = float(np.sum(reference_image.xyz**2))
    total = float(reference_image.xyz.sum())
    floor = np.sqrt(EPSILON_SHARE) * mean
    sums = np.abs(xyz) + np.abs(reference_image.xyz) + floor
    return {
        "relmse": max(raw - reference_image.own_relmse, 0.0),
        "relmse_raw": raw,
        "relmse_trimmed": _trimmed(terms, noise),
        "relmse_whole": max(
            float(np.mean(reference_image.whole_weight * (difference**2 - reference_image.variance))), 0.0
        ),
        "smape": float(np.mean(np.abs(difference) / np.where(sums > 0.0, sums, 1.0))),
        "chroma": _chroma(xyz, reference_image.xyz),
        "nrmse": float(np.sqrt(max(np.sum(difference**2 - reference_image.variance), 0.0) / square)) if square else 0.0,
        "energy_ratio": float(xyz.sum() / total) if total else 0.0,
    }


def _trimmed(terms: np.ndarray, noise: np.ndarray) -> float:
    """Mean without the largest terms, less the reference's noise in those that stay."""
    flat = terms.ravel()
    keep = flat.size - int(np.ceil(TRIMMED_SHARE * flat.size))
    if keep < 1:
        return 0.0
    kept = np.argpartition(flat, keep - 1)[:keep]
    return max(float(np.mean(flat[kept] - noise.ravel()[kept])), 0.0)


def _chroma(xyz: np.ndarray, reference: np.ndarray) -> float:
    lit = reference[..., 1] > LIT_SHARE * reference[..., 1].mean()
    if not lit.any():
        return 0.0
    return float(np.mean(np.linalg.norm(_uv(xyz[lit]) - _uv(reference[lit]), axis=-1)))


def _uv(xyz: np.ndarray) -> np.ndarray:
    """CIE 1976 u′v′ of (N, 3); D65's where there is no light."""
    below = xyz @ np.array([1.0, 15.0, 3.0])
    bright = below > 0.0
    safe = np.where(bright, below, 1.0)
    return np.where(bright[:, None], xyz[:, :2] * np.array([4.0, 9.0]) / safe[:, None], _GREY_UV)


def flip(xyz: np.ndarray, reference_image: ReferencePicture) -> float | None:
    """Mean HDR-FLIP on linear Rec.709 (Andersson et al. 2021), 0 to 1; None where the package is missing or nothing is
    lit.

    FLIP takes its exposures from the reference's median, which is black in most caustics: here it is the median of the
    lit pixels, and the 99.9 % quantile stands for the maximum, which in a caustic is a matter of luck.
    """
    try:
        import flip_evaluator
    except ImportError:
        return None
    from ..model.optics.colorimetry import xyz_to_rgb709

    luminance = reference_image.xyz[..., 1]
    lit = luminance[luminance > LIT_SHARE * luminance.mean()]
    if not lit.size:
        return None
    brightest, median = float(np.quantile(lit, _HIGHLIGHT_QUANTILE)), float(np.median(lit))
    exposures = {
        "startExposure": float(np.log2(_FLIP_WHITE / brightest)),
        "stopExposure": float(np.log2(_FLIP_WHITE / median)),
    }
    reference, test = (
        np.ascontiguousarray(np.clip(xyz_to_rgb709(picture), 0.0, None), dtype=np.float32)
        for picture in (reference_image.xyz, xyz)
    )
    _, mean, _ = flip_evaluator.evaluate(reference, test, "HDR", applyMagma=False, parameters=exposures)
    return float(mean)


@dataclass(frozen=True)
class BiasVariance:
    """relMSE of one photon budget split into bias² and variance, over seeds."""

    relmse: float
    bias2: float
    variance: float


def bias_variance(mean_difference: np.ndarray, raw: list[float], reference_image: ReferencePicture) -> BiasVariance:
    """bias² and variance from the mean over n seeds of I − R̂ (H, W, 3) and each seed's relmse_raw.

    With w = 1/(R̂²+ε): V = (Σ raw − n·mean[w D̄²])/(n−1) is the variance of one picture, and
    bias² = mean[w D̄²] − V/n − mean[w var R̂]. Both are unbiased; bias² is cut at 0. One seed gives 0 for both.
    """
    n = len(raw)
    mean_raw = float(np.mean(raw))
    relmse = max(mean_raw - reference_image.own_relmse, 0.0)
    if n < 2:
        return BiasVariance(relmse, 0.0, 0.0)
    of_mean = relmse_of_difference(mean_difference, reference_image)
    variance = max(n * (mean_raw - of_mean) / (n - 1), 0.0)
    return BiasVariance(relmse, max(of_mean - variance / n - reference_image.own_relmse, 0.0), variance)


def relmse_of_difference(difference: np.ndarray, reference_image: ReferencePicture) -> float:
    """mean[w D²] of a difference (H, W, 3)."""
    return float(np.mean(reference_image.weight * difference.astype(np.float64) ** 2))
