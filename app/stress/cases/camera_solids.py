"""Whole solids seen through: the camera's paths at their longest (light guides, retroreflectors, gems, rooms of
mirrors, more branches than can wait), the camera in glass or on its face, solids at any scale, nested or touching, and
spoilt meshes.

What a path is given up for must be counted, and must cost no more light than it carried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...gpu.context import Context
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.geometry.primitives import box, extruded
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import ellipsoid, sphere
from ...model.optics.colorimetry import rgb_basis
from ...model.optics.glass import Dispersion, constant, from_abbe
from ...model.scene import Camera, Mirror, Scene, SceneObject
from ...passes.camera_programs import MAX_DEPTH
from ..case import Held, Measured, case
from ..rigs.camera_probe import (
    ANY,
    FEW,
    PROBE,
    Sight,
    ahead,
    daylight_mean,
    difference,
    fresnel,
    in_furnace,
    render_probe,
    resized,
    seen,
    sky,
    slope,
    slope_sky,
    straight,
    together,
    white_furnace,
    with_sky,
)
from ..rigs.flat_glass import radiance_seen, rectangle, ways
from ..rigs.probe import NOISE
from ..rigs.scene_parts import FLINT, SUN, at, extent, moved, solid, stage, tilted, with_glass
from .contacts import PAIRS, Pair
from .meshes import FAULTS, Fault

ORIGIN = (0.0, 0.0, 0.0)


@case("eye-guide", "reflections", (10, 20, 30, 40, 60))
def eye_guide(context: Context, counts: Sequence[int]) -> Measured:
    """A light guide of ten to sixty total reflections, against the sum over all ways

    A camera path ends after a fixed number of surfaces. What is given up is counted, and shines as if it left the glass
    there."""
    n = 1.6
    direction = np.array([1.0, 1.0]) / np.sqrt(2.0)
    cosine, sine = np.sqrt(1.0 - 0.5 / n**2), np.sqrt(0.5) / n
    for bounces in counts:
        # Looked into at 45°: all that enters is reflected totally from side to side and leaves at the far end.
        outline = rectangle(bounces * 0.2 * cosine / sine, 0.2)
        foot = np.array([outline[0, 0], 0.013])
        start = foot - 2.0 * direction
        guide = solid("guide", extruded("guide", outline, 0.2), constant(n, "guide"))
        camera = straight((*foot, 0.0), (*direction, 0.0), 0.01, 2.0)
        sight = render_probe(context, with_sky(guide, camera=camera, environment=sky(ahead)), FEW)
        out = ways(outline, n, start, direction)
        expected = sum(way.weight for way in out if way.direction[0] > 0.0)
        # A path given up shines as if it left there, in the direction it has, without the 5 % that the end would have
        # reflected.
        given_up = sum(way.weight for way in out if way.events > MAX_DEPTH)
        deep = any(way.events > MAX_DEPTH and way.weight > 0.5 for way in out)
        held: Held = {
            "transmittance": (np.abs(sight.mean - expected).max(), 0.08 * given_up + 3e-3),
            "not counted": (deep and sight.share("depth_reached") < 1.0, 0.0),
        }
        note = f"{given_up:.1%} of the light has more than {MAX_DEPTH} events before it"
        shares = {"depth_reached": np.inf}
        yield seen(bounces, f"{bounces} reflections", sight, held, shares, note)


@case("eye-corner", "tilt (degrees)", (0.0, 2.0, 5.0, 10.0, 15.0))
def eye_corner(context: Context, tilts_deg: Sequence[float]) -> Measured:
    """A corner cube of glass returns the view

    Three total reflections turn any ray round exactly; rounding must not."""
    n, corners = 1.8, np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    mesh = make_mesh("corner", corners, np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]))
    face, side = np.ones(3) / np.sqrt(3.0), np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    for tilt_deg in tilts_deg:
        tilt = np.radians(tilt_deg)
        toward, mirrored = (np.cos(tilt) * face + sign * np.sin(tilt) * side for sign in (1.0, -1.0))
        camera = straight(face / np.sqrt(3.0), -toward, 0.02)
        scene = with_sky(solid("corner", mesh, constant(n)), camera=camera, environment=slope_sky())
        sight = render_probe(context, scene, FEW)
        # What its face reflects, outside or inside, leaves on the mirrored side.
        r, back, across = float(fresnel(np.cos(tilt), n)), slope(toward), slope(mirrored)
        expected = r * across + (1.0 - r) ** 2 * (back + r * across) / (1.0 - r * r)
        # The face is no larger than the cube: of what it reflects inside, some comes out another way.
        bound = 1e-3 if tilt_deg <= 10.0 else r * r
        held: Held = {"returned": (np.abs(sight.mean / expected - 1.0).max(), bound)}
        yield seen(tilt_deg, f"tilted by {tilt_deg:g}°", sight, held)


STONES = (
    ("brilliant, n 2.42", brilliant(2.0), constant(2.42), 5e-3),
    ("smooth ellipsoid, n 2.42", ellipsoid((1.0, 0.8, 0.6), 1280), constant(2.42), 5e-3),
    ("cube, n 1.5: light that never leaves", box((1.2, 1.2, 1.2)), constant(1.5), 5e-3),
    ("brilliant, V_d 55", brilliant(2.0), from_abbe(2.42, 55.0, "diamond"), 5e-3),
    ("brilliant, V_d 10", brilliant(2.0), from_abbe(2.42, 10.0, "fiery"), 1e-2),
)


@case("eye-gems", "gem", STONES)
def eye_gems(context: Context, stones: Sequence[tuple[str, Mesh, Dispersion, float]]) -> Measured:
    """Gems before white: nothing of them may be seen

    Chains of dozens of reflections split at every facet, columns grow exponentially, total reflection cuts bands; the
    weights of all parts must add up to one."""
    camera = Camera((0.4, -4.0, 2.2), ORIGIN, vertical_fov_deg=26.0)
    for number, (label, mesh, glass, mean) in enumerate(stones, 1):
        sight = render_probe(context, white_furnace(solid("stone", mesh, glass), camera=camera))
        shares = ANY | {"depth_reached": 0.3, "stack_full": 1e-2}
        yield seen(number, label, sight, in_furnace(sight.picture, mean, 0.2), shares)


@case("eye-room", "reflectance", (1.0, 0.98, 0.9, 0.5))
def eye_room(context: Context, reflectances: Sequence[float]) -> Measured:
    """A closed room of mirrors

    No path ends by itself: each must be given up, once, and counted."""
    camera = Camera((0.1, 0.2, 0.05), (1.0, 0.4, 0.3), vertical_fov_deg=60.0)
    for reflectance in reflectances:
        room = SceneObject("room", box((2.0, 2.0, 2.0)), Mirror((reflectance, reflectance, reflectance)))
        sight = render_probe(context, white_furnace(room, camera=camera), FEW)
        held: Held = {
            "radiance": (np.abs(sight.mean / reflectance**MAX_DEPTH - 1.0).max(), 1e-4),
            "paths not counted": (abs(sight.share("depth_reached") - 1.0), 0.0),
        }
        yield seen(reflectance, f"reflectance {reflectance:g}", sight, held, {"depth_reached": 1.0})


@case("eye-mirrors", "reflections", (2, 8, 32, 46))
def eye_mirrors(context: Context, counts: Sequence[int]) -> Measured:
    """Two coloured mirrors that face each other, against the product of their spectra

    Colours multiplied as three numbers drift away from spectra with every reflection."""
    colours, direction = ((0.95, 0.85, 0.6), (0.98, 0.9, 0.97)), np.array([2.0, 0.0, 0.1])
    start = np.array([1.0, 0.0, 0.1]) - 0.5 * direction
    camera = Camera(tuple(start), tuple(start + direction), (0.0, 1.0, 0.0), "orthographic", vertical_extent=0.01)
    first, second = (rgb_basis() @ np.array(c) for c in colours)
    for hops in counts:
        # In x = 1 and x = −1, as long as a ray that climbs 0.1 at every crossing takes for so many of them.
        lengths = 0.1 * (hops if hops % 2 else hops - 1), 0.1 * (hops - 1 if hops % 2 else hops)
        mirrors = (
            SceneObject("mirror", box((0.1, 1.0, reach + 0.1)), Mirror(colour), at(side * 1.05, 0.0, 0.5 * reach))
            for side, colour, reach in zip((1.0, -1.0), colours, lengths, strict=True)
        )
        sight = render_probe(context, white_furnace(*mirrors, camera=camera), FEW)
        expected = daylight_mean(first ** ((hops + 1) // 2) * second ** (hops // 2))
        held: Held = {"colour": (np.abs(sight.mean - expected).max() / expected.max(), 1e-2)}
        yield seen(hops, f"{hops} reflections", sight, held)


@case("eye-shells", "shells", (1, 2, 3))
def eye_shells(context: Context, counts: Sequence[int]) -> Measured:
    """Shells within shells, each of which splits a path strongly

    More branches than can wait: the rest is left to chance, counted, and no light may be lost by it."""
    camera = Camera((0.0, -5.0, 0.3), ORIGIN, vertical_fov_deg=24.0)
    media = constant(3.0, "dense"), constant(1.0, "air")
    for shells in counts:
        faces = range(2 * shells, 0, -1)
        items = (
            solid("shell", sphere(0.9 * k / (2 * shells), 320), media[k % 2], priority=2 * shells - k) for k in faces
        )
        sight = render_probe(context, white_furnace(*items, camera=camera), resized(PROBE, 24, 16))
        uncounted = shells > 1 and not sight.fallbacks["stack_full"]
        held: Held = {**in_furnace(sight.picture, 2e-3, 0.1), "full stack not counted": (uncounted, 0.0)}
        yield seen(shells, f"{shells} shells", sight, held, ANY | {"band_uncut": 0.0})


# ---- where the camera is ----------------------------------------------------------------------

SURE = 1e-3
"""Nearer to a face than that the camera may be taken for inside or outside, for float32 and a ray's
safe distance cannot distinguish them."""


@case("eye-inside", "place", (0.3, 1e-2, 1e-3, 1e-5, 1e-7, 0.0, -1e-7, -1e-5, -1e-3, -1e-2, -0.3))
def eye_inside(context: Context, distances: Sequence[float]) -> Measured:
    """The camera inside glass, on its face and before it, against the sum over all ways

    Which medium a path begins in decides all that follows, and on a face rounding decides that; either is right,
    anything else is not."""
    n, outline, angle = 1.5, rectangle(1.0, 1.0), np.radians(20.0)
    glass = solid("cube", extruded("cube", outline, 1.0), constant(n))
    for number, distance in enumerate(distances):
        held, sights = {}, []
        for name, sign in (("outwards", 1.0), ("inwards", -1.0)):
            direction, start = np.array([sign * np.cos(angle), np.sin(angle)]), np.array([0.5 - distance, 0.07])
            camera = Camera((*start, 0.0), (*(start + direction), 0.0), (0.0, 0.0, 1.0), vertical_fov_deg=0.1)
            sights.append(render_probe(context, with_sky(glass, camera=camera, environment=slope_sky()), FEW))
            # Next to the face, from a point that is no doubt inside and from one that is outside.
            places = (
                [(start[0], distance > 0.0)] if abs(distance) >= SURE else [(0.5 - 1e-9, True), (0.5 + 1e-9, False)]
            )
            true = [radiance_seen(outline, n, (x, start[1]), direction, slope, inside) for x, inside in places]
            held[name] = min(np.abs(sights[-1].mean / value - 1.0).max() for value in true), 5e-4
        label = f"{abs(distance):.0e} {'inside' if distance > 0.0 else 'outside'}" if distance else "on the face"
        yield seen(number, label, together(*sights), held)


# ---- against a simpler description -------------------------------------------------------------

SEEN_FROM = Camera((2.6, -2.2, 2.6), (0.0, 0.0, 1.1), vertical_fov_deg=30.0)
SAME_PICTURE, SAME_ENERGY = 5e-3, 3e-3
"""Rounding's share of a picture; of its sum."""
CHOSEN_PAIRS = (
    "a bubble as a solid of n = 1, and as a cavity",
    "water that reaches into the wall, and one that is carved out",
    "a cemented doublet of one glass, and a lens",
)


