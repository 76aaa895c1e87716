"""Where the camera stands, and whole solids seen through: inside glass, on its face, at any scale, solids that nest or
touch, spoilt meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives_gem import brilliant
from ...model.optics.glass import constant
from ...model.scene import Camera, Scene
from ..case import Case, Measurement
from ..rigs.camera_probe import (
    PROBE,
    UNCHECKED,
    Judged,
    Sight,
    difference,
    measurement_of,
    render_probe,
    resized,
    sharing_programs,
    slope,
    slope_sky,
    with_sky,
)
from ..rigs.flat_glass import extruded, radiance_seen, rectangle
from ..rigs.scene_parts import (
    FLINT,
    SUN,
    extent,
    moved,
    solid,
    stage,
    with_glass,
)
from .contact_cases import PAIRS, tilted
from .mesh_file_cases import FAULTS, Fault, sound_solid, through_file

FEW = resized(PROBE, 12, 8, 64)
SEEN_FROM = Camera((2.6, -2.2, 2.6), (0.0, 0.0, 1.1), vertical_fov_deg=30.0)
FROM_FACE = (0.3, 1e-2, 1e-3, 1e-5, 1e-7, 0.0, -1e-7, -1e-5, -1e-3, -1e-2, -0.3)
SURE = 1e-3
"""Nearer to a face than that the camera may be taken for inside or outside, for either is as true as float32 and a
ray's safe distance tell."""
CUBE_N = 1.5
CHOSEN_PAIRS = (
    "a bubble as a solid of n = 1, and as a cavity",
    "water that reaches into the wall, and one that is carved out",
    "a cemented doublet of one glass, and a lens",
)
CHOSEN_FAULTS = tuple(fault for fault in FAULTS if fault.label not in ("nothing", "every face twice"))
NOISE, SAME_PICTURE, SAME_ENERGY = 3.0, 5e-3, 3e-3
"""As in `contact_cases`: what chance makes of two seeds, times three; rounding's share of a picture; of its sum."""
CHANGES = (
    ("× 1e-4", 1e-4, 0.0),
    ("× 1e4", 1e4, 0.0),
    ("1e4 extents off the origin", 1.0, 1e4),
    ("× 1e-4, and 1e4 extents off", 1e-4, 1e4),
)
ANY = {"depth_reached": UNCHECKED, "columns_dropped": UNCHECKED, "band_uncut": UNCHECKED, "stack_full": UNCHECKED}


@sharing_programs
def measure_inside(context: Context) -> Iterator[Measurement]:
    """A cube seen from within and from before it, across its face: outwards and inwards, against the sum over all
    ways."""
    outline = rectangle(1.0, 1.0)
    glass = solid("cube", extruded(outline, 1.0, "cube"), constant(CUBE_N))
    angle = np.radians(20.0)
    for number, distance in enumerate(FROM_FACE):
        judged, sights = Judged(), []
        for name, sign in (("outwards", 1.0), ("inwards", -1.0)):
            direction = np.array([sign * np.cos(angle), np.sin(angle)])
            start = np.array([0.5 - distance, 0.07])
            camera = Camera((*start, 0.0), (*(start + direction), 0.0), (0.0, 0.0, 1.0), vertical_fov_deg=0.1)
            sight = render_probe(context, with_sky(glass, camera=camera, environment=slope_sky()), FEW)
            sights.append(sight)
            places = [distance > 0.0] if abs(distance) >= SURE else [True, False]
            true = [
                radiance_seen(outline, CUBE_N, _clearly(start, distance, inside), tuple(direction), slope, inside)
                for inside in places
            ]
            judged.hold(name, min(np.abs(sight.mean / value - 1.0).max() for value in true), 5e-4)
        where = "inside" if distance > 0.0 else "outside"
        yield measurement_of(
            number, f"{abs(distance):.0e} {where}" if distance else "on the face", _together(sights), judged
        )


def _clearly(start: np.ndarray, distance: float, inside: bool) -> tuple[float, float]:
    """`start`, or where it is next to the face a point that is no doubt inside or outside."""
    return (float(start[0]) if abs(distance) >= SURE else 0.5 - (1e-9 if inside else -1e-9), float(start[1]))


@sharing_programs
def measure_pairs(context: Context) -> Iterator[Measurement]:
    """Solids that nest or touch, seen through, against a simpler description of the same."""
    for number, pair in enumerate((p for p in PAIRS if p.label in CHOSEN_PAIRS), 1):
        joined, plain = _seen_through(pair.joined()), _seen_through(pair.plain())
        base, other = (render_probe(context, plain, replace(PROBE, seed=seed), 1) for seed in (1, 2))
        sight = render_probe(context, joined, PROBE, 1)
        judged = Judged().hold(
            "picture",
            difference(sight.picture, base.picture),
            NOISE * difference(other.picture, base.picture) + SAME_PICTURE,
        )
        judged.hold("energy", abs(sight.picture.mean() / base.picture.mean() - 1.0), SAME_ENERGY)
        yield measurement_of(number, pair.label, sight, judged, ANY)


