"""Very long paths: dozens of reflections inside a diamond, columns that outgrow every scale, and beams through
facets that are hard to distinguish."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...beams.convert import polygons_of
from ...beams.facets import beam_scene
from ...beams.find import Search, search
from ...beams.search import SUM_ENTERED, SUM_NUMERIC, SUM_ROULETTE
from ...beams.sources import emissions
from ...gpu.context import Context
from ...gpu.records import FLAG_FOOTPRINT_DROPPED
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import ellipsoid
from ...model.geometry.primitives_round import sphere as sphere_mesh
from ...model.lights import PointLight
from ...model.lights.light import Light
from ...model.optics.spectral_tables import SpectralAxis
from ...model.optics.spectrum import constant
from ...model.scene import Camera, Diffuse, Scene, SceneObject
from ...reference import optics
from ...reference.glasses import D_NM, index
from ...reference.optics import dot, times
from ..case import EPSILON, Held, Measured, Measurement, case, judged, length, not_finite, not_finite_in
from ..rigs.gpu_paths import (
    REFLECTED,
    REFRACTED,
    Photons,
    beam_light,
    extruded,
    glass,
    placed,
    screen,
    trace_beam,
    trace_light,
    traced,
)

# ---- a diamond's facets ------------------------------------------------------------------------

DIAMOND = float(index("diamond", D_NM))
HEIGHTS = 2.0, 4.0
"""Of two screens over the diamond: from landings on both follows the direction."""
SCREEN_REACH = 12.0
"""Half a screen's side over its height."""
PER_EVENT = 8.0
"""Roundings that an event adds to a direction: two of the mirror's own, those of θ twice, of the plane's normal twice,
and of the scaling to length one."""


@dataclass(frozen=True)
class Chain:
    """Where float64 rays (N, 3) end, with columns (5, N, 3) by start (2), by start direction (2) and by n."""

    position: np.ndarray
    direction: np.ndarray
    dposition: np.ndarray
    ddirection: np.ndarray
    from_edge: np.ndarray
    """(N,): the least distance of a hit from another facet's plane."""
    steepest: np.ndarray
    """(N,): the least |d·n| of the chain."""
    length: np.ndarray
    """(N,): of the path inside."""
    exists: np.ndarray
    """(N,): whether light can leave where it is to leave."""


def across(direction: np.ndarray) -> np.ndarray:
    """Two unit vectors (2, 3) across a direction (3,)."""
    side = optics.unit(np.cross(direction, [0.0, 1.0, 0.0]))
    return np.stack([side, np.cross(direction, side)])


def follow_chain(position: np.ndarray, direction: np.ndarray, events: int, screen_z: float) -> Chain:
    """Rays into a brilliant, `events` − 2 reflections, out, and on to z = `screen_z`, by the float64 references.

    A facet is never met twice in a row.
    """
    planes = brilliant(2.0).convex_planes
    assert planes is not None
    normals, offsets, rows = planes[:, :3], planes[:, 3], len(position)
    zero, each = np.zeros((rows, 3)), np.arange(rows)
    frame = [np.broadcast_to(axis, zero.shape) for axis in across(direction[0])]
    dp, dd = np.array([*frame, zero, zero, zero]), np.array([zero, zero, *frame, zero])
    by_n = np.array([0, 0, 0, 0, 1.0])[:, None]
    from_edge, steepest, exists = np.full(rows, np.inf), np.ones(rows), np.ones(rows, bool)
    at_plane, inside_length = np.full(rows, -1), np.zeros(rows)
    for event in range(events):
        entering, facing, gap = event == 0, direction @ normals.T, offsets - position @ normals.T
        if not entering:
            gap[each, at_plane] = np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            way = gap / facing
        way = np.where(facing < 0.0, way, -np.inf) if entering else np.where(facing > 0.0, way, np.inf)
        at_plane = way.argmax(axis=1) if entering else way.argmin(axis=1)
        distance, outward = way[each, at_plane], normals[at_plane]
        dp = optics.transfer_column(dp, dd, direction, outward, distance)
        position = position + times(distance, direction)
        inside_length += 0.0 if entering else distance
        inside = offsets - position @ normals.T
        inside[each, at_plane] = np.inf
        from_edge = np.minimum(from_edge, inside.min(axis=1))
        normal = outward if entering else -outward
        steepest = np.minimum(steepest, -dot(direction, normal))
        if 0 < event < events - 1:
            dd = optics.reflect_column(direction, dd, normal, zero)
            direction = optics.reflect(direction, normal)
            continue
        eta = np.full(rows, 1.0 / DIAMOND if entering else DIAMOND)
        passes = optics.transmitted_cosine2(direction, normal, eta) > 0.0
        exists &= passes
        # Where no light leaves, any direction will do: the path does not exist.
        safe = np.where(passes, eta, 1.0)
        deta = np.where(passes, -eta / DIAMOND if entering else 1.0, 0.0)
        dd = optics.refract_column_stable(direction, dd, normal, zero, safe, deta * by_n)
        direction = optics.refract(direction, normal, safe)
        # Near total reflection columns are divided by the cosine at which the ray leaves.
        steepest = np.where(passes, np.minimum(steepest, np.abs(dot(direction, normal))), steepest)
    # What leaves downwards is not among the photons that are judged.
    distance = (screen_z - position[:, 2]) / np.where(np.abs(direction[:, 2]) > 1e-9, direction[:, 2], 1e-9)
    dp = optics.transfer_column(dp, dd, direction, np.broadcast_to([0.0, 0.0, 1.0], zero.shape), distance)
    return Chain(position + times(distance, direction), direction, dp, dd, from_edge, steepest, inside_length, exists)


