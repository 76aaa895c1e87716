"""The camera's rays at the stiffest single surfaces: the edge of total reflection, grazing views, glass that is hardly
there or that no maker sells, and what a lens's focus makes of a pixel.

Glass with flat sides is seen along one plane, so that every way of a ray is known (`flat_glass`). Other glass is
compared with `reference.camera_reference`, which follows one random wavelength a path and shares nothing with the
shaders.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...gpu.context import Context
from ...gpu.map_channels import MapChannels
from ...model.geometry.primitives import box, extruded, plane, prism
from ...model.geometry.primitives_round import sphere
from ...model.lights import DirectionalLight
from ...model.optics.colorimetry import VISIBLE_NM, daylight_per_lumen
from ...model.optics.glass import Dispersion, constant, from_abbe, sellmeier
from ...model.optics.spectrum import illuminant
from ...model.scene import Black, Camera, Diffuse, Scene, SceneObject
from ...model.texture import Texture
from ...reference.camera_reference import render_camera_reference
from ...reference.glasses import sellmeier_terms
from ..case import Held, Measured, case
from ..rigs.camera_probe import (
    ANY,
    CHANCE,
    FEW,
    PROBE,
    WHITE,
    Sight,
    ahead,
    daylight_mean,
    difference,
    look_with,
    opened_camera_pass,
    render_probe,
    resized,
    seen,
    sky,
    slope,
    slope_sky,
    straight,
    together,
    with_sky,
)
from ..rigs.flat_glass import radiance_seen, rectangle, trapezium
from ..rigs.probe import blocks
from ..rigs.scene_parts import ANOMALOUS, FLINT, IMPOSSIBLE, RAINBOW, STEP, at, solid, turn

ORIGIN, ALONG_X = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)


@case("eye-tir-margin", "margin to the critical angle (rad)", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6))
def eye_tir_margin(context: Context, margins: Sequence[float]) -> Measured:
    """The camera looks at the edge of total reflection, from both sides

    Fresnel's reflectance falls from 1 like a root, and float32 knows cos² to seven digits of 1: a picture may lose or
    gain no more than that."""
    n = 1.5
    for margin in margins:
        held, sights = {}, []
        for name, side in (("inside the edge", -1.0), ("beyond the edge", 1.0)):
            outline = trapezium(float(np.arcsin(1.0 / n)) + side * margin)
            glass = solid("prism", extruded("prism", outline, 1.0), constant(n, "glass"))
            camera = straight(ORIGIN, ALONG_X, 0.02)
            sight = render_probe(context, with_sky(glass, camera=camera, environment=slope_sky()), FEW)
            expected = radiance_seen(outline, n, (-3.0, 0.0), (1.0, 0.0), slope)
            # Fresnel's reflectance falls from 1 as the root of the margin, which rounding moves by about 2e-7.
            slack = 4.0 * (np.sqrt(margin + 4e-7) - np.sqrt(margin)) + 2e-3
            held[name] = np.abs(sight.mean / expected - 1.0).max(), slack
            sights.append(sight)
        yield seen(margin, f"{margin:g} rad", together(*sights), held)


CUT_NM = 503.239
"""Where N-BK7 begins to reflect totally at 41.10° inside (n = 1/sin i)."""
CUT_BINS = 32


@case("eye-cut", "bands", (1, 4, 16, 32))
def eye_cut(context: Context, counts: Sequence[int]) -> Measured:
    """A band of a camera path that total reflection cuts in two, against the sum over all ways at 401 wavelengths

    Half of a band leaves the glass (N-BK7 at 41.10°, from 503 nm on), half stays. The band is cut there, in colour and
    in 32 spectral bins."""
    outline, glass = trapezium(np.radians(41.10)), sellmeier(*sellmeier_terms("N-BK7"), name="N-BK7")
    wedge = solid("prism", extruded("prism", outline, 1.0), glass)
    scene = with_sky(wedge, camera=straight(ORIGIN, ALONG_X, 0.02), environment=sky(ahead))
    ways = [radiance_seen(outline, float(n), (-3.0, 0.0), (1.0, 0.0), ahead) for n in glass.index(VISIBLE_NM)]
    through, edges = np.array(ways), np.linspace(380.0, 780.0, CUT_BINS + 1)
    cells = MapChannels(tuple(edges.tolist())).cell_weights()[:, :CUT_BINS] * daylight_per_lumen()[:, None]
    white, binned = cells.sum(axis=0), replace(FEW, bins=CUT_BINS)
    with opened_camera_pass(context, scene, FEW) as colours, opened_camera_pass(context, scene, binned) as bins:
        for bands in counts:
            sight = look_with(colours, scene.camera, FEW, bands)
            spectral = look_with(bins, scene.camera, binned, bands)
            assert spectral.spectral is not None
            off = spectral.spectral.mean(axis=(0, 1)) / white - through @ cells / white
            # Fresnel's transmittance rises like a root at the cut, which a band carries as a straight line.
            held: Held = {
                "colour": (np.abs(sight.mean - daylight_mean(through)).max(), 0.12 / bands + 2e-3),
                "spectrum": (np.abs(off).max(), 0.4 / bands + 2e-3),
                "light before the cut": (off[edges[1:] < CUT_NM].max(), 0.05 / bands + 3e-3),
            }
            yield seen(bands, f"{bands} band{'s' if bands > 1 else ''}", together(sight, spectral), held)


@case("eye-grazing", "degrees from grazing", (80.0, 89.0, 89.9, 89.99, 89.999))
def eye_grazing(context: Context, angles_deg: Sequence[float]) -> Measured:
    """A slab of flint seen at 80° to 89.999°, against the sum over all its reflections

    A pixel's columns land as 1/cos of the angle, and what was let in is reflected to and fro hundreds of times."""
    thickness = 0.2
    outline = rectangle(4.0, thickness)
    glass = solid("slab", extruded("slab", outline, 4.0), FLINT)
    # Black walls hide all below the slab's middle: what is reflected is seen, what is let through is not.
    walls = [SceneObject(f"wall {x:+g}", box((0.1, 8.0, 20.0)), Black(), at(x, -4.0, 0.0)) for x in (-6.0, 6.0)]
    coarse = VISIBLE_NM[::40]
    for angle_deg in angles_deg:
        angle = np.radians(angle_deg)
        direction, foot = np.array([np.sin(angle), -np.cos(angle)]), np.array([0.0, 0.5 * thickness])
        camera = straight((*foot, 0.0), (*direction, 0.0), 0.05 * np.cos(angle))
        sight = render_probe(context, Scene("slab", camera, (), (glass, *walls), background_rgb=WHITE), FEW)
        start = foot - 3.0 * direction
        values = [radiance_seen(outline, float(n), start, direction, _upper) for n in FLINT.index(coarse)]
        expected = daylight_mean(np.interp(VISIBLE_NM, coarse, values))
        held: Held = {"reflectance": (np.abs(sight.mean - expected).max(), 4e-3)}
        yield seen(90.0 - angle_deg, f"{angle_deg:g}°", sight, held, ANY | {"columns_dropped": 0.0})


