"""Float64 reference of shaders/lib/tone.glsl: from linear Rec.709 to what a display shows."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
LUMINANCE = np.array([0.2126390, 0.7151687, 0.0721923])


def luminance_709(rgb: Array) -> Array:
    """Y (…,) of linear Rec.709 (…, 3)."""
    return rgb @ LUMINANCE


def p_norm(channels: Array) -> Array:
    """Fifth root of the sum of fifth powers of non-negative (…, 3), as (…,)."""
    largest = np.maximum(channels.max(axis=-1), 1e-30)
    return largest * np.sum((channels / largest[..., None]) ** 5, axis=-1) ** 0.2


def into_gamut(rgb: Array) -> Array:
    """Non-negative colours (…, 3) of the same luminance and hue; rounded at the gamut's border."""
    grey = np.maximum(luminance_709(rgb), 1e-30)[..., None]
    depth = p_norm(np.maximum(1.0 - rgb / grey, 0.0))[..., None]
    beyond = np.maximum(depth - 0.8, 0.0)
    # With o = beyond/0.2: 0.2·o/(1 + o).
    limited = np.where(depth > 0.8, 0.8 + 0.2 * beyond / (0.2 + beyond), depth)
    return np.maximum(grey + limited / np.maximum(depth, 1e-30) * (rgb - grey), 0.0)


def roll_off(rgb: Array) -> Array:
    """Non-negative colours (…, 3) into [0, 1]."""
    norm = (p_norm(rgb) / 3.0**0.2)[..., None]
    over = np.maximum(2.0 * norm - 1.0, 0.0)
    shown = np.where(norm > 0.5, 0.5 + 0.5 * over / (1.0 + over), norm)
    chroma = rgb * shown / np.maximum(norm, 1e-30)
    display = chroma + (over / (over + 12.0)) ** 1.5 * (shown - chroma)
    return display / np.maximum(display.max(axis=-1, keepdims=True), 1.0)


def tone_spectrasplat(rgb: Array) -> Array:
    """The program's own curve."""
    return roll_off(into_gamut(rgb))


def tone_aces(rgb: Array) -> Array:
    """Hill's fit of ACES, middle grey kept."""
    to_fit = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
    from_fit = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
    v = np.clip(1.8 * rgb @ to_fit.T, 0.0, 1e6)
    fitted = (v**2 + 0.0245786 * v - 0.000090537) / (0.983729 * v**2 + 0.4329510 * v + 0.238081)
    return np.clip(fitted @ from_fit.T, 0.0, 1.0)


def tone_reinhard(rgb: Array) -> Array:
    """Reinhard's extended operator on luminance; white at 8."""
    y = np.maximum(luminance_709(rgb), 0.0)[..., None]
    return np.clip(rgb * (1.0 + y / 8.0**2) / (1.0 + y), 0.0, 1.0)


def srgb_encode(linear: Array) -> Array:
    """sRGB codes 0…1 of linear values in [0, 1]."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (5.0 / 12.0) - 0.055)


def signed_error(shown: Array, reference: Array, floor_value: Array) -> Array:
    """|shown − reference| / (|reference| + floor), signed by luminance."""
    apart = shown - reference
    size = np.sqrt(np.sum(apart**2, axis=-1)) / (np.sqrt(np.sum(reference**2, axis=-1)) + floor_value)
    return np.where(luminance_709(apart) < 0.0, -size, size)
