"""Where light piles up: a perfect focus, a fold and a cusp, from the real tracer to the real splats, against closed
forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import erf

import numpy as np

from ...features.features import Features
from ...gpu.context import Context
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.geometry.primitives_round import ellipsoid
from ...model.geometry.primitives_round import sphere as sphere_mesh
from ...model.scene import Mirror
from ...reference.glasses import D_NM, index
from ..case import EPSILON, Held, Measured, case, length
from ..rigs.gpu_paths import REFRACTED, Photons, glass, screen, trace_beam, traced
from ..rigs.splat_rig import Rig, photons
from .splats import EDGE, FAST_ERF, SAMPLED

GLASS = "N-BK7"
N = float(index(GLASS, D_NM))
SMOOTHING = 0.6
COLOURLESS = Features(spectral_groups=0)


@case("perfect-focus", "triangles", (320, 1280, 5120, 20_480))
def perfect_focus(context: Context, tessellations: Sequence[int]) -> Measured:
    """An ellipsoid of eccentricity 1/n, tessellated finer and finer: a perfect focus

    Footprints shrink to nothing and irradiance grows without bound. The columns must vanish with the facets, and what a
    texel holds must be the light that falls into it, all of it."""
    minor = float(np.sqrt(1.0 - 1.0 / N**2))
    way, curvature, texel = 1.0 + 1.0 / N, 1.0 / minor**2, 4e-3
    focus = screen([1.0 / N, 0, 0], [1, 0, 0], 3.0)
    for triangles in tessellations:
        mesh = ellipsoid((1.0, minor, minor), triangles)
        beam = trace_beam(context, mesh, glass(GLASS), focus, [-3, 0, 0], [1, 0, 0], 0.5, D_NM, 1500, 1)
        landed = beam.of_choices(REFRACTED)
        # Linear interpolation over an edge h leaves |n''| h²/6 of a normal with |n''| ≤ 2 κ² (its direction and
        # its length both bend), and |n''| h of its derivative; the ray turns by less than its normal, and lands `way`
        # further.
        edge = longest_edge(mesh)
        column = np.stack([landed.dposition_ds, landed.dposition_dt], axis=1)[..., 1:]
        at = landed.position[:, 1:]
        axes = SMOOTHING * np.sqrt(landed.flux_w) * column / texel
        rig = Rig(context.ctx, COLOURLESS, size=(64, 64))
        image = rig.draw(photons(COLOURLESS, at / texel + 32.5, axes[:, 0], axes[:, 1]))[..., 3] / rig.light.power_w()
        sigma = np.maximum(np.sqrt(np.sum(axes**2, axis=1)), 1e-9)
        share = np.prod([inside_texel(at[:, i] / texel, sigma[:, i]) for i in range(2)], axis=0)
        held: Held = {
            "miss of the focus": (length(at), way * curvature**2 * edge**2 / 3.0 + 8.0 * EPSILON),
            "column (0 at a focus)": (length(column).ravel(), way * 2.0 * curvature**2 * edge),
            "energy": (abs(image.sum() / len(at) - 1.0), FAST_ERF),
            # Where all light lies in a texel, it shows all of it.
            "peak": (abs(image[32, 32] / share.sum() - 1.0), 0.02),
        }
        note = f"{share.mean():.0%} of the light in one texel"
        yield traced(triangles, f"{triangles:,} triangles", landed, held, [image], note=note)


def inside_texel(at: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Share of Gaussians about `at` within ±½."""
    ends = [((0.5 - a) / s / 2**0.5, (0.5 + a) / s / 2**0.5) for a, s in zip(at, sigma, strict=True)]
    return np.array([0.5 * (erf(low) + erf(high)) for low, high in ends])


def longest_edge(mesh: Mesh) -> float:
    """The longest edge of its triangles."""
    corners = mesh.corners()
    return float(length(corners - np.roll(corners, 1, axis=1)).max())


# ---- a fold: the ball of T15, and a cusp: the nephroid in a mirror's hollow --------------------

