"""What beams leave behind: polygons on flat receivers, and pieces that photons have to carry on.

A beam is all light of one lamp that meets the same facets in the same order. Its outline is an intersection of
half-planes that move with the wavelength; on a flat receiver each is a line, given at both ends of a narrow band of the
spectral coordinate x (`model.optics.spectral_tables`) and linear in x between them. So the light at a place is that of
an interval of x, cut out by the lines, times a density: no wavelength has to be sampled.

All arrays are float64 and lengths are in GPU space (`gpu.gpu_space.GpuSpace`) unless they say otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

WIDE = 2.0
"""Penumbrae; a wider polygon has places that are all inside, and every edge has its own penumbra."""


class Outlines:
    """Values a row each, with edges from `edge_start` on and corners of hulls from `hull_start` on."""

    edge_start: np.ndarray
    hull_start: np.ndarray

    def where(self, chosen: np.ndarray) -> Self:
        """Those that are `chosen`, bool (rows,), in order."""
        return self if chosen.all() else self.take(np.flatnonzero(chosen))

    def take(self, rows: np.ndarray) -> Self:
        """Some rows, int (n,), in that order; the same may come several times."""
        values = {}
        for name in (field.name for field in fields(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if name in ("edges", "hulls"):
                starts = self.edge_start if name == "edges" else self.hull_start
                counts = np.diff(starts)[rows]
                ahead = np.repeat(starts[rows] - np.cumsum(counts) + counts, counts)
                values[name] = value[ahead + np.arange(len(ahead))]
            elif name.endswith("_start"):
                values[name] = np.append(0, np.cumsum(np.diff(value)[rows])).astype(np.int32)
            else:
                values[name] = value[rows]
        return type(self)(**values)


@dataclass(frozen=True)
class BeamPolygons(Outlines):
    """Polygons that bands of beams cast on flat receivers; N polygons, E edges, H corners of hulls.

    Place p on a receiver is (u, v) of its plane's frame (`PlaneFrame`, by receiver). At t in [0, 1], where
    x = x_lo + t (x_hi - x_lo), p is lit where for every edge  a(t) . p + c(t) >= 0, with (a, c) linear in t.
    """

    light: np.ndarray
    """int32 (N,), index of the scene's light."""
    receiver: np.ndarray
    """int32 (N,), index of the receiver."""
    source: np.ndarray
    """int32 (N,), object that the beam met first."""
    depth: np.ndarray
    """int32 (N,), specular events on the way."""
    x_lo: np.ndarray
    """(N,), start of the band."""
    x_hi: np.ndarray
    """(N,), its end; equal to `x_lo` for an emission line: then only the first of each pair of ends counts."""
    density: np.ndarray
    """(N, 3), at x_lo, in the middle and at x_hi (a parabola between), carried to `centre` along `slope`: flux per
    scene unit² on the receiver, per unit of the light's spectral power (`SceneBuffers.light_power`, what `emit.comp`'s
    `weight` multiplies)."""
    slope: np.ndarray
    """(N, 2), relative change of the density per GPU unit along u and v, about `centre`."""
    centre: np.ndarray
    """(N, 2), where `density` is taken: where the beam's middle lands in the middle of the band."""
    flux: np.ndarray
    """(N,), W that the polygon holds, per W that the light has over its whole spectrum."""
    edge_start: np.ndarray
    """int32 (N + 1,), polygon i has edges edge_start[i] … edge_start[i + 1]."""
    edges: np.ndarray
    """(E, 8): a_u, a_v, c, softness at x_lo, the same at x_hi. |a| = 1; a . p + c is the distance inside, GPU units;
    softness: half width of the penumbra of an extended light there, GPU units, 0: sharp. Where it is negative the line
    is a mask, of that width: it bounds no light, but what other edges' penumbrae cast beyond it stays inside."""
    hull_start: np.ndarray
    """int32 (N + 1,), likewise into `hulls`."""
    hulls: np.ndarray
    """(H, 2), corners, counter-clockwise, of a convex polygon that holds the lit places of the whole band (penumbra
    included)."""
    area: np.ndarray
    """(N,), GPU units², at the middle of the band."""

    def __len__(self) -> int:
        return len(self.light)


