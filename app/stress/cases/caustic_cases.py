"""Where light piles up: a perfect focus, a fold and a cusp, from the real tracer to the real splats, against closed
forms."""

from __future__ import annotations

from collections.abc import Iterator
from math import erf

import numpy as np

from ...gpu.context import Context
from ...model.geometry.mesh import Mesh, make_mesh
from ...model.geometry.primitives_round import ellipsoid
from ...model.geometry.primitives_round import sphere as sphere_mesh
from ...model.scene import Mirror
from ...reference.glasses import D_NM, index
from ..case import Case, Measurement
from ..judging import EPSILON, judged, length
from ..rigs.gpu_paths import REFRACTED, Photons, glass, screen, trace_beam, traced
from ..rigs.splat_rig import Rig, SplatFeatures, photons
from .splat_cases import EDGE, FAST_ERF, SAMPLED

GLASS = "N-BK7"
N = float(index(GLASS, D_NM))
SMOOTHING = 0.6
GOLDEN = 0.6180339887498949


# ---- a perfect focus: an ellipsoid of eccentricity 1/n gathers a parallel beam in its far focus ------


def measure_focus(context: Context) -> Iterator[Measurement]:
    minor = float(np.sqrt(1.0 - 1.0 / N**2))
    curvature = 1.0 / minor**2
    way = 1.0 + 1.0 / N
    texel = 4e-3
    for triangles in (320, 1280, 5120, 20_480):
        mesh = ellipsoid((1.0, minor, minor), triangles)
        beam = trace_beam(
            context,
            mesh,
            glass(GLASS),
            screen([1.0 / N, 0, 0], [1, 0, 0], 3.0),
            [-3, 0, 0],
            [1, 0, 0],
            0.5,
            D_NM,
            count=1500,
            max_depth=1,
        )
        landed = beam.of_choices(REFRACTED)
        # Linear interpolation over an edge h leaves |n''| h²/6 of a normal with |n''| ≤ 2 κ² (its direction and
        # its length both bend), and |n''| h of its derivative; the ray turns by less than its normal, and lands `way`
        # further.
        edge = longest_edge(mesh)
        column = np.stack([landed.dposition_ds, landed.dposition_dt], axis=1)[..., 1:]
        at = landed.position[:, 1:]
        spacing = np.sqrt(landed.flux_w)
        rig = Rig(context.ctx, SplatFeatures(spectral_groups=0), size=(64, 64))
        axes = SMOOTHING * spacing * column / texel
        image = rig.draw(photons(rig.features, at / texel + 32.5, axes[:, 0], axes[:, 1]))[..., 3] / rig.light.power_w()
        sigma = np.maximum(np.sqrt(np.sum(axes**2, axis=1)), 1e-9)
        share = np.prod([inside_texel(at[:, i] / texel, sigma[:, i]) for i in range(2)], axis=0)
        errors, bounds = judged(
            {
                "miss of the focus": (length(at), way * curvature**2 * edge**2 / 3.0 + 8.0 * EPSILON),
                "column (0 at a focus)": (length(column).ravel(), way * 2.0 * curvature**2 * edge),
                "energy": (np.array([abs(image.sum() / len(at) - 1.0)]), FAST_ERF),
                # Where all light lies in a texel, it shows all of it.
                "peak": (np.array([abs(image[32, 32] / share.sum() - 1.0)]), 0.02),
            }
        )
        yield traced(
            float(triangles),
            f"{triangles:,} triangles",
            landed,
            errors,
            bounds,
            images=[image],
            note=f"{share.mean():.0%} of the light in one texel",
        )


