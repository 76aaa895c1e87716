"""Lights and cameras in places where geometry degenerates: on a face, along a face, in glass, far away, faint and
fierce.

Each must keep what every rendering promises (finite, closed, counted) and, where a neighbouring or a limiting scene
has the same light, agree with that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from ..case import Measured, Measurement, case, measured
from ..rigs.probe import (
    CAUSTIC,
    LOST_TO_NUMERICS,
    NOISE,
    SAME_PICTURE,
    TEXELS,
    compared,
    picture_error,
    probe,
    rendered,
)
from ..rigs.scene_parts import BEAM, FLINT, SUN, brighter, solid, stage
from .contacts import transmits

Vec3 = tuple[float, float, float]
SPECTRUM = illuminant("D65").scaled_to_luminous(100.0)
TOP, SIDE = 1.0, 0.8
"""The block's highest z, and its x towards the light."""


def _block(*lights: Light, camera: Camera | None = None, bottom: float = 0.4) -> Scene:
    """A block of n = 1.5, 1.6 units wide, its top at z = 1."""
    mesh, glass = box((1.6, 1.6, TOP - bottom)), constant(1.5, "n 1.5")
    scene = stage(solid("block", mesh, glass, (0.0, 0.0, 0.5 * (TOP + bottom))), lights=lights or (BEAM,))
    return scene if camera is None else replace(scene, camera=camera)


def _beam(position: Vec3, direction: Vec3 = (0.0, 0.0, -1.0), radius: float = 0.3) -> Light:
    return replace(BEAM, position=position, direction=direction, radius=radius)


def _point(position: Vec3) -> Light:
    return PointLight("lamp", SPECTRUM, position)


def _area(position: Vec3, radius: float = 0.3) -> Light:
    return AreaLight("panel", SPECTRUM, position, (0.0, 0.0, -1.0), radius=radius)


def _prism_under(light: Light) -> Scene:
    return stage(solid("prism", prism(), FLINT, (0.0, 0.0, 0.9)), lights=[light])


def _from(position: Vec3, target: Vec3, vertical_fov_deg: float = 35.0) -> Scene:
    """The block from elsewhere."""
    return _block(camera=Camera(position, target, vertical_fov_deg=vertical_fov_deg))


def _tiny_table() -> Scene:
    return replace(_block(SUN), objects=(*_block(SUN).objects[:1], SceneObject("table", plane(1e-3, 1e-3), Diffuse())))


@dataclass(frozen=True)
class Place:
    """A degenerate place of a light or a camera."""

    label: str
    scene: Callable[[], Scene]
    whole: bool = False
    """Whether all light goes through the block, so that the share that lands is known."""
    lost: float = LOST_TO_NUMERICS
    """Share that may be lost to numerics; more where a light's place itself is on the brink of glass and air."""


PLACES = (
    Place("a beam from above (nothing degenerate)", lambda: _block(_beam((0.0, 0.0, 3.0))), True),
    Place("a beam whose aperture lies in the block's top face", lambda: _block(_beam((0.0, 0.0, TOP))), True),
    Place("a beam whose aperture is 1e-7 above the top face", lambda: _block(_beam((0.0, 0.0, TOP + 1e-7))), True),
    Place("a beam whose aperture cuts through the block", lambda: _block(_beam((SIDE + 0.1, 0.0, 0.7)))),
    Place("a beam along the top face, exactly in its plane", lambda: _block(_beam((-3.0, 0.0, TOP), (1.0, 0.0, 0.0)))),
    Place("a beam half of which passes a side face, along it", lambda: _block(_beam((SIDE, 0.0, 3.0)))),
    Place("a beam along a vertical edge", lambda: _block(_beam((SIDE, SIDE, 3.0)))),
    Place("a thread of light of radius 1e-6", lambda: _block(_beam((0.1, 0.2, 3.0), radius=1e-6)), True),
    Place("a point light in the plane of a side face", lambda: _block(_point((SIDE, 0.0, 3.0)))),
    Place("a point light on a face", lambda: _block(_point((0.1, 0.1, TOP))), lost=0.05),
    Place("a point light 1e-6 above a face", lambda: _block(_point((0.1, 0.1, TOP + 1e-6)))),
    Place("a point light on a corner", lambda: _block(_point((SIDE, SIDE, TOP))), lost=0.05),
    Place("a panel lying on the top face", lambda: _block(_area((0.0, 0.0, TOP)))),
    Place("a panel of radius 1e-6", lambda: _block(_area((0.0, 0.0, 3.0), 1e-6))),
    Place("a light that points away from all glass", lambda: _block(_beam((0.0, 0.0, 3.0), (0.0, 0.0, 1.0)))),
    Place("a light under the table", lambda: _block(_beam((0.0, 0.0, -1.0), (0.0, 0.0, -1.0)))),
    Place("a light of no power", lambda: _block(replace(_beam((0.0, 0.0, 3.0)), spectral_power=Spectrum()))),
    Place("a block standing on the table, faces coincident", lambda: _block(_beam((0.0, 0.0, 3.0)), bottom=0.0)),
    Place("a table of a thousandth of the glass", _tiny_table),
    Place("the camera in the glass", lambda: _from((0.1, 0.0, 0.7), (3.0, 0.0, 0.2))),
    Place("the camera on a face", lambda: _from((0.0, 0.0, TOP), (0.0, 0.5, 0.0))),
    Place("the camera on the table, looking along it", lambda: _from((-3.0, 0.0, 0.0), (0.0, 0.0, 0.0))),
    Place("the camera looking straight down", lambda: _from((0.0, 0.0, 4.0), (0.0, 0.0, 0.0))),
    Place("a field of view of 179.9°", lambda: _from((0.0, -3.0, 2.0), (0.0, 0.0, 0.5), vertical_fov_deg=179.9)),
    Place("a field of view of 1e-3°", lambda: _from((0.0, -3.0, 2.0), (0.0, 0.0, 0.5), vertical_fov_deg=1e-3)),
)


