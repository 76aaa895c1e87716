"""Caustic maps against a histogram of random photons, texel by texel (z-tests over texels, blocks and the whole).

The scene has a closed form: a spot with a soft edge shines through two faces of an N-SF11 wedge onto a screen. The
histogram is of float64 rays, with wavelength and direction from shifted Kronecker sequences of its own; it
shares the scene's numbers with the renderer and nothing else. Means over independent seeds are compared by Welch's t;
with the Šidák correction a right renderer is refused once in 10,000 runs. The smallest error of the total energy seen
with probability 0.99 is asserted to be below 1 %. Mutants: 1 % more energy, half a texel aside, red and blue exchanged.
Methods with footprints blur by part of a texel, and `srd` takes a chord for the path within a band (a quarter of a
texel at most): `ALLOWED` gives texels that much, in shares of the brightest; the whole picture gets a tenth of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from reference.textbook_optics import fresnel_reflectance
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.gpu.scene_buffers import SceneBuffers
from spectrasplat.model.geometry.mesh import make_mesh
from spectrasplat.model.lights import SpotLight
from spectrasplat.model.optics.colorimetry import K_M, cmf_xyz
from spectrasplat.model.optics.spectrum import illuminant
from spectrasplat.model.scene import Camera, Diffuse, Scene, SceneObject
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.plane_frame import plane_frame
from spectrasplat.reference import optics
from spectrasplat.reference.glasses import index
from spectrasplat.render.device_scene import spectral_axis
from spectrasplat.render.light_pass import LightPass
from spectrasplat.stress.rigs.gpu_paths import extruded, glass, screen

ALPHA = 1e-4
SIZE = (24, 16)
SEEDS, PHOTONS = 12, 16_384
REPLICATES, RAYS = 12, 120_000
ALLOWED = {
    "stochastic-point": 0.0,
    "stochastic": 0.01,
    "stochastic-even": 0.01,
    "progressive-stochastic": 0.01,
    "srd-photons": 0.01,
    "progressive": 0.01,
}
DETECTABLE = {
    "stochastic-point": 0.09,
    "stochastic": 0.09,
    "stochastic-even": 0.01,
    "progressive-stochastic": 0.045,
    "srd-photons": 0.01,
    "progressive": 0.01,
}
"""Smallest error of the whole map that is seen: wavelengths drawn by chance leave more noise than a lattice of them."""
PASSES = {
    "progressive-stochastic": (PHOTONS // 4,) * 16,
    "progressive": (PHOTONS // 16, PHOTONS // 4, PHOTONS),
}
"""Photons of each, where a method has several."""

PASSES_SHRINK = ((1, True), (2, True), (3, True), (3, False))
"""How many of `progressive`'s passes are rendered, and whether their footprints shrink."""

APEX = np.radians(30.0)
LAMP = np.array([-4.0, 0.6, 0.1])
AIM = np.array([0.0, 0.0, 0.0])
OUTER = np.radians(3.0)
SPECTRUM = illuminant("D65")


def wedge() -> np.ndarray:
    """Section (4, 2), counter-clockwise: a trapezium whose sides lean by half the apex angle."""
    tangent = np.tan(0.5 * APEX)
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0 - 2.0 * tangent, 1.0], [-1.0 + 2.0 * tangent, 1.0]]) * [0.6, 1.0]


def scene() -> Scene:
    direction = optics.unit(AIM - LAMP)
    light = SpotLight(
        "lamp",
        SPECTRUM,
        position=tuple(LAMP),
        direction=tuple(direction),
        inner_half_angle_deg=0.0,
        outer_half_angle_deg=float(np.degrees(OUTER)),
    )
    solid = SceneObject("wedge", extruded("wedge", wedge(), half=1.0), glass("N-SF11"))
    sheet = screen((5.0, -2.1, -0.1), (1.0, -0.4, 0.0), half=2.0)
    return Scene(
        "wedge",
        Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)),
        (light,),
        (solid, SceneObject("screen", make_mesh("screen", sheet.vertices, sheet.triangles), Diffuse())),
    )


@dataclass(frozen=True)
class Window:
    """The map's rectangle on the screen, world units."""

    origin: np.ndarray
    axes: np.ndarray
    normal: np.ndarray
    low: np.ndarray
    high: np.ndarray