SIZES = (24, 48, 96, 192)
"""Texels across the map."""
PLANE_X = 1.2
FOLD_RADIUS = 0.06458174
"""dy/dh = 0 at h = 0.5028279 (physics T15)."""
SLOPE = np.radians(45.0)
BEAM_RADIUS = 0.3
HOLLOW_BEAM = np.array([np.cos(SLOPE), 0.0, -np.sin(SLOPE)])
HOLLOW_START = np.array([1.0, 0.0, 0.5]) - 1.6 * HOLLOW_BEAM
"""The axis meets the mirror half a unit above the floor and comes down on the cusp at x = ½."""


def disc(radius: float, count: int = 400_000) -> tuple[np.ndarray, np.ndarray]:
    """Radii and turns of points that fill a disc evenly (Vogel's spiral)."""
    number = np.arange(count)
    return radius * np.sqrt((number + 0.5) / count), 2.0 * np.pi * 0.6180339887498949 * number


def ball_radius(height: np.ndarray) -> np.ndarray:
    """Signed distance from the axis on the plane x = `PLANE_X`, of rays at `height` through the unit ball."""
    incident, inside = np.arcsin(height), np.arcsin(height / N)
    leaves_at, deviation = 2.0 * inside - incident, 2.0 * (incident - inside)
    return np.sin(leaves_at) - np.tan(deviation) * (PLANE_X - np.cos(leaves_at))


@case("fold", "texels across the map", SIZES)
def fold(context: Context, sizes: Sequence[int]) -> Measured:
    """The fold caustic of a ball, at finer and finer maps

    Irradiance is r^(-1/2) at a fold, where a photon's footprint collapses and turns over. Energy in rings at the fold
    against the exact ball."""
    ball, wall = sphere_mesh(1.0, 81_920), screen([PLANE_X, 0, 0], [1, 0, 0], 3.0)
    beam = trace_beam(context, ball, glass(GLASS), wall, [-3, 0, 0], [1, 0, 0], 0.99, D_NM, 6000)
    # Rays from above 0.99 are left out on both sides.
    height, turn = disc(0.99)
    exact = ball_radius(height)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    edge = 0.9 * FOLD_RADIUS, 1.15 * FOLD_RADIUS
    rings = {"outer tenth of the ring": edge, "inner half": (0.0, 0.5 * FOLD_RADIUS)}
    for size in sizes:
        # Facets 0.019 wide displace a landing by up to 1e-4 (test_t4_ball_lens).
        held, image = ring_energies(
            context, beam, beam.of_depth(2), (1, 2), exact, size, 1.25 * FOLD_RADIUS, np.zeros(2), rings, 1e-4
        )
        yield traced(size, f"{size}² texels", beam, held, [image])


def hollow_mirror(segments: int = 1200) -> Mesh:
    """The unit cylinder about z from −60° to 60°, its smooth normals inwards."""
    angle = np.radians(np.linspace(-60.0, 60.0, segments + 1))
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    low, high = (np.column_stack([ring, np.full(len(ring), z)]) for z in (-0.3, 2.0))
    k, step = np.arange(segments), segments + 1
    faces = np.concatenate([np.column_stack([k, k + step, k + 1]), np.column_stack([k + 1, k + step, k + 1 + step])])
    inwards = -np.column_stack([np.tile(ring, (2, 1)), np.zeros(2 * len(ring))])
    return make_mesh("hollow", np.concatenate([low, high]), faces, inwards[faces])