def inside_texel(at: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Share of Gaussians about `at` within ±½."""
    return np.array(
        [0.5 * (erf((0.5 - a) / s / 2**0.5) + erf((0.5 + a) / s / 2**0.5)) for a, s in zip(at, sigma, strict=True)]
    )


def longest_edge(mesh: Mesh) -> float:
    corners = mesh.corners()
    return float(length(corners - np.roll(corners, 1, axis=1)).max())


# ---- a fold: the ball of T15 --------------------------------------------------------------------

PLANE_X = 1.2
FOLD_RADIUS = 0.06458174
"""dy/dh = 0 at h = 0.5028279 (physics T15)."""


def ball_radius(height: np.ndarray) -> np.ndarray:
    """Signed distance from the axis on the plane x = `PLANE_X`, of rays at `height` through the unit ball."""
    incident, inside = np.arcsin(height), np.arcsin(height / N)
    leaves_at, deviation = 2.0 * inside - incident, 2.0 * (incident - inside)
    return np.sin(leaves_at) - np.tan(deviation) * (PLANE_X - np.cos(leaves_at))


def measure_fold(context: Context) -> Iterator[Measurement]:
    ball = trace_beam(
        context,
        sphere_mesh(1.0, 81_920),
        glass(GLASS),
        screen([PLANE_X, 0, 0], [1, 0, 0], 3.0),
        [-3, 0, 0],
        [1, 0, 0],
        0.99,
        D_NM,
        count=6000,
    )
    landed = ball.of_depth(2)
    # A disc of the beam, evenly; those from above 0.99 are left out on both sides.
    count = 400_000
    height = 0.99 * np.sqrt((np.arange(count) + 0.5) / count)
    turn = 2.0 * np.pi * GOLDEN * np.arange(count)
    exact = ball_radius(height)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    # Facets 0.019 wide displace a landing by up to 1e-4 (test_t4_ball_lens).
    facets = 1e-4
    for size in (24, 48, 96, 192):
        yield caustic_energy(
            context,
            ball,
            landed,
            landed.position[:, 1:],
            (1, 2),
            exact,
            size,
            1.25 * FOLD_RADIUS,
            np.zeros(2),
            {
                "outer tenth of the ring": (0.9 * FOLD_RADIUS, 1.15 * FOLD_RADIUS),
                "inner half": (0.0, 0.5 * FOLD_RADIUS),
            },
            facets,
        )


# ---- a cusp: the nephroid in a mirror's hollow --------------------------------------------------

SLOPE = np.radians(45.0)
BEAM_RADIUS, BEAM_CENTRE_Z = 0.3, 1.5


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


def measure_cusp(context: Context) -> Iterator[Measurement]:
    direction = np.array([np.cos(SLOPE), 0.0, -np.sin(SLOPE)])
    # The axis meets the mirror half a unit above the floor and comes down on the cusp at x = ½.
    start = np.array([1.0, 0.0, 0.5]) - 1.6 * direction
    beam = trace_beam(
        context,
        hollow_mirror(),
        Mirror(),
        screen([0, 0, 0], [0, 0, 1], 3.0),
        start,
        direction,
        BEAM_RADIUS,
        D_NM,
        count=6000,
        max_depth=1,
    )
    landed = beam.of_depth(1)
    count = 400_000
    radius = BEAM_RADIUS * np.sqrt((np.arange(count) + 0.5) / count)
    turn = 2.0 * np.pi * GOLDEN * np.arange(count)
    across, up = np.array([0.0, 1.0, 0.0]), np.array([np.sin(SLOPE), 0.0, np.cos(SLOPE)])
    starts = start + (radius * np.cos(turn))[:, None] * across + (radius * np.sin(turn))[:, None] * up
    exact = mirrored_landing(starts, direction)
    missed = length(landed.position[:, :2] - mirrored_landing(landed.start, direction))
    for size in (24, 48, 96, 192):
        result = caustic_energy(
            context,
            beam,
            landed,
            landed.position[:, :2],
            (0, 1),
            exact,
            size,
            0.12,
            np.array([0.5, 0.0]),
            {"round the cusp": (0.0, 0.04), "about it": (0.04, 0.1)},
            2e-6,
        )
        # Segments of h = 1.75e-3: their sagitta h²/8 and their normals' h²/8 displace a landing at 0.5 by less than
        # h²/4.
        result.errors["landing"], result.bounds["landing"] = float(missed.max()), 1.75e-3**2 / 4.0 + 16.0 * EPSILON
        yield result


# ---- energy of both ------------------------------------------------------------------------------


def caustic_energy(
    context: Context,
    beam: Photons,
    landed: Photons,
    at: np.ndarray,
    plane: tuple[int, int],
    exact: np.ndarray,
    size: int,
    half: float,
    middle: np.ndarray,
    rings: dict[str, tuple[float, float]],
    displaced: float,
) -> Measurement:
    """Energy of a splatted caustic in rings (r0, r1) about `middle`, against exact landings (M, 2) of equal weight.

    The map has `size`² texels over ±`half`. Light crosses a ring's edges as far as splats are blurred: by the
    texel's own variance, by what sampling adds, and by the footprint. How much that is allowed to be is worked out by
    blurring the exact landings as much, and half as much again. Lattices of N points are uneven by N^(-3/4).
    """
    texel = 2.0 * half / size
    spacing = np.sqrt(landed.flux_w)
    axes = SMOOTHING * spacing * np.stack([landed.dposition_ds, landed.dposition_dt], axis=1)[..., list(plane)] / texel
    rig = Rig(context.ctx, SplatFeatures(spectral_groups=0), size=(size, size))
    image = rig.draw(photons(rig.features, (at - middle) / texel + 0.5 * size, axes[:, 0], axes[:, 1]))[..., 3]
    image /= rig.light.power_w() * beam.lattice_in_disc
    grid = (np.arange(size) + 0.5 - 0.5 * size) * texel
    of_texel = np.hypot(grid[:, None], grid[None, :])
    cell = np.floor((exact - middle) / texel + 0.5 * size).astype(int)
    seen = np.all((cell >= 0) & (cell < size), axis=1)
    exact_texel = np.full(len(exact), np.inf)
    exact_texel[seen] = of_texel[cell[seen, 1], cell[seen, 0]]
    landing_radius = length(at - middle)
    noise = np.random.default_rng(size).normal(size=exact.shape)
    rows = {}
    for name, (inner, outer) in rings.items():
        wanted = np.mean((exact_texel >= inner) & (exact_texel < outer))
        held = image[(of_texel >= inner) & (of_texel < outer)].sum()
        near = (landing_radius > inner - 0.1 * half) & (landing_radius < outer + 0.1 * half)
        footprint = np.sqrt(np.median(np.sum(axes[near] ** 2, axis=(1, 2))) / 2.0)
        blur = 1.5 * (texel * np.hypot(footprint, np.sqrt(1.0 / 12.0 + SAMPLED)) + displaced)
        blurred = length(exact + blur * noise - middle)
        sharp = length(exact - middle)
        crossing = abs(np.mean((blurred >= inner) & (blurred < outer)) - np.mean((sharp >= inner) & (sharp < outer)))
        rows[name] = (
            np.array([abs(held - wanted)]),
            crossing + beam.lattice_in_disc**-0.75 + (FAST_ERF + EDGE / size) * wanted,
        )
    errors, bounds = judged(rows)
    return traced(float(size), f"{size}² texels", beam, errors, bounds, images=[image])


CASES = (
    Case(
        "perfect-focus",
        "An ellipsoid of eccentricity 1/n, tessellated finer and finer: a perfect focus",
        "Footprints shrink to nothing and irradiance grows without bound. The columns must vanish with the facets, "
        "and what a texel holds must be the light that falls into it, all of it.",
        "triangles",
        measure_focus,
        steps=4,
    ),
    Case(
        "fold",
        "The fold caustic of a ball, at finer and finer maps",
        "Irradiance is r^(-1/2) at a fold, where a photon's footprint collapses and turns over. Energy in rings at "
        "the fold against the exact ball.",
        "texels across the map",
        measure_fold,
        steps=4,
    ),
    Case(
        "cusp",
        "The nephroid's cusp under a hollow mirror, at finer and finer maps",
        "Both columns collapse where two folds meet. Energy about the cusp against the exact mirror.",
        "texels across the map",
        measure_cusp,
        steps=4,
    ),
)
