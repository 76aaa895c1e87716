"""The camera's rays at the stiffest single surfaces: the edge of total reflection, grazing views, and glass that is
hardly there.

All glass here has flat sides and is seen along one plane, so that every way of a ray is known (`flat_glass`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...gpu.context import Context
from ...gpu.map_channels import MapChannels
from ...model.geometry.primitives import box
from ...model.geometry.primitives_round import sphere
from ...model.optics.colorimetry import VISIBLE_NM, daylight_per_lumen
from ...model.optics.glass import constant, from_abbe, sellmeier
from ...model.scene import Black, Camera, Scene, SceneObject
from ...reference.glasses import sellmeier_terms
from ..case import Case, Measurement
from ..rigs.camera_probe import (
    PROBE,
    UNCHECKED,
    WHITE,
    Judged,
    Sight,
    at,
    daylight_mean,
    difference,
    half_sky,
    look_with,
    measurement_of,
    opened_camera_pass,
    render_probe,
    resized,
    sharing_programs,
    sky,
    slope,
    slope_sky,
    with_sky,
)
from ..rigs.flat_glass import extruded, radiance_seen, rectangle, trapezium
from ..rigs.scene_parts import solid

FEW = resized(PROBE, 12, 8, 64)
"""Flat glass looks the same in every pixel."""
BK7 = sellmeier(*sellmeier_terms("N-BK7"), name="N-BK7")
FLINT = from_abbe(1.7, 30.0, "flint")
MARGINS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
INDEX = 1.5
BANDS = (1, 4, 16, 32)
CUT_INCIDENCE = np.radians(41.10)
CUT_NM = 503.239
"""Where N-BK7 begins to reflect totally at 41.10° inside (n = 1/sin i)."""
GRAZING_DEG = (80.0, 89.0, 89.9, 89.99, 89.999)
CUT_BINS = 32
TRIANGLES = 5120
"""Of a ball whose limb is to be as wide as its index makes it, not as a facet is: with 1,280 twice as many bands are
left uncut."""
SLAB_THICKNESS = 0.2
SLAB = rectangle(4.0, SLAB_THICKNESS)
DIFFERENCES = (1e-2, -1e-2, 1e-4, -1e-4, 1e-6, -1e-6)
RIM_GRAIN = 0.05
"""nRMSE that bands may add to a picture of 16 samples a pixel, in which a tenth of the pixels lie on a rim."""


def along_x(extent: float) -> Camera:
    """Parallel rays in the direction of x, through the origin."""
    return Camera((-3.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "orthographic", vertical_extent=extent)


@sharing_programs
def measure_margin(context: Context) -> Iterator[Measurement]:
    """Both sides of the edge: before it little leaves and most is reflected, beyond it all is."""
    critical = float(np.arcsin(1.0 / INDEX))
    for margin in MARGINS:
        judged, sights = Judged(), []
        for side in (-1.0, 1.0):
            outline = trapezium(critical + side * margin)
            scene = with_sky(
                solid("prism", extruded(outline, 1.0, "prism"), constant(INDEX, "glass")),
                camera=along_x(0.02),
                environment=slope_sky(),
            )
            sight = render_probe(context, scene, FEW)
            expected = radiance_seen(outline, INDEX, (-3.0, 0.0), (1.0, 0.0), slope)
            # Fresnel's reflectance falls from 1 as the root of the margin, which rounding moves by about 2e-7.
            slack = 4.0 * (np.sqrt(margin + 4e-7) - np.sqrt(margin)) + 2e-3
            judged.hold(
                "inside the edge" if side < 0 else "beyond the edge", np.abs(sight.mean / expected - 1.0).max(), slack
            )
            sights.append(sight)
        total = replace(sights[0], nonfinite=sum(sight.nonfinite for sight in sights))
        yield measurement_of(margin, f"{margin:g} rad", total, judged)


@sharing_programs
def measure_cut(context: Context) -> Iterator[Measurement]:
    """N-BK7 at 41.10° inside: what is longer than 503 nm leaves towards white, the rest is reflected towards black.

    Fresnel's transmittance rises like a root at the cut, which a band carries as a straight line: the error falls with
    the bands.
    """
    outline = trapezium(CUT_INCIDENCE)
    scene = with_sky(
        solid("prism", extruded(outline, 1.0, "prism"), BK7),
        camera=along_x(0.02),
        environment=half_sky((1.0, 0.0, 0.0)),
    )
    through = np.array(
        [radiance_seen(outline, float(n), (-3.0, 0.0), (1.0, 0.0), _ahead) for n in BK7.index(VISIBLE_NM)]
    )
    edges = np.linspace(380.0, 780.0, CUT_BINS + 1)
    cells = MapChannels(tuple(edges.tolist())).cell_weights()[:, :CUT_BINS] * daylight_per_lumen()[:, None]
    white = cells.sum(axis=0)
    want = through @ cells / white
    settings = replace(FEW, bins=CUT_BINS)
    with (
        opened_camera_pass(context, scene, FEW) as camera_pass,
        opened_camera_pass(context, scene, settings) as camera_in_bins,
    ):
        for bands in BANDS:
            sight, spectral = (
                look_with(camera_pass, scene.camera, FEW, bands),
                look_with(camera_in_bins, scene.camera, settings, bands),
            )
            assert spectral.spectral is not None
            got = spectral.spectral.mean(axis=(0, 1)) / white
            judged = Judged().hold("colour", np.abs(sight.mean - daylight_mean(through)).max(), 0.12 / bands + 2e-3)
            judged.hold("spectrum", np.abs(got - want).max(), 0.4 / bands + 2e-3)
            dark = edges[1:] < CUT_NM
            judged.hold("light before the cut", (got - want)[dark].max(), 0.05 / bands + 3e-3)
            yield measurement_of(bands, f"{bands} band{'s' if bands > 1 else ''}", _both(sight, spectral), judged)


def _ahead(d: np.ndarray) -> np.ndarray:
    return (d[..., 0] > 0.0).astype(float)


@sharing_programs
def measure_grazing(context: Context) -> Iterator[Measurement]:
    """A slab between black walls that hide all below its middle: what is reflected is seen, what is let through is
    not."""
    glass = solid("slab", extruded(SLAB, 4.0, "slab"), FLINT)
    walls = [SceneObject(f"wall {x:+g}", box((0.1, 8.0, 20.0)), Black(), at(x, -4.0, 0.0)) for x in (-6.0, 6.0)]
    coarse = VISIBLE_NM[::40]
    for angle_deg in GRAZING_DEG:
        angle = np.radians(angle_deg)
        direction, foot = np.array([np.sin(angle), -np.cos(angle)]), np.array([0.0, 0.5 * SLAB_THICKNESS])
        start = foot - 3.0 * direction
        camera = Camera(
            (*start, 0.0), (*foot, 0.0), (0.0, 0.0, 1.0), "orthographic", vertical_extent=0.05 * np.cos(angle)
        )
        sight = render_probe(context, Scene("slab", camera, (), (glass, *walls), background_rgb=WHITE), FEW)
        values = [radiance_seen(SLAB, float(n), tuple(start), tuple(direction), _upper) for n in FLINT.index(coarse)]
        expected = daylight_mean(np.interp(VISIBLE_NM, coarse, values))
        judged = Judged().hold("reflectance", np.abs(sight.mean - expected).max(), 4e-3)
        yield measurement_of(
            90.0 - angle_deg,
            f"{angle_deg:g}°",
            sight,
            judged,
            {"depth_reached": UNCHECKED, "stack_full": UNCHECKED, "band_uncut": UNCHECKED},
        )


def _upper(d: np.ndarray) -> np.ndarray:
    return (d[..., 1] > 0.0).astype(float)


@sharing_programs
def measure_index_matched(context: Context) -> Iterator[Measurement]:
    """A ball whose index is 1 but for a little, before a sky that varies in every direction: it may be seen less and
    less.

    The ray bends by some |n − 1|; at the limb, over a share of the ball of 2 |n − 1|, by as much as anything can.
    """
    environment = sky(lambda d: 1.0 + 0.5 * np.sin(9.0 * d[..., 0]) * np.cos(7.0 * d[..., 1]))
    camera = Camera((0.3, -4.0, 0.5), (0.0, 0.0, 0.0), vertical_fov_deg=24.0)
    behind_camera = solid("far", sphere(1e-3, 80), constant(1.5), (0.0, -9.0, 0.0))
    empty = render_probe(context, with_sky(behind_camera, camera=camera, environment=environment))
    for disperses in (False, True):
        for delta in DIFFERENCES:
            glass = (
                from_abbe(1.0 + delta, 0.5 if delta > 0.0 else 20.0, "hardly glass")
                if disperses
                else constant(1.0 + delta, "hardly glass")
            )
            scene = with_sky(solid("ball", sphere(0.7, TRIANGLES), glass), camera=camera, environment=environment)
            sight = render_probe(context, scene, PROBE, 1)
            bound = 10.0 * abs(delta) + 0.5 * np.sqrt(2.0 * abs(delta)) + 1e-5
            judged = Judged().hold("picture", difference(sight.picture, empty.picture), bound)
            if disperses:
                # Of the samples of a pixel on the ball's rim some have a band and some the whole spectrum: that leaves
                # grain.
                in_bands = render_probe(context, scene)
                judged.hold("picture in bands", difference(in_bands.picture, empty.picture), bound + RIM_GRAIN)
                sight = _both(sight, in_bands)
            label = f"1 {'+' if delta > 0 else '−'} {abs(delta):.0e}" + (", dispersive" if disperses else "")
            # At the very limb columns grow without end: now and then one path's are dropped, and counted.
            shares = {"columns_dropped": 1e-4, "depth_reached": 1e-2, "stack_full": 1e-3, "band_uncut": 0.1}
            yield measurement_of(delta * (1.01 if disperses else 1.0), label, sight, judged, shares)


def _both(sight: Sight, other: Sight) -> Sight:
    """The first, with what is not finite in either and both's fall-backs."""
    fallbacks = {name: count + other.fallbacks[name] for name, count in sight.fallbacks.items()}
    return replace(
        sight, nonfinite=sight.nonfinite + other.nonfinite, fallbacks=fallbacks, samples=sight.samples + other.samples
    )


