"""What shines or is lit, at its stiffest: suns in panoramas, tiny lamps, poles, textures far too fine, glass that
swallows everything."""

from __future__ import annotations

from collections.abc import Iterator
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
from ...model.scene import (
    Absorption,
    Camera,
    Dielectric,
    Diffuse,
    Scene,
    SceneObject,
)
from ...model.scene_camera import camera_rays
from ...model.texture import Environment, Texture
from ...passes.variants import TINT_STEPS
from ...reference.camera_reference import render_camera_reference
from ..case import Case, Measurement
from ..rigs.camera_probe import (
    CHANCE,
    PROBE,
    UNCHECKED,
    WHITE,
    Judged,
    at,
    daylight_mean,
    difference,
    fresnel,
    measurement_of,
    render_probe,
    resized,
    sharing_programs,
    sky,
    with_sky,
)
from ..rigs.scene_parts import FLINT, solid

FEW = resized(PROBE, 12, 8, 16)
SUNS = (1e2, 1e4, 1e5, 1e6, 1e8)
"""Of one texel of a panorama, the rest of which is about 1."""
LAMPS = (0.2, 0.1, 0.03, 0.01, 0.003)
"""Radii of a lamp of one and the same power."""
POLES_DEG = (80.0, 89.0, 89.9, 89.999, 90.0, -90.0)
TEXELS = (8.0, 32.0, 128.0, 500.0)
"""Texels to a pixel."""
VIEWS_DEG = (60.0, 80.0, 88.0, 89.5, 89.95)
COEFFICIENTS = (0.0, 1e-6, 1.0, 1e2, 1e6, 1e30, 1e38)
GREY = 0.5
STONE_SEEN_FROM = Camera((0.3, -3.6, 2.4), (0.0, 0.0, 0.0), vertical_fov_deg=24.0)
ANY = {"depth_reached": UNCHECKED, "columns_dropped": UNCHECKED, "band_uncut": UNCHECKED, "stack_full": UNCHECKED}


@sharing_programs
def measure_sun(context: Context) -> Iterator[Measurement]:
    """A panorama with one bright texel, which a brilliant's table reflects: the picture is linear, so less the one
    without a sun it grows with it.

    Radiance over n² is kept along a ray, so nothing seen in glass is brighter than what shines. In all, it is as bright
    as the reference's.
    """
    stone = solid("stone", brilliant(1.6), FLINT)

    def scene(sun: float) -> Scene:
        return with_sky(stone, camera=STONE_SEEN_FROM, environment=_panorama(sun))

    without, hundred = (render_probe(context, scene(sun), PROBE, 4) for sun in (0.0, SUNS[0]))
    added = (hundred.picture - without.picture) / SUNS[0]
    reference_image = render_camera_reference(scene(SUNS[0]), PROBE.width, PROBE.height, samples=256)
    want = reference_image.rgb().sum() - without.picture.sum()
    chance = CHANCE * np.sqrt(reference_image.variance.sum()) / want
    for sun in SUNS:
        sight = render_probe(context, scene(sun), PROBE, 4)
        judged = Judged().hold(
            "brighter than the sun", max(0.0, sight.picture.max() / (1.02 * sun + without.picture.max()) - 1.0), 0.0
        )
        judged.hold("not linear", difference((sight.picture - without.picture) / sun, added), 2e-3)
        judged.hold(
            "light in all",
            abs((sight.picture.sum() - without.picture.sum()) / sun * SUNS[0] / want - 1.0),
            0.02 + chance,
        )
        judged.tell("brightest over mean", sight.picture.max() / sight.picture.mean())
        yield measurement_of(sun, f"{sun:.0e}", sight, judged, ANY)


def _panorama(sun: float) -> Environment:
    """A sky of 64 × 128 texels, 0.5 to 1.5, with one that shines `sun` more, where a level mirror shows it to the
    camera."""
    environment = sky(lambda d: 1.0 + 0.5 * d[..., 2], height=64)
    rgb = environment.rgb.copy()
    rgb[20, 30] += np.float32(sun)
    return Environment(rgb)