def diamond_photons(context: Context, screen_z: float) -> Photons:
    """Light into a brilliant's table, and all of it that comes out upwards after up to 64 events."""
    direction = np.array([0.13, 0.07, -1.0])
    receiver = screen([0, 0, screen_z], [0, 0, 1], SCREEN_REACH * screen_z)
    gem, start = brilliant(2.0), -1.2 * direction
    return trace_beam(context, gem, glass("diamond"), receiver, start, direction, 0.6, D_NM, 6000, 64)


def of_both(near: Photons, far: Photons) -> tuple[Photons, Photons]:
    """Those lattice points of both, in one order."""
    near, far = (photons.where(np.argsort(photons.records["photon_id"])) for photons in (near, far))
    shared = np.intersect1d(near.records["photon_id"], far.records["photon_id"])
    low, high = (photons.where(np.isin(photons.records["photon_id"], shared)) for photons in (near, far))
    return low, high


def columns_along(photons: Photons, exact: Chain) -> np.ndarray:
    """∂position by the emission plane's own axes and by n, (3, N, 3)."""
    frame = np.stack([photons.emitter.domain.tangent, photons.emitter.domain.bitangent])
    spatial = np.einsum("ij,jnk->ink", frame @ across(photons.direction[0]).T, exact.dposition[:2])
    return np.concatenate([spatial, exact.dposition[4:]])


@case("long-chain", "events", (5, 10, 20, 30, 60))
def long_chain(context: Context, counts: Sequence[int]) -> Measured:
    """Five to sixty events inside a diamond

    Every reflection adds a few roundings to a direction, and the path that is left carries them on. Against float64
    over the same facets, the error must stay below events × rounding × what float64's own columns say becomes of it."""
    near, far = (diamond_photons(context, z) for z in HEIGHTS)
    for events in counts:
        choices = (REFRACTED, *[REFLECTED] * (events - 2), REFRACTED)
        low, high = of_both(near.of_choices(*choices), far.of_choices(*choices))
        exact = follow_chain(low.start, low.direction, events, HEIGHTS[0])
        # Every event turns the ray by PER_EVENT roundings at most and moves it by half as many; what becomes of that by
        # the end is what becomes of the start: the columns by position and, seen from inside, n times those by
        # direction.
        moved = np.max(length(exact.dposition[:2]), axis=0) + np.max(length(exact.ddirection[:2]), axis=0)
        turned = DIAMOND * np.max(length(exact.dposition[2:4]), axis=0)
        rounding = EPSILON * events * PER_EVENT
        of_direction = rounding * DIAMOND * np.max(length(exact.ddirection[2:4]), axis=0)
        # Another facet anywhere on the way leaves another direction, coarsely. That may happen only where a hit is
        # closer to an edge than float32 knows it there.
        astray = length(optics.unit(high.position - low.position) - exact.direction)
        same = exact.exists & (astray < 1e-3)
        unexplained = ~same & exact.exists & (exact.from_edge > rounding * (exact.length + 0.5))
        dropped = (low.records["flags"] & FLAG_FOOTPRINT_DROPPED) != 0
        kept = same & ~dropped
        got = np.stack([low.dposition_ds, low.dposition_dt, low.dposition_dn])
        largest = np.max(length(exact.dposition), axis=0)
        of_columns = np.max(length(got - columns_along(low, exact)), axis=0) / (1.0 + largest)
        held: Held = {
            "position": (length(low.position - exact.position)[same], (rounding * (0.5 * moved + turned))[same]),
            # Seen over the distance between two screens, each landing with its own rounding.
            "direction": (astray[same], (of_direction + 2.0 * EPSILON * SCREEN_REACH * HEIGHTS[1])[same]),
            # A column's share of the error: each transfer divides by d·n twice.
            "columns": (of_columns[kept], (rounding * DIAMOND / exact.steepest**2)[kept]),
            "paths astray without an edge": (unexplained, 0.0),
        }
        note = f"{np.count_nonzero(same)} paths; {np.count_nonzero(~same)} more over other facets, by an edge"
        yield traced(events, f"{events} events", low, held, dropped=int(np.count_nonzero(dropped)), note=note)


