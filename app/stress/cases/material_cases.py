"""Refractive indices at the edge of what there is: a gas, germanium, dispersion without bound, and the gem of the
literature."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ...base.errors import UserError
from ...gpu.context import Context
from ...gpu.records import specular_events
from ...model.geometry.primitives import slab
from ...model.geometry.primitives_gem import brilliant
from ...model.optics import glass as model_glass
from ...model.optics.glass import Dispersion
from ...model.scene import Dielectric, Diffuse
from ...reference import optics
from ..case import Case, Measurement
from ..judging import EPSILON, judged, not_finite_in
from ..rigs.gpu_paths import (
    REFRACTED,
    Photons,
    beam_light,
    extruded,
    placed,
    screen,
    trace_beam,
    trace_light,
    traced,
)

# ---- a slab of anything -------------------------------------------------------------------------

EXTREMES: tuple[tuple[float, str, Dispersion], ...] = (
    (1.0003, "n 1.0003, a gas", model_glass.constant(1.0003)),
    (4.0, "n 4", model_glass.constant(4.0)),
    (0.9, "n 0.9", model_glass.constant(0.9)),
    (1.5, "V_d infinite", model_glass.from_abbe(1.5)),
    (2.4, "n 2.4, V_d 20", model_glass.from_abbe(2.4, 20.0)),
    (1.51, "V_d 1", model_glass.from_abbe(1.5, 1.0)),
    (1.52, "V_d 1e-3", model_glass.from_abbe(1.5, 1e-3)),
    (1.53, "V_d -20: n rises with wavelength", model_glass.from_abbe(1.5, -20.0)),
)
SAID_ALOUD = ("n 0.9", "V_d 1e-3", "V_d -20: n rises with wavelength")
"""Those that a user must be told about: n below 1, held at 1, or rising with wavelength."""
REFUSED: tuple[Callable[[], Dispersion], ...] = (
    lambda: model_glass.constant(0.0),
    lambda: model_glass.constant(-1.5),
    lambda: model_glass.constant(float("nan")),
    lambda: model_glass.constant(float("inf")),
    lambda: model_glass.from_abbe(1.5, 0.0),
    lambda: model_glass.from_abbe(1.5, float("nan")),
    lambda: model_glass.sellmeier([1.0], [0.25]),
    lambda: model_glass.cauchy([0.1, -0.2]),
    lambda: model_glass.table([400.0, 700.0], [1.5, -1.0]),
)


def measure_extremes(context: Context) -> Iterator[Measurement]:
    block = slab(8.0, 8.0, 1.0)
    below = screen([0, 0, -1.5], [0, 0, 1], 10.0)
    tilt = np.array([1.0, 0.0, -1.0])
    for severity, label, dispersion in EXTREMES:
        photons = trace_beam(
            context,
            block,
            Dielectric(dispersion),
            below,
            [-2, 0, 2.5],
            tilt,
            0.3,
            (430.0, 680.0),
            count=300,
            max_depth=6,
        )
        landed = photons.of_choices(REFRACTED, REFRACTED)
        anchor = landed.nm[:, 1]
        n = dispersion.index(anchor)
        sine = np.sqrt(0.5)
        # Down at 45° through a unit of thickness: x = s/√(n² − s²) inside, as much as the drop outside.
        x = landed.start[:, 0] + (landed.start[:, 2] + 1.5 - 1.0) + sine / np.sqrt(n**2 - sine**2)
        slope = -sine * n / (n**2 - sine**2) ** 1.5
        # The table holds n in float32, at an x of 24 bits, between samples linear in n itself.
        span = float(np.ptp(dispersion.index(np.linspace(380.0, 780.0, 401))))
        of_n = EPSILON * (n + 2.0 * span) + table_error(photons, dispersion)
        # Leaving, cos² = 1 − n² sin² is made from a cosine near 1: 8 n² u of it, and tan of the way down with it.
        of_cosine2 = 8.0 * n**2 * EPSILON
        rounding = 16.0 * EPSILON * (1.0 + np.abs(x)) + of_cosine2
        column = landed.dposition_dn[:, 0] if photons.groups.count else slope
        silent = label in SAID_ALOUD and not dispersion.notes()
        errors, bounds = judged(
            {
                "position": (np.abs(landed.position[:, 0] - x), rounding + np.abs(slope) * of_n),
                "column n": (
                    np.abs(column - slope),
                    64.0 * EPSILON * (1.0 + np.abs(slope))
                    + 2.0 * of_cosine2 / n
                    + np.abs(3.0 * slope * n / (n**2 - sine**2)) * of_n,
                ),
                "said aloud": (np.array([float(silent)]), 0.0),
                "impossible indices accepted": (np.array([float(accepted())]), 0.0),
            }
        )
        yield traced(severity, label, photons, errors, bounds, note=f"{len(x)} photons")


def table_error(photons: Photons, dispersion: Dispersion) -> float:
    """Largest error of n between two of 1025 samples in x, where n is not affine in x."""
    if not dispersion.is_dispersive or photons.axis.affine_in_n:
        return 0.0
    fine = np.linspace(0.0, 1.0, 8 * 1024 + 1)
    n = dispersion.index(photons.axis.nm_of_x(fine))
    return float(np.abs(np.interp(fine, fine[::8], n[::8]) - n).max())


def accepted() -> int:
    """How many impossible materials are taken without complaint."""
    taken = 0
    for make in REFUSED:
        try:
            make()
            taken += 1
        except UserError:
            pass
    return taken


# ---- the gem of Elek et al. 2014b: n from 2.2 at the violet end to 1.2 at the red one -----------------

GEM = model_glass.table([380.0, 780.0], [2.2, 1.2], name="gem")
APEX = np.radians(35.0)
CRITICAL_N = float(1.0 / np.sin(APEX))


def wedge_photons(context: Context, band_nm: tuple[float, float]) -> Photons:
    """Straight through the first face of a wedge, so that the second is met at the apex angle by every wavelength."""
    section = np.array([[0.0, -1.0], [2.0 * np.tan(APEX), -1.0], [0.0, 1.0]])
    wall = screen([4.0, 0, 0], [1, 0, 0], 40.0)
    return trace_beam(
        context,
        extruded("wedge", section),
        Dielectric(GEM),
        wall,
        [-1.0, -0.2, 0.0],
        [1.0, 0.0, 0.0],
        0.1,
        band_nm,
        count=200,
        max_depth=4,
    )


def wedge_landing(start: np.ndarray, n: np.ndarray) -> np.ndarray:
    """y (N, K) on the wall of rays from `start` (N, 3) at indices (N, K) below the critical one."""
    outward = np.array([np.cos(APEX), np.sin(APEX), 0.0])
    leaves_x = (1.0 - start[:, 1]) * np.tan(APEX)
    direction = optics.refract(np.array([1.0, 0.0, 0.0]), -outward, n)
    return start[:, 1, None] + (4.0 - leaves_x[:, None]) * direction[..., 1] / direction[..., 0]


def measure_gem_bands(context: Context) -> Iterator[Measurement]:
    for width in (200.0, 100.0, 30.0, 10.0, 3.0, 1.0):
        photons = wedge_photons(context, (640.0 - 0.5 * width, 640.0 + 0.5 * width))
        landed = photons.of_choices(REFRACTED, REFRACTED)
        n = GEM.index(landed.nm)
        step = n[:, [0, 2]] - n[:, 1:2]
        linear = landed.position[:, 1, None] + landed.dposition_dn[:, 1, None] * step
        exact = wedge_landing(landed.start, n)
        # Taylor's remainder: half the largest curvature of y(n) over the band, times the step squared.
        reach = np.linspace(0.0, 1.0, 65)
        among = n[:, 2:] + (n[:, :1] - n[:, 2:]) * reach
        y = wedge_landing(landed.start, among)
        curvature = np.abs(np.diff(y, 2, axis=1)).max(axis=1) / np.diff(among, axis=1)[:, 0] ** 2
        amplified = 1.0 / (1.0 - (n[:, :1] / CRITICAL_N) ** 2)
        rounding = 16.0 * EPSILON * (4.0 + np.abs(exact)) * amplified
        errors, bounds = judged(
            {
                "anchor": (np.abs(landed.position[:, 1] - exact[:, 1]), rounding[:, 1]),
                # The curvature between the samples may be a little more than at them.
                "band ends": (
                    np.abs(linear - exact[:, [0, 2]]).ravel(),
                    (0.505 * curvature[:, None] * step**2 + rounding[:, [0, 2]]).ravel(),
                ),
            }
        )
        yield traced(
            width, f"{width:g} nm", photons, errors, bounds, note=f"n {n[0, 0]:.3f} to {n[0, 2]:.3f} in one band"
        )


def measure_gem_cut(context: Context) -> Iterator[Measurement]:
    direction = np.array([0.13, 0.07, -1.0])
    gem = placed("gem", brilliant(2.0), Dielectric(GEM))
    above = placed("screen", screen([0, 0, 2.0], [0, 0, 1], 20.0), Diffuse())
    for width in (10.0, 50.0, 200.0, 380.0):
        critical_nm = float(
            np.interp(-CRITICAL_N, -GEM.index(np.arange(380.0, 780.1, 0.01)), np.arange(380.0, 780.1, 0.01))
        )
        band = max(390.0, critical_nm - 0.5 * width), min(770.0, critical_nm + 0.5 * width)
        photons = wedge_photons(context, band)
        # In through the one face; what the other lets out begins where reflection stops being total.
        let_out = photons.where((specular_events(photons.records) == 2) & (photons.nm[:, 2] > band[1] - 1e-2))
        cut_n = GEM.index(let_out.nm[:, 0])
        # c² = 1 − n² s² vanishes there: dn = dc²/(2 n s²), to which bisection in 22 steps, x's 24 bits and the table
        # add theirs.
        of_cosine2 = EPSILON * (3.0 * (CRITICAL_N**2 - 1.0) + 5.0 * CRITICAL_N * np.sqrt(CRITICAL_N**2 - 1.0))
        allowed = 0.5 * of_cosine2 * CRITICAL_N + 4.0 * EPSILON * CRITICAL_N
        whole = trace_light(
            context, (gem, above), beam_light(tuple(-1.2 * direction), tuple(direction), 0.6), [band], 60, 30
        )
        below = photons.where((specular_events(photons.records) == 2) & (photons.nm[:, 2] < critical_nm - 0.5))
        errors, bounds = judged(
            {
                "index at the cut": (np.abs(cut_n - CRITICAL_N), allowed),
                "photons let out that reflect totally": (np.ones(len(below.records)), 0.0),
                "cuts not counted": (
                    np.array([float(photons.tally.fallbacks["band_cut"] < len(let_out.records))]),
                    0.0,
                ),
                "flux out of balance, in a brilliant": (np.array([whole.tally.imbalance]), 1e-4),
            }
        )
        bad = not_finite_in(photons.records) + not_finite_in(whole.records)
        yield Measurement(
            width,
            f"{band[0]:.0f} to {band[1]:.0f} nm",
            bad,
            errors,
            bounds,
            photons.tally.imbalance,
            {name: count + whole.tally.fallbacks[name] for name, count in photons.tally.fallbacks.items()},
            note=f"{len(cut_n)} cut bands, {len(whole.records)} landings in the brilliant",
        )


CASES = (
    Case(
        "extreme-index",
        "Indices from a gas to germanium, dispersion from none to all there is, and the wrong way round",
        "V_d towards 0 sends n to a thousand or below 1, and a table of n may have anything in it. What cannot be is "
        "refused, what is odd is said aloud, and what can be is traced as it is.",
        "index (1.5…: V_d varies)",
        measure_extremes,
        steps=len(EXTREMES),
        logarithmic=False,
    ),
    Case(
        "gem-bands",
        "A gem with n from 2.2 (violet) to 1.2 (red), in bands of 200 nm to 1 nm",
        "The path over a band is linear in n, exactly; nothing better is claimed, and nothing worse may happen: the "
        "band's ends land within Taylor's remainder of the reference.",
        "width of the band (nm)",
        measure_gem_bands,
        steps=6,
    ),
    Case(
        "gem-cut",
        "The same gem where total reflection sets in inside a band",
        "Half of a band leaves the glass, the other half stays. The band is cut at the wavelength that float32 can "
        "know, both parts go on, and flux closes.",
        "width of the band (nm)",
        measure_gem_cut,
        steps=4,
    ),
)