@sharing_programs
def measure_lamps(context: Context) -> Iterator[Measurement]:
    """A disc ever smaller and brighter, which a brilliant's table reflects: as much light in all, and never brighter
    than the lamp itself."""
    stone = solid("stone", brilliant(1.6), FLINT)
    toward = np.array([-0.3, 3.6, 2.4]) / np.linalg.norm([-0.3, 3.6, 2.4])
    settings = replace(PROBE, spp=32)
    first = None
    for radius in LAMPS:
        power = illuminant("D65").scaled_to_luminous(1.0 / (np.pi * radius**2))
        lamp = AreaLight("lamp", power, position=tuple(3.0 * toward), direction=tuple(-toward), radius=radius)
        sight = render_probe(context, Scene("lamp", STONE_SEEN_FROM, (lamp,), (stone,)), settings, 4)
        total = sight.picture.sum()
        first = first or total
        judged = Judged().hold(
            "brighter than the lamp", max(0.0, sight.picture.max() * np.pi * radius**2 / 1.02 - 1.0), 0.0
        )
        judged.hold("light in all", abs(total / first - 1.0), 0.1)
        judged.tell("brightest over mean", sight.picture.max() / sight.picture.mean())
        yield measurement_of(radius, f"radius {radius:g}", sight, judged, ANY)


@sharing_programs
def measure_poles(context: Context) -> Iterator[Measurement]:
    """A sky that is smooth in every direction, seen near straight up and straight down: the panorama's rows shrink to a
    point there."""
    for elevation_deg in POLES_DEG:
        elevation = np.radians(elevation_deg)
        forward = np.array([np.cos(elevation) * 0.8, np.cos(elevation) * 0.6, np.sin(elevation)])
        camera = Camera((0.0, 0.0, 0.0), tuple(forward), (0.6, -0.8, 0.0), vertical_fov_deg=30.0)
        settings = resized(PROBE, 32, 32, 16)
        scene = with_sky(
            SceneObject("far", box((0.1, 0.1, 0.1)), Diffuse(), at(-9.0, 0.0, 0.0)),
            camera=camera,
            environment=sky(_smooth),
        )
        sight = render_probe(context, scene, settings)
        _, directions = camera_rays(camera, (32, 32), 32 * 16 + 1)
        middles = directions[8::16, 8::16][::-1]
        judged = Judged().hold("radiance", np.abs(sight.picture - _smooth(middles)[..., None]).max(), 5e-3)
        yield measurement_of(90.0 - elevation_deg, f"{elevation_deg:g}° up", sight, judged)


def _smooth(d: np.ndarray) -> np.ndarray:
    return 1.0 + 0.5 * d[..., 0] + 0.3 * d[..., 1] + 0.1 * d[..., 2] + 0.2 * (d[..., 0] ** 2 - d[..., 1] ** 2)


