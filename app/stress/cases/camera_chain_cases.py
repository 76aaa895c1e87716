"""The camera's paths at their longest: light guides, retroreflectors, gems, rooms of mirrors, and more branches than
can wait.

What a path is given up for must be counted, and must cost no more light than it carried.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...gpu.context import Context
from ...model.geometry.mesh import make_mesh
from ...model.geometry.primitives import box
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import ellipsoid, sphere
from ...model.optics.colorimetry import rgb_basis
from ...model.optics.glass import constant, from_abbe
from ...model.scene import Camera, Mirror, SceneObject
from ...passes.variants import MAX_DEPTH
from ..case import Case, Measurement
from ..rigs.camera_probe import (
    PROBE,
    UNCHECKED,
    Judged,
    daylight_mean,
    fresnel,
    furnace_errors,
    half_sky,
    measurement_of,
    render_probe,
    resized,
    sharing_programs,
    slope,
    slope_sky,
    white_furnace,
    with_sky,
)
from ..rigs.flat_glass import extruded, rectangle, ways
from ..rigs.scene_parts import solid

FEW = resized(PROBE, 12, 8, 64)
GUIDE_N = 1.6
BOUNCES = (10, 20, 30, 40, 60)
"""Total reflections on the way through a light guide; from MAX_DEPTH on the way ends inside."""
CORNER_N = 1.8
TILTS_DEG = (0.0, 2.0, 5.0, 10.0, 15.0)
REFLECTANCES = (1.0, 0.98, 0.9, 0.5)
HOPS = (2, 8, 32, 46)
"""Reflections between two mirrors."""
SHELLS = (1, 2, 3)


@sharing_programs
def measure_guide(context: Context) -> Iterator[Measurement]:
    """A square rod, looked into at 45°: all that enters is reflected totally from side to side and leaves at the far
    end."""
    direction = np.array([1.0, 1.0]) / np.sqrt(2.0)
    inner = np.array([np.sqrt(1.0 - 0.5 / GUIDE_N**2), np.sqrt(0.5) / GUIDE_N])
    glass = constant(GUIDE_N, "guide")
    for bounces in BOUNCES:
        width, height = bounces * 0.2 * inner[0] / inner[1], 0.2
        outline = rectangle(width, height)
        foot = np.array([-0.5 * width, 0.013])
        start = foot - 2.0 * direction
        camera = Camera((*start, 0.0), (*foot, 0.0), (0.0, 0.0, 1.0), "orthographic", vertical_extent=0.01)
        guide = solid("guide", extruded(outline, 0.2, "guide"), glass)
        sight = render_probe(context, with_sky(guide, camera=camera, environment=half_sky((1.0, 0.0, 0.0))), FEW)
        out = ways(outline, GUIDE_N, tuple(start), tuple(direction))
        expected = sum(way.weight for way in out if way.direction[0] > 0.0)
        # A path given up shines as if it left there, in the direction it has, without the 5 % that the end would have
        # reflected.
        given_up = sum(way.weight for way in out if way.events > MAX_DEPTH)
        judged = Judged().hold("transmittance", np.abs(sight.mean - expected).max(), 0.08 * given_up + 3e-3)
        deep = any(way.events > MAX_DEPTH and way.weight > 0.5 for way in out)
        judged.hold("not counted", float(deep and sight.share("depth_reached") < 1.0), 0.0)
        note = f"{given_up:.1%} of the light has more than {MAX_DEPTH} events before it"
        yield measurement_of(bounces, f"{bounces} reflections", sight, judged, {"depth_reached": UNCHECKED}, note)


@sharing_programs
def measure_corner(context: Context) -> Iterator[Measurement]:
    """A corner cube throws light back where it came from; what its face reflects, outside or inside, goes to the
    mirrored side."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    corner = make_mesh("corner", corners, np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]))
    face = np.ones(3) / np.sqrt(3.0)
    side = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    for tilt_deg in TILTS_DEG:
        tilt = np.radians(tilt_deg)
        toward, mirrored = (np.cos(tilt) * face + sign * np.sin(tilt) * side for sign in (1.0, -1.0))
        camera = Camera(
            tuple(face / np.sqrt(3.0) + 3.0 * toward),
            tuple(face / np.sqrt(3.0)),
            (0.0, 0.0, 1.0),
            "orthographic",
            vertical_extent=0.02,
        )
        sight = render_probe(
            context, with_sky(solid("corner", corner, constant(CORNER_N)), camera=camera, environment=slope_sky()), FEW
        )
        r = float(fresnel(np.cos(tilt), CORNER_N))
        back, across = slope(toward), slope(mirrored)
        expected = r * across + (1.0 - r) ** 2 * (back + r * across) / (1.0 - r * r)
        # The face is no larger than the cube: of what it reflects inside, some comes out another way.
        judged = Judged().hold(
            "returned", np.abs(sight.mean / expected - 1.0).max(), 1e-3 if tilt_deg <= 10.0 else r * r
        )
        yield measurement_of(tilt_deg, f"tilted by {tilt_deg:g}°", sight, judged)


