"""Float64 reference of shaders/lib/tone.glsl and highlights.glsl: from linear Rec.709 to what a display shows."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

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


def bending(rgb: Array) -> Array:
    """By how much (…,) a colour lies beyond where the curve begins to bend, by the gamut's knee or by the shoulder;
    negative: it stays as it is."""
    grey = np.maximum(luminance_709(rgb), 1e-30)[..., None]
    return np.maximum(p_norm(np.maximum(1.0 - rgb / grey, 0.0)) - 0.8, p_norm(np.maximum(rgb, 0.0)) / 3.0**0.2 - 0.5)


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


def exposed_norm(rgb: Array) -> Array:
    """Norm (…,) of colours (…, 3): of a grey its value."""
    return p_norm(np.maximum(rgb, 0.0)) / 3.0**0.2


class Step(NamedTuple):
    """Within a pixel: colours (3,) and norms of its two sides, and how much they are seen to differ."""

    bright: Array
    dark: Array
    high: float
    low: float
    contrast: float

    @property
    def weight(self) -> float:
        """How far its brighter side is overexposed."""
        return min(max(self.high - 1.0, 0.0), 1.0)


def step_between(pixel: Array, before: tuple[Array, Array], after: tuple[Array, Array]) -> Step | None:
    """The step within a pixel between two pixels before it and two after it (the nearer one first); None where
    brightness does not rise or fall all the way."""
    sides = sorted((before, after), key=lambda side: float(exposed_norm(side[0])))
    own = float(exposed_norm(pixel))
    colours, norms = [], []
    for (near, far), is_bright in zip(sides, (False, True), strict=True):
        n_near, n_far = float(exposed_norm(near)), float(exposed_norm(far))
        if (n_near > own) != is_bright or n_near == own:
            return None
        if is_bright:
            way, slope = (1.0 / (1.0 + a) - 1.0 / (1.0 + b) for a, b in ((own, n_near), (n_near, n_far)))
        else:
            way, slope = own - n_near, n_near - n_far
        flat = 1.0 - min(4.0 * max(slope, 0.0) / way, 1.0)
        colours.append(pixel + flat * (near - pixel))
        norms.append(own + flat * (n_near - own))
    contrast = norms[1] / (1.0 + norms[1]) - norms[0] / (1.0 + norms[0])
    return Step(colours[1], colours[0], norms[1], norms[0], contrast)


def antialiased(exposed: Array, curve: Callable[[Array], Array]) -> Array:
    """A picture (H, W, 3), display white at 1, through a tone curve that is straight across steps at what is
    overexposed: pixel by pixel."""
    padded = np.pad(exposed, ((2, 2), (2, 2), (0, 0)), mode="edge")
    shown = curve(exposed)
    for row in range(len(exposed)):
        for column in range(exposed.shape[1]):
            pixel, found = exposed[row, column], []
            for down, right in ((0, 1), (1, 0)):
                line = [padded[row + 2 + k * down, column + 2 + k * right] for k in (-2, -1, 1, 2)]
                step = step_between(pixel, (line[1], line[0]), (line[2], line[3]))
                if step is not None and step.contrast > 0.0:
                    found.append(step)
            if not found:
                continue
            step = max(found, key=lambda step: step.contrast)
            share = min(max((float(exposed_norm(pixel)) - step.low) / max(step.high - step.low, 1e-20), 0.0), 1.0)
            straight = share * curve(step.bright) + (1.0 - share) * curve(step.dark)
            bent = curve(share * step.bright + (1.0 - share) * step.dark)
            shown[row, column] *= 1.0 + step.weight * (np.minimum(straight / np.maximum(bent, 1e-6), 1.0) - 1.0)
    return with_dots(exposed, shown)


def glint_share(norm: float, around: float) -> float:
    """Of what is shown of an overexposed pixel, where the brightest of those beside it has the norm `around`."""
    return 0.135 * min(max(norm - 1.0, 0.0), 1.0) * min(max(2.0 - 2.0 * around, 0.0), 1.0)


def with_dots(exposed: Array, shown: Array) -> Array:
    """`shown` with some of each overexposed pixel on the one at its side, the brightest one's, where no more than three
    in a row are overexposed on each line through it."""
    sides = ((0, 1), (1, 0), (0, -1), (-1, 0))
    norm = np.pad(exposed_norm(exposed), 4, mode="edge")

    def at_way(at: tuple[int, int], down: int, right: int) -> float:
        return norm[at[0] + 4 + down, at[1] + 4 + right]

    dotted = shown.copy()
    for row in range(len(exposed)):
        for column in range(exposed.shape[1]):
            own = shown[row, column]
            for down, right in sides:
                at = min(max(row + down, 0), len(exposed) - 1), min(max(column + right, 0), exposed.shape[1] - 1)
                behind = min(at_way(at, k * down, k * right) for k in (1, 2, 3))
                lines = ((right, down), (down + right, right + down), (down - right, right - down))
                ends = max(
                    min(
                        max(at_way(at, i * one, i * other), at_way(at, -j * one, -j * other))
                        for i in (1, 2, 3)
                        for j in range(1, 5 - i)
                    )
                    for one, other in lines
                )
                around = max(at_way((row, column), 0, 0), behind, ends)
                share = glint_share(at_way(at, 0, 0), around)
                brighter = own + share * np.maximum(shown[at] - own, 0.0)
                dotted[row, column] = np.maximum(dotted[row, column], brighter)
    return dotted
