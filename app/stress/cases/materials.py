"""Materials at the edge of what there is: indices of a gas and of germanium, dispersion without bound, the gem of the
literature, rough mirrors, and gratings whose orders are about to become evanescent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...base.errors import UserError
from ...base.paths import assets_dir
from ...gpu.context import Context
from ...gpu.records import specular_events
from ...model.geometry.primitives import slab
from ...model.geometry.primitives_gem import brilliant
from ...model.io.scene_file import load_scene
from ...model.optics.glass import Dispersion, cauchy, constant, from_abbe, sellmeier, table
from ...model.scene import Dielectric, Diffuse, Grating, Mirror
from ...reference import optics
from ...reference.optics import unit
from ..case import EPSILON, Held, Measured, Measurement, case, judged, length, not_finite_in
from ..rigs.camera_probe import FEW, render_probe, seen, straight, together, white_furnace
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
from ..rigs.probe import probe, rendered, with_photons

# ---- a slab of anything ----------------------------------------------------------------------

EXTREMES = (
    (1.0003, "n 1.0003, a gas", constant(1.0003)),
    (4.0, "n 4", constant(4.0)),
    (0.9, "n 0.9", constant(0.9)),
    (1.5, "V_d infinite", from_abbe(1.5)),
    (2.4, "n 2.4, V_d 20", from_abbe(2.4, 20.0)),
    (1.51, "V_d 1", from_abbe(1.5, 1.0)),
    (1.52, "V_d 1e-3", from_abbe(1.5, 1e-3)),
    (1.53, "V_d -20: n rises with wavelength", from_abbe(1.5, -20.0)),
)
NOTED = ("n 0.9", "V_d 1e-3", "V_d -20: n rises with wavelength")
"""Those that a user must be warned of: n below 1, held at 1, or rising with wavelength."""
REFUSED: tuple[Callable[[], Dispersion], ...] = (
    lambda: constant(0.0),
    lambda: constant(-1.5),
    lambda: constant(float("nan")),
    lambda: constant(float("inf")),
    lambda: from_abbe(1.5, 0.0),
    lambda: from_abbe(1.5, float("nan")),
    lambda: sellmeier([1.0], [0.25]),
    lambda: cauchy([0.1, -0.2]),
    lambda: table([400.0, 700.0], [1.5, -1.0]),
)


@case("extreme-index", "index (1.5…: V_d varies)", EXTREMES)
def extreme_index(context: Context, extremes: Sequence[tuple[float, str, Dispersion]]) -> Measured:
    """Indices from a gas to germanium, dispersion from none to all there is, and the wrong way round

    V_d towards 0 sends n to a thousand or below 1, and a table of n may have anything in it. What cannot be is refused,
    what is odd is noted, and what can be is traced as it is."""
    block, below = slab(8.0, 8.0, 1.0), screen([0, 0, -1.5], [0, 0, 1], 10.0)
    start, direction, band, sine = [-2, 0, 2.5], [1, 0, -1], (430.0, 680.0), np.sqrt(0.5)
    for severity, label, dispersion in extremes:
        photons = trace_beam(context, block, Dielectric(dispersion), below, start, direction, 0.3, band, 300, 6)
        landed = photons.of_choices(REFRACTED, REFRACTED)
        n = dispersion.index(landed.nm[:, 1])
        # Down at 45° through a unit of thickness: x = s/√(n² − s²) inside, as much as the drop outside.
        x = landed.start[:, 0] + (landed.start[:, 2] + 1.5 - 1.0) + sine / np.sqrt(n**2 - sine**2)
        slope = -sine * n / (n**2 - sine**2) ** 1.5
        # The table holds n in float32, at an x of 24 bits, between samples linear in n itself.
        span = float(np.ptp(dispersion.index(np.linspace(380.0, 780.0, 401))))
        of_n = EPSILON * (n + 2.0 * span) + table_error(photons, dispersion)
        # Leaving, cos² = 1 − n² sin² is made from a cosine near 1: 8 n² u of it, and tan of the way down with it.
        of_cosine2 = 8.0 * n**2 * EPSILON
        of_column = 64.0 * EPSILON * (1.0 + np.abs(slope)) + 2.0 * of_cosine2 / n
        column = landed.dposition_dn[:, 0] if photons.groups.count else slope
        held: Held = {
            "position": (
                np.abs(landed.position[:, 0] - x),
                16.0 * EPSILON * (1.0 + np.abs(x)) + of_cosine2 + np.abs(slope) * of_n,
            ),
            "column n": (
                np.abs(column - slope),
                of_column + np.abs(3.0 * slope * n / (n**2 - sine**2)) * of_n,
            ),
            "said aloud": (label in NOTED and not dispersion.notes(), 0.0),
            "impossible indices accepted": (accepted(), 0.0),
        }
        yield traced(severity, label, photons, held, note=f"{len(x)} photons")


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

GEM = table([380.0, 780.0], [2.2, 1.2], name="gem")
APEX = np.radians(35.0)
CRITICAL_N = float(1.0 / np.sin(APEX))


def wedge_photons(context: Context, band_nm: tuple[float, float]) -> Photons:
    """Straight through the first face of a wedge, so that the second is met at the apex angle by every wavelength."""
    wedge = extruded("wedge", np.array([[0.0, -1.0], [2.0 * np.tan(APEX), -1.0], [0.0, 1.0]]))
    wall = screen([4.0, 0, 0], [1, 0, 0], 40.0)
    return trace_beam(context, wedge, Dielectric(GEM), wall, [-1.0, -0.2, 0.0], [1.0, 0.0, 0.0], 0.1, band_nm, 200, 4)


def wedge_landing(start: np.ndarray, n: np.ndarray) -> np.ndarray:
    """y (N, K) on the wall of rays from `start` (N, 3) at indices (N, K) below the critical one."""
    outward = np.array([np.cos(APEX), np.sin(APEX), 0.0])
    leaves_x = (1.0 - start[:, 1]) * np.tan(APEX)
    direction = optics.refract(np.array([1.0, 0.0, 0.0]), -outward, n)
    return start[:, 1, None] + (4.0 - leaves_x[:, None]) * direction[..., 1] / direction[..., 0]


@case("gem-bands", "width of the band (nm)", (200.0, 100.0, 30.0, 10.0, 3.0, 1.0))
def gem_bands(context: Context, widths_nm: Sequence[float]) -> Measured:
    """A gem with n from 2.2 (violet) to 1.2 (red), in bands of 200 nm to 1 nm

    The path over a band is linear in n, exactly; nothing better is claimed, and nothing worse may happen: the band's
    ends land within Taylor's remainder of the reference."""
    for width in widths_nm:
        photons = wedge_photons(context, (640.0 - 0.5 * width, 640.0 + 0.5 * width))
        landed = photons.of_choices(REFRACTED, REFRACTED)
        n = GEM.index(landed.nm)
        step = n[:, [0, 2]] - n[:, 1:2]
        linear = landed.position[:, 1, None] + landed.dposition_dn[:, 1, None] * step
        exact = wedge_landing(landed.start, n)
        # Taylor's remainder: half the largest curvature of y(n) over the band, times the step squared.
        among = n[:, 2:] + (n[:, :1] - n[:, 2:]) * np.linspace(0.0, 1.0, 65)
        bend = np.abs(np.diff(wedge_landing(landed.start, among), 2, axis=1)).max(axis=1)
        curvature = bend / np.diff(among, axis=1)[:, 0] ** 2
        rounding = 16.0 * EPSILON * (4.0 + np.abs(exact)) / (1.0 - (n[:, :1] / CRITICAL_N) ** 2)
        # The curvature between the samples may be a little more than at them.
        remainder = 0.505 * curvature[:, None] * step**2 + rounding[:, [0, 2]]
        held: Held = {
            "anchor": (np.abs(landed.position[:, 1] - exact[:, 1]), rounding[:, 1]),
            "band ends": (np.abs(linear - exact[:, [0, 2]]).ravel(), remainder.ravel()),
        }
        note = f"n {n[0, 0]:.3f} to {n[0, 2]:.3f} in one band"
        yield traced(width, f"{width:g} nm", photons, held, note=note)