@sharing_programs
def measure_gems(context: Context) -> Iterator[Measurement]:
    """White all round: a gem without absorption cannot be seen in it, however long its chains are."""
    stones = (
        ("brilliant, n 2.42", brilliant(2.0), constant(2.42), 5e-3),
        ("smooth ellipsoid, n 2.42", ellipsoid((1.0, 0.8, 0.6), 1280), constant(2.42), 5e-3),
        ("cube, n 1.5: light that never leaves", box((1.2, 1.2, 1.2)), constant(1.5), 5e-3),
        ("brilliant, V_d 55", brilliant(2.0), from_abbe(2.42, 55.0, "diamond"), 5e-3),
        ("brilliant, V_d 10", brilliant(2.0), from_abbe(2.42, 10.0, "fiery"), 1e-2),
    )
    for number, (label, mesh, glass, mean) in enumerate(stones, 1):
        camera = Camera((0.4, -4.0, 2.2), (0.0, 0.0, 0.0), vertical_fov_deg=26.0)
        sight = render_probe(context, white_furnace(solid("stone", mesh, glass), camera=camera))
        judged = furnace_errors(Judged(), sight.picture, mean, 0.2)
        yield measurement_of(
            number,
            label,
            sight,
            judged,
            {"depth_reached": 0.3, "columns_dropped": UNCHECKED, "band_uncut": UNCHECKED, "stack_full": 1e-2},
        )


@sharing_programs
def measure_room(context: Context) -> Iterator[Measurement]:
    """A closed room of mirrors: every path meets MAX_DEPTH of them, is counted, and is worth the product of their
    reflectances."""
    camera = Camera((0.1, 0.2, 0.05), (1.0, 0.4, 0.3), vertical_fov_deg=60.0)
    for reflectance in REFLECTANCES:
        room = SceneObject("room", box((2.0, 2.0, 2.0)), Mirror((reflectance, reflectance, reflectance)))
        sight = render_probe(context, white_furnace(room, camera=camera), FEW)
        expected = reflectance**MAX_DEPTH
        judged = Judged().hold("radiance", np.abs(sight.mean / expected - 1.0).max(), 1e-4)
        judged.hold("paths not counted", abs(sight.share("depth_reached") - 1.0), 0.0)
        yield measurement_of(reflectance, f"reflectance {reflectance:g}", sight, judged, {"depth_reached": 1.0})