CASES: tuple[Case, ...] = (
    Case(
        "eye-tir-margin",
        "The camera looks at the edge of total reflection, from both sides",
        "Fresnel's reflectance falls from 1 like a root, and float32 knows cos² to seven digits of 1: a picture may "
        "lose or "
        "gain no more than that.",
        "margin to the critical angle (rad)",
        measure_margin,
        len(MARGINS),
    ),
    Case(
        "eye-cut",
        "A band of a camera path that total reflection cuts in two, against the sum over all ways at 401 wavelengths",
        "Half of a band leaves the glass (N-BK7 at 41.10°, from 503 nm on), half stays. The band is cut there, in "
        "colour and in "
        "32 spectral bins.",
        "bands",
        measure_cut,
        len(BANDS),
    ),
    Case(
        "eye-grazing",
        "A slab of flint seen at 80° to 89.999°, against the sum over all its reflections",
        "A pixel's columns land as 1/cos of the angle, and what was let in is reflected to and fro hundreds of times.",
        "degrees from grazing",
        measure_grazing,
        len(GRAZING_DEG),
    ),
    Case(
        "eye-index-matched",
        "A ball of next to no glass, and of next to none that disperses, against no ball",
        "Where media hardly differ their difference drowns in rounding; at the limb, total reflection sets in.",
        "n − 1",
        measure_index_matched,
        2 * len(DIFFERENCES),
        logarithmic=False,
    ),
)