@dataclass(frozen=True)
class BeamPieces(Outlines):
    """Pieces of beams that go on as photons, since what they meet is not flat; M pieces, E edges, H hull corners.

    A piece is a polygon in its light's emission coordinates q = (q_u, q_v) (`EmissionDomain`: GPU units across a
    parallel light, Lambert's azimuthal plane for one that diverges), on the surface its rays left last. At t in
    {0, 1/2, 1} of the band a ray of q has origin  X + X_u (q_u - c_u) + X_v (q_v - c_v)  and direction likewise, c the
    piece's `centre`; between the three a parabola in x. It exists where all edges are >= 0 (linear in t, as in
    `BeamPolygons`).
    """

    light: np.ndarray
    """int32 (M,)."""
    source: np.ndarray
    """int32 (M,), object first met."""
    depth: np.ndarray
    """int32 (M,), specular events so far, at least 1."""
    x_lo: np.ndarray
    x_hi: np.ndarray
    centre: np.ndarray
    """(M, 2), q."""
    position: np.ndarray
    """(M, 3, 3, 3): [at x_lo, middle, x_hi][X, X_u, X_v][xyz]."""
    direction: np.ndarray
    """(M, 3, 3, 3) likewise; the first is a unit vector."""
    weight: np.ndarray
    """(M, 3): flux per unit measure of q (scene unit² for parallel light, sr else), per unit of spectral power."""
    last_triangle: np.ndarray
    """int32 (M,), some triangle (of the scene's, in the object's order) of the facet that was left last."""
    last_object: np.ndarray
    """int32 (M,)."""
    is_inside: np.ndarray
    """bool (M,), whether the piece travels on the inner side of `last_object`'s facet."""
    inside: np.ndarray
    """uint64 (M,), bit per object of the solids that the piece is inside of."""
    key: np.ndarray
    """int64 (M,), hash of the facets met: the same from frame to frame of an animation."""
    is_tail: np.ndarray
    """bool (M,), whether it was merely too weak to be followed on."""
    flux: np.ndarray
    """(M,), per unit of spectral power, middle of the band."""
    state: np.ndarray
    """(M, 3, 6): of polarisation, as `polarised`; zeros where it is not followed."""
    edge_start: np.ndarray
    edges: np.ndarray
    """(E, 6): a_u, a_v, c about q - centre at x_lo, the same at x_hi; |a| = 1."""
    hull_start: np.ndarray
    hulls: np.ndarray
    """(H, 2), q - centre."""

    def __len__(self) -> int:
        return len(self.light)


def parabola_at(values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """(N, …) at t (N,) in [0, 1], of parabolas through `values` (N, 3, …) at the start, the middle and the end."""
    t = t.reshape(-1, *(1,) * (values.ndim - 2))
    low, middle, high = values[:, 0], values[:, 1], values[:, 2]
    return low + t * (4.0 * middle - 3.0 * low - high + t * 2.0 * (low + high - 2.0 * middle))


def joined(parts: list[BeamPolygons] | list[BeamPieces]):
    """One value that holds all of `parts` in order."""
    kind = type(parts[0])
    values = {}
    for field in fields(kind):
        arrays = [getattr(part, field.name) for part in parts]
        if field.name.endswith("_start"):
            ends = np.cumsum([0, *(array[-1] for array in arrays)])
            arrays = [array[:-1] + end for array, end in zip(arrays, ends, strict=False)] + [ends[-1:]]
            values[field.name] = np.concatenate(arrays).astype(np.int32)
        else:
            values[field.name] = np.concatenate(arrays)
    return kind(**values)