@case("places", "place", PLACES)
def places(context: Context, rows: Sequence[Place]) -> Measured:
    """Lights and cameras on faces, along faces, on corners, in glass

    Rays start at distance zero from a face, or run in its plane."""
    for number, place in enumerate(rows, 1):
        found = probe(context, place.scene())
        held = transmits(found, 1.5) if place.whole else {}
        yield rendered(number, place.label, found, held, lost=place.lost)


REFUSED: tuple[tuple[str, Callable[[], Scene]], ...] = (
    ("a point light in the glass", lambda: _block(_point((0.1, 0.0, 0.7)))),
    ("a beam's aperture in the glass", lambda: _block(_beam((0.0, 0.0, 0.7)))),
    ("no light", lambda: replace(_block(SUN), lights=())),
    ("nothing to land on", lambda: replace(_block(SUN), objects=_block(SUN).objects[:1])),
)


@case("refusals", "scene", REFUSED)
def refusals(_: Context, rows: Sequence[tuple[str, Callable[[], Scene]]]) -> Measured:
    """Scenes that cannot be right

    A light in glass has no defined medium: better refused than drawn wrong."""
    for number, (label, scene) in enumerate(rows, 1):
        yield refused(number, label, scene)


def refused(severity: float, label: str, scene: Callable[[], Scene]) -> Measurement:
    """A scene that must be refused, and the sentence that refuses it before anything is traced."""
    try:
        check_scene(scene(), "scene")
        accepted, note = 1.0, "accepted"
    except UserError as error:
        accepted, note = 0.0, str(error)
    return measured(severity, label, {"accepted": (accepted, 0.0)}, note=note)


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


SPOT = SpotLight("spot", SPECTRUM, (0.1, 0.1, 3.0), inner_half_angle_deg=10.0, outer_half_angle_deg=10.0)
HARD = _lamp([0, 10, 10.000001, 180], [1, 1, 0, 0])
UPWARDS = _lamp([0, 90, 180], [1, 0.5, 0], direction=(0.0, 0.0, 1.0))
LAMPS = (
    Lamp("the same all round, as a point", _lamp([0, 90, 180], [1, 1, 1]), _point((0.1, 0.1, 3.0)), 1e-6),
    Lamp("cut off at 10° within a millionth of a degree, as a hard spot", HARD, SPOT, 0.05),
    Lamp("a peak of a hundredth of a degree", _lamp([0, 0.01, 180], [1, 0, 0])),
    Lamp("a peak a thousand times as bright as the rest", _lamp([0, 0.5, 180], [1, 1e-3, 1e-3])),
    Lamp("a ring of light, dark inside and outside", _lamp([0, 4, 5, 6, 180], [0, 0, 1, 0, 0])),
    Lamp("a comb of 180 dark and bright directions each way", _comb(180)),
    Lamp("shining up only, away from the block", _lamp([0, 89.999, 90, 180], [0, 0, 1, 1])),
    Lamp("the pole of the angles in the middle of the block", UPWARDS),
)


@case("lamps", "lamp", LAMPS)
def lamps(context: Context, rows: Sequence[Lamp]) -> Measured:
    """Photometric files with peaks, zeros and edges

    A table is looked up between its angles; photons are spread over directions, not over the light."""
    for number, lamp in enumerate(rows, 1):
        found, held = probe(context, _block(lamp.light)), None
        if lamp.like is not None:
            held = compared(found, probe(context, _block(lamp.like)), lamp.bound, lamp.bound)
        yield rendered(number, lamp.label, found, held)


@case("power", "factor on the power", (1e-25, 1e-10, 1e10, 1e25))
def power(context: Context, factors: Sequence[float]) -> Measured:
    """Light of any strength

    Weights, sums and colours must neither vanish nor overflow, nor thresholds know the unit."""
    base = probe(context, _prism_under(SUN))
    # A factor is no power of two, so that it rounds; choices are made by shares of power.
    for factor in factors:
        found = probe(context, _prism_under(replace(SUN, spectral_power=brighter(SUN.spectral_power, factor))))
        held = compared(replace(found, picture=found.picture / factor), base, SAME_PICTURE, 1e-3)
        yield rendered(factor, f"× {factor:.0e}", found, held)


@case("distance", "distance, scene units", (1e2, 1e4, 1e5, 1e6))
def distance(context: Context, distances: Sequence[float]) -> Measured:
    """A point light ever farther away, against the sun

    Float32 positions of far lights carry no digits of the glass; rays are met from nearby."""
    base, other = (probe(context, _prism_under(SUN), replace(CAUSTIC, seed=seed)) for seed in (1, 2))
    noise = picture_error(other.picture, base.picture)
    for far in distances:
        x, y, z = (-far * d for d in SUN.direction)
        lamp = PointLight("lamp", brighter(SUN.spectral_power, far**2), (x, y, z + 0.9))
        found = probe(context, _prism_under(lamp), CAUSTIC)
        # Light from distance D moves a place 4 units from the axis by 4/D, and float32 knows the lamp's place and the
        # direction of a ray to D 2⁻²³; a pixel is 1/20 wide.
        moved, rounded = 4.0 / far, far * 2.0**-23
        picture = NOISE * noise + TEXELS + min(20.0 * (moved + rounded), 2.0)
        held = compared(found, base, picture, 0.01 + 2.0 * moved + rounded)
        yield rendered(far, f"{far:.0e} units", found, held)
