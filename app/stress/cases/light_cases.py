"""Lights and cameras in places where geometry degenerates: on a face, along a face, in glass, far away, faint and
fierce.

Each is held to what every rendering promises (finite, closed, counted); where a neighbouring or a limiting
scene has the same light, also to that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.errors import UserError
from ...gpu.context import Context
from ...model.geometry.primitives import box, plane, prism
from ...model.lights import AreaLight, IesLight, PointLight, SpotLight
from ...model.lights.ies_file import Profile
from ...model.optics.glass import constant
from ...model.optics.spectrum import Spectrum, illuminant
from ...model.scene import Camera, Diffuse, Light, Scene, SceneObject
from ...model.scene_checks import check_scene
from ..case import Case, Measurement
from ..rigs.probe import (
    LOST_TO_NUMERICS,
    Held,
    energy_error,
    measurement,
    picture_error,
    probe,
)
from ..rigs.scene_parts import (
    BEAM,
    FLINT,
    SUN,
    brighter,
    solid,
    stage,
)
from .contact_cases import (
    CAUSTIC,
    NOISE,
    PLATES,
    SAME_PICTURE,
    TEXELS,
    plates,
)

GLASS = constant(1.5, "n 1.5")
POWERS = (1e-25, 1e-10, 1e10, 1e25)
DISTANCES = (1e2, 1e4, 1e5, 1e6)
SPECTRUM = illuminant("D65").scaled_to_luminous(100.0)
TOP, SIDE = 1.0, 0.8
"""The block's highest z, and its x towards the light."""


@dataclass(frozen=True)
class Place:
    """A degenerate place of a light or a camera."""

    label: str
    scene: Callable[[], Scene]
    share: float | None = None
    """Share of the light that must land, where it is known."""
    lost: float = LOST_TO_NUMERICS
    """Share that may be lost to numerics; more where a light's place itself is on the brink of glass and air."""


def measure_places(context: Context) -> Iterator[Measurement]:
    """Each place; the share that lands where a closed form says it."""
    for number, place in enumerate(PLACES, 1):
        found = probe(context, place.scene())
        held = Held()
        if place.share is not None:
            held.errors["transmittance"] = abs(found.shares.get("deposited", 0.0) - place.share)
            held.bounds["transmittance"] = PLATES
        yield measurement(number, place.label, found, held, place.lost)


def measure_refusals(_: Context) -> Iterator[Measurement]:
    """Scenes that cannot be right are refused in one sentence before anything is traced."""
    for number, (label, scene) in enumerate(REFUSED, 1):
        yield refused(number, label, scene)


def refused(severity: float, label: str, scene: Callable[[], Scene]) -> Measurement:
    """A scene that must not be taken, and the sentence that says so."""
    try:
        check_scene(scene(), "scene")
        accepted, note = 1.0, "accepted"
    except UserError as error:
        accepted, note = 0.0, str(error)
    return Measurement(severity, label, 0, {"accepted": accepted}, {"accepted": 0.0}, note=note)


def measure_powers(context: Context) -> Iterator[Measurement]:
    """The same picture, so many times brighter. A factor is no power of two, so that it rounds; choices go by shares of
    power."""
    scene = stage(solid("prism", prism(), FLINT, (0.0, 0.0, 0.9)), lights=[SUN])
    base = probe(context, scene)
    for factor in POWERS:
        light = replace(SUN, spectral_power=brighter(SUN.spectral_power, factor))
        found = probe(context, replace(scene, lights=(light,)))
        picture = found.picture / factor
        held = Held(
            {"picture": picture_error(picture, base.picture), "energy": energy_error(picture, base.picture)},
            {"picture": SAME_PICTURE, "energy": 1e-3},
        )
        yield measurement(factor, f"× {factor:.0e}", found, held)


def measure_distances(context: Context) -> Iterator[Measurement]:
    """A point light ever farther away becomes a sun: what is left of the difference is parallax, and what float32
    leaves of a far place.

    Light from distance D moves a place 4 units from the axis by 4/D, and float32 knows the lamp's place and the
    direction of a ray to D 2⁻²³; a pixel is 1/20 wide."""
    base = probe(context, _prism_under(SUN), CAUSTIC)
    noise = picture_error(probe(context, _prism_under(SUN), replace(CAUSTIC, seed=2)).picture, base.picture)
    for distance in DISTANCES:
        x, y, z = (-distance * d for d in SUN.direction)
        lamp = PointLight("lamp", brighter(SUN.spectral_power, distance**2), (x, y, z + 0.9))
        found = probe(context, _prism_under(lamp), CAUSTIC)
        moved, rounded = 4.0 / distance, distance * 2.0**-23
        held = Held(
            {"picture": picture_error(found.picture, base.picture), "energy": energy_error(found.picture, base.picture)}
        )
        held.bounds.update(
            {
                "picture": NOISE * noise + TEXELS + min(20.0 * (moved + rounded), 2.0),
                "energy": 0.01 + 2.0 * moved + rounded,
            }
        )
        yield measurement(distance, f"{distance:.0e} units", found, held)


