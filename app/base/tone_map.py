"""Scene-referred linear Rec.709 to display sRGB, without clipping channel by channel.

Caustics are the hardest pictures there are for a tone curve: spectral colours far outside
Rec.709 (strongly negative channels) next to highlights many stops above the paper. Clipping
each channel on its own turns both into flat patches of the wrong hue. Here a colour only ever
moves along straight lines to black or to grey, so its dominant wavelength stays:

1. exposure: stops;
2. into the gamut: towards the grey of the same luminance, until no channel is negative;
3. a shoulder on the colour's norm, which keeps its chromaticity and cannot reach white;
4. bleaching: far above display white colours fade towards white, as film does.

The gamut's border is rounded (p-norms in place of minimum and maximum): with its sharp corners
every sweep through the spectrum shows dark lines at the hues of the primaries and bright ones
between. Colours well inside the gamut and below the shoulder come out exactly as they are.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .highlights import find_glints, find_steps, largest_channel

LUMINANCE_709 = np.array([0.2126390, 0.7151687, 0.0721923], np.float32)
"""Y of linear Rec.709 (ITU-R BT.709-6, primaries and D65 white to seven digits)."""

SHOULDER_START = 0.5
"""Norm of a colour up to which the tone curve is the identity (the norm of a grey is its value)."""
BLEACH = 12.0
"""Excess over the shoulder's start, in units of its length, at which a colour has faded by 0.35."""
GAMUT_KNEE = 0.8
"""Share of the distance from grey to the gamut's border up to which colours stay as they are."""
CORNER_POWER = 5
"""Roundness of the gamut's corners: large is sharp."""
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
    of the frame is black, the median to how deep the shadows are.
    """
    lit = luminance(np.asarray(rgb, np.float32)).ravel()
    lit = lit[np.isfinite(lit) & (lit > 0)].astype(np.float64)
    if lit.size == 0:
        return 0.0
    lit = lit[lit >= 1e-4 * np.percentile(lit, 99.0)]
    lit = lit[lit >= 0.05 * np.median(lit)]
    key_ev = np.log2(0.18) - np.mean(np.log2(lit))
    highlight_ev = np.log2(8.0) - np.log2(np.percentile(lit, 99.5))
    return float(min(key_ev, highlight_ev))


def to_display(rgb: np.ndarray, exposure_ev: float, antialias: bool = False) -> np.ndarray:
    """Linear display RGB in [0, 1], float32 (…, 3), of scene colours `rgb` (…, 3).

    `exposure_ev` is absolute: scene values are multiplied by 2^exposure_ev first. Pixels that
    are not finite come out as `NOT_FINITE_RGB`. `antialias`: of a picture (H, W, 3), edges of what is overexposed have
    no steps (`highlights`).
    """
    scene = np.asarray(rgb, np.float32)
    finite = np.isfinite(scene[..., 0]) & np.isfinite(scene[..., 1]) & np.isfinite(scene[..., 2])
    # Products of float32 must not overflow however bright a firefly is.
    limit = np.float32(1e30)
    exposed = np.where(finite[..., None], np.clip(scene, -limit, limit), np.float32(0))
    gain = np.float32(np.clip(2.0 ** float(np.clip(exposure_ev, -60, 60)), 1e-18, 1e18))
    exposed = np.clip(exposed * gain, -limit, limit)
    # Most pixels of many caustics are black, and stay so.
    lit = (exposed[..., 0] != 0) | (exposed[..., 1] != 0) | (exposed[..., 2] != 0)
    display = np.zeros_like(exposed)
    display[lit] = _roll_off(into_gamut(exposed[lit]))
    if antialias:
        _antialias(display, exposed, lit)
    display[~finite] = NOT_FINITE_RGB
    return display


def srgb_oetf(linear: np.ndarray) -> np.ndarray:
    """sRGB encoding (IEC 61966-2-1) of linear values in [0, 1]."""
    curve = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curve)


def srgb_eotf(encoded: np.ndarray) -> np.ndarray:
    """Inverse of `srgb_oetf`."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0.04045) + 0.055) / 1.055) ** 2.4)


