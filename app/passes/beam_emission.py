"""Pieces of beams become rays on their way: what flat facets did to light is done, photons carry it on.

What a beam leaves to photons (`beams.polygons.BeamPieces`) starts at the surface that it left last, with the weights,
the medium and the derivatives that a photon of the emission lattice would have after the same events.
`TracePass.carry_on` takes the records.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..beams.piece_lattice import PieceLattice, PieceRays
from ..beams.polygons import BeamPieces, parabola_at
from ..gpu.records import FLAG_INSIDE
from ..gpu.reindex import Spans
from ..gpu.scene_buffers import SceneBuffers
from ..gpu.schema import Struct

_SAME_X = 1e-6
_BATCHES = 8
"""Batches that are laid out at once, so that few threads wait for each other; more would take too much memory."""


class BeamEmission:
    """The pieces of one search, ready to be emitted in any number of passes."""

    def __init__(self, scene: SceneBuffers, ray: Struct, pieces: BeamPieces, spans: Spans, widest: float = 1.0) -> None:
        """`ray`: the trace pass's records; `spans`: bands of the spectral tables that photons are splatted by;
        `widest`: band of a weak beam's photons, where glass disperses and bands may be cut.

        A photon's interval may be any part of the spectrum where bands may be cut, else it is that of a table's band. A
        line's is then all that is nearer to it than to another; where no band is cut a lamp's strongest line in a
        band represents all of it. An emission line within a band that photons carry too is in their share, so that its
        own pieces are not taken. Raises ValueError for a piece whose interval no table has.
        """
        self._scene = scene
        self._ray = ray
        self._features = scene.features
        if not self._features.band_cuts:
            pieces = _by_bands(_lines_as_bands(pieces, spans, scene), spans)
        elif self._features.spectral_groups and widest < 1.0:
            pieces = narrowed(pieces, widest)
        band = _bands(pieces, spans, any_interval=self._features.band_cuts)
        within = _is_line_within(pieces)
        self.pieces = pieces.where(~within)
        self._band = band[~within]
        self._lo, self._hi = self._intervals(spans)
        missing = self._band < 0
        if missing.any():
            which = int(np.argmax(missing))
            light, x_lo, x_hi = self.pieces.light[which], self.pieces.x_lo[which], self.pieces.x_hi[which]
            raise ValueError(f"no spectral table of light {light} has the band {x_lo:.6f} to {x_hi:.6f} of a beam")
        measures = [scene.space.scale**-2 if light.is_parallel else 1.0 for light in scene.scene.lights]
        self._lattice = PieceLattice(self.pieces, scene.light_power, measures)
        self._inside_mask, self._inside_object = scene.media_of(self.pieces.inside)
        self._primitive = scene.primitive_of(self.pieces.last_object, self.pieces.last_triangle)

    def flux_w(self, light: int) -> float:
        """W that all pieces of a light hold."""
        return float(self._lattice.flux_w[self.pieces.light == light].sum())

    def batches(
        self,
        light: int,
        count: int,
        weight: float,
        shift: tuple[int, int],
        key: int,
        most: int,
    ) -> Iterator[np.ndarray]:
        """Ray records of about `count` points over a light's pieces, at most `most` at once. `weight`, `shift` and
        `key` as of a `LatticeSlice`: its weight, shift and seed."""
        for rays in self._lattice.portions(light, count, shift, key, _BATCHES * most):
            records = self._records(rays, light, weight, key)
            for start in range(0, len(records), most):
                yield records[start : start + most]

    def _records(self, rays: PieceRays, light: int, weight: float, key: int) -> np.ndarray:
        pieces, own = self.pieces, rays.piece
        records = self._ray.zeros(len(rays))
        records["position"], records["direction"] = rays.position, rays.direction
        records["flux_w"], records["throughput"] = weight * rays.flux_w, weight * rays.throughput
        records["x_lo"], records["x_anchor"], records["x_hi"] = rays.band.T
        at_line = pieces.x_lo[own] == pieces.x_hi[own]
        records["x_lo"][at_line], records["x_hi"][at_line] = self._lo[own[at_line]], self._hi[own[at_line]]
        records["footprint_scale"] = records["survival"] = 1.0
        records["photon_id"] = rays.number & 0xFFFFFFFF
        records["light_and_source"] = light | self._band[own] << 8 | pieces.source[own].astype(np.int64) << 16
        records["branch_key"] = _hashed(key ^ _hashed(pieces.key[own].astype(np.uint32)))
        records["flags"] = np.where(pieces.is_inside[own], FLAG_INSIDE, 0)
        records["depth"] = pieces.depth[own]
        records["last_primitive"], records["last_object"] = self._primitive[own], pieces.last_object[own]
        records["inside_mask"], records["inside_object"] = self._inside_mask[own], self._inside_object[own]
        spatial = 0
        if self._features.footprints:
            spatial = 2
            records["dposition"][:, :2, :3], records["ddirection"][:, :2, :3] = (
                rays.dposition[:, :2],
                rays.ddirection[:, :2],
            )
        if self._features.spectral_groups:
            group, per_variable = self._spectral_scale(rays.band)
            at = np.arange(len(rays)), spatial + group
            records["dposition"][*at, :3] = rays.dposition[:, 2] * per_variable[:, None]
            records["ddirection"][*at, :3] = rays.ddirection[:, 2] * per_variable[:, None]
        if self._features.polarised:
            self._polarise(records, own, rays.band)
        return records

    def _polarise(self, records: np.ndarray, own: np.ndarray, band: np.ndarray) -> None:
        """States at the three places of each ray's band, by the parabola through those of its piece."""
        pieces = self.pieces
        width = (pieces.x_hi - pieces.x_lo)[own]
        t = np.where(width[:, None] > 0.0, (band - pieces.x_lo[own, None]) / np.maximum(width, 1e-300)[:, None], 0.5)
        stokes = np.stack([parabola_at(pieces.state[own][..., :3], t[:, k]) for k in range(3)], axis=1)
        stokes /= np.maximum(np.linalg.norm(stokes, axis=-1, keepdims=True), 1.0)  # at most wholly polarised
        axis = _across(pieces.state[own, 1, 3:], records["direction"].astype(float))
        for k, name in enumerate("quv"):
            records[f"stokes_{name}"] = stokes[..., k]
            records[f"axis_{'xyz'[k]}"] = axis[:, k]

    def _intervals(self, spans: Spans) -> tuple[np.ndarray, np.ndarray]:
        """Ends of all that a line's photons represent, (M,) each: up to half the way to the next line, unless the line
        is a table's band by itself."""
        lo, hi = self.pieces.x_lo.copy(), self.pieces.x_hi.copy()
        for light, lamp in enumerate(self._scene.scene.lights):
            mine = np.flatnonzero((self.pieces.light == light) & (lo == hi))
            if not len(mine) or any(first == last for first, last in spans[light]):
                continue
            others = [float(self._scene.axis.x_of_nm(nm)) for nm, _ in lamp.spectral_power.lines]
            lines = np.unique(np.concatenate([others, lo[mine]]))
            ends = np.concatenate([[0.0], 0.5 * (lines[1:] + lines[:-1]), [1.0]])
            nearest = np.searchsorted(lines, lo[mine])
            lo[mine], hi[mine] = ends[nearest], ends[nearest + 1]
        return lo, hi

    def _spectral_scale(self, band: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """For each ray the group whose variable changes most over its band, and dx by that variable there."""
        table = self._scene.variables
        x = np.linspace(0.0, 1.0, table.shape[1])
        change = np.stack([np.interp(band[:, 2], x, row) - np.interp(band[:, 0], x, row) for row in table])
        group = np.abs(change).argmax(axis=0)
        change = change[group, np.arange(len(band))]
        moves = change != 0.0
        return group, np.where(moves, (band[:, 2] - band[:, 0]) / np.where(moves, change, 1.0), 0.0)


def _bands(pieces: BeamPieces, spans: Spans, *, any_interval: bool) -> np.ndarray:
    """Table's band of each piece, int64 (M,); -1: there is none."""
    found = np.full(len(pieces), -1, np.int64)
    for light, edges in enumerate(np.array(bands, float) for bands in spans):
        mine = np.flatnonzero(pieces.light == light)
        ends = np.column_stack([pieces.x_lo[mine], pieces.x_hi[mine]])
        off = np.abs(ends[:, None] - edges).max(axis=-1)
        nearest = off.argmin(axis=1)
        same = off[np.arange(len(mine)), nearest] < _SAME_X
        # What is cut out of a band is drawn by the light's running integral, whichever the band.
        found[mine] = np.where(same | any_interval, nearest, -1)
    return found


def _lines_as_bands(pieces: BeamPieces, spans: Spans, scene: SceneBuffers) -> BeamPieces:
    """Pieces of emission lines of lamps that have nothing else, as pieces of the tables' bands that hold them.

    What nothing disperses takes all lines the same way: those of a band's strongest represent the others there."""
    lo, hi, taken = pieces.x_lo.copy(), pieces.x_hi.copy(), np.ones(len(pieces), bool)
    for light, lamp in enumerate(scene.scene.lights):
        mine = pieces.light == light
        if not mine.any() or (pieces.x_lo != pieces.x_hi)[mine].any():
            continue
        lines = np.array([scene.axis.x_of_nm(nm) for nm, _ in lamp.spectral_power.lines])
        watts = np.array([power for _, power in lamp.spectral_power.lines])
        for first, last in spans[light]:
            held = np.flatnonzero((lines >= first) & (lines <= last))
            if last <= first or not len(held):
                continue
            within = mine & (pieces.x_lo >= first) & (pieces.x_lo <= last)
            strongest = within & (np.abs(pieces.x_lo - lines[held[watts[held].argmax()]]) < _SAME_X)
            taken &= ~within | strongest
            lo[strongest], hi[strongest] = first, last
    return replace(pieces, x_lo=lo, x_hi=hi).where(taken)


def _by_bands(pieces: BeamPieces, spans: Spans) -> BeamPieces:
    """Each piece once for every table's band within its interval, if they fill that. What nothing disperses is the
    same at all wavelengths, but for its weight."""
    rows, bands = [], []
    for row, (light, lo, hi) in enumerate(zip(pieces.light, pieces.x_lo, pieces.x_hi, strict=True)):
        within = [band for band in spans[light] if lo - _SAME_X <= band[0] < band[1] <= hi + _SAME_X]
        filled = within and abs(within[0][0] - lo) + abs(within[-1][1] - hi) < _SAME_X
        for band in within if filled else [(lo, hi)]:
            rows.append(row)
            bands.append(band)
    ends, chosen = np.array(bands, float).reshape(-1, 2), np.array(rows, int)
    width = np.maximum(pieces.x_hi - pieces.x_lo, 1e-300)[chosen]
    return _parts_of(pieces, chosen, *((ends.T - pieces.x_lo[chosen]) / width))


def narrowed(pieces: BeamPieces, widest: float) -> BeamPieces:
    """Weak beams' pieces in as many equal parts of their bands as none is wider than `widest`."""
    width = pieces.x_hi - pieces.x_lo
    parts = np.where(pieces.is_tail, np.ceil(width / widest), 1.0).clip(1.0).astype(int)
    rows = np.repeat(np.arange(len(pieces)), parts)
    first = (np.arange(len(rows)) - (np.cumsum(parts) - parts)[rows]) / parts[rows]
    return _parts_of(pieces, rows, first, first + 1.0 / parts[rows])


def _parts_of(pieces: BeamPieces, rows: np.ndarray, first: np.ndarray, last: np.ndarray) -> BeamPieces:
    """Pieces `rows`, int (n,), from t = `first` to `last` of their bands."""
    parts, width = pieces.take(rows), (pieces.x_hi - pieces.x_lo)[rows]
    x_lo, places = parts.x_lo + first * width, (first, 0.5 * (first + last), last)
    near, far = parts.edges[:, :3], parts.edges[:, 3:]
    each = np.repeat(np.stack([first, last]), np.diff(parts.edge_start), axis=1)[..., None]
    curves = {
        name: np.stack([parabola_at(getattr(parts, name), t) for t in places], axis=1)
        for name in ("position", "direction", "weight", "state")
    }
    edges, key = np.hstack([*(near + each * (far - near))]), parts.key ^ (x_lo * (1 << 20)).astype(np.int64)
    return replace(parts, x_lo=x_lo, x_hi=parts.x_lo + last * width, edges=edges, key=key, **curves)


def _is_line_within(pieces: BeamPieces) -> np.ndarray:
    """Whether each piece is of an emission line in a band that the same light has pieces of, bool (M,)."""
    lines = pieces.x_lo == pieces.x_hi
    within = np.zeros(len(pieces), bool)
    for light in np.unique(pieces.light[lines]):
        mine = pieces.light == light
        bands = np.unique(np.column_stack([pieces.x_lo, pieces.x_hi])[mine & ~lines], axis=0)
        x = pieces.x_lo[mine & lines, None]
        within[mine & lines] = ((x > bands[:, 0]) & (x <= bands[:, 1])).any(axis=1)
    return within


def _hashed(value: np.ndarray) -> np.ndarray:
    """PCG's output permutation as a hash, uint32 (shaders/lib/random.glsl)."""
    state = value * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    return (word >> np.uint32(22)) ^ word


def _across(axis: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Axes (n, 3) made unit vectors across directions (n, 3) near those they belong to."""
    axis = axis - np.einsum("ni,ni->n", axis, direction)[:, None] * direction
    return axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-30)
