"""Glass that absorbs: in lines, as didymium does, where a band's weight at its ends and in its middle says nothing of a
line between them; and panes of several tints, of any thickness, under every kind of lamp."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import box, plane, slab
from ...model.lights import AreaLight, CollimatedLight, DirectionalLight, IesLight, PointLight, SpotLight
from ...model.lights.ies_file import Profile
from ...model.lights.light import made
from ...model.materials.absorption import Absorption
from ...model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, xyz_to_rgb709
from ...model.scene import Camera, Diffuse, Light, Scene, SceneObject
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


def share_behind(depth: np.ndarray, cosine: float = 1.0) -> np.ndarray:
    """Share of light behind a plate, by the nanometre: Fresnel's reflections within it all added up, and Beer and
    Lambert's law along the way in it."""
    n = CROWN.index(VISIBLE_NM)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / n**2)
    kept = np.exp(-depth / inside)
    s, p = ((cosine - n * inside) / (cosine + n * inside)) ** 2, ((n * cosine - inside) / (n * cosine + inside)) ** 2
    return np.asarray(0.5 * sum((1.0 - r) ** 2 * kept / (1.0 - (r * kept) ** 2) for r in (s, p)))


def let_through(width_nm: float) -> float:
    """Share of the beam's power behind the slab."""
    power, share = BEAM.spectral_power.density, share_behind(optical_depth(width_nm))
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


LAMPS: dict[str, tuple[type[Light], dict[str, Any]]] = {
    "sun": (DirectionalLight, {"angular_diameter_deg": 0.53}),
    "parallel": (DirectionalLight, {"angular_diameter_deg": 0.0}),
    "beam": (CollimatedLight, {"radius": 4.0}),
    "point": (PointLight, {}),
    "spot": (SpotLight, {"inner_half_angle_deg": 50.0, "outer_half_angle_deg": 60.0}),
    "panel": (AreaLight, {"radius": 0.015}),
    "file": (IesLight, {"profile": Profile(np.array([0.0, 180.0]), np.array([0.0, 360.0]), np.ones((2, 2)), 1.0, "")}),
}
PANES = ((1e-4, 8), (4e-3, 1), (4e-3, 2), (0.1, 4), (1.0, 3), (10.0, 8))
"""Thickness and number of tints."""
METHODS = "srd", "srd-photons"
COLOUR = 0.04
"""What a colour behind a pane may be off by, over its largest channel: footprints blur beyond their pane's edge, and
weak beams of the sun's parts play roulette."""
COUNTED = 0.02
"""Share of the light whose end beams do not count: what a facet absorbs they count by the middle of a band."""
LOW = Camera((0.0, 0.0, -5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=2.0)


def behind_a_pane(light: Light, height: float, x: float, depth: np.ndarray) -> np.ndarray:
    """Linear Rec.709 irradiance of a table at `x` from below the lamp, through a pane that moves light by nothing."""
    cosine = 1.0 if light.is_parallel else float(height / np.hypot(height, x))
    share = share_behind(depth, cosine) * cosine ** (4 if light.has_outline else 3) / light.reach(height)
    return np.asarray(xyz_to_rgb709(K_M * (light.spectral_power.density * share) @ cmf_xyz()))


def measure_panes(context: Context) -> Iterator[Measurement]:
    """Panes side by side, each of its own tint."""
    settings, table = replace(SMALL, width=320, height=80, spp=4, layer="caustic"), plane(8.0, 2.0)
    at_x, at_y = 4.0 - (np.arange(320) + 0.5) / 40.0, (np.arange(80) + 0.5) / 40.0 - 1.0
    for number, ((kind, (lamp, given)), method) in enumerate(product(LAMPS.items(), METHODS)):
        thickness, count = PANES[number % len(PANES)]
        height = 3.0 if thickness < 0.01 else 3000.0 * max(thickness, 1.0)
        placed = {"position": (0.0, 0.0, height), "direction": (0.0, 0.0, -1.0)}
        light = made(lamp, {"name": kind, "spectral_power": BEAM.spectral_power, **placed, **given})
        middles = np.interp(np.arange(count) + 0.5, [0.0, count], [420.0, 680.0])
        depths = 0.1 + 2.5 * (1.0 - np.exp(-0.5 * ((VISIBLE_NM - middles[:, None]) / 60.0) ** 2))
        places = 0.6 * (np.arange(count) - 0.5 * (count - 1))
        panes = []
        for x, depth in zip(places, depths, strict=True):
            pane = solid("pane", box((0.5, 0.5, thickness)), CROWN, (float(x), 0.0, 1.0 + 0.5 * thickness))
            panes.append(replace(pane, material=pane.material.changed(absorption=Absorption(depth / thickness))))
        scene = stage(*panes, lights=[light], camera=LOW, table=SceneObject("table", table, Diffuse((1.0, 1.0, 1.0))))
        found, off = probe(context, scene, replace(settings, method=method)), 0.0
        for x, depth in zip(places * (1.0 if light.is_parallel else height / (height - 1.0)), depths, strict=True):
            part = found.picture[np.ix_(np.abs(at_y) < 0.1, np.abs(at_x - x) < 0.1)].mean(axis=(0, 1)) * np.pi
            want = behind_a_pane(light, height, x, depth)
            off = max(off, float(np.abs(part - want).max() / want.max()))
        label = f"{count} of {thickness:g} under a {kind}, {method}"
        held = Held(
            {"colour": off, "unaccounted": found.stats.tally.imbalance}, {"colour": COLOUR, "unaccounted": COUNTED}
        )
        yield replace(measurement(number, label, found, held), flux_imbalance=None)


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
    Case(
        "tinted-panes",
        "Panes of one to eight tints, 1e-4 to 10 thick, under every kind of lamp, against Beer and Lambert's law",
        "Light that is caught in a thin pane is absorbed to nothing, by which nothing may be divided; and every tint "
        "needs bands of its own, of which a texture holds so many.",
        "row",
        measure_panes,
        len(LAMPS) * len(METHODS),
        logarithmic=False,
    ),
)