@cache
def _encoding_table() -> np.ndarray:
    """8-bit sRGB code of i / 65535: twenty entries a code where the curve is steepest."""
    return np.rint(255 * srgb_oetf(np.linspace(0.0, 1.0, 65536))).astype(np.uint8)


def tone_map_8bit(rgb: np.ndarray, exposure_ev: float, antialias: bool = False) -> np.ndarray:
    """Display picture uint8 (…, 3) of linear Rec.709 scene colours; `exposure_ev`, `antialias` as in `to_display`."""
    display = to_display(rgb, exposure_ev, antialias)
    return _encoding_table()[np.rint(display * np.float32(65535)).astype(np.uint16)]


def _antialias(display: np.ndarray, exposed: np.ndarray, lit: np.ndarray) -> None:
    """Show pixels with a step at something overexposed by what either side covers, and single overexposed ones as
    dots."""
    norm = np.zeros(lit.shape, np.float32)
    norm[lit] = _p_norm(np.maximum(exposed[lit], 0))[..., 0] * np.float32(3 ** (-1 / CORNER_POWER))
    steps = find_steps(exposed, norm)
    bright, dark, mixed = (_roll_off(into_gamut(side)) for side in (steps.bright, steps.dark, steps.mixed))
    straight = dark + steps.share * (bright - dark)
    fall = np.minimum(straight / np.maximum(mixed, np.float32(1e-6)), 1)
    display[steps.rows, steps.columns] *= 1 + steps.weight * (fall - 1)
    glints = find_glints(norm)
    own, bright = display[glints.rows, glints.columns], display[tuple(glints.bright)]
    np.maximum.at(display, (glints.rows, glints.columns), own + glints.share * np.maximum(bright - own, 0))


def _p_norm(channels: np.ndarray) -> np.ndarray:
    """(Σ c^p)^(1/p) over the last axis of non-negative values, kept as an axis of length 1."""
    largest = np.maximum(largest_channel(channels), np.float32(1e-30))[..., None]
    powers = (channels / largest) ** CORNER_POWER
    return largest * (powers[..., 0] + powers[..., 1] + powers[..., 2])[..., None] ** np.float32(1 / CORNER_POWER)


def into_gamut(rgb: np.ndarray) -> np.ndarray:
    """Move colours towards the grey of their luminance until no channel is negative."""
    grey = np.maximum(luminance(rgb), np.float32(1e-30))[..., None]
    # How far the colour lies from grey; the gamut's border is at 1, its corners just beyond.
    depth = _p_norm(np.maximum(1 - rgb / grey, 0))
    over = np.maximum(depth - np.float32(GAMUT_KNEE), 0) / np.float32(1 - GAMUT_KNEE)
    limited = np.minimum(depth, np.float32(GAMUT_KNEE)) + np.float32(1 - GAMUT_KNEE) * (over / (1 + over))
    # The last maximum only removes rounding and negative light.
    return np.maximum(grey + limited / np.maximum(depth, np.float32(1e-30)) * (rgb - grey), 0)


def _roll_off(rgb: np.ndarray) -> np.ndarray:
    """Non-negative colours into [0, 1]: a hyperbolic shoulder on the norm, then bleaching."""
    start = np.float32(SHOULDER_START)
    # Scaled so that the norm of a grey is its value.
    norm = _p_norm(rgb) * np.float32(3 ** (-1 / CORNER_POWER))
    over = np.maximum(norm - start, 0) / (1 - start)
    shown = np.minimum(norm, start) + (1 - start) * (over / (1 + over))
    faded = (over / (over + np.float32(BLEACH))) ** np.float32(1.5)
    chroma = rgb * (shown / np.maximum(norm, np.float32(1e-30)))
    display = chroma + faded * (shown - chroma)
    # A pure primary's largest channel exceeds its norm by up to 3^(1/p).
    return display / np.maximum(largest_channel(display), 1)[..., None]