@case("gem-cut", "width of the band (nm)", (10.0, 50.0, 200.0, 380.0))
def gem_cut(context: Context, widths_nm: Sequence[float]) -> Measured:
    """The same gem where total reflection sets in inside a band

    Half of a band leaves the glass, the other half stays. The band is cut at the wavelength that float32 can know, both
    parts go on, and flux closes."""
    direction = np.array([0.13, 0.07, -1.0])
    light = beam_light(-1.2 * direction, direction, 0.6)
    gem = placed("gem", brilliant(2.0), Dielectric(GEM)), placed("screen", screen([0, 0, 2], [0, 0, 1], 20), Diffuse())
    fine_nm = np.arange(380.0, 780.1, 0.01)
    critical_nm = float(np.interp(-CRITICAL_N, -GEM.index(fine_nm), fine_nm))
    # c² = 1 − n² s² vanishes at the cut: dn = dc²/(2 n s²), to which bisection in 22 steps, x's 24 bits and the table
    # add theirs.
    of_cosine2 = EPSILON * (3.0 * (CRITICAL_N**2 - 1.0) + 5.0 * CRITICAL_N * np.sqrt(CRITICAL_N**2 - 1.0))
    for width in widths_nm:
        band = max(390.0, critical_nm - 0.5 * width), min(770.0, critical_nm + 0.5 * width)
        photons = wedge_photons(context, band)
        # In through the one face; what the other lets out begins where reflection stops being total.
        let_out = photons.where((specular_events(photons.records) == 2) & (photons.nm[:, 2] > band[1] - 1e-2))
        below = photons.where((specular_events(photons.records) == 2) & (photons.nm[:, 2] < critical_nm - 0.5))
        cut_n = GEM.index(let_out.nm[:, 0])
        whole = trace_light(context, gem, light, [band], 60, 30)
        held: Held = {
            "index at the cut": (
                np.abs(cut_n - CRITICAL_N),
                0.5 * of_cosine2 * CRITICAL_N + 4.0 * EPSILON * CRITICAL_N,
            ),
            "photons let out that reflect totally": (np.ones(len(below.records)), 0.0),
            "cuts not counted": (photons.tally.fallbacks["band_cut"] < len(let_out.records), 0.0),
            "flux out of balance, in a brilliant": (whole.tally.imbalance, 1e-4),
        }
        bad = not_finite_in(photons.records) + not_finite_in(whole.records)
        counts = {name: count + whole.tally.fallbacks[name] for name, count in photons.tally.fallbacks.items()}
        label = f"{band[0]:.0f} to {band[1]:.0f} nm"
        note = f"{len(cut_n)} cut bands, {len(whole.records)} landings in the brilliant"
        yield Measurement(width, label, bad, *judged(held), photons.tally.imbalance, counts, note=note)


