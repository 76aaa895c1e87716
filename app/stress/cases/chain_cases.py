"""Paths that go on and on: dozens of reflections inside a diamond, and columns that outgrow every scale."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...gpu.context import Context
from ...gpu.records import FLAG_FOOTPRINT_DROPPED
from ...model.geometry.primitives_gem import brilliant
from ...model.geometry.primitives_round import ellipsoid
from ...model.geometry.primitives_round import sphere as sphere_mesh
from ...model.scene import Diffuse
from ...reference import optics
from ...reference.glasses import D_NM, index
from ...reference.optics import dot, times
from ..case import Case, Measurement
from ..judging import EPSILON, judged, length, not_finite_in
from ..rigs.gpu_paths import (
    REFLECTED,
    REFRACTED,
    Photons,
    beam_light,
    glass,
    placed,
    screen,
    trace_beam,
    trace_light,
)

DIAMOND = float(index("diamond", D_NM))
SCREEN_REACH = 12.0
"""Half a screen's side over its height."""
PER_EVENT = 8.0
"""Roundings that an event adds to a direction: two of the mirror's own, those of θ twice, of the plane's normal twice,
and of the scaling to length one."""


@dataclass(frozen=True)
class Chain:
    """Where float64 rays end, with columns by start (2), by start direction (2) and by n."""

    position: np.ndarray
    """(N, 3)."""
    direction: np.ndarray
    dposition: np.ndarray
    """(5, N, 3)."""
    ddirection: np.ndarray
    from_edge: np.ndarray
    """(N,): the least distance of a hit from another facet's plane."""
    steepest: np.ndarray
    """(N,): the least |d·n| of the chain."""
    length: np.ndarray
    """(N,): of the path inside."""
    exists: np.ndarray
    """(N,): whether light can leave where it is to leave."""


def follow_chain(
    planes: np.ndarray, position: np.ndarray, direction: np.ndarray, n: float, events: int, screen_z: float
) -> Chain:
    """Rays into a convex solid n·x ≤ d of rows (n, d), `events` − 2 reflections, out, and on to z = `screen_z`.

    Written with the float64 references; a facet is never met twice in a row.
    """
    side = np.cross(direction[0], [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(direction[0], side)])
    rows, zero = len(position), np.zeros((len(position), 3))
    spread = [np.broadcast_to(axis, zero.shape) for axis in frame]
    dp, dd = np.array([*spread, zero, zero, zero]), np.array([zero, zero, *spread, zero])
    from_edge, steepest, exists = np.full(rows, np.inf), np.ones(rows), np.ones(rows, bool)
    at_plane, inside_length = np.full(rows, -1), np.zeros(rows)
    each = np.arange(rows)
    for event in range(events):
        facing = direction @ planes[:, :3].T
        gap = planes[:, 3] - position @ planes[:, :3].T
        if event:
            gap[each, at_plane] = np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            way = gap / facing
        entering = event == 0
        way = np.where(facing < 0.0, way, -np.inf) if entering else np.where(facing > 0.0, way, np.inf)
        at_plane = way.argmax(axis=1) if entering else way.argmin(axis=1)
        distance = way[each, at_plane]
        outward = planes[at_plane, :3]
        dp = np.array([optics.transfer_column(p, d, direction, outward, distance) for p, d in zip(dp, dd, strict=True)])
        position = position + times(distance, direction)
        inside_length += 0.0 if entering else distance
        inside = planes[:, 3] - position @ planes[:, :3].T
        inside[each, at_plane] = np.inf
        from_edge = np.minimum(from_edge, inside.min(axis=1))
        normal = outward if entering else -outward
        steepest = np.minimum(steepest, -dot(direction, normal))
        if 0 < event < events - 1:
            dd = np.array([optics.reflect_column(direction, d, normal, zero) for d in dd])
            direction = optics.reflect(direction, normal)
            continue
        eta = np.full(rows, 1.0 / n if entering else n)
        passes = optics.transmitted_cosine2(direction, normal, eta) > 0.0
        exists &= passes
        # Where no light leaves, any direction will do: the path does not exist.
        safe = np.where(passes, eta, 1.0)
        deta = np.where(passes, -eta / n if entering else 1.0, 0.0)
        by_n = np.zeros((5, 1)) + np.array([0, 0, 0, 0, 1.0])[:, None]
        dd = np.array(
            [
                optics.refract_column_stable(direction, d, normal, zero, safe, deta * k)
                for d, k in zip(dd, by_n, strict=True)
            ]
        )
        direction = optics.refract(direction, normal, safe)
        # Near total reflection columns are divided by the cosine at which the ray leaves.
        steepest = np.where(passes, np.minimum(steepest, np.abs(dot(direction, normal))), steepest)
    upward = np.array([0.0, 0.0, 1.0])
    # What leaves downwards is not among the photons that are asked about.
    distance = (screen_z - position[:, 2]) / np.where(np.abs(direction[:, 2]) > 1e-9, direction[:, 2], 1e-9)
    dp = np.array(
        [
            optics.transfer_column(p, d, direction, np.broadcast_to(upward, zero.shape), distance)
            for p, d in zip(dp, dd, strict=True)
        ]
    )
    return Chain(position + times(distance, direction), direction, dp, dd, from_edge, steepest, inside_length, exists)


