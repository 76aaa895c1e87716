"""Glass that no maker sells, seen through, and what a lens's focus makes of a pixel: against the float64 reference of
the camera.

The reference (`reference.camera_reference`) follows one random wavelength a path and shares nothing with the shaders.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...gpu.context import Context
from ...model.geometry.primitives import plane, prism
from ...model.geometry.primitives_round import sphere
from ...model.lights import DirectionalLight
from ...model.optics.glass import Dispersion, constant, from_abbe, table
from ...model.optics.spectrum import illuminant
from ...model.placement import rotation_about
from ...model.scene import Camera, Diffuse, Scene, SceneObject
from ...model.texture import Texture
from ...reference.camera_reference import render_camera_reference
from ..case import Case, Measurement
from ..rigs.camera_probe import (
    CHANCE,
    PROBE,
    UNCHECKED,
    Judged,
    Sight,
    measurement_of,
    render_probe,
    resized,
    sharing_programs,
    sky,
    with_sky,
)
from ..rigs.probe import blocks
from ..rigs.scene_parts import solid

BLOCK = 3
"""Side of the blocks of pixels that are compared."""
PROBE_LONG = resized(PROBE, 30, 21, 128)
"""Fine stripes need many samples before a picture's own chance is below what its dispersion does."""
PROBE_FOCUS = resized(PROBE, 36, 24, 32)
REFERENCE_SAMPLES = 512
DEFOCUS = (0.5, 0.1, 0.01, 0.0)
"""Distance of a wall from a ball's focus, radii."""
BALL_N = 1.5
STEP = "a step from 1.7 to 1.5 within 1 nm"
"""Within a band the index moves evenly: such a step is smeared over one of them."""
ANY = {"depth_reached": UNCHECKED, "stack_full": UNCHECKED, "columns_dropped": UNCHECKED, "band_uncut": UNCHECKED}


def glasses() -> list[tuple[str, Dispersion, float]]:
    """(label, glass, what a picture in bands may err by, as a share of it)."""
    return [
        ("V_d 20", from_abbe(1.6, 20.0, "flint"), 0.006),
        ("V_d 1", from_abbe(1.6, 1.0, "absurd"), 0.015),
        ("V_d −20, anomalous", from_abbe(1.6, -20.0, "anomalous"), 0.006),
        ("n 2.2 (violet) to 1.2 (red)", table((380.0, 780.0), (2.2, 1.2), "rainbow gem"), 0.015),
        (STEP, table((380.0, 549.5, 550.5, 780.0), (1.7, 1.7, 1.5, 1.5), "step"), 0.006),
    ]


@sharing_programs
def measure_glasses(context: Context) -> Iterator[Measurement]:
    """A ball and a prism of each glass before a sky of stripes."""
    stripes = sky(lambda d: 1.0 + 0.9 * np.sin(40.0 * d[..., 2]), height=256)
    camera = Camera((0.2, -6.0, 0.9), (0.0, 0.0, 0.0), vertical_fov_deg=14.0)
    turned = rotation_about((0.0, 0.0, 1.0), np.radians(110.0))
    for number, (label, glass, bias) in enumerate(glasses(), 1):
        ball = solid("ball", sphere(0.7, 1280), glass, (-0.85, 0.0, 0.0))
        wedge = solid("prism", prism(side=1.2), glass, (0.9, 0.0, 0.0), turned=turned)
        scene = with_sky(ball, wedge, camera=camera, environment=stripes)
        sight = render_probe(context, scene, PROBE_LONG)
        yield measurement_of(
            number,
            label,
            sight,
            against_reference(scene, sight, bias + (1.0 / sight.bands if label == STEP else 0.0)),
            ANY,
        )


@sharing_programs
def measure_focus(context: Context) -> Iterator[Measurement]:
    """Parallel rays through a ball on to a checked wall through its focus; then a camera in the focus, whose rays leave
    in parallel."""
    focus = BALL_N / (2.0 * (BALL_N - 1.0))
    checks = np.where((np.indices((64, 64)) // 4).sum(axis=0) % 2 == 0, 0.9, 0.1).astype(np.float32)
    wall_material = Diffuse((1.0, 1.0, 1.0), texture=Texture(np.repeat(checks[..., None], 3, axis=-1)))
    upright = np.array([[0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    # From above and behind: the ball's shadow falls beside what is seen.
    lamp = DirectionalLight("lamp", illuminant("D65").scaled_to_luminous(3.0), direction=(0.25881905, 0.0, -0.96592583))
    ball = solid("ball", sphere(1.0, 5120), constant(BALL_N))
    for defocus in DEFOCUS:
        place = upright.copy()
        place[0, 3] = focus + defocus
        scene = Scene(
            "focus",
            Camera((-5.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "orthographic", vertical_extent=2.4),
            (lamp,),
            (ball, SceneObject("wall", plane(4.0, 4.0), wall_material, place)),
        )
        sight = render_probe(context, scene, PROBE_FOCUS)
        yield measurement_of(
            1.0 + defocus, f"wall {defocus:g} off the focus", sight, against_reference(scene, sight, 0.003), ANY
        )
    stripes = sky(lambda d: 1.0 + 0.9 * np.sin(40.0 * d[..., 2]) * np.sin(31.0 * d[..., 1]))
    for defocus in (0.01, 0.0):
        camera = Camera((-focus - defocus, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), vertical_fov_deg=60.0)
        scene = with_sky(ball, camera=camera, environment=stripes)
        sight = render_probe(context, scene, PROBE_FOCUS)
        yield measurement_of(
            -defocus, f"camera {defocus:g} off the focus", sight, against_reference(scene, sight, 0.003), ANY
        )


def against_reference(scene: Scene, sight: Sight, bias: float) -> Judged:
    """The picture in blocks, its colours (red less blue) and its sum against two passes of a reference; what these
    differ by is chance."""
    height, width = sight.picture.shape[:2]
    halves = [
        blocks(render_camera_reference(scene, width, height, samples=REFERENCE_SAMPLES, seed=seed).rgb(), BLOCK)
        for seed in (1, 2)
    ]
    want, apart = 0.5 * (halves[0] + halves[1]), 0.5 * (halves[0] - halves[1])
    error, size = blocks(sight.picture, BLOCK) - want, want.mean()
    judged = Judged().hold("picture", _root_mean_square(error) / size, bias + 2.0 * _root_mean_square(apart) / size)
    judged.hold(
        "colour",
        _root_mean_square(_red_less_blue(error)) / size,
        bias + 2.0 * _root_mean_square(_red_less_blue(apart)) / size,
    )
    return judged.hold(
        "energy",
        abs(error.mean()) / size,
        0.25 * bias + CHANCE * _root_mean_square(apart) / size / np.sqrt(want[..., 0].size),
    )


def _red_less_blue(picture: np.ndarray) -> np.ndarray:
    return picture[..., 0] - picture[..., 2]


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


CASES: tuple[Case, ...] = (
    Case(
        "eye-glasses",
        "A ball and a prism of glass with any dispersion, before a sky of stripes, against the float64 reference",
        "A path's columns are straight lines in n; where the spectrum is spread far or jumps, it must be cut into "
        "bands enough.",
        "glass",
        measure_glasses,
        len(glasses()),
        logarithmic=False,
    ),
    Case(
        "eye-focus",
        "A wall through the focus of a ball, and the camera in it, against the float64 reference",
        "The area that a pixel stands for shrinks to nothing there, and grows again turned over.",
        "place",
        measure_focus,
        len(DEFOCUS) + 2,
        logarithmic=False,
    ),
)
