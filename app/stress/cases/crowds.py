"""Many of everything: lights, objects, stones, triangles, glasses, lines of absorption and tints. Outside of the
beam they may cost time and memory, and nothing else."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import box, plane, slab
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import sphere
from ...model.lights import AreaLight, CollimatedLight, DirectionalLight, IesLight, PointLight, SpotLight
from ...model.lights.ies_file import Profile
from ...model.lights.light import made
from ...model.materials.absorption import Absorption
from ...model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz, xyz_to_rgb709
from ...model.optics.glass import from_abbe
from ...model.scene import Diffuse, Light, Scene, SceneObject
from ...model.scene_checks import MAX_LIGHTS, MAX_OBJECTS
from ..case import Held, Measured, case
from ..rigs.probe import (
    SAME_ENERGY,
    SAME_PICTURE,
    SMALL,
    against_single_wavelengths,
    compared,
    energy_error,
    picture_error,
    probe,
    rendered,
)
from ..rigs.scene_parts import BEAM, CROWN, FLINT, SUN, UNDER_GLASS, brighter, solid, stage
from .lights import refused


@cache
def _ball(triangles: int = 1_280) -> SceneObject:
    """In the beam."""
    return solid("ball", sphere(0.5, triangles), CROWN, (BEAM.position[0], 0.0, 0.9))


def _in_light_of(count: int) -> Scene:
    spectrum = brighter(SUN.spectral_power, 1.0 / count)
    return stage(_ball(), lights=[replace(SUN, name=f"sun {i}", spectral_power=spectrum) for i in range(count)])


@case("many-lights", "lights", (1, 16, 255, 256, 300))
def many_lights(context: Context, counts: Sequence[int]) -> Measured:
    """One sun in up to 256 parts; 300 are refused

    A photon stores its light in 8 bits: one light more would be read as a wavelength band."""
    whole = probe(context, _in_light_of(1))
    for count in counts:
        if count > MAX_LIGHTS:
            yield refused(count, f"{count} lights", partial(_in_light_of, count))
            continue
        found = probe(context, _in_light_of(count))
        # Photons are shared by many lights, each with a lattice of its own.
        held: Held = {"energy": (energy_error(found.picture, whole.picture), 0.03)}
        yield rendered(count, f"{count} light{'s' * (count > 1)}", found, held)


def _with_a_city(count: int) -> Scene:
    """So many objects in all: the ball, the table, and boxes of one mesh in a square far outside of the beam."""
    house, side = box((0.5, 0.5, 0.5)), int(np.ceil((count - 2) ** 0.5))
    places = ((40.0 + i % side, float(i // side), 0.5) for i in range(count - 2))
    return stage(_ball(), *(solid("house", house, FLINT, place) for place in places))


@case("many-objects", "objects", (1_000, 10_000, 65_534, 70_000))
def many_objects(context: Context, counts: Sequence[int]) -> Measured:
    """A ball in a beam, and up to 65,534 glass boxes outside of it; 70,000 are refused

    A photon stores the object that it met first in 16 bits; what no light meets may not change the picture."""
    alone = probe(context, stage(_ball()))
    for count in counts:
        if count > MAX_OBJECTS:
            yield refused(count, f"{count:,} objects", partial(_with_a_city, count))
            continue
        started = time.perf_counter()
        found = probe(context, _with_a_city(count))
        held, seconds = compared(found, alone, SAME_PICTURE, SAME_ENERGY), time.perf_counter() - started
        yield rendered(count, f"{count:,} objects", found, held, f"{seconds:.1f} s")


@case("many-stones", "stones", (10, 100, 1_000))
def many_stones(context: Context, counts: Sequence[int]) -> Measured:
    """Up to a thousand brilliants under one sun

    Light wanders from stone to stone; every share of it must be accounted for."""
    stone = brilliant(0.9)
    for count in counts:
        side = int(np.ceil(count**0.5))
        places = ((1.2 * (i % side - 0.5 * side), 1.2 * (i // side - 0.5 * side), 0.8) for i in range(count))
        scene = stage(*(solid("stone", stone, FLINT, place) for place in places), lights=[SUN])
        found = probe(context, scene, replace(SMALL, photons=65_536))
        held: Held = {"shares missing": (abs(1.0 - sum(found.shares.values())), 1e-3)}
        yield rendered(count, f"{count:,} brilliants", found, held)


@case("many-triangles", "triangles", (1_280, 20_480, 327_680, 2_000_000))
def many_triangles(context: Context, counts: Sequence[int]) -> Measured:
    """A ball of up to two million triangles

    Tessellation is an error that settles; trees deepen, and offsets must find their triangle."""
    before: np.ndarray | None = None
    for count in counts:
        started = time.perf_counter()
        triangles, found = len(_ball(count).mesh.triangles), probe(context, stage(_ball(count)))
        # A ball of 1,280 triangles with smooth normals; the finest is compared with the one before it.
        held: Held = {
            "picture, against the coarser": ([] if before is None else picture_error(found.picture, before), 0.05)
        }
        before, seconds = found.picture, time.perf_counter() - started
        yield rendered(triangles, f"{triangles:,} triangles", found, held, f"{seconds:.1f} s")


@case("many-glasses", "glasses", (2, 4, 5, 8))
def many_glasses(context: Context, counts: Sequence[int]) -> Measured:
    """Up to eight glasses in one scene, against one-wavelength photons

    Each of four glasses has columns of its own; more share one, and bands are then finer."""
    for count in counts:
        blocks = []
        for i in range(count):
            place = 0.55 * (i % 4) - 0.9, 0.7 * (i // 4) - 0.35, 0.5 + 0.02 * i
            blocks.append(solid("block", box((0.4, 0.4, 0.3)), from_abbe(1.5 + 0.03 * i, 60.0 - 4.0 * i), place))
        yield against_single_wavelengths(context, stage(*blocks, lights=[SUN]), count, f"{count} glasses")


# ---- glass that absorbs: in lines, as didymium does, and panes of several tints -------------------

LINES_NM = (430.0, 475.0, 512.0, 526.0, 573.0, 586.0, 684.0, 740.0)
"""About where neodymium and praseodymium absorb in glass."""
THICK = 0.5
POWER = 0.02
"""Relative error of the power that gets through: 32 bands have to do for eight lines, three bends each. Also of the
picture that beams make, against that of photons."""


def optical_depth(width_nm: float) -> np.ndarray:
    """Of the slab on the visible grid: 3 in the middle of a line so wide at half its maximum."""
    sigma = width_nm / np.sqrt(8.0 * np.log(2.0))
    lines = np.exp(-0.5 * ((VISIBLE_NM[:, None] - np.array(LINES_NM)) / sigma) ** 2)
    return 3.0 * np.asarray(lines.sum(axis=1))


def absorbing(item: SceneObject, coefficient: np.ndarray) -> SceneObject:
    """The same of glass that absorbs."""
    return replace(item, material=item.material.changed(absorption=Absorption(coefficient)))


def behind_the_slab(width_nm: float) -> Scene:
    """A beam straight down through a slab of such glass."""
    pane = solid("pane", slab(3.0, 3.0, THICK), CROWN, (0.0, 0.0, 1.0))
    return stage(absorbing(pane, optical_depth(width_nm) / THICK))


def share_behind(depth: np.ndarray, cosine: float = 1.0) -> np.ndarray:
    """Share of light behind a plate, by the nanometre: Fresnel's reflections within it all added up, and Beer and
    Lambert's law along the way in it."""
    n = CROWN.index(VISIBLE_NM)
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / n**2)
    kept = np.exp(-depth / inside)
    s, p = ((cosine - n * inside) / (cosine + n * inside)) ** 2, ((n * cosine - inside) / (n * cosine + inside)) ** 2
    return np.asarray(0.5 * sum((1.0 - r) ** 2 * kept / (1.0 - (r * kept) ** 2) for r in (s, p)))