def chain_photons(context: Context, screen_z: float) -> Photons:
    """Light into a brilliant's table, and all of it that comes out upwards after up to 64 events."""
    direction = np.array([0.13, 0.07, -1.0])
    receiver = screen([0, 0, screen_z], [0, 0, 1], SCREEN_REACH * screen_z)
    return trace_beam(
        context,
        brilliant(2.0),
        glass("diamond"),
        receiver,
        -1.2 * direction,
        direction,
        0.6,
        D_NM,
        count=6000,
        max_depth=64,
    )


def measure_chain(context: Context) -> Iterator[Measurement]:
    heights = 2.0, 4.0
    near, far = (chain_photons(context, z) for z in heights)
    planes = brilliant(2.0).convex_planes
    assert planes is not None
    for events in (5, 10, 20, 30, 60):
        choices = (REFRACTED, *[REFLECTED] * (events - 2), REFRACTED)
        low, high = (by_id(photons.of_choices(*choices)) for photons in (near, far))
        both = np.intersect1d(low.records["photon_id"], high.records["photon_id"])
        low, high = (p.where(np.isin(p.records["photon_id"], both)) for p in (low, high))
        exact = follow_chain(planes, low.start, low.direction, DIAMOND, events, heights[0])
        # Every event turns the ray by PER_EVENT roundings at most and moves it by half as many; what becomes of that by
        # the end is what becomes of the start: the columns by position and, seen from inside, n times those by
        # direction.
        moved = np.max(length(exact.dposition[:2]), axis=0) + np.max(length(exact.ddirection[:2]), axis=0)
        turned = DIAMOND * np.max(length(exact.dposition[2:4]), axis=0)
        position_bound = EPSILON * events * (0.5 * PER_EVENT * moved + PER_EVENT * turned)
        direction_bound = EPSILON * events * PER_EVENT * DIAMOND * np.max(length(exact.ddirection[2:4]), axis=0)
        # A column's share of the error: each transfer divides by d·n twice.
        largest = np.max(length(exact.dposition), axis=0)
        column_bound = EPSILON * events * PER_EVENT * DIAMOND / exact.steepest**2
        # Another facet anywhere on the way leaves another direction, coarsely. That may happen only where a hit lies
        # closer to an edge than float32 knows it there.
        seen_direction = optics.unit(high.position - low.position)
        astray = length(seen_direction - exact.direction)
        same = exact.exists & (astray < 1e-3)
        known_to = EPSILON * events * (PER_EVENT * exact.length + 0.5 * PER_EVENT)
        unexplained = ~same & exact.exists & (exact.from_edge > known_to)
        dropped = (low.records["flags"] & FLAG_FOOTPRINT_DROPPED) != 0
        got = np.stack([low.dposition_ds, low.dposition_dt, low.dposition_dn])
        column_error = np.max(length(got - columns_along(low, exact)), axis=0) / (1.0 + largest)
        errors, bounds = judged(
            {
                "position": (length(low.position - exact.position)[same], position_bound[same]),
                # Seen over the distance between two screens, each landing with its own rounding.
                "direction": (astray[same], (direction_bound + 2.0 * EPSILON * SCREEN_REACH * heights[1])[same]),
                "columns": (column_error[same & ~dropped], column_bound[same & ~dropped]),
                "paths astray without an edge": (unexplained.astype(float), 0.0),
            }
        )
        yield Measurement(
            float(events),
            f"{events} events",
            not_finite_in(low.records),
            errors,
            bounds,
            near.tally.imbalance,
            dict(near.tally.fallbacks),
            int(np.count_nonzero(dropped)),
            note=f"{np.count_nonzero(same)} paths; {np.count_nonzero(~same)} more over other facets, by an edge",
        )


