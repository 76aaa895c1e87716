"""Many of everything: lights, objects, instances, triangles. What is beside the beam may cost time and memory, and
nothing else."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import box
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import sphere
from ...model.optics.glass import Dispersion, from_abbe
from ...model.scene import Scene, SceneObject
from ...model.scene_checks import MAX_LIGHTS, MAX_OBJECTS
from ..case import Case, Measurement
from ..rigs.probe import SMALL, Held, energy_error, measurement, picture_error, probe
from ..rigs.scene_parts import BEAM, CROWN, FLINT, SUN, brighter, solid, stage
from .light_cases import refused
from .sweep_cases import SAME_ENERGY, SAME_PICTURE, against_single_wavelengths

LIGHTS = (1, 16, 255, 256, 300)
OBJECTS = (1_000, 10_000, 65_534, 70_000)
INSTANCES = (10, 100, 1_000)
TRIANGLES = (1_280, 20_480, 327_680, 2_000_000)
GLASSES = (2, 4, 5, 8)
APART = 40.0
"""Where what the beam must not meet begins, scene units from the axis."""
FACETED = 0.05
"""nRMSE of a ball of 1,280 triangles with smooth normals; the finest is compared with the one before it."""
DIVIDED = 0.03
"""Sum over a picture whose photons are shared by many lights, each with a lattice of its own."""


def measure_lights(context: Context) -> Iterator[Measurement]:
    """One sun in parts: the light of all is the light of one."""
    whole = probe(context, _in_light_of(1))
    for count in LIGHTS:
        if count > MAX_LIGHTS:
            yield refused(count, f"{count} lights", partial(_in_light_of, count))
            continue
        found = probe(context, _in_light_of(count))
        errors = {"energy": energy_error(found.picture, whole.picture)}
        yield measurement(count, f"{count} light{'s' * (count > 1)}", found, Held(errors, {"energy": DIVIDED}))


def measure_objects(context: Context) -> Iterator[Measurement]:
    """A ball in a beam, and a city of glass boxes far from it."""
    alone = probe(context, stage(_ball(1_280)))
    for count in OBJECTS:
        if count > MAX_OBJECTS:
            yield refused(count, f"{count:,} objects", partial(_beside_a_city, count))
            continue
        started = time.perf_counter()
        found = probe(context, _beside_a_city(count))
        held = Held(
            {
                "picture": picture_error(found.picture, alone.picture),
                "energy": energy_error(found.picture, alone.picture),
            },
            {"picture": SAME_PICTURE, "energy": SAME_ENERGY},
            note=f"{time.perf_counter() - started:.1f} s",
        )
        yield measurement(count, f"{count:,} objects", found, held)


def measure_instances(context: Context) -> Iterator[Measurement]:
    """Brilliants in rows under one sun: each has its share of the light that one alone has."""
    stone = brilliant(0.9)
    for count in INSTANCES:
        side = int(np.ceil(count**0.5))
        places = [(1.2 * (i % side - 0.5 * side), 1.2 * (i // side - 0.5 * side), 0.8) for i in range(count)]
        rows = [solid(f"{i}", stone, FLINT, place) for i, place in enumerate(places)]
        found = probe(context, stage(*rows, lights=[SUN]), replace(SMALL, photons=65_536))
        ended = found.shares
        gone = 1.0 - sum(ended.values())
        yield measurement(
            count, f"{count:,} brilliants", found, Held({"shares missing": abs(gone)}, {"shares missing": 1e-3})
        )


def measure_triangles(context: Context) -> Iterator[Measurement]:
    """A ball ever finer: its caustic settles."""
    before: np.ndarray | None = None
    for count in TRIANGLES:
        started = time.perf_counter()
        ball = _ball(count)
        triangles = len(ball.mesh.triangles)
        found = probe(context, stage(ball))
        errors, bounds = {}, {}
        if before is not None:
            errors["picture, against the coarser"] = picture_error(found.picture, before)
            bounds["picture, against the coarser"] = FACETED
        before = found.picture
        note = f"{time.perf_counter() - started:.1f} s"
        yield measurement(triangles, f"{triangles:,} triangles", found, Held(errors, bounds, note))


def measure_glasses(context: Context) -> Iterator[Measurement]:
    """More glasses than there are columns for: those that are left share one."""
    for count in GLASSES:
        prisms = [
            solid(
                f"{i}", box((0.4, 0.4, 0.3)), _glass(i), (0.55 * (i % 4) - 0.9, 0.7 * (i // 4) - 0.35, 0.5 + 0.02 * i)
            )
            for i in range(count)
        ]
        scene = stage(*prisms, lights=[SUN])
        yield against_single_wavelengths(context, scene, count, f"{count} glasses", 0.0)


def _in_light_of(count: int) -> Scene:
    spectrum = brighter(SUN.spectral_power, 1.0 / count)
    lights = [replace(SUN, name=f"sun {i}", spectral_power=spectrum) for i in range(count)]
    return stage(_ball(1_280), lights=lights)


@cache
def _ball(triangles: int) -> SceneObject:
    return solid("ball", sphere(0.5, triangles), CROWN, (BEAM.position[0], 0.0, 0.9))


def _beside_a_city(count: int) -> Scene:
    """So many objects in all."""
    return stage(_ball(1_280), *_city(count - 2))


def _city(count: int) -> list[SceneObject]:
    """Boxes that share one mesh, in a square beside the table."""
    house = box((0.5, 0.5, 0.5))
    side = int(np.ceil(count**0.5))
    return [solid(f"house {i}", house, FLINT, (APART + i % side, float(i // side), 0.5)) for i in range(count)]


def _glass(i: int) -> Dispersion:
    return from_abbe(1.5 + 0.03 * i, 60.0 - 4.0 * i, f"glass {i}")


CASES: tuple[Case, ...] = (
    Case(
        "many-lights",
        "One sun in up to 256 parts; 300 are refused",
        "A photon tells its light in 8 bits: one light more would be told as a wavelength band.",
        "lights",
        measure_lights,
        len(LIGHTS),
    ),
    Case(
        "many-objects",
        "A ball in a beam, and up to 65,534 glass boxes beside it; 70,000 are refused",
        "A photon tells the object that it met first in 16 bits; what no light meets may not change the picture.",
        "objects",
        measure_objects,
        len(OBJECTS),
    ),
    Case(
        "many-stones",
        "Up to a thousand brilliants under one sun",
        "Light wanders from stone to stone; every share of it must be told.",
        "stones",
        measure_instances,
        len(INSTANCES),
    ),
    Case(
        "many-triangles",
        "A ball of up to two million triangles",
        "Tessellation is an error that settles; trees deepen, and offsets must find their triangle.",
        "triangles",
        measure_triangles,
        len(TRIANGLES),
    ),
    Case(
        "many-glasses",
        "Up to eight glasses in one scene, against one-wavelength photons",
        "Each of four glasses has columns of its own; more share one, and bands are then finer.",
        "glasses",
        measure_glasses,
        len(GLASSES),
    ),
)