def alike(sight: Sight, base: Sight, picture: float) -> Held:
    """Two pictures of one thing."""
    return {
        "picture": (difference(sight.picture, base.picture), picture),
        "energy": (abs(sight.picture.mean() / base.picture.mean() - 1.0), SAME_ENERGY),
    }


def two_seeds(context: Context, scene: Scene) -> tuple[Sight, float]:
    """A picture in one band, and what a picture of another seed may differ from it."""
    base, other = (render_probe(context, scene, replace(PROBE, seed=seed), 1) for seed in (1, 2))
    return base, NOISE * difference(other.picture, base.picture) + SAME_PICTURE


def _glass_alone(scene: Scene) -> Scene:
    """Without dispersion, under a sky: the case is about which medium comes next."""
    glass = tuple(item for item in scene.objects if item.material.transmits)
    scene = replace(scene, camera=SEEN_FROM, objects=glass, lights=(), environment=slope_sky())
    return with_glass(scene, lambda dispersion: constant(dispersion.n_d, dispersion.name))


@case("eye-contacts", "pair", [pair for pair in PAIRS if pair.label in CHOSEN_PAIRS])
def eye_contacts(context: Context, pairs: Sequence[Pair]) -> Measured:
    """Solids that nest or touch, seen through, against a simpler scene of the same look

    Where faces coincide rounding decides their order; a path must follow priorities."""
    for number, pair in enumerate(pairs, 1):
        base, chance = two_seeds(context, _glass_alone(pair.plain()))
        sight = render_probe(context, _glass_alone(pair.joined()), PROBE, 1)
        yield seen(number, pair.label, sight, alike(sight, base, chance), ANY)


