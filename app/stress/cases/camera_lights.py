"""What shines or is lit, at its stiffest: suns in panoramas, tiny lamps, poles, textures far too fine, glass that
swallows everything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import box, plane
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import sphere
from ...model.lights import AreaLight, DirectionalLight
from ...model.optics.colorimetry import VISIBLE_NM
from ...model.optics.glass import constant
from ...model.optics.spectrum import illuminant
from ...model.scene import Absorption, Camera, Dielectric, Diffuse, Scene, SceneObject
from ...model.scene_camera import camera_rays
from ...model.texture import Environment, Texture
from ...model.vectors import vec3
from ...passes.camera_programs import TINT_STEPS
from ...reference.camera_reference import render_camera_reference
from ..case import Held, Measured, case
from ..rigs.camera_probe import (
    ANY,
    CHANCE,
    PROBE,
    WHITE,
    daylight_mean,
    difference,
    fresnel,
    render_probe,
    resized,
    seen,
    sky,
    with_sky,
)
from ..rigs.scene_parts import FLINT, at, solid

ORIGIN = (0.0, 0.0, 0.0)
STONE_SEEN_FROM = Camera((0.3, -3.6, 2.4), ORIGIN, vertical_fov_deg=24.0)
STONE = solid("stone", brilliant(1.6), FLINT)
"""Its table shows the camera what is at (−0.3, 3.6, 2.4)."""
FAINTEST = 1e2


def _under_a_sun(sun: float) -> Scene:
    """The stone under a sky of 64 × 128 texels, 0.5 to 1.5, one of which, where the table shows it, shines `sun`
    more."""
    rgb = sky(lambda d: 1.0 + 0.5 * d[..., 2], height=64).rgb.copy()
    rgb[20, 30] += np.float32(sun)
    return with_sky(STONE, camera=STONE_SEEN_FROM, environment=Environment(rgb))


@case("eye-sun", "the texel's radiance", (1e2, 1e4, 1e5, 1e6, 1e8))
def eye_sun(context: Context, suns: Sequence[float]) -> Measured:
    """A panorama with one bright texel, through a brilliant

    One sample in thousands finds the sun: a picture of sparks, or of sparks brighter than the sun."""
    # The picture is linear: less the one without a sun it grows with it. Radiance over n² is kept along a ray, so
    # nothing seen in glass is brighter than what shines.
    without, hundred = (render_probe(context, _under_a_sun(sun), PROBE, 4).picture for sun in (0.0, FAINTEST))
    known = render_camera_reference(_under_a_sun(FAINTEST), PROBE.width, PROBE.height, samples=256)
    want = known.rgb.sum() - without.sum()
    chance = CHANCE * np.sqrt(known.variance.sum()) / want
    for sun in suns:
        sight = render_probe(context, _under_a_sun(sun), PROBE, 4)
        picture, added = sight.picture, (sight.picture - without) / sun
        light = (picture.sum() - without.sum()) / sun * FAINTEST / want
        held: Held = {
            "brighter than the sun": (max(0.0, picture.max() / (1.02 * sun + without.max()) - 1.0), 0.0),
            "not linear": (difference(added, (hundred - without) / FAINTEST), 2e-3),
            "light in all": (abs(light - 1.0), 0.02 + chance),
            "brightest over mean": (picture.max() / picture.mean(), None),
        }
        yield seen(sun, f"{sun:.0e}", sight, held, ANY)


@case("eye-lamps", "radius", (0.2, 0.1, 0.03, 0.01, 0.003))
def eye_lamps(context: Context, radii: Sequence[float]) -> Measured:
    """A lamp ever smaller and brighter, through a brilliant

    The same with a lamp, whose edge a path blurs over the solid angle that the path samples."""
    toward = np.array([-0.3, 3.6, 2.4]) / np.linalg.norm([-0.3, 3.6, 2.4])
    first = None
    for radius in radii:
        power = illuminant("D65").scaled_to_luminous(1.0 / (np.pi * radius**2))
        lamp = AreaLight("lamp", power, position=vec3(3.0 * toward), direction=vec3(-toward), radius=radius)
        scene = Scene("lamp", STONE_SEEN_FROM, (lamp,), (STONE,))
        sight = render_probe(context, scene, replace(PROBE, spp=32), 4)
        total = sight.picture.sum()
        first = first or total
        held: Held = {
            "brighter than the lamp": (max(0.0, sight.picture.max() * np.pi * radius**2 / 1.02 - 1.0), 0.0),
            "light in all": (abs(total / first - 1.0), 0.1),
            "brightest over mean": (sight.picture.max() / sight.picture.mean(), None),
        }
        yield seen(radius, f"radius {radius:g}", sight, held, ANY)


def _smooth(d: np.ndarray) -> np.ndarray:
    return 1.0 + 0.5 * d[..., 0] + 0.3 * d[..., 1] + 0.1 * d[..., 2] + 0.2 * (d[..., 0] ** 2 - d[..., 1] ** 2)


@case("eye-poles", "degrees from the zenith", (80.0, 89.0, 89.9, 89.999, 90.0, -90.0))
def eye_poles(context: Context, elevations_deg: Sequence[float]) -> Measured:
    """A panorama's poles, against the function it was made of

    Rows of texels shrink to a point, and longitudes jump."""
    far = SceneObject("far", box((0.1, 0.1, 0.1)), Diffuse(), at(-9.0, 0.0, 0.0))
    for degrees in elevations_deg:
        up, level = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
        camera = Camera(ORIGIN, vec3((level * 0.8, level * 0.6, up)), (0.6, -0.8, 0.0), vertical_fov_deg=30.0)
        scene = with_sky(far, camera=camera, environment=sky(_smooth))
        sight = render_probe(context, scene, resized(PROBE, 32, 32, 16))
        _, directions = camera_rays(camera, (32, 32), 32 * 16 + 1)
        middles = directions[8::16, 8::16][::-1]
        held: Held = {"radiance": (np.abs(sight.picture - _smooth(middles)[..., None]).max(), 5e-3)}
        yield seen(90.0 - degrees, f"{degrees:g}° up", sight, held)


GREY = 0.5


def _checked(camera: Camera, *objects: SceneObject, background: float = GREY) -> Scene:
    """A wall in z = 0 whose every other texel is white, the others black; lit so slantingly that no shadow falls into
    the view."""
    side, elevation = 64.0, np.radians(1.0)
    checks = (np.indices((1024, 1024)).sum(axis=0) % 2).astype(np.float32)
    paint = Diffuse((1.0, 1.0, 1.0), texture=Texture(np.repeat(checks[..., None], 3, axis=-1)))
    mesh = plane(side, side)
    assert mesh.uv is not None
    wall = SceneObject("wall", replace(mesh, uv=mesh.uv * side), paint)
    power = illuminant("D65").scaled_to_luminous(2.0 * np.pi * GREY / np.sin(elevation))
    lamp = DirectionalLight("lamp", power, direction=(np.cos(elevation), 0.0, -np.sin(elevation)))
    return Scene("checks", camera, (lamp,), (*objects, wall), background_rgb=(background,) * 3)


def _not_grey(picture: np.ndarray) -> float:
    return float(np.abs(picture / GREY - 1.0).max())


@case("eye-texels", "texels to a pixel", (8.0, 32.0, 128.0, 500.0))
def eye_texels(context: Context, counts: Sequence[float]) -> Measured:
    """Checks far finer than a pixel, seen directly and through a ball

    A texture must be averaged over the area that a sample covers, or it flickers."""
    for texels in counts:
        # Through the ball and directly, before a sky as grey as the checks' mean: all is grey.
        extent = PROBE.height * texels / 1024.0
        camera = Camera((0.05, 0.03, 9.0), (0.05, 0.03, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=extent)
        ball = solid("ball", sphere(0.3 * extent, 1280), FLINT, (0.05, 0.03, 0.45 * extent))
        bare = render_probe(context, _checked(camera, background=0.0), resized(PROBE, 24, 16, 4))
        sight = render_probe(context, _checked(camera, ball), resized(PROBE, 24, 16), 4)
        held: Held = {
            "directly": (_not_grey(bare.picture), 0.02),
            "through glass": (_not_grey(sight.mean), 0.02),
            "a pixel through glass": (_not_grey(sight.picture), None),
        }
        yield seen(texels, f"{texels:g} texels a pixel", sight, held, ANY)


@case("eye-slanting", "degrees from grazing", (60.0, 80.0, 88.0, 89.5, 89.95))
def eye_slanting(context: Context, angles_deg: Sequence[float]) -> Measured:
    """The same checks at grazing views

    A pixel's foot is hundreds of times as long as wide."""
    for angle_deg in angles_deg:
        sine, cosine = np.sin(np.radians(angle_deg)), np.cos(np.radians(angle_deg))
        position = vec3((0.0, -5.0 * sine, 5.0 * cosine))
        camera = Camera(position, ORIGIN, (0.0, 0.0, 1.0), "orthographic", vertical_extent=10.0 * cosine)
        sight = render_probe(context, _checked(camera, background=0.0), resized(PROBE, 8, 24, 16))
        columns = sight.picture[4:-4]
        held: Held = {"mean": (_not_grey(columns.mean(axis=(0, 1))), 0.02), "of a pixel": (_not_grey(columns), 0.1)}
        yield seen(90.0 - angle_deg, f"{angle_deg:g}°", sight, held)


