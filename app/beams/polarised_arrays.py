"""States of polarisation of many finished beams (`polarised`), as numpy arrays: made fit to be interpolated."""

from __future__ import annotations

import numpy as np

from .polygons import parabola_at


def from_one_axis(state: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """States (M, 3, 6) counted from the axis at the middle of the band, whose rays run along `direction` (M, 3): so
    that they may be interpolated."""
    axis = state[:, 1, None, 3:]
    along = np.einsum("mak,mbk->ma", state[..., 3:], axis)
    across_axis = np.einsum("mak,mbk->ma", np.cross(direction[:, None], state[..., 3:]), axis)
    size = np.maximum(along**2 + across_axis**2, 1e-30)
    cosine, sine = (along**2 - across_axis**2) / size, 2.0 * along * across_axis / size
    q, u = cosine * state[..., 0] + sine * state[..., 1], cosine * state[..., 1] - sine * state[..., 0]
    return np.concatenate([q[..., None], u[..., None], state[..., 2:3], np.broadcast_to(axis, (*q.shape, 3))], axis=-1)


def bounded(stokes: np.ndarray) -> np.ndarray:
    """Stokes parameters (…, 3), at most wholly polarised."""
    return stokes / np.maximum(np.linalg.norm(stokes, axis=-1, keepdims=True), 1.0)


def across(axis: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Axes (n, 3) made unit vectors across directions (n, 3) near those they belong to."""
    axis = axis - np.einsum("ni,ni->n", axis, direction)[:, None] * direction
    return axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-30)


def stokes_over_band(state: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Stokes parameters (n, 3, 3) of states (n, 3, 6) at three places t (n, 3) of their bands, by parabolas."""
    return bounded(np.stack([parabola_at(state[..., :3], t[:, k]) for k in range(3)], axis=1))