def mirrored_landing(start: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Where rays (N, 3) land on z = 0 after the cylinder: in plan, the two-dimensional law of reflection."""
    across = length(direction[:2])
    to_mirror = (np.sqrt(1.0 - start[:, 1] ** 2) - start[:, 0]) / across
    point = start[:, :2] + to_mirror[:, None] * np.array([across, 0.0])
    mirrored = np.array([across, 0.0]) - 2.0 * across * point[:, :1] * point
    left = -start[:, 2] / direction[2] - to_mirror
    return point + left[:, None] * mirrored


@case("cusp", "texels across the map", SIZES)
def cusp(context: Context, sizes: Sequence[int]) -> Measured:
    """The nephroid's cusp under a hollow mirror, at finer and finer maps

    Both columns collapse where two folds meet. Energy about the cusp against the exact mirror."""
    floor = screen([0, 0, 0], [0, 0, 1], 3.0)
    beam = trace_beam(context, hollow_mirror(), Mirror(), floor, HOLLOW_START, HOLLOW_BEAM, BEAM_RADIUS, D_NM, 6000, 1)
    landed = beam.of_depth(1)
    radius, turn = disc(BEAM_RADIUS)
    across, up = np.array([0.0, 1.0, 0.0]), np.array([np.sin(SLOPE), 0.0, np.cos(SLOPE)])
    starts = HOLLOW_START + (radius * np.cos(turn))[:, None] * across + (radius * np.sin(turn))[:, None] * up
    exact = mirrored_landing(starts, HOLLOW_BEAM)
    missed = length(landed.position[:, :2] - mirrored_landing(landed.start, HOLLOW_BEAM))
    middle, rings = np.array([0.5, 0.0]), {"round the cusp": (0.0, 0.04), "about it": (0.04, 0.1)}
    for size in sizes:
        held, image = ring_energies(context, beam, landed, (0, 1), exact, size, 0.12, middle, rings, 2e-6)
        # Segments of h = 1.75e-3: their sagitta h²/8 and their normals' h²/8 displace a landing at 0.5 by less than
        # h²/4.
        landing = {"landing": (missed.max(), 1.75e-3**2 / 4.0 + 16.0 * EPSILON)}
        yield traced(size, f"{size}² texels", beam, {**held, **landing}, [image])


def ring_energies(
    context: Context,
    beam: Photons,
    landed: Photons,
    plane: tuple[int, int],
    exact: np.ndarray,
    size: int,
    half: float,
    middle: np.ndarray,
    rings: Mapping[str, tuple[float, float]],
    displaced: float,
) -> tuple[Held, np.ndarray]:
    """Energy of a splatted caustic in rings (r0, r1) about `middle`, against exact landings (M, 2) of equal weight; and
    the map.

    The map has `size`² texels over ±`half` in the axes `plane`. Light crosses a ring's edges as far as splats are
    blurred: by the texel's own variance, by what sampling adds, and by the footprint. How much that is allowed to be is
    worked out by blurring the exact landings as much, and half as much again. Lattices of N points are uneven by
    N^(-3/4).
    """
    at, texel = landed.position[:, list(plane)], 2.0 * half / size
    columns = np.stack([landed.dposition_ds, landed.dposition_dt], axis=1)[..., list(plane)]
    axes = SMOOTHING * np.sqrt(landed.flux_w) * columns / texel
    rig = Rig(context.ctx, COLOURLESS, size=(size, size))
    image = rig.draw(photons(COLOURLESS, (at - middle) / texel + 0.5 * size, axes[:, 0], axes[:, 1]))[..., 3]
    image /= rig.light.power_w() * beam.lattice_in_disc
    grid = (np.arange(size) + 0.5 - 0.5 * size) * texel
    of_texel = np.hypot(grid[:, None], grid[None, :])
    cell = np.floor((exact - middle) / texel + 0.5 * size).astype(int)
    within = np.all((cell >= 0) & (cell < size), axis=1)
    exact_texel = np.full(len(exact), np.inf)
    exact_texel[within] = of_texel[cell[within, 1], cell[within, 0]]
    landing_radius, sharp = length(at - middle), length(exact - middle)
    noise = np.random.default_rng(size).normal(size=exact.shape)
    held = {}
    for name, (inner, outer) in rings.items():
        wanted = share_between(exact_texel, inner, outer)
        error = abs(image[(of_texel >= inner) & (of_texel < outer)].sum() - wanted)
        near = (landing_radius > inner - 0.1 * half) & (landing_radius < outer + 0.1 * half)
        footprint = np.sqrt(np.median(np.sum(axes[near] ** 2, axis=(1, 2))) / 2.0)
        blur = 1.5 * (texel * np.hypot(footprint, np.sqrt(1.0 / 12.0 + SAMPLED)) + displaced)
        blurred = length(exact + blur * noise - middle)
        crossing = abs(share_between(blurred, inner, outer) - share_between(sharp, inner, outer))
        held[name] = error, crossing + beam.lattice_in_disc**-0.75 + (FAST_ERF + EDGE / size) * wanted
    return held, image


def share_between(radius: np.ndarray, inner: float, outer: float) -> float:
    """Share of radii (N,) in a ring."""
    return float(np.mean((radius >= inner) & (radius < outer)))