@case("absorption-lines", "width of a line, nm", (80.0, 40.0, 20.0, 10.0, 5.0, 2.0))
def absorption_lines(context: Context, widths_nm: Sequence[float]) -> Measured:
    """A slab that absorbs in eight lines ever narrower, against Beer and Lambert's law with Fresnel's

    Weights are known at three places of a band and straight between them: a band must not be wider than the detail it
    has to show."""
    power = BEAM.spectral_power.density
    for width in widths_nm:
        scene = behind_the_slab(width)
        photons, beams = probe(context, scene), probe(context, scene, replace(SMALL, method="srd"))
        passing = np.trapezoid(power * share_behind(optical_depth(width)), VISIBLE_NM)
        want = float(passing / np.trapezoid(power, VISIBLE_NM))
        held: Held = {
            "power": (abs(photons.shares["deposited"] / want - 1.0), POWER),
            "beams": (energy_error(beams.picture, photons.picture), POWER),
        }
        yield rendered(width, f"{width:g} nm", photons, held, f"{100.0 * want:.1f} % pass")


ROUND = Profile(np.array([0.0, 180.0]), np.array([0.0, 360.0]), np.ones((2, 2)), 1.0, "")
LAMPS: dict[str, tuple[type[Light], dict[str, Any]]] = {
    "sun": (DirectionalLight, {"angular_diameter_deg": 0.53}),
    "parallel": (DirectionalLight, {"angular_diameter_deg": 0.0}),
    "beam": (CollimatedLight, {"radius": 4.0}),
    "point": (PointLight, {}),
    "spot": (SpotLight, {"inner_half_angle_deg": 50.0, "outer_half_angle_deg": 60.0}),
    "panel": (AreaLight, {"radius": 0.015}),
    "file": (IesLight, {"profile": ROUND}),
}
PANES = ((1e-4, 8), (4e-3, 1), (4e-3, 2), (0.1, 4), (1.0, 3), (10.0, 8))
"""Thickness and number of tints."""
TINTED = [
    (number, kind, method, *PANES[number % len(PANES)])
    for number, (kind, method) in enumerate(product(LAMPS, ("srd", "srd-photons")))
]
COLOUR = 0.04
"""What a colour behind a pane may be off by, over its largest channel: footprints blur beyond their pane's edge, and
weak beams of the sun's parts play roulette."""
COUNTED = 0.02
"""Share of the light whose end beams do not count: what a facet absorbs they count by the middle of a band."""
LOW = replace(UNDER_GLASS, vertical_extent=2.0)