def by_id(photons: Photons) -> Photons:
    return photons.where(np.argsort(photons.records["photon_id"]))


def columns_along(photons: Photons, exact: Chain) -> np.ndarray:
    """∂position by the emission plane's own axes and by n, (3, N, 3)."""
    frame = np.stack([photons.emitter.domain.tangent, photons.emitter.domain.bitangent])
    side = np.cross(photons.direction[0], [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    own = np.stack([side, np.cross(photons.direction[0], side)])
    spatial = np.einsum("ij,jnk->ink", frame @ own.T, exact.dposition[:2])
    return np.concatenate([spatial, exact.dposition[4:]])


def measure_smooth_chain(context: Context) -> Iterator[Measurement]:
    gem = placed("gem", ellipsoid((1.0, 0.8, 0.6), 1280), glass("diamond"))
    below = placed("screen", screen([0, 0, -1.5], [0, 0, 1], 20.0), Diffuse())
    light = beam_light((0.25, 0.1, 3.0), (0.05, 0.03, -1.0), 0.5)
    for events in (5, 10, 20, 40, 60):
        yield outgrown(
            trace_light(context, (gem, below), light, [(450.0, 650.0)], 100, events), float(events), f"{events} events"
        )


def measure_far_screen(context: Context) -> Iterator[Measurement]:
    ball, light = placed("ball", sphere_mesh(1.0, 1280), glass("N-BK7")), beam_light((-3, 0, 0), (1, 0, 0), 0.8)
    for distance in (1e1, 1e3, 1e5, 1e7, 1e9):
        receiver = placed("screen", screen([distance, 0, 0], [1, 0, 0], 4.0 * distance), Diffuse())
        yield outgrown(
            trace_light(context, (ball, receiver), light, [(450.0, 650.0)], 500, 2), distance, f"{distance:g} radii"
        )


def outgrown(photons: Photons, severity: float, label: str) -> Measurement:
    """Columns that are not finite, or longer than a million glass sizes, must carry the flag, and flags must be
    counted."""
    records = photons.records
    columns = [
        records[name][..., :3].astype(np.float64) for name in ("dposition_ds", "dposition_dt", "dposition_dvar0")
    ]
    longest = np.max([length(column) for column in columns], axis=0)
    flagged = (records["flags"] & FLAG_FOOTPRINT_DROPPED) != 0
    counted = photons.tally.fallbacks["footprint_dropped"]
    errors, bounds = judged(
        {
            "unflagged": ((~(longest < 1e6) & ~flagged).astype(float), 0.0),
            "flags not counted": (np.array([abs(int(flagged.sum()) - counted)], float), 0.0),
        }
    )
    bad, finite = not_finite_in(records[~flagged]), longest[np.isfinite(longest)]
    note = (
        f"{np.count_nonzero(flagged)} of {len(records)} footprints dropped, longest column {finite.max():.1e} glass "
        "sizes"
    )
    return Measurement(
        severity,
        label,
        bad,
        errors,
        bounds,
        photons.tally.imbalance,
        dict(photons.tally.fallbacks),
        int(flagged.sum()),
        note,
    )


CASES = (
    Case(
        "long-chain",
        "Five to sixty events inside a diamond",
        "Every reflection adds a few roundings to a direction, and the path that is left carries them on. Against "
        "float64 over the same facets, "
        "the error must stay below events × rounding × what float64's own columns say becomes of it.",
        "events",
        measure_chain,
        steps=5,
    ),
    Case(
        "smooth-chain",
        "The same inside a smooth gem, where columns grow exponentially",
        "Curved facets make neighbouring rays part for good. A column beyond a million glass sizes, or not finite, "
        "costs the photon its footprint, never its light, and is counted.",
        "events",
        measure_smooth_chain,
        steps=5,
    ),
    Case(
        "far-screen",
        "A receiver a thousand million radii away",
        "Columns grow with the distance beyond anything a map can show, and squares of them beyond float32.",
        "distance (radii)",
        measure_far_screen,
        steps=5,
    ),
)