def measure_lamps(context: Context) -> Iterator[Measurement]:
    """Tables of intensities that are hard on a lookup, against a spot or a point of the same light."""
    for number, lamp in enumerate(LAMPS, 1):
        found = probe(context, _block(lamp.light))
        held = Held()
        if lamp.like is not None:
            base = probe(context, _block(lamp.like))
            held = Held(
                {
                    "picture": picture_error(found.picture, base.picture),
                    "energy": energy_error(found.picture, base.picture),
                },
                {"picture": lamp.bound, "energy": lamp.bound},
            )
        yield measurement(number, lamp.label, found, held)


@dataclass(frozen=True)
class Lamp:
    """A photometric lamp, and what shines as it does."""

    label: str
    light: Light
    like: Light | None = None
    bound: float = 0.0


def _lamp(vertical_deg: Sequence[float], share: Sequence[float], **placed: Any) -> Light:
    """A lamp that is the same all the way round."""
    intensity = np.array([share, share], float)
    profile = Profile(np.array(vertical_deg, float), np.array([0.0, 360.0]), intensity, 1.0, "")
    return IesLight("lamp", SPECTRUM, profile, **({"position": (0.1, 0.1, 3.0)} | placed))


def _comb(teeth: int) -> Light:
    """Every other direction dark, all the way round too."""
    vertical, horizontal = np.linspace(0.0, 180.0, 2 * teeth + 1), np.linspace(0.0, 360.0, 2 * teeth + 1)
    intensity = np.where((np.arange(2 * teeth + 1)[:, None] + np.arange(2 * teeth + 1)) % 2, 0.0, 1.0)
    return IesLight("comb", SPECTRUM, Profile(vertical, horizontal, intensity, 1.0, ""), (0.1, 0.1, 3.0))


def _prism_under(light: Light) -> Scene:
    return stage(solid("prism", prism(), FLINT, (0.0, 0.0, 0.9)), lights=[light])


def _block(*lights: Light, camera: Camera | None = None, bottom: float = 0.4) -> Scene:
    """A block of n = 1.5, 1.6 units wide, its top at z = 1."""
    block = solid("block", box((1.6, 1.6, TOP - bottom)), GLASS, (0.0, 0.0, 0.5 * (TOP + bottom)))
    scene = stage(block, lights=lights or (BEAM,))
    return scene if camera is None else replace(scene, camera=camera)


def _beam(
    position: tuple[float, float, float], direction: tuple[float, float, float] = (0.0, 0.0, -1.0), radius: float = 0.3
) -> Light:
    return replace(BEAM, position=position, direction=direction, radius=radius)


def _point(position: tuple[float, float, float]) -> Light:
    return PointLight("lamp", SPECTRUM, position)


def _area(position: tuple[float, float, float], radius: float = 0.3) -> Light:
    return AreaLight("panel", SPECTRUM, position, (0.0, 0.0, -1.0), radius=radius)


def _tiny_table() -> Scene:
    return replace(_block(SUN), objects=(*_block(SUN).objects[:1], SceneObject("table", plane(1e-3, 1e-3), Diffuse())))