def behind_a_pane(light: Light, height: float, x: float, depth: np.ndarray) -> np.ndarray:
    """Linear Rec.709 irradiance of a table at `x` from below the lamp, through a pane that moves light by nothing."""
    cosine = 1.0 if light.is_parallel else float(height / np.hypot(height, x))
    share = share_behind(depth, cosine) * cosine ** (4 if light.has_outline else 3) / light.reach(height)
    return np.asarray(xyz_to_rgb709(K_M * (light.spectral_power.density * share) @ cmf_xyz()))


@case("tinted-panes", "row", TINTED)
def tinted_panes(context: Context, rows: Sequence[tuple[int, str, str, float, int]]) -> Measured:
    """Panes of one to eight tints, 1e-4 to 10 thick, under every kind of lamp, against Beer and Lambert's law

    Light that is caught in a thin pane is absorbed to nothing, by which nothing may be divided; and every tint needs
    bands of its own, of which a texture holds so many."""
    settings = replace(SMALL, width=320, height=80, spp=4, layer="caustic")
    table = SceneObject("table", plane(8.0, 2.0), Diffuse((1.0, 1.0, 1.0)))
    at_x, at_y = 4.0 - (np.arange(320) + 0.5) / 40.0, (np.arange(80) + 0.5) / 40.0 - 1.0
    for number, kind, method, thickness, count in rows:
        height, (lamp, given) = 3.0 if thickness < 0.01 else 3000.0 * max(thickness, 1.0), LAMPS[kind]
        given = {"position": (0.0, 0.0, height), "direction": (0.0, 0.0, -1.0)} | given
        light = made(lamp, {"name": kind, "spectral_power": BEAM.spectral_power, **given})
        middles = np.interp(np.arange(count) + 0.5, [0.0, count], [420.0, 680.0])
        depths = 0.1 + 2.5 * (1.0 - np.exp(-0.5 * ((VISIBLE_NM - middles[:, None]) / 60.0) ** 2))
        places, mesh = 0.6 * (np.arange(count) - 0.5 * (count - 1)), box((0.5, 0.5, thickness))
        panes = [
            absorbing(solid("pane", mesh, CROWN, (float(x), 0.0, 1.0 + 0.5 * thickness)), depth / thickness)
            for x, depth in zip(places, depths, strict=True)
        ]
        scene = stage(*panes, lights=[light], camera=LOW, table=table)
        found, off = probe(context, scene, replace(settings, method=method)), 0.0
        for x, depth in zip(places * (1.0 if light.is_parallel else height / (height - 1.0)), depths, strict=True):
            part = found.picture[np.ix_(np.abs(at_y) < 0.1, np.abs(at_x - x) < 0.1)].mean(axis=(0, 1)) * np.pi
            want = behind_a_pane(light, height, x, depth)
            off = max(off, float(np.abs(part - want).max() / want.max()))
        label = f"{count} of {thickness:g} under a {kind}, {method}"
        held: Held = {"colour": (off, COLOUR), "unaccounted": (found.stats.tally.imbalance, COUNTED)}
        yield replace(rendered(number, label, found, held), flux_imbalance=None)
