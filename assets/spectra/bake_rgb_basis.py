"""Bakes the three reflectances that every RGB of this program is a mixture of
(`spectrasplat.model.optics.colorimetry.rgb_basis`).

A reflectance that is linear in RGB can be filtered before or after it is made a spectrum, which no
non-linear fit allows, and one whose basis sums to 1 leaves greys flat. Among all such bases the
smoothest is chosen, after I. Mallett and C. Yuksel, Spectral Primary Decomposition for Rendering with
sRGB Reflectance (EGSR 2019, section 3), with this program's own observer, daylight and 1 nm grid.

Run from the repository root: python assets/spectra/bake_rgb_basis.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.sparse import block_diag, bmat, csc_matrix, diags, hstack, viewpoint
from scipy.sparse.linalg import splu
from spectrasplat.model.optics.colorimetry import VISIBLE_NM, cmf_xyz, illuminant_table, xyz_to_rgb709_matrix

HERE = Path(__file__).resolve().parent

COUNT = len(VISIBLE_NM)
ROUNDS = 200


def smoothest_basis() -> np.ndarray:
    """Non-negative r, g, b, float64 (401, 3), summing to 1, with the colours of the primaries under D65.

    Minimises the sum of squared differences of neighbours. A convex quadratic programme in 1203 unknowns,
    solved by the primal-dual active-set method (Hintermüller, Ito, Kunisch, SIAM J. Optim. 13(3), 2002, algorithm 2.1):
    guess which values are 0, solve the equations that remain, and guess again from signs and multipliers.
    """
    difference = diags([-1.0, 1.0], [0, 1], shape=(COUNT - 1, COUNT))
    cost = csc_matrix(block_diag([2.0 * difference.T @ difference] * 3))
    daylight = illuminant_table()["D65"]
    to_rgb = (xyz_to_rgb709_matrix() @ (daylight[:, None] * cmf_xyz()).T) / (daylight @ cmf_xyz()[:, 1])
    # With the sum fixed, blue's colour follows from the other two (white is D65): its rows would be dependent.
    colours = hstack([block_diag([to_rgb, to_rgb]), csc_matrix((6, COUNT))])
    equations = csc_matrix(bmat([[hstack([viewpoint(COUNT)] * 3)], [colours]]))
    wanted = np.concatenate([np.ones(COUNT), np.eye(3)[:2].ravel()])
    zero = np.zeros(3 * COUNT, dtype=bool)
    for _ in range(ROUNDS):
        values, multipliers = _solve(cost, equations, wanted, zero)
        guess = multipliers > values
        if np.array_equal(guess, zero):
            return np.ascontiguousarray(values.reshape(3, COUNT).T)
        zero = guess
    raise RuntimeError("the active set did not settle")


def _solve(
    cost: csc_matrix, equations: csc_matrix, wanted: np.ndarray, zero: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values (1203,) that minimise under the equations with those in `zero` held at 0, and the multipliers of these."""
    free = np.flatnonzero(~zero)
    rows = equations[:, free]
    system = bmat([[cost[free][:, free], rows.T], [rows, None]], format="csc")
    solution = splu(system).solve(np.concatenate([np.zeros(len(free)), wanted]))
    values = np.zeros(len(zero))
    values[free] = solution[: len(free)]
    gradient = cost @ values + equations.T @ solution[len(free) :]
    return values, np.where(zero, gradient, 0.0)


def main() -> None:
    """Write the table after checking what it promises."""
    basis = smoothest_basis()
    assert basis.min() >= -1e-12 and np.abs(basis.sum(axis=1) - 1.0).max() < 1e-12
    header = (
        "Smoothest reflectances >= 0 that sum to 1 and show the Rec.709 primaries under D65; computed by "
        "bake_rgb_basis.py\n"
        "wavelength_nm,red,green,blue"
    )
    rows = np.column_stack([VISIBLE_NM, np.clip(basis, 0.0, 1.0)])
    np.savetxt(HERE / "rgb_basis_1nm.csv", rows, fmt=["%d"] + ["%.15g"] * 3, delimiter=",", header=header)


if __name__ == "__main__":
    main()
