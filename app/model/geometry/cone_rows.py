"""Cones of a solid of revolution, cut into rows that taper little.

A facet of a cone has two corners on one ring of the mesh and one on the next. The wider one ring is than the other, the
more unevenly the interpolated normal turns along the facet, and light that it throws is striped by half the taper
however narrow the facets are: more segments make the stripes finer, not weaker. More rows make them weaker.
"""

from __future__ import annotations

import numpy as np

from .mesh import normalised

TAPER = 0.05
"""By how much the radii of a row's two rings may differ, as a share of the smaller one."""
MOST_ROWS = 16
"""Of one cone; towards its tip rows taper more, and throw next to nothing."""
_TIP = 0.1
_SHORTEST = 0.05
"""Of a row, as a share of the largest radius: what a fine profile gives is left as it is."""


def in_rows(
    points: np.ndarray, start: np.ndarray, end: np.ndarray, loop: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The profile (K, 2) of (radius, z) and the normals (K or K - 1, 2) at both ends of its segments, with segments
    that sweep cones cut into rows of at most `TAPER`, or into `MOST_ROWS` of them."""
    begins, ends = points[: len(start)], np.roll(points, -1, axis=0)[: len(start)]
    shortest = _SHORTEST * float(points[:, 0].max())
    cut = [np.concatenate([[0.0], _cuts(a, b, shortest)]) for a, b in zip(begins, ends, strict=True)]
    rows = [len(shares) for shares in cut]
    share = np.concatenate(cut)[:, None]
    following = np.concatenate([np.append(shares[1:], 1.0) for shares in cut])[:, None]
    a, b, low, high = (np.repeat(array, rows, axis=0) for array in (begins, ends, start, end))
    found = (1.0 - share) * a + share * b
    return (
        found if loop else np.vstack([found, points[-1:]]),
        normalised((1.0 - share) * low + share * high),
        normalised((1.0 - following) * low + following * high),
    )


def _cuts(a: np.ndarray, b: np.ndarray, shortest: float) -> np.ndarray:
    """Shares of the way from a to b at which a segment is cut."""
    narrow, wide = sorted((float(a[0]), float(b[0])))
    if narrow == wide or a[1] == b[1]:
        return np.zeros(0)
    ratio = wide / max(narrow, _TIP * wide)
    rows = min(int(np.ceil(np.log(ratio) / np.log1p(TAPER) - 1e-9)), MOST_ROWS, int(np.hypot(*(b - a)) / shortest))
    radii = wide / ratio ** (np.arange(1, rows) / max(rows, 1))
    shares = np.sort((radii - a[0]) / (b[0] - a[0]))
    return shares[(shares > 0.0) & (shares < 1.0)]