def rendered(
    gl: Context, method: str, kernel: float = 1.0, shrinks: bool = True, passes: int | None = None, beams: bool = True
) -> tuple[np.ndarray, Window]:
    """Maps (SEEDS, H, W, 3): X, Y, Z a texel. `kernel`: times as wide; `shrinks` False: a mutant that keeps it.
    `passes`: so many of the method's first; without `beams` photons carry everything."""
    width, height = SIZE
    settings = RenderSettings(width=width, height=height, method=method, layer="map:screen", max_depth=2)
    question = scene()
    features = Features.of(question, settings)
    features = replace(features, beams=features.beams and beams)
    buffers = SceneBuffers(gl.ctx, question, features, spectral_axis(question, features))
    half = LightPass(gl, question, settings, features, buffers)
    try:
        half.prepare()
        half.smoothing *= kernel
        sizes = PASSES.get(method, (PHOTONS,))[:passes]
        maps = []
        for seed in range(SEEDS):
            half.begin(sizes[0], 100 + seed)
            for number, photons in enumerate(sizes):
                half._shrinks = half._shrinks and shrinks
                half.widening = 1.0 if shrinks else (photons / sizes[0]) ** 0.5
                half.plan(photons, number)
                half.run_pass(number, photons, lambda _: True)
            maps.append(half.maps.receiver(0)[..., :3].astype(float) * half.maps.scale)
        frame = plane_frame(buffers.space.to_gpu(buffers.world_meshes[1].vertices))
        (window,) = half.layout.windows[0]
        scale = buffers.space.scale
        return np.array(maps), Window(
            buffers.space.to_world(frame.origin),
            frame.axes,
            np.cross(*frame.axes),
            window.low / scale,
            window.high / scale,
        )
    finally:
        half.release()
        buffers.release()


def histogram(window: Window) -> np.ndarray:
    """Maps (REPLICATES, H, W, 3) of float64 rays through the wedge's two planes."""
    section = wedge()
    faces = []
    for a, b in ((section[3], section[0]), (section[1], section[2])):
        along = b - a
        normal = optics.unit(np.array([along[1], -along[0], 0.0]))
        faces.append((np.array([*a, 0.0]), normal))
    axis = optics.unit(AIM - LAMP)
    first = optics.unit(np.cross(axis, [0.0, 0.0, 1.0]))
    second = np.cross(axis, first)
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(OUTER))
    rng = np.random.default_rng(7)
    maps = []
    for _ in range(REPLICATES):
        # R3: powers of the root of x⁴ = x + 1.
        u = (rng.random(3) + np.arange(RAYS)[:, None] * 1.2207440846057596 ** -np.arange(1.0, 4.0)) % 1.0
        cosine = 1.0 - u[:, 0] * (1.0 - np.cos(OUTER))
        turn, sine = 2.0 * np.pi * u[:, 1], np.sqrt(1.0 - cosine**2)
        direction = (
            cosine[:, None] * axis + (sine * np.cos(turn))[:, None] * first + (sine * np.sin(turn))[:, None] * second
        )
        t = 1.0 - np.arccos(cosine) / OUTER
        weight = solid_angle * t * t * (3.0 - 2.0 * t)
        cell = np.minimum((u[:, 2] * 401).astype(int), 400)
        nm = np.clip(380.0 + cell + (u[:, 2] * 401 - cell) - 0.5, 380.0, 780.0)
        n = index("N-SF11", nm)
        position = np.broadcast_to(LAMP, direction.shape)
        for (corner, normal), eta in zip(faces, (1.0 / n, n), strict=True):
            position = (
                position + (optics.dot(corner - position, normal) / optics.dot(direction, normal))[:, None] * direction
            )
            facing = normal if optics.dot(direction[0], normal) < 0 else -normal
            normals = np.broadcast_to(facing, direction.shape)
            weight = weight * (1.0 - fresnel_reflectance(direction, normals, eta))
            direction = optics.refract(direction, normals, eta)
        position = (
            position + ((window.origin - position) @ window.normal / (direction @ window.normal))[:, None] * direction
        )
        at = (position - window.origin) @ window.axes.T
        xyz = (401.0 / RAYS) * weight[:, None] * SPECTRUM.density[cell, None] * K_M * cmf_xyz()[cell]
        bounds = [(window.low[1], window.high[1]), (window.low[0], window.high[0])]
        maps.append(
            np.stack(
                [
                    np.histogram2d(at[:, 1], at[:, 0], bins=(SIZE[1], SIZE[0]), range=bounds, weights=xyz[:, c])[0]
                    for c in range(3)
                ],
                axis=-1,
            )
        )
    return np.array(maps)