def _upper(d: np.ndarray) -> np.ndarray:
    return (d[..., 1] > 0.0).astype(float)


DIFFERENCES = (1e-2, -1e-2, 1e-4, -1e-4, 1e-6, -1e-6)
RIM_GRAIN = 0.05
"""nRMSE that bands may add to a picture of 16 samples a pixel, in which a tenth of the pixels lie on a rim: of a
pixel's samples some have a band there and some the whole spectrum."""


@case("eye-index-matched", "n − 1", [(d, delta) for d in (False, True) for delta in DIFFERENCES])
def eye_index_matched(context: Context, rows: Sequence[tuple[bool, float]]) -> Measured:
    """A ball of next to no glass, and of next to none that disperses, against no ball

    Where media hardly differ their difference drowns in rounding; at the limb, total reflection sets in."""
    environment = sky(lambda d: 1.0 + 0.5 * np.sin(9.0 * d[..., 0]) * np.cos(7.0 * d[..., 1]))
    camera = Camera((0.3, -4.0, 0.5), ORIGIN, vertical_fov_deg=24.0)
    behind_camera = solid("far", sphere(1e-3, 80), constant(1.5), (0.0, -9.0, 0.0))
    empty = render_probe(context, with_sky(behind_camera, camera=camera, environment=environment)).picture
    # The ball's limb is to be as wide as its index makes it, not as a facet is.
    ball = sphere(0.7, 5120)
    for disperses, delta in rows:
        v_d = 0.5 if delta > 0.0 else 20.0
        glass = from_abbe(1.0 + delta, v_d, "hardly glass") if disperses else constant(1.0 + delta, "hardly glass")
        scene = with_sky(solid("ball", ball, glass), camera=camera, environment=environment)
        sight = render_probe(context, scene, PROBE, 1)
        # The ray bends by some |n − 1|; at the limb, over a share of the ball of 2 |n − 1|, by as much as anything can.
        bound = 10.0 * abs(delta) + 0.5 * np.sqrt(2.0 * abs(delta)) + 1e-5
        held = {"picture": (difference(sight.picture, empty), bound)}
        if disperses:
            in_bands = render_probe(context, scene)
            held["picture in bands"] = difference(in_bands.picture, empty), bound + RIM_GRAIN
            sight = together(sight, in_bands)
        label = f"1 {'+' if delta > 0 else '−'} {abs(delta):.0e}" + (", dispersive" if disperses else "")
        # At the very limb columns grow without end: now and then one path's are dropped, and counted.
        shares = {"columns_dropped": 1e-4, "depth_reached": 1e-2, "stack_full": 1e-3, "band_uncut": 0.1}
        yield seen(delta * (1.01 if disperses else 1.0), label, sight, held, shares)


# ---- against the reference ---------------------------------------------------------------------

REFERENCE_SAMPLES = 512


