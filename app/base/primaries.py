"""Other RGB spaces to linear Rec.709: what the chromaticities in a picture's header say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x and y of red, green, blue and white."""
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0)
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""Cone response of the Bradford transform (CIE 160:2004)."""


def to_rec709(chromaticities: Sequence[float]) -> np.ndarray | None:
    """Matrix (3, 3) from linear RGB of these primaries and white to linear Rec.709; None where they are the same.

    Another white becomes D65 (Bradford); XYZ itself is left as it is. Raises ValueError for what are no primaries.
    """
    given = np.array(chromaticities, float)
    if given.shape == (8,) and np.allclose(given, REC709, rtol=0.0, atol=1e-3):
        return None
    if given.shape == (8,) and (np.abs(given) <= 10.0).all() and given[7] > 1e-3:
        is_xyz = np.allclose(given, XYZ, rtol=0.0, atol=1e-3)
        with np.errstate(all="ignore"):
            source, target = _to_xyz(given), _to_xyz(np.array(REC709))
            cones = _BRADFORD @ target.sum(axis=1) / (_BRADFORD @ source.sum(axis=1))
            adapted = np.eye(3) if is_xyz else np.linalg.inv(_BRADFORD) @ (cones[:, None] * _BRADFORD)
            matrix = np.linalg.inv(target) @ adapted @ source
        if (np.abs(matrix) < 100.0).all():
            return matrix
    raise ValueError("its primaries and white are not eight numbers x, y of colours")


def _to_xyz(xy: np.ndarray) -> np.ndarray:
    """XYZ = M @ RGB; white has Y = 1."""
    x, y = xy.reshape(4, 2).T
    columns = np.stack([x, y, 1.0 - x - y])
    return columns[:, :3] * np.linalg.solve(columns[:, :3], columns[:, 3] / y[3])