# ---- columns that outgrow every scale ----------------------------------------------------------


@case("smooth-chain", "events", (5, 10, 20, 40, 60))
def smooth_chain(context: Context, counts: Sequence[int]) -> Measured:
    """The same inside a smooth gem, where columns grow exponentially

    Curved facets make neighbouring rays part for good. A column beyond a million glass sizes, or not finite, costs the
    photon its footprint, never its light, and is counted."""
    gem = placed("gem", ellipsoid((1.0, 0.8, 0.6), 1280), glass("diamond"))
    below = placed("screen", screen([0, 0, -1.5], [0, 0, 1], 20.0), Diffuse())
    light = beam_light((0.25, 0.1, 3.0), (0.05, 0.03, -1.0), 0.5)
    for events in counts:
        photons = trace_light(context, (gem, below), light, [(450.0, 650.0)], 100, events)
        yield outgrown(photons, float(events), f"{events} events")


@case("far-screen", "distance (radii)", (1e1, 1e3, 1e5, 1e7, 1e9))
def far_screen(context: Context, distances: Sequence[float]) -> Measured:
    """A receiver a thousand million radii away

    Columns grow with the distance beyond anything a map can show, and squares of them beyond float32."""
    ball, light = placed("ball", sphere_mesh(1.0, 1280), glass("N-BK7")), beam_light((-3, 0, 0), (1, 0, 0), 0.8)
    for distance in distances:
        receiver = placed("screen", screen([distance, 0, 0], [1, 0, 0], 4.0 * distance), Diffuse())
        photons = trace_light(context, (ball, receiver), light, [(450.0, 650.0)], 500, 2)
        yield outgrown(photons, distance, f"{distance:g} radii")


def outgrown(photons: Photons, severity: float, label: str) -> Measurement:
    """Columns that are not finite, or longer than a million glass sizes, must carry the flag, and flags must be
    counted."""
    records, names = photons.records, ("dposition_ds", "dposition_dt", "dposition_dvar0")
    longest = np.max([length(records[name][..., :3].astype(np.float64)) for name in names], axis=0)
    flagged = (records["flags"] & FLAG_FOOTPRINT_DROPPED) != 0
    held: Held = {
        "unflagged": (~(longest < 1e6) & ~flagged, 0.0),
        "flags not counted": (abs(int(flagged.sum()) - photons.tally.fallbacks["footprint_dropped"]), 0.0),
    }
    largest = longest[np.isfinite(longest)].max()
    note = f"{flagged.sum()} of {len(records)} footprints dropped, longest column {largest:.1e} glass sizes"
    found = traced(severity, label, photons, held, dropped=int(flagged.sum()), note=note)
    return replace(found, nonfinite=not_finite_in(records[~flagged]))


# ---- beams: nothing may be lost and nothing twice ----------------------------------------------

LINES = 0.0, 0.4, 1.0
"""Places in the spectrum, where beams of one index are followed."""
ROUNDING = 1e-11
"""Share of the light that rounding may lose on the way."""


def kept(
    solids: Sequence[SceneObject], light: Light, severity: float, label: str, bound: float = ROUNDING
) -> Measurement:
    """All light of `light` through `solids` on to a floor, at single indices: what enters ends somewhere once."""
    floor = screen([0.0, 0.0, -2.0], [0.0, 0.0, 1.0], 30.0)
    objects = (*solids, placed("floor", floor, Diffuse()))
    scene = Scene("stress", Camera((0, 0, 9), (0, 0, 0), up=(0, 1, 0)), (light,), objects)
    axis = SpectralAxis.build([o.material.dispersion for o in solids if o.material.dispersion])
    frames = {0: (np.array([0.0, 0.0, -2.0]), np.eye(3)[:2])}
    beams = beam_scene(scene, [o.mesh for o in objects], frames, axis, 1.0)
    beams.facets["texel"] = 1e-3
    total, bad, count = np.zeros(SUM_ENTERED + 1), 0, 0
    for emission in emissions(light, beams, lambda p: np.asarray(p, float), 1.0, axis, 1):
        lines = replace(emission, lines=LINES, line_shares=(1.0,) * len(LINES), is_continuous=False)
        [(leaves, sums)] = search(beams, [(lines, Search(1e-5, 1, 64, 1e-3))])
        polygons = polygons_of(leaves, beams, 0, 1.0)
        bad += not_finite((polygons.edges, polygons.density, polygons.hulls))
        total, count = total + sums[: SUM_ENTERED + 1], count + len(polygons)
    entered, ended = total[SUM_ENTERED], total[: SUM_ROULETTE + 1].sum()
    held: Held = {
        "lost or doubled": (abs(ended - entered) / entered, bound),
        "of no facet": (total[SUM_NUMERIC] / entered, bound),
    }
    return Measurement(severity, label, bad, *judged(held), note=f"{count} polygons")