SLAB = plates([1.5])
PLACES = (
    Place("a beam from above (nothing degenerate)", lambda: _block(_beam((0.0, 0.0, 3.0))), SLAB),
    Place("a beam whose aperture lies in the block's top face", lambda: _block(_beam((0.0, 0.0, TOP))), SLAB),
    Place("a beam whose aperture is 1e-7 above the top face", lambda: _block(_beam((0.0, 0.0, TOP + 1e-7))), SLAB),
    Place("a beam whose aperture cuts through the block", lambda: _block(_beam((SIDE + 0.1, 0.0, 0.7)))),
    Place("a beam along the top face, exactly in its plane", lambda: _block(_beam((-3.0, 0.0, TOP), (1.0, 0.0, 0.0)))),
    Place("a beam half of which passes a side face, along it", lambda: _block(_beam((SIDE, 0.0, 3.0)))),
    Place("a beam along a vertical edge", lambda: _block(_beam((SIDE, SIDE, 3.0)))),
    Place("a thread of light of radius 1e-6", lambda: _block(_beam((0.1, 0.2, 3.0), radius=1e-6)), SLAB),
    Place("a point light in the plane of a side face", lambda: _block(_point((SIDE, 0.0, 3.0)))),
    Place("a point light on a face", lambda: _block(_point((0.1, 0.1, TOP))), lost=0.05),
    Place("a point light 1e-6 above a face", lambda: _block(_point((0.1, 0.1, TOP + 1e-6)))),
    Place("a point light on a corner", lambda: _block(_point((SIDE, SIDE, TOP))), lost=0.05),
    Place("a panel lying on the top face", lambda: _block(_area((0.0, 0.0, TOP)))),
    Place("a panel of radius 1e-6", lambda: _block(_area((0.0, 0.0, 3.0), 1e-6))),
    Place("a light that looks away from all glass", lambda: _block(_beam((0.0, 0.0, 3.0), (0.0, 0.0, 1.0)))),
    Place("a light under the table", lambda: _block(_beam((0.0, 0.0, -1.0), (0.0, 0.0, -1.0)))),
    Place("a light of no power", lambda: _block(replace(_beam((0.0, 0.0, 3.0)), spectral_power=Spectrum()))),
    Place("a block standing on the table, faces coincident", lambda: _block(_beam((0.0, 0.0, 3.0)), bottom=0.0)),
    Place("a table of a thousandth of the glass", _tiny_table),
    Place("the camera in the glass", lambda: _block(camera=Camera((0.1, 0.0, 0.7), (3.0, 0.0, 0.2)))),
    Place("the camera on a face", lambda: _block(camera=Camera((0.0, 0.0, TOP), (0.0, 0.5, 0.0)))),
    Place(
        "the camera on the table, looking along it", lambda: _block(camera=Camera((-3.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    ),
    Place("the camera looking straight down", lambda: _block(camera=Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0)))),
    Place(
        "a field of view of 179.9°",
        lambda: _block(camera=Camera((0.0, -3.0, 2.0), (0.0, 0.0, 0.5), vertical_fov_deg=179.9)),
    ),
    Place(
        "a field of view of 1e-3°",
        lambda: _block(camera=Camera((0.0, -3.0, 2.0), (0.0, 0.0, 0.5), vertical_fov_deg=1e-3)),
    ),
)

LAMPS = (
    Lamp("the same all round, as a point", _lamp([0, 90, 180], [1, 1, 1]), _point((0.1, 0.1, 3.0)), 1e-6),
    Lamp(
        "cut off at 10° within a millionth of a degree, as a hard spot",
        _lamp([0, 10, 10.000001, 180], [1, 1, 0, 0]),
        SpotLight("spot", SPECTRUM, (0.1, 0.1, 3.0), inner_half_angle_deg=10.0, outer_half_angle_deg=10.0),
        0.05,
    ),
    Lamp("a peak of a hundredth of a degree", _lamp([0, 0.01, 180], [1, 0, 0])),
    Lamp("a peak a thousand times as bright as the rest", _lamp([0, 0.5, 180], [1, 1e-3, 1e-3])),
    Lamp("a ring of light, dark inside and outside", _lamp([0, 4, 5, 6, 180], [0, 0, 1, 0, 0])),
    Lamp("a comb of 180 dark and bright directions each way", _comb(180)),
    Lamp("shining up only, away from the block", _lamp([0, 89.999, 90, 180], [0, 0, 1, 1])),
    Lamp(
        "the pole of the angles in the middle of the block", _lamp([0, 90, 180], [1, 0.5, 0], direction=(0.0, 0.0, 1.0))
    ),
)

REFUSED: tuple[tuple[str, Callable[[], Scene]], ...] = (
    ("a point light in the glass", lambda: _block(_point((0.1, 0.0, 0.7)))),
    ("a beam's aperture in the glass", lambda: _block(_beam((0.0, 0.0, 0.7)))),
    ("no light", lambda: replace(_block(SUN), lights=())),
    ("nothing to land on", lambda: replace(_block(SUN), objects=_block(SUN).objects[:1])),
)

CASES: tuple[Case, ...] = (
    Case(
        "places",
        "Lights and cameras on faces, along faces, on corners, in glass",
        "Rays start at distance zero from a face, or run in its plane.",
        "place",
        measure_places,
        len(PLACES),
        logarithmic=False,
    ),
    Case(
        "refusals",
        "Scenes that cannot be right",
        "A light in glass has no defined medium: better refused than drawn wrong.",
        "scene",
        measure_refusals,
        len(REFUSED),
        logarithmic=False,
    ),
    Case(
        "lamps",
        "Photometric files with peaks, zeros and edges",
        "A table is looked up between its angles; photons are spread over directions, not over the light.",
        "lamp",
        measure_lamps,
        len(LAMPS),
        logarithmic=False,
    ),
    Case(
        "power",
        "Light of any strength",
        "Weights, sums and colours must neither vanish nor overflow, nor thresholds know the unit.",
        "factor on the power",
        measure_powers,
        len(POWERS),
    ),
    Case(
        "distance",
        "A point light ever farther away, against the sun",
        "Float32 positions of far lights carry no digits of the glass; rays are met from nearby.",
        "distance, scene units",
        measure_distances,
        len(DISTANCES),
    ),
)
