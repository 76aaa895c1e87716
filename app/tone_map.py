"""Scene-referred linear Rec.709 to display sRGB, without clipping channel by channel.

Caustics are the hardest pictures there are for a tone curve: spectral colours far outside
Rec.709 (strongly negative channels) next to highlights many stops above the paper. Clipping
each channel on its own turns both into flat patches of the wrong hue. Here a colour only ever
moves along the straight line between itself and the grey of the same luminance, which keeps its
dominant wavelength, and along the line through black, which keeps its chromaticity:

1. exposure, 2. into the gamut from below (no negative channel), 3. a shoulder for luminance,
4. into the gamut from above (no channel over one): bright colours bleach towards white.

Both gamut steps have a soft knee: colours well inside stay as they are, colours outside keep
their order instead of piling up on the border.
"""

from __future__ import annotations

import numpy as np

LUMINANCE_709 = np.array([0.2126390, 0.7151687, 0.0721923], np.float32)
"""Y of linear Rec.709 (ITU-R BT.709-6, primaries and D65 white to seven digits)."""

SHOULDER_START = 0.5
"""Display luminance up to which the tone curve is the identity."""
GAMUT_KNEE = 0.9
"""Share of the distance from grey to the gamut's border up to which colours stay as they are."""
NOT_FINITE_RGB = (1.0, 0.0, 1.0)
"""Magenta: a broken pixel must be seen, not hidden."""


def luminance(rgb: np.ndarray) -> np.ndarray:
    """Luminance (…,) of linear Rec.709 colours (…, 3), in their unit."""
    return rgb @ LUMINANCE_709.astype(rgb.dtype)


def auto_exposure(rgb: np.ndarray) -> float:
    """Exposure in EV (stops) that shows the picture `rgb` (H, W, 3) well; 0 when it is black.

    The logarithmic mean of the lit pixels becomes middle grey (0.18), unless the brightest
    caustics (99.5th percentile) would then lie more than three stops above display white: those
    must keep their drawing. Percentiles make it indifferent to single fireflies and to how much
    of the frame is black.
    """
    lit = luminance(np.asarray(rgb, np.float32)).ravel()
    lit = lit[np.isfinite(lit) & (lit > 0)]
    if lit.size == 0:
        return 0.0
    lit = lit[lit > 1e-3 * np.percentile(lit, 99.0)].astype(np.float64)
    key_ev = np.log2(0.18) - np.mean(np.log2(lit))
    highlight_ev = np.log2(8.0) - np.log2(np.percentile(lit, 99.5))
    return float(min(key_ev, highlight_ev))


def to_display(rgb: np.ndarray, exposure_ev: float) -> np.ndarray:
    """Linear display RGB in [0, 1], float32 (…, 3), of scene colours `rgb` (…, 3).

    `exposure_ev` is absolute: scene values are multiplied by 2^exposure_ev first. Pixels that
    are not finite come out as `NOT_FINITE_RGB`.
    """
    scene = np.asarray(rgb, np.float32)
    finite = np.isfinite(scene).all(axis=-1)
    # Products of float32 must not overflow however bright a firefly is.
    limit = np.float32(1e30)
    exposed = np.where(finite[..., None], np.clip(scene, -limit, limit), np.float32(0))
    gain = np.float32(np.clip(2.0**float(np.clip(exposure_ev, -60, 60)), 1e-18, 1e18))
    exposed = np.clip(exposed * gain, -limit, limit)
    inside = _desaturate_to_positive(exposed)
    grey = luminance(inside)
    shown = _shoulder(grey)
    scale = np.divide(shown, grey, out=np.zeros_like(grey), where=grey > 0)
    display = _desaturate_to_white(inside * scale[..., None], shown)
    display[~finite] = NOT_FINITE_RGB
    return display


def srgb_oetf(linear: np.ndarray) -> np.ndarray:
    """sRGB encoding (IEC 61966-2-1) of linear values in [0, 1]."""
    curve = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curve)


def srgb_eotf(encoded: np.ndarray) -> np.ndarray:
    """Inverse of `srgb_oetf`."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0.04045) + 0.055) / 1.055) ** 2.4)


def tone_map_8bit(rgb: np.ndarray, exposure_ev: float) -> np.ndarray:
    """Display picture uint8 (…, 3) of linear Rec.709 scene colours; `exposure_ev` as in `to_display`."""
    return np.rint(srgb_oetf(to_display(rgb, exposure_ev)) * np.float32(255)).astype(np.uint8)


def _soft_limit(ratio: np.ndarray) -> np.ndarray:
    """Identity up to `GAMUT_KNEE`, then smoothly towards 1 (once differentiable, strictly monotone)."""
    room = np.float32(1 - GAMUT_KNEE)
    over = np.maximum(ratio - np.float32(GAMUT_KNEE), 0) / room
    return np.minimum(ratio, np.float32(GAMUT_KNEE)) + room * (over / (1 + over))


def _desaturate_to_positive(rgb: np.ndarray) -> np.ndarray:
    """Move colours towards the grey of their luminance until no channel is negative."""
    grey = np.maximum(luminance(rgb), 0)[..., None]
    # How far the lowest channel lies below grey; 1 is the gamut's border.
    depth = np.divide(grey - rgb.min(axis=-1, keepdims=True), grey, out=np.zeros_like(grey), where=grey > 0)
    depth = np.maximum(depth, 0)
    keep = np.divide(_soft_limit(depth), depth, out=np.ones_like(depth), where=depth > 0)
    # The last maximum only removes rounding.
    return np.where(grey > 0, np.maximum(grey + keep * (rgb - grey), 0), 0).astype(np.float32)


def _shoulder(grey: np.ndarray) -> np.ndarray:
    """Tone curve for luminance: identity to `SHOULDER_START`, then a hyperbola that tends to 1."""
    start = np.float32(SHOULDER_START)
    over = np.maximum(grey - start, 0) / (1 - start)
    return np.minimum(grey, start) + (1 - start) * (over / (1 + over))


def _desaturate_to_white(rgb: np.ndarray, grey: np.ndarray) -> np.ndarray:
    """Move colours (luminance `grey`, below 1) towards grey until no channel exceeds one."""
    grey = grey[..., None]
    room = np.maximum(1 - grey, np.float32(1e-7))
    height = np.maximum(rgb.max(axis=-1, keepdims=True) - grey, 0) / room
    keep = np.divide(_soft_limit(height), height, out=np.ones_like(height), where=height > 0)
    return np.clip(grey + keep * (rgb - grey), 0, 1)
