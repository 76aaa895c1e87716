"""Gratings at their edges: orders about to become evanescent, grazing light, lines finer than waves, many orders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...base.paths import assets_dir
from ...gpu.context import Context
from ...model.io.scene_file import load_scene
from ...model.scene import Grating
from ...reference.optics import unit
from ..case import Case, Measurement
from ..judging import EPSILON, judged, length, not_finite_in
from ..rigs.gpu_paths import Photons, placed, screen, trace_beam
from ..rigs.probe import measurement, probe, with_photons

UP = np.array([0.0, 0.0, 1.0])
REACH = 1.0
"""From the grating to the wall that faces the order."""
ROUNDINGS = 4.0
"""Of a direction's part in the surface, and of the wavelength in its table."""


def order_sent(direction: np.ndarray, step: float) -> np.ndarray | None:
    """Unit direction (3,) behind a grating in z = 0 that adds `step` along x; None: evanescent."""
    a, b = direction[0] + step, direction[1]
    c2 = 1.0 - a * a - b * b
    return None if c2 <= 0.0 else np.array([a, b, -np.sqrt(c2)])


def shone(context: Context, lines: float, nm: float, direction: np.ndarray) -> tuple[Photons, np.ndarray | None]:
    """A thin beam onto order 1 of a grating about the origin, and the exact way on."""
    grating = placed("grating", screen(np.zeros(3), UP, 3.0), Grating(lines, (1,), (0.8,)))
    sent = order_sent(direction, lines * nm * 1e-6)
    facing = -UP if sent is None else sent
    wall = screen(REACH * facing, -facing, 0.5)
    # So far that even a beam that grazes starts above the sheet.
    start = -max(0.3, 0.01 / abs(direction[2])) * direction
    return trace_beam(context, [grating], None, wall, start, direction, 1e-3, nm, count=64), sent


def errors_of(found: Photons, direction: np.ndarray, sent: np.ndarray, nm: float, lines: float) -> dict:
    """Rows for `judged`: landing and ∂(landing)/∂λ, with what rounding allows."""
    start = found.start
    at = start - (start[:, 2] / direction[2])[:, None] * direction

    def landing(nm: float) -> np.ndarray:
        going = order_sent(direction, lines * nm * 1e-6)
        assert going is not None
        distance = (REACH - at @ sent) / (going @ sent)
        return at + distance[:, None] * going

    steep = abs(sent[2])
    h = min(0.05, 0.002 * steep**2 * nm)
    slope = (landing(nm + h) - landing(nm - h)) / (2e-3 * h)
    size = float(np.maximum(length(slope).max(), 1e-12))
    return {
        "landing": (
            length(found.position - landing(nm)),
            ROUNDINGS * EPSILON * (1.0 + 1.0 / steep),
        ),
        # The derivative goes with 1 / cosine: its rounding with the cosine's, whose square is the difference of ones.
        "column": (length(found.dposition_dvar[:, 0] - slope) / size, ROUNDINGS * EPSILON / steep**2 + 1e-5),
    }


def measured(
    context: Context, severity: float, label: str, lines: float, nm: float, direction: np.ndarray
) -> Measurement:
    """One severity; where the order is evanescent, all of its light must be counted as absorbed."""
    found, sent = shone(context, lines, nm, direction)
    tally = found.tally
    absorbed = tally.ended["absorbed"] / tally.emitted
    if sent is None:
        landed = float(len(found.records))
        errors, bounds = {"absorbed": abs(1.0 - absorbed), "landed": landed}, {"absorbed": 1e-5, "landed": 0.0}
    else:
        errors, bounds = judged(errors_of(found, direction, sent, nm, lines))
        errors["absorbed"], bounds["absorbed"] = abs(0.2 - absorbed), 1e-5
        errors["missing"], bounds["missing"] = float(len(found.records) == 0), 0.0
    return Measurement(
        severity, label, not_finite_in(found.records), errors, bounds, tally.imbalance, dict(tally.fallbacks)
    )


EDGES = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, -1e-3, -0.1)


def measure_edge(context: Context) -> Iterator[Measurement]:
    for cosine in EDGES:
        # 2000 lines/mm at right angles: sin = λ / 500 nm.
        nm = 500.0 * np.sqrt(1.0 - cosine * abs(cosine))
        label = f"cosine {cosine:g}" if cosine > 0.0 else f"evanescent by {-cosine:g}"
        yield measured(context, abs(cosine), label, 2000.0, float(nm), -UP)


GRAZES = (0.3, 0.1, 0.03, 0.01, 3e-3)


def measure_grazing(context: Context) -> Iterator[Measurement]:
    for cosine in GRAZES:
        direction = unit(np.array([-np.sqrt(1.0 - cosine**2), 0.0, -cosine]))
        yield measured(context, cosine, f"cosine {cosine:g}", 1200.0, 550.0, direction)


LINES = (1.0, 10.0, 100.0, 600.0, 1200.0, 1818.0, 2400.0, 3300.0, 5000.0, 10_000.0)


def measure_lines(context: Context) -> Iterator[Measurement]:
    direction = unit(np.array([-0.9, 0.1, -0.4]))
    for lines in LINES:
        yield measured(context, lines, f"{lines:g} lines/mm, λ/Λ = {lines * 5.5e-4:.3g}", lines, 550.0, direction)


COUNTS = (1, 3, 11, 31, 101)


def measure_orders(context: Context) -> Iterator[Measurement]:
    scene = load_scene(assets_dir() / "scenes" / "spectrometer.toml")
    first = scene.objects[0]
    for count in COUNTS:
        orders = tuple(range(-(count // 2), count // 2 + 1))
        grating = Grating(100.0 if count < 31 else 30.0, orders, (0.9 / count,) * count)
        crowded = replace(scene, objects=(replace(first, material=grating), *scene.objects[1:]))
        found = probe(context, crowded, with_photons(8192))
        yield measurement(float(count), f"{count} orders", found)


CASES = (
    Case(
        "grating-edge",
        "A grating's order about to become evanescent",
        "The cosine it leaves at is the root of a difference of ones; beyond the edge nothing may leave, and all of it "
        "is counted as absorbed.",
        "cosine of the angle it leaves at",
        measure_edge,
        len(EDGES),
    ),
    Case(
        "grating-grazing",
        "Light that grazes a grating",
        "Its own normal part is nearly nothing, while the order leaves steeply.",
        "cosine of incidence",
        measure_grazing,
        len(GRAZES),
    ),
    Case(
        "grating-lines",
        "From one line a millimetre to lines finer than waves",
        "The order leaves next to the beam at one end, and at the other, past λ/Λ near 2, not at all.",
        "lines a millimetre",
        measure_lines,
        len(LINES),
    ),
    Case(
        "grating-orders",
        "Up to a hundred orders",
        "Orders leave one after the other; queues must not overflow and no light be lost in between.",
        "orders",
        measure_orders,
        len(COUNTS),
    ),
)