EDGE_NM = 550.0
COEFFICIENTS = (
    *((f"{c:.0e} per unit" if c else "nothing", np.full(401, c)) for c in (0.0, 1e-6, 1.0, 1e2, 1e6, 1e30, 1e38)),
    ("1e6 per unit, below 550 nm", np.where(VISIBLE_NM < EDGE_NM, 1e6, 0.0)),
)


@case("eye-absorption", "coefficient", COEFFICIENTS)
def eye_absorption(context: Context, rows: Sequence[tuple[str, np.ndarray]]) -> Measured:
    """Glass that absorbs nothing, everything, or everything below 550 nm, against the sum over reflections

    Coefficients beyond float32 times lengths of zero are NaN."""
    camera = Camera((0.0, 0.0, 4.0), ORIGIN, (0.0, 1.0, 0.0), "orthographic", vertical_extent=0.2)
    thickness, n = 0.3, 1.5
    r = float(fresnel(1.0, n))
    for number, (label, coefficient) in enumerate(rows):
        slab = SceneObject("slab", box((2.0, 2.0, thickness)), Dielectric(constant(n), Absorption(coefficient)))
        sight = render_probe(context, Scene("slab", camera, (), (slab,), background_rgb=WHITE), resized(PROBE, 12, 8))
        kept = np.exp(-np.minimum(coefficient * thickness, 700.0))
        values = r + (1.0 - r) ** 2 * kept * (1.0 + r * kept) / (1.0 - (r * kept) ** 2)
        # Over 1/TINT_STEPS of the spectrum a path lets through what it does in the middle: an edge may lie off by half
        # of that, and near 550 nm a nanometre holds some 1.2 % of a channel.
        bound = 0.012 * 0.5 * 400.0 / TINT_STEPS if "below" in label else 2e-4
        yield seen(number, label, sight, {"radiance": (np.abs(sight.mean - daylight_mean(values)).max(), bound)})