@sharing_programs
def measure_texels(context: Context) -> Iterator[Measurement]:
    """A wall of checks far finer than a pixel, seen directly and through a ball of flint, before a sky as grey as their
    mean: all is grey."""
    for texels in TEXELS:
        extent = PROBE.height * texels / 1024.0
        camera = Camera((0.05, 0.03, 9.0), (0.05, 0.03, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=extent)
        bare = render_probe(
            context, replace(_checked(camera), background_rgb=(0.0, 0.0, 0.0)), resized(PROBE, 24, 16, 4)
        )
        ball = solid("ball", sphere(0.3 * extent, 1280), FLINT, (0.05, 0.03, 0.45 * extent))
        sight = render_probe(context, _checked(camera, ball), resized(PROBE, 24, 16), 4)
        judged = Judged().hold("directly", np.abs(bare.picture / GREY - 1.0).max(), 0.02)
        judged.hold("through glass", np.abs(sight.mean / GREY - 1.0).max(), 0.02)
        judged.tell("a pixel through glass", np.abs(sight.picture / GREY - 1.0).max())
        yield measurement_of(texels, f"{texels:g} texels a pixel", sight, judged, ANY)


@sharing_programs
def measure_slanting(context: Context) -> Iterator[Measurement]:
    """The same wall at a grazing view: a pixel covers a texel one way and hundreds the other."""
    for angle_deg in VIEWS_DEG:
        angle = np.radians(angle_deg)
        position = (0.0, -5.0 * np.sin(angle), 5.0 * np.cos(angle))
        camera = Camera(
            position, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "orthographic", vertical_extent=10.0 * np.cos(angle)
        )
        sight = render_probe(
            context, replace(_checked(camera), background_rgb=(0.0, 0.0, 0.0)), resized(PROBE, 8, 24, 16)
        )
        columns = sight.picture[4:-4]
        judged = Judged().hold("mean", np.abs(columns.mean(axis=(0, 1)) / GREY - 1.0).max(), 0.02)
        judged.hold("of a pixel", np.abs(columns / GREY - 1.0).max(), 0.1)
        yield measurement_of(90.0 - angle_deg, f"{angle_deg:g}°", sight, judged)


def _checked(camera: Camera, *objects: SceneObject) -> Scene:
    """A wall in z = 0 whose every other texel is white, the others black; lit so slantingly that no shadow falls into
    the view."""
    checks = (np.indices((1024, 1024)).sum(axis=0) % 2).astype(np.float32)
    side = 64.0
    uv_side = plane(side, side)
    assert uv_side.uv is not None
    mesh = replace(uv_side, uv=uv_side.uv * side)
    elevation = np.radians(1.0)
    power = illuminant("D65").scaled_to_luminous(2.0 * np.pi * GREY / np.sin(elevation))
    lamp = DirectionalLight("lamp", power, direction=(np.cos(elevation), 0.0, -np.sin(elevation)))
    wall = SceneObject(
        "wall", mesh, Diffuse((1.0, 1.0, 1.0), texture=Texture(np.repeat(checks[..., None], 3, axis=-1)))
    )
    return Scene("checks", camera, (lamp,), (*objects, wall), background_rgb=(GREY, GREY, GREY))


@sharing_programs
def measure_absorption(context: Context) -> Iterator[Measurement]:
    """A slab that absorbs nothing up to everything, before white; then one that absorbs everything below 550 nm and
    nothing above."""
    camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), "orthographic", vertical_extent=0.2)
    thickness, n = 0.3, 1.5
    step = VISIBLE_NM < 550.0
    cases = [(f"{c:.0e} per unit" if c else "nothing", np.full(401, c)) for c in COEFFICIENTS]
    cases.append(("1e6 per unit, below 550 nm", np.where(step, 1e6, 0.0)))
    for number, (label, coefficient) in enumerate(cases):
        slab = SceneObject("slab", box((2.0, 2.0, thickness)), Dielectric(constant(n), Absorption(coefficient)))
        sight = render_probe(context, Scene("slab", camera, (), (slab,), background_rgb=WHITE), FEW)
        r, kept = float(fresnel(1.0, n)), np.exp(-np.minimum(coefficient * thickness, 700.0))
        values = r + (1.0 - r) ** 2 * kept * (1.0 + r * kept) / (1.0 - (r * kept) ** 2)
        # Over 1/TINT_STEPS of the spectrum a path lets through what it does in the middle: an edge may lie off by half
        # of that, and near 550 nm a nanometre holds some 1.2 % of a channel.
        sharp = 0.012 * 0.5 * 400.0 / TINT_STEPS if "below" in label else 2e-4
        judged = Judged().hold("radiance", np.abs(sight.mean - daylight_mean(values)).max(), sharp)
        yield measurement_of(number, label, sight, judged)


CASES: tuple[Case, ...] = (
    Case(
        "eye-sun",
        "A panorama with one bright texel, through a brilliant",
        "One sample in thousands finds the sun: a picture of sparks, or of sparks brighter than the sun.",
        "the texel's radiance",
        measure_sun,
        len(SUNS),
    ),
    Case(
        "eye-lamps",
        "A lamp ever smaller and brighter, through a brilliant",
        "The same with a lamp, whose edge a path blurs by as much as it stands for.",
        "radius",
        measure_lamps,
        len(LAMPS),
    ),
    Case(
        "eye-poles",
        "A panorama's poles, against the function it was made of",
        "Rows of texels shrink to a point, and longitudes jump.",
        "degrees from the zenith",
        measure_poles,
        len(POLES_DEG),
        logarithmic=False,
    ),
    Case(
        "eye-texels",
        "Checks far finer than a pixel, seen directly and through a ball",
        "What is looked up must be averaged over what a sample stands for, or it flickers.",
        "texels to a pixel",
        measure_texels,
        len(TEXELS),
    ),
    Case(
        "eye-slanting",
        "The same checks at grazing views",
        "A pixel's foot is hundreds of times as long as wide.",
        "degrees from grazing",
        measure_slanting,
        len(VIEWS_DEG),
    ),
    Case(
        "eye-absorption",
        "Glass that absorbs nothing, everything, or everything below 550 nm, against the sum over reflections",
        "Coefficients beyond float32 times lengths of zero are NaN.",
        "coefficient",
        measure_absorption,
        len(COEFFICIENTS) + 1,
        logarithmic=False,
    ),
)
