"""Edges of what is overexposed, as a display shows them without steps.

A pixel's radiance is its mean over the pixel; the tone curve comes after. Where a tenth of a pixel is covered by
something a hundred times brighter than white, the mean is ten times white and the pixel is shown as white as if all of
it were covered: edges have steps. Tone mapped first and averaged then, as by a larger picture made smaller, a tenth of
white would be shown. That is what is found here from the linear picture alone: where what lies on both sides of a pixel
is flat there is a step within it (subcell resolution: Harten 1989, *ENO Schemes with Subcell Resolution*, Journal of
Computational Physics 83), its place is known from the three values, and so is how much of the pixel either side covers.
A tone curve is straight between two such sides, by what they cover, instead of bent between them.

What is smaller than a pixel, such as the sun's image in a curved glass, is one pixel, or two by two, all white and
square: nothing in the picture tells how much of them is covered. It is shown as a lens would, as a dot: a little of
what is shown of it lies on the pixels at its sides. That much is done for what is no wider than three pixels.

Where nothing near is brighter than white nothing changes, nor where brightness has a slope and not a step: spectra,
penumbrae, caustics. Only pictures to look at have it, never linear data. `shaders/lib/highlights.glsl` is the same on
the device.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

WHITE = 1.0
"""Norm (of a grey its value) from which the bright side is overexposed; from twice that all of the correction is
made."""
STEEPNESS = 4.0
"""A side is flat where its own slope is this much less than the way to the pixel."""

GLINT_SPREAD = 0.135
"""Share of a pixel overexposed alone that is shown on each of those beside it: a Gaussian of half a pixel."""


def largest_channel(rgb: np.ndarray) -> np.ndarray:
    """The largest of three channels (…, 3), one by one: numpy takes thirty times as long over an axis of three."""
    return np.maximum(np.maximum(rgb[..., 0], rgb[..., 1]), rgb[..., 2])


@dataclass(frozen=True)
class Glints:
    """n sides of pixels within small groups that are overexposed."""

    rows: np.ndarray
    columns: np.ndarray
    bright: np.ndarray
    """int64 (2, n): row and column of that one."""
    share: np.ndarray
    """float32 (n, 1): of what is shown of it."""


def find_glints(norm: np.ndarray) -> Glints:
    """What lies beside small groups of overexposed pixels of a picture whose colours have these norms (H, W).

    Of a pixel beside two of theirs what becomes brighter counts. A group is small where on each line through its pixel,
    diagonals too, no more than three in a row are above white, surely where those at the ends are below half of it.
    """
    rows, columns = np.nonzero(norm > WHITE)
    over = np.float32(GLINT_SPREAD) * np.clip(norm[rows, columns] / np.float32(WHITE) - 1, 0, 1)
    found: list[tuple[np.ndarray, ...]] = []
    for side in _BESIDE:
        beside = _places(norm, rows, columns, side, 1)
        behind = _darkest(norm, rows, columns, (-side[0], -side[1]))[-1]
        around = [norm[beside], behind]
        for turn in (-1, 0, 1):
            way = (side[1] + turn * side[0], side[0] + turn * side[1])
            ahead, back = _darkest(norm, rows, columns, way), _darkest(norm, rows, columns, (-way[0], -way[1]))
            around.append(np.min([np.maximum(a, b) for a, b in zip(ahead, back[::-1], strict=True)], axis=0))
        share = over * np.clip(2 - 2 * np.max(around, axis=0) / np.float32(WHITE), 0, 1)
        chosen = share > 0
        found.append((*(part[chosen] for part in (*beside, rows, columns)), share[chosen]))
    row, column, bright_row, bright_column, share = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return Glints(row, column, np.stack([bright_row, bright_column]), share[:, None])


_BESIDE = ((0, -1), (-1, 0), (0, 1), (1, 0))


def _places(
    norm: np.ndarray, rows: np.ndarray, columns: np.ndarray, way: tuple[int, int], pixels: int
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels so many along a way from these; at the border there is nothing beyond, but the border's own again."""
    height, width = norm.shape
    return np.clip(rows + pixels * way[0], 0, height - 1), np.clip(columns + pixels * way[1], 0, width - 1)