def against_reference(scene: Scene, sight: Sight, bias: float) -> Held:
    """The picture in blocks, its colours (red less blue) and its sum against two passes of a reference; what these
    differ by is chance."""
    height, width = sight.picture.shape[:2]
    one, other = (
        blocks(render_camera_reference(scene, width, height, samples=REFERENCE_SAMPLES, seed=seed).rgb, 3)
        for seed in (1, 2)
    )
    want, apart = 0.5 * (one + other), 0.5 * (one - other)
    error, size = blocks(sight.picture, 3) - want, want.mean()
    chance = CHANCE * _root_mean_square(apart) / size / np.sqrt(want[..., 0].size)
    return {
        "picture": (_root_mean_square(error) / size, bias + 2.0 * _root_mean_square(apart) / size),
        "colour": (
            _root_mean_square(error[..., 0] - error[..., 2]) / size,
            bias + 2.0 * _root_mean_square(apart[..., 0] - apart[..., 2]) / size,
        ),
        "energy": (abs(error.mean()) / size, 0.25 * bias + chance),
    }


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


GLASSES = (
    ("V_d 20", from_abbe(1.6, 20.0, "flint"), 0.006),
    ("V_d 1", from_abbe(1.6, 1.0, "absurd"), 0.015),
    *((label, IMPOSSIBLE[label], bias) for label, bias in ((ANOMALOUS, 0.006), (RAINBOW, 0.015), (STEP, 0.006))),
)
"""Label, glass, what a picture in bands may err by, as a share of it."""


@case("eye-glasses", "glass", GLASSES)
def eye_glasses(context: Context, glasses: Sequence[tuple[str, Dispersion, float]]) -> Measured:
    """A ball and a prism of glass with any dispersion, before a sky of stripes, against the float64 reference

    A path's columns are straight lines in n; where the spectrum is spread far or jumps, it must be cut into bands
    enough."""
    stripes = sky(lambda d: 1.0 + 0.9 * np.sin(40.0 * d[..., 2]), height=256)
    camera = Camera((0.2, -6.0, 0.9), ORIGIN, vertical_fov_deg=14.0)
    for number, (label, glass, bias) in enumerate(glasses, 1):
        ball = solid("ball", sphere(0.7, 1280), glass, (-0.85, 0.0, 0.0))
        wedge = solid("prism", prism(side=1.2), glass, (0.9, 0.0, 0.0), turned=turn((0.0, 0.0, 1.0), 110.0))
        scene = with_sky(ball, wedge, camera=camera, environment=stripes)
        # Fine stripes need many samples before a picture's own chance is below what its dispersion does.
        sight = render_probe(context, scene, resized(PROBE, 30, 21, 128))
        # Within a band the index moves evenly: a step is smeared over one of them.
        smeared = 1.0 / sight.bands if label == STEP else 0.0
        yield seen(number, label, sight, against_reference(scene, sight, bias + smeared), ANY)


FOCI = (*(("wall", defocus) for defocus in (0.5, 0.1, 0.01, 0.0)), ("camera", 0.01), ("camera", 0.0))
"""What is near the ball's focus, and its distance from it, radii."""


@case("eye-focus", "place", FOCI)
def eye_focus(context: Context, places: Sequence[tuple[str, float]]) -> Measured:
    """A wall through the focus of a ball, and the camera in it, against the float64 reference

    The area that a pixel covers shrinks to nothing there, and grows again turned over."""
    n = 1.5
    focus, ball = n / (2.0 * (n - 1.0)), solid("ball", sphere(1.0, 5120), constant(n))
    checks = np.where((np.indices((64, 64)) // 4).sum(axis=0) % 2 == 0, 0.9, 0.1).astype(np.float32)
    paint = Diffuse((1.0, 1.0, 1.0), texture=Texture(np.repeat(checks[..., None], 3, axis=-1)))
    upright = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    stripes = sky(lambda d: 1.0 + 0.9 * np.sin(40.0 * d[..., 2]) * np.sin(31.0 * d[..., 1]))
    # From above and behind: the ball's shadow falls outside of what is seen.
    lamp = DirectionalLight("lamp", illuminant("D65").scaled_to_luminous(3.0), direction=(0.25881905, 0.0, -0.96592583))
    for thing, defocus in places:
        if thing == "wall":
            wall = SceneObject("wall", plane(4.0, 4.0), paint, at(focus + defocus, 0.0, 0.0, upright))
            scene = Scene("focus", straight(ORIGIN, ALONG_X, 2.4, 5.0), (lamp,), (ball, wall))
        else:
            camera = Camera((-focus - defocus, 0.0, 0.0), ORIGIN, (0.0, 0.0, 1.0), vertical_fov_deg=60.0)
            scene = with_sky(ball, camera=camera, environment=stripes)
        sight = render_probe(context, scene, resized(PROBE, 36, 24, 32))
        held, severity = against_reference(scene, sight, 0.003), 1.0 + defocus if thing == "wall" else -defocus
        yield seen(severity, f"{thing} {defocus:g} off the focus", sight, held, ANY)