@sharing_programs
def measure_mirrors(context: Context) -> Iterator[Measurement]:
    """Two coloured mirrors that face each other: their reflectances multiply wavelength by wavelength, not colour by
    colour."""
    colours = (0.95, 0.85, 0.6), (0.98, 0.9, 0.97)
    for hops in HOPS:
        sight = render_probe(context, white_furnace(*_corridor(colours, hops), camera=_into_corridor(hops)), FEW)
        first, second = (rgb_basis() @ np.array(c) for c in colours)
        expected = daylight_mean(first ** ((hops + 1) // 2) * second ** (hops // 2))
        judged = Judged().hold("colour", np.abs(sight.mean - expected).max() / expected.max(), 1e-2)
        yield measurement_of(hops, f"{hops} reflections", sight, judged)


def _corridor(colours: tuple, hops: int) -> list[SceneObject]:
    """Mirrors in x = 1 and x = −1, as long as a ray that climbs 0.1 at every crossing takes for `hops` of them."""
    found = []
    for side, colour, last in (
        (1.0, colours[0], hops if hops % 2 else hops - 1),
        (-1.0, colours[1], hops if hops % 2 == 0 else hops - 1),
    ):
        reach = 0.1 * last
        matrix = np.eye(4)
        matrix[:3, 3] = side * 1.05, 0.0, 0.5 * reach
        found.append(SceneObject(f"mirror {side:+.0f}", box((0.1, 1.0, reach + 0.1)), Mirror(colour), matrix))
    return found


def _into_corridor(hops: int) -> Camera:
    direction = np.array([2.0, 0.0, 0.1])
    start = np.array([1.0, 0.0, 0.1]) - 0.5 * direction
    return Camera(tuple(start), tuple(start + direction), (0.0, 1.0, 0.0), "orthographic", vertical_extent=0.01)


@sharing_programs
def measure_shells(context: Context) -> Iterator[Measurement]:
    """Shells of n = 3 with air between: every face splits strongly, more paths wait than there is room for, and white
    stays white."""
    camera = Camera((0.0, -5.0, 0.3), (0.0, 0.0, 0.0), vertical_fov_deg=24.0)
    for shells in SHELLS:
        items = []
        for k in range(2 * shells, 0, -1):
            glass = constant(3.0, "dense") if k % 2 == 0 else constant(1.0, "air")
            items.append(solid(f"shell {k}", sphere(0.9 * k / (2 * shells), 320), glass, priority=2 * shells - k))
        sight = render_probe(context, white_furnace(*items, camera=camera), resized(PROBE, 24, 16))
        judged = furnace_errors(Judged(), sight.picture, 2e-3, 0.1)
        judged.hold("full stack not counted", float(shells > 1 and not sight.fallbacks["stack_full"]), 0.0)
        yield measurement_of(
            shells,
            f"{shells} shells",
            sight,
            judged,
            {"stack_full": UNCHECKED, "depth_reached": UNCHECKED, "columns_dropped": UNCHECKED},
        )


CASES: tuple[Case, ...] = (
    Case(
        "eye-guide",
        "A light guide of ten to sixty total reflections, against the sum over all ways",
        f"A camera path ends after {MAX_DEPTH} surfaces. What is given up is counted, and shines as if it left the "
        "glass there.",
        "reflections",
        measure_guide,
        len(BOUNCES),
        logarithmic=False,
    ),
    Case(
        "eye-corner",
        "A corner cube of glass throws the view back",
        "Three total reflections turn any ray round exactly; rounding must not.",
        "tilt (degrees)",
        measure_corner,
        len(TILTS_DEG),
        logarithmic=False,
    ),
    Case(
        "eye-gems",
        "Gems before white: nothing of them may be seen",
        "Chains of dozens of reflections split at every facet, columns grow exponentially, total reflection cuts "
        "bands; the "
        "weights of all parts must add up to one.",
        "gem",
        measure_gems,
        5,
        logarithmic=False,
    ),
    Case(
        "eye-room",
        "A closed room of mirrors",
        "No path ends by itself: each must be given up, once, and counted.",
        "reflectance",
        measure_room,
        len(REFLECTANCES),
        logarithmic=False,
    ),
    Case(
        "eye-mirrors",
        "Two coloured mirrors that face each other, against the product of their spectra",
        "Colours multiplied as three numbers drift away from spectra with every reflection.",
        "reflections",
        measure_mirrors,
        len(HOPS),
    ),
    Case(
        "eye-shells",
        "Shells within shells, each of which splits a path strongly",
        "More branches than can wait: the rest is left to chance, counted, and no light may be lost by it.",
        "shells",
        measure_shells,
        len(SHELLS),
        logarithmic=False,
    ),
)