CHANGES = (
    ("× 1e-4", 1e-4, 0.0),
    ("× 1e4", 1e4, 0.0),
    ("1e4 extents off the origin", 1.0, 1e4),
    ("× 1e-4, and 1e4 extents off", 1e-4, 1e4),
)


@case("eye-scale", "change", CHANGES)
def eye_scale(context: Context, changes: Sequence[tuple[str, float, float]]) -> Measured:
    """A brilliant on a table, at other sizes and far from the origin

    Columns, footprints and safe distances have lengths in them; the picture has none."""
    scene = stage(*tilted(solid("stone", brilliant(1.2), FLINT)), lights=[SUN], camera=SEEN_FROM)
    scene = replace(scene, background_rgb=(0.3, 0.4, 0.6))
    base = render_probe(context, scene, PROBE, 4)
    for number, (label, scale, offset) in enumerate(changes, 1):
        place = offset * extent(scene) * scale
        sight = render_probe(context, moved(scene, scale=scale, offset=(place, -place, place)), PROBE, 4)
        yield seen(number, label, sight, alike(sight, base, SAME_PICTURE), ANY)


CHOSEN_FAULTS = [fault for fault in FAULTS if fault.label not in ("nothing", "every face twice")]


@case("eye-meshes", "fault", CHOSEN_FAULTS)
def eye_meshes(context: Context, faults: Sequence[Fault]) -> Measured:
    """Mesh files with slivers, zero normals, doubled vertices and holes, seen against the intact solid

    Normals of nothing are NaN, and so are the columns that they bend. A hole lets rays in that no medium can follow:
    that only has to stay finite."""

    def viewed(fault: Fault) -> Scene:
        glass = FLINT if fault.smooth else constant(1.7, "no dispersion")
        return with_sky(*tilted(solid("solid", fault.loaded()[0], glass)), camera=SEEN_FROM, environment=slope_sky())

    clean = {smooth: two_seeds(context, viewed(Fault("", lambda mesh: mesh, smooth))) for smooth in (False, True)}
    for number, fault in enumerate(faults, 1):
        sight, (base, chance) = render_probe(context, viewed(fault), PROBE, 1), clean[fault.smooth]
        held: Held = {"picture": (difference(sight.picture, base.picture), chance if fault.mendable else None)}
        yield seen(number, fault.label, sight, held, ANY)