def _seen_through(scene: Scene) -> Scene:
    """Its glass alone, without dispersion, under a sky: what is asked is which medium comes next."""
    glass = tuple(item for item in scene.objects if item.material.transmits)
    scene = replace(scene, camera=SEEN_FROM, objects=glass, lights=(), environment=slope_sky())
    return with_glass(scene, lambda dispersion: constant(dispersion.n_d, dispersion.name))


@sharing_programs
def measure_scale(context: Context) -> Iterator[Measurement]:
    """A brilliant on a lit table: the same picture at any size and place."""
    scene = replace(
        stage(*tilted(solid("stone", brilliant(1.2), FLINT)), lights=[SUN]),
        camera=SEEN_FROM,
        background_rgb=(0.3, 0.4, 0.6),
    )
    base = render_probe(context, scene, PROBE, 4)
    size = extent(scene)
    for number, (label, scale, offset) in enumerate(CHANGES, 1):
        place = offset * size * scale
        sight = render_probe(context, moved(scene, scale=scale, offset=(place, -place, place)), PROBE, 4)
        judged = Judged().hold("picture", difference(sight.picture, base.picture), SAME_PICTURE)
        judged.hold("energy", abs(sight.picture.mean() / base.picture.mean() - 1.0), SAME_ENERGY)
        yield measurement_of(number, label, sight, judged, ANY)


@sharing_programs
def measure_faults(context: Context) -> Iterator[Measurement]:
    """Spoilt meshes, loaded as a user would, against the sound solid. A hole lets rays in that no medium can follow:
    that only has to stay finite."""
    clean: dict[bool, tuple[Sight, float]] = {}
    for smooth in (False, True):
        base, other = (
            render_probe(context, _solid_scene(Fault("", lambda mesh: mesh, smooth)), replace(PROBE, seed=seed), 1)
            for seed in (1, 2)
        )
        clean[smooth] = base, difference(other.picture, base.picture)
    for number, fault in enumerate(CHOSEN_FAULTS, 1):
        base, noise = clean[fault.smooth]
        sight = render_probe(context, _solid_scene(fault), PROBE, 1)
        error = difference(sight.picture, base.picture)
        judged = Judged()
        if fault.mendable:
            judged.hold("picture", error, NOISE * noise + SAME_PICTURE)
        else:
            judged.tell("picture", error)
        yield measurement_of(number, fault.label, sight, judged, ANY)


def _solid_scene(fault: Fault) -> Scene:
    mesh, _ = through_file(fault.spoil(sound_solid(fault.smooth)), fault.smooth)
    glass = FLINT if fault.smooth else constant(1.7, "no dispersion")
    return with_sky(*tilted(solid("solid", mesh, glass)), camera=SEEN_FROM, environment=slope_sky())


def _together(sights: list[Sight]) -> Sight:
    """The first, with what is not finite in any of them and all their fall-backs."""
    fallbacks = {name: sum(s.fallbacks[name] for s in sights) for name in sights[0].fallbacks}
    return replace(
        sights[0],
        nonfinite=sum(s.nonfinite for s in sights),
        fallbacks=fallbacks,
        samples=sum(s.samples for s in sights),
    )


CASES: tuple[Case, ...] = (
    Case(
        "eye-inside",
        "The camera inside glass, on its face and before it, against the sum over all ways",
        "Which medium a path begins in decides all that follows, and on a face rounding decides that; either is "
        "right, anything "
        "else is not.",
        "place",
        measure_inside,
        len(FROM_FACE),
        logarithmic=False,
    ),
    Case(
        "eye-contacts",
        "Solids that nest or touch, seen through, against a simpler scene of the same look",
        "Where faces coincide rounding decides their order; a path must go by priority.",
        "pair",
        measure_pairs,
        len(CHOSEN_PAIRS),
        logarithmic=False,
    ),
    Case(
        "eye-scale",
        "A brilliant on a table, at other sizes and far from the origin",
        "Columns, footprints and safe distances have lengths in them; the picture has none.",
        "change",
        measure_scale,
        len(CHANGES),
        logarithmic=False,
    ),
    Case(
        "eye-meshes",
        "Mesh files with slivers, zero normals, doubled vertices and holes, seen against the sound solid",
        "Normals of nothing are NaN, and so are the columns that they bend.",
        "fault",
        measure_faults,
        len(CHOSEN_FAULTS),
        logarithmic=False,
    ),
)
