"""Glass that absorbs in lines, as didymium does: a band's weight at its ends and in its middle says nothing of a line
between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import slab
from ...model.materials.absorption import Absorption
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.scene import Scene
from ..case import Case, Measurement
from ..rigs.probe import SMALL, Held, energy_error, measurement, probe
from ..rigs.scene_parts import BEAM, CROWN, solid, stage

WIDTHS_NM = (80.0, 40.0, 20.0, 10.0, 5.0, 2.0)
"""Full widths at half maximum."""
LINES_NM = (430.0, 475.0, 512.0, 526.0, 573.0, 586.0, 684.0, 740.0)
"""About where neodymium and praseodymium absorb in glass."""
DEPTH = 3.0
"""Optical depth of the slab in a line's middle."""
THICK = 0.5
POWER = 0.02
"""Relative error of the power that gets through: 32 bands have to do for eight lines, three bends each. Also of the
picture that beams make, against that of photons."""


def optical_depth(width_nm: float) -> np.ndarray:
    """Of the slab, on the visible grid."""
    sigma = width_nm / np.sqrt(8.0 * np.log(2.0))
    lines = np.exp(-0.5 * ((VISIBLE_NM[:, None] - np.array(LINES_NM)) / sigma) ** 2)
    return DEPTH * np.asarray(lines.sum(axis=1))


def behind_the_slab(width_nm: float) -> Scene:
    """A beam straight down through a slab of such glass."""
    pane = solid("pane", slab(3.0, 3.0, THICK), CROWN, (0.0, 0.0, 1.0))
    material = pane.material.changed(absorption=Absorption(optical_depth(width_nm) / THICK))
    return stage(replace(pane, material=material))


def let_through(width_nm: float) -> float:
    """Share of the beam's power behind the slab, all reflections within it added up: T²a / (1 − R²a²)."""
    n = CROWN.index(VISIBLE_NM)
    r, a = ((n - 1.0) / (n + 1.0)) ** 2, np.exp(-optical_depth(width_nm))
    power = BEAM.spectral_power.density
    share = (1.0 - r) ** 2 * a / (1.0 - (r * a) ** 2)
    return float(np.trapezoid(power * share, VISIBLE_NM) / np.trapezoid(power, VISIBLE_NM))


def measure_lines(context: Context) -> Iterator[Measurement]:
    """Power behind the slab, by photons and by beams."""
    for width in WIDTHS_NM:
        want, scene = let_through(width), behind_the_slab(width)
        photons = probe(context, scene)
        beams = probe(context, scene, replace(SMALL, method="srd"))
        errors = {
            "power": abs(photons.shares["deposited"] / want - 1.0),
            "beams": energy_error(beams.picture, photons.picture),
        }
        bounds = {"power": POWER, "beams": POWER}
        yield measurement(width, f"{width:g} nm", photons, Held(errors, bounds, f"{100.0 * want:.1f} % pass"))


CASES: tuple[Case, ...] = (
    Case(
        "absorption-lines",
        "A slab that absorbs in eight lines ever narrower, against Beer and Lambert's law with Fresnel's",
        "Weights are known at three places of a band and straight between them: a band must not be wider than what it "
        "is to tell.",
        "width of a line, nm",
        measure_lines,
        len(WIDTHS_NM),
    ),
)