def _darkest(norm: np.ndarray, rows: np.ndarray, columns: np.ndarray, way: tuple[int, int]) -> np.ndarray:
    """(3, n): the least norm among the next one, two and three pixels along a way."""
    return np.minimum.accumulate([norm[_places(norm, rows, columns, way, k)] for k in (1, 2, 3)], axis=0)


@dataclass(frozen=True)
class Steps:
    """n pixels, each with a step in it."""

    rows: np.ndarray
    columns: np.ndarray
    bright: np.ndarray
    """float32 (n, 3): the colour on the brighter side; on its darker side; of the pixel were it made of both."""
    dark: np.ndarray
    mixed: np.ndarray
    share: np.ndarray
    """float32 (n, 1): of the pixel that the brighter side covers."""
    weight: np.ndarray
    """float32 (n, 1): how far it is overexposed, 0 to 1."""


def find_steps(exposed: np.ndarray, norm: np.ndarray) -> Steps:
    """Steps at what is overexposed in a picture, float32 (H, W, 3) with display white at 1; `norm` (H, W): of each
    colour, at most its largest channel."""
    hot = np.pad(largest_channel(exposed) > WHITE, 1)
    rows, columns = np.nonzero(hot[:-2, 1:-1] | hot[2:, 1:-1] | hot[1:-1, :-2] | hot[1:-1, 2:])
    colour, own = exposed[rows, columns], norm[rows, columns]
    best = np.zeros_like(own)
    bright, dark = colour.copy(), colour.copy()
    high, low = own.copy(), own.copy()
    for down, right in ((0, 1), (1, 0)):
        places = [
            (np.clip(rows + k * down, 0, exposed.shape[0] - 1), np.clip(columns + k * right, 0, exposed.shape[1] - 1))
            for k in (-2, -1, 1, 2)
        ]
        colours, norms = [exposed[place] for place in places], [norm[place] for place in places]
        rises = norms[2] > norms[1]
        a, b = (np.where(rises[:, None], colours[i], colours[3 - i]) for i in (2, 1))
        n_a, n_a2, n_b, n_b2 = (np.where(rises, norms[i], norms[3 - i]) for i in (2, 3, 1, 0))
        # Of the bright side what is seen of its slope counts.
        flat_a = _flatness(_seen(n_a2) - _seen(n_a), _seen(n_a) - _seen(own))
        flat_b = _flatness(n_b - n_b2, own - n_b)
        n_bright, n_dark = own + flat_a * (n_a - own), own + flat_b * (n_b - own)
        contrast = np.where((n_a > own) & (own > n_b), _seen(n_bright) - _seen(n_dark), 0)
        better = contrast > best
        best = np.where(better, contrast, best)
        bright = np.where(better[:, None], colour + flat_a[:, None] * (a - colour), bright)
        dark = np.where(better[:, None], colour + flat_b[:, None] * (b - colour), dark)
        high, low = np.where(better, n_bright, high), np.where(better, n_dark, low)
    share = np.clip((own - low) / np.maximum(high - low, np.float32(1e-20)), 0, 1)[:, None]
    weight = np.clip(high / np.float32(WHITE) - 1, 0, 1)[:, None]
    found = (best > 0) & (weight[:, 0] > 0)
    parts = (rows, columns, bright, dark, dark + share * (bright - dark), share, weight)
    return Steps(*(part[found] for part in parts))


def _seen(norm: np.ndarray) -> np.ndarray:
    """A norm about as a display shows it, 0 to 1."""
    return norm / (1 + norm)


def _flatness(beyond: np.ndarray, within: np.ndarray) -> np.ndarray:
    """1 where the slope beyond a pixel's neighbour is nothing beside the way `within` from the pixel to it."""
    return 1 - np.clip(np.float32(STEEPNESS) * np.maximum(beyond, 0) / np.maximum(within, np.float32(1e-20)), 0, 1)