def regions(maps: np.ndarray) -> list[np.ndarray]:
    """Texels, blocks of four by four, and everything: each (samples, regions · channels)."""
    count, height, width, channels = maps.shape
    blocks = maps.reshape(count, height // 4, 4, width // 4, 4, channels).sum(axis=(2, 4))
    return [maps.reshape(count, -1), blocks.reshape(count, -1), maps.sum(axis=(1, 2))]


@dataclass(frozen=True)
class Comparison:
    """The least p-value over all regions, Šidák-corrected, and what error of the total would be seen."""

    p_value: float
    detectable: float


def compare(ours: np.ndarray, theirs: np.ndarray, allowed: float) -> Comparison:
    from scipy.stats import t as student

    p_values, detectable = [], 0.0
    for level, (a, b) in enumerate(zip(regions(ours), regions(theirs), strict=True)):
        mean = b.mean(axis=0)
        # Faint regions hold too few rays for a mean to be normal.
        bright = mean > 0.02 * mean.max()
        variance = a.var(axis=0, ddof=1)[bright] / len(a), b.var(axis=0, ddof=1)[bright] / len(b)
        error = np.sqrt(sum(variance))
        freedom = sum(variance) ** 2 / (variance[0] ** 2 / (len(a) - 1) + variance[1] ** 2 / (len(b) - 1))
        # Texels have all of the allowance, blocks a third, the whole a tenth.
        room = allowed * mean.max() * (1.0, 0.33, 0.1)[level]
        distance = np.maximum(np.abs(a.mean(axis=0) - mean)[bright] - room, 0.0)
        p_values.append(2.0 * student.sf(distance / error, freedom))
        if level == 2:
            share = (error * (student.isf(0.5 * ALPHA / ours[0].size, freedom) + 2.33) + room) / mean[bright]
            detectable = float(share.max())
    everything = np.concatenate(p_values)
    return Comparison(float(-np.expm1(len(everything) * np.log1p(-min(everything.min(), 0.999999)))), detectable)


@pytest.fixture(scope="module")
def reference(gl) -> tuple[np.ndarray, np.ndarray, Window]:
    maps, window = rendered(gl, "stochastic-point")
    return histogram(window), maps, window


@pytest.mark.parametrize(
    "method",
    ["stochastic-point", "srd-photons", "progressive"]
    + [
        pytest.param(name, marks=pytest.mark.slow)
        for name in ("stochastic", "stochastic-even", "progressive-stochastic")
    ],
)
def test_maps_are_the_histogram_of_random_photons(
    gl, reference: tuple[np.ndarray, np.ndarray, Window], method: str
) -> None:
    theirs, by_points, window = reference
    ours, own_window = (by_points, window) if method == "stochastic-point" else rendered(gl, method, beams=False)
    if not np.array_equal(own_window.low, window.low):  # a method's pilot fits its own window
        theirs = histogram(own_window)
    allowed = ALLOWED[method]
    same = compare(ours, theirs, allowed)
    assert same.p_value > ALPHA, same
    limit = DETECTABLE[method]
    assert same.detectable < limit, same
    shifted = 0.5 * (ours + np.roll(ours, 1, axis=2))
    mutants = {
        "a detectable share more": (1.0 + (limit if limit < 0.02 else 2.0 * limit)) * ours,
        "red for blue": ours[..., ::-1],
    }
    if limit < 0.02:
        mutants["half a texel aside"] = shifted
    for name, mutant in mutants.items():
        assert compare(mutant, theirs, allowed).p_value < ALPHA, name


@pytest.mark.slow
def test_a_kernel_that_shrinks_takes_its_bias_along(gl, reference: tuple[np.ndarray, np.ndarray, Window]) -> None:
    """With a first kernel that blurs, bias² over 16 passes is less than half of that of a kernel which stays."""
    theirs = reference[0]
    truth, noise = theirs.mean(axis=0), theirs.var(axis=0, ddof=1) / len(theirs)
    bias2 = {}
    for shrinks in (True, False):
        maps, window = rendered(gl, "progressive-stochastic", kernel=6.0, shrinks=shrinks)
        assert np.array_equal(window.low, reference[2].low)
        bias2[shrinks] = float(np.sum((maps.mean(axis=0) - truth) ** 2 - maps.var(axis=0, ddof=1) / len(maps) - noise))
    assert bias2[False] > 0.0 and bias2[True] < 0.5 * bias2[False], bias2


@pytest.mark.slow
def test_passes_that_grow_take_their_bias_along(gl) -> None:
    """With kernels that blur, bias² of `progressive` by photons falls with every pass, as its footprints become half as
    wide; that of a mutant whose footprints stay as wide hardly falls."""
    found = [rendered(gl, "progressive", 6.0, shrinks, passes, beams=False) for passes, shrinks in PASSES_SHRINK]
    theirs = histogram(found[0][1])
    truth, noise = theirs.mean(axis=0), theirs.var(axis=0, ddof=1) / len(theirs)
    first, second, third, frozen = (
        float(np.sum((maps.mean(axis=0) - truth) ** 2 - maps.var(axis=0, ddof=1) / len(maps) - noise))
        for maps, _ in found
    )
    assert 0.0 < second < 0.5 * first and third < 0.3 * second, (first, second, third)
    assert frozen > 0.7 * first, (first, frozen)