@case("rough-mirror", "roughness", (1e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 1.0))
def rough_mirror(context: Context, roughnesses: Sequence[float]) -> Measured:
    """A mirror that loses nothing, from polished to matt, in a white furnace

    Its microfacets may be too narrow for float32, or so wide, and met so flatly, that most light meets several: what
    one sends on and what the rest does, by a table, must be all that came."""
    for roughness in roughnesses:
        sheet, sights, held = placed("sheet", screen(np.zeros(3), UP, 1.0), Mirror(roughness=roughness)), [], {}
        for degrees in (5.0, 60.0, 85.0):
            way = [np.sin(np.radians(degrees)), 0.0, -np.cos(np.radians(degrees))]
            sights.append(render_probe(context, white_furnace(sheet, camera=straight(np.zeros(3), way, 0.01)), FEW))
            held[f"energy at {degrees:g}°"] = np.abs(sights[-1].mean - 1.0).max(), 0.01
        yield seen(roughness, f"{roughness:g}", together(*sights), held)


# ---- gratings --------------------------------------------------------------------------------

UP = np.array([0.0, 0.0, 1.0])
ROUNDINGS = 4.0
"""Of a direction's part in the surface, and of the wavelength in its table."""


def order_sent(direction: np.ndarray, step: float) -> np.ndarray | None:
    """Unit direction (3,) behind a grating in z = 0 that adds `step` along x; None: evanescent."""
    a, b = direction[0] + step, direction[1]
    c2 = 1.0 - a * a - b * b
    return None if c2 <= 0.0 else np.array([a, b, -np.sqrt(c2)])


def order_errors(found: Photons, direction: np.ndarray, sent: np.ndarray, nm: float, lines: float) -> Held:
    """Landing and ∂(landing)/∂λ on a wall that faces the order at distance 1, with what rounding allows."""
    at = found.start - (found.start[:, 2] / direction[2])[:, None] * direction

    def landing(nm: float) -> np.ndarray:
        going = order_sent(direction, lines * nm * 1e-6)
        assert going is not None
        return at + ((1.0 - at @ sent) / (going @ sent))[:, None] * going

    steep = abs(sent[2])
    h = min(0.05, 0.002 * steep**2 * nm)
    slope = (landing(nm + h) - landing(nm - h)) / (2e-3 * h)
    size = float(np.maximum(length(slope).max(), 1e-12))
    # The derivative grows as 1 / cosine, and its rounding as the cosine's, whose square is a difference of ones.
    of_column = ROUNDINGS * EPSILON / steep**2 + 1e-5
    return {
        "landing": (length(found.position - landing(nm)), ROUNDINGS * EPSILON * (1.0 + 1.0 / steep)),
        "column": (length(found.dposition_dvar[:, 0] - slope) / size, of_column),
    }