def block(low: Sequence[float], high: Sequence[float], glass_name: str) -> SceneObject:
    """A box along the axes."""
    section = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])])
    mesh = extruded("block", section, 0.5 * (high[2] - low[2]))
    moved = np.eye(4)
    moved[2, 3] = 0.5 * (high[2] + low[2])
    return placed("block", mesh.transformed(moved), glass(glass_name))


@case("beam-slivers", "width", (1e-1, 1e-3, 1e-5, 1e-7))
def beam_slivers(_: Context, widths: Sequence[float]) -> Measured:
    """Beams through a facet ever thinner

    A beam cut to almost nothing has corners that rounding decides. What it loses its neighbour must get."""
    light = beam_light((-0.6, 0.0, 2.0), (0.3, 0.05, -1.0), 0.35)
    for width in widths:
        section = np.array([(-0.4, -0.3), (0.4, -0.3), (0.4, -0.3 + width), (-0.4, 0.3)])
        splinter = placed("splinter", extruded("splinter", section), glass("N-SF11"))
        yield kept([splinter], light, width, f"{width:g} wide")


@case("beam-films", "thickness", (1e-1, 1e-3, 1e-5))
def beam_films(_: Context, thicknesses: Sequence[float]) -> Measured:
    """Beams between parallel faces ever closer

    Dozens of events between faces that all but touch: none is skipped for being near, none met again."""
    light = beam_light((-0.6, 0.0, 2.0), (0.3, 0.0, -1.0), 0.3)
    for thickness in thicknesses:
        film = block((-0.5, -0.5, 0.0), (0.5, 0.5, thickness), "diamond")
        yield kept([film], light, thickness, f"{thickness:g} thick")


@case("beam-contact", "gap", (1e-3, 1e-6, 0.0, -1e-6, -1e-3, -0.3))
def beam_contact(_: Context, gaps: Sequence[float]) -> Measured:
    """Beams through solids apart, cemented, and one within the other

    Faces in one place are one interface; where solids overlap, which face is nearer changes along a line."""
    light, one = beam_light((-0.6, 0.0, 2.0), (0.3, 0.05, -1.0), 0.4), block((-0.5, -0.3, 0), (0, 0.3, 0.5), "N-SF11")
    for gap in gaps:
        yield kept([one, block((gap, -0.3, 0.0), (0.5, 0.3, 0.5), "N-BK7")], light, gap, f"{gap:g} apart")


@case("beam-edge-on", "angle (rad)", (1e-2, 1e-5, 1e-8, 0.0))
def beam_edge_on(_: Context, angles: Sequence[float]) -> Measured:
    """Facets seen from their edge

    A facet along the light catches none or a sliver of it, and never from its back."""
    solid = block((-0.3, -0.3, 0.0), (0.3, 0.3, 0.5), "N-SF11")
    for angle in angles:
        yield kept([solid], beam_light((0.1, 0.0, 2.0), (angle, 0.0, -1.0), 0.4), angle, f"{angle:g} rad")


@case("beam-near-points", "distance", ((3.0, 5e-3), (0.5, 5e-3), (0.1, 0.1)))
def beam_near_points(_: Context, rows: Sequence[tuple[float, float]]) -> Measured:
    """A point close to its facet

    Rays of a point are affine to first order only: beams are halved until a quarter of a texel does not show it."""
    solid = block((-0.5, -0.4, 0.0), (0.5, 0.4, 0.3), "N-SF11")
    # Polygons follow a point's brightness; light that escapes is counted by the middle of its beam, and beams from
    # close by are wide.
    for distance, bound in rows:
        light = PointLight("point", constant(1.0), position=(0.1, 0.05, 0.3 + distance))
        yield kept([solid], light, distance, f"{distance:g} above", bound)