def sent_on(
    context: Context, severity: float, label: str, lines: float, nm: float, direction: np.ndarray
) -> Measurement:
    """A thin beam on to order 1 of a grating; where the order is evanescent, all its light must be counted as
    absorbed."""
    grating = placed("grating", screen(np.zeros(3), UP, 3.0), Grating(lines, (1,), (0.8,)))
    sent = order_sent(direction, lines * nm * 1e-6)
    facing = -UP if sent is None else sent
    # So far that even a beam that grazes starts above the sheet.
    start = -max(0.3, 0.01 / abs(direction[2])) * direction
    found = trace_beam(context, [grating], None, screen(facing, -facing, 0.5), start, direction, 1e-3, nm, 64)
    absorbed = found.tally.ended["absorbed"] / found.tally.emitted
    if sent is None:
        return traced(severity, label, found, {"absorbed": (abs(1.0 - absorbed), 1e-5), "landed": (len(found.q), 0.0)})
    held = order_errors(found, direction, sent, nm, lines)
    kept: Held = {"absorbed": (abs(0.2 - absorbed), 1e-5), "missing": (len(found.records) == 0, 0.0)}
    return traced(severity, label, found, {**held, **kept})


@case("grating-edge", "cosine of the angle it leaves at", (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, -1e-3, -0.1))
def grating_edge(context: Context, cosines: Sequence[float]) -> Measured:
    """A grating's order about to become evanescent

    The cosine it leaves at is the root of a difference of ones; beyond the edge nothing may leave, and all of it is
    counted as absorbed."""
    for cosine in cosines:
        # 2000 lines/mm at right angles: sin = λ / 500 nm.
        nm = float(500.0 * np.sqrt(1.0 - cosine * abs(cosine)))
        label = f"cosine {cosine:g}" if cosine > 0.0 else f"evanescent by {-cosine:g}"
        yield sent_on(context, abs(cosine), label, 2000.0, nm, -UP)


@case("grating-grazing", "cosine of incidence", (0.3, 0.1, 0.03, 0.01, 3e-3))
def grating_grazing(context: Context, cosines: Sequence[float]) -> Measured:
    """Light that grazes a grating

    Its own normal part is nearly nothing, while the order leaves steeply."""
    for cosine in cosines:
        direction = unit(np.array([-np.sqrt(1.0 - cosine**2), 0.0, -cosine]))
        yield sent_on(context, cosine, f"cosine {cosine:g}", 1200.0, 550.0, direction)


LINES = (1.0, 10.0, 100.0, 600.0, 1200.0, 1818.0, 2400.0, 3300.0, 5000.0, 10_000.0)


@case("grating-lines", "lines a millimetre", LINES)
def grating_lines(context: Context, densities: Sequence[float]) -> Measured:
    """From one line a millimetre to lines finer than waves

    The order leaves next to the beam at one end, and at the other, past λ/Λ near 2, not at all."""
    direction = unit(np.array([-0.9, 0.1, -0.4]))
    for lines in densities:
        yield sent_on(context, lines, f"{lines:g} lines/mm, λ/Λ = {lines * 5.5e-4:.3g}", lines, 550.0, direction)


@case("grating-orders", "orders", (1, 3, 11, 31, 101))
def grating_orders(context: Context, counts: Sequence[int]) -> Measured:
    """Up to a hundred orders

    Orders leave one after the other; queues must not overflow and no light be lost in between."""
    scene = load_scene(assets_dir() / "scenes" / "spectrometer.toml")
    for count in counts:
        orders = tuple(range(-(count // 2), count // 2 + 1))
        grating = Grating(100.0 if count < 31 else 30.0, orders, (0.9 / count,) * count)
        crowded = replace(scene, objects=(replace(scene.objects[0], material=grating), *scene.objects[1:]))
        yield rendered(count, f"{count} orders", probe(context, crowded, with_photons(8192)))
