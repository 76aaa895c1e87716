"""Lattices over pieces of beams: what they carry adds up to the piece, and lies where and when it is lit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.beams.piece_lattice import PieceLattice, PieceRays
from spectrasplat.beams.polygons import BeamPieces, joined
from spectrasplat.model.optics.spectral_tables import CumulativeSpectrum
from spectrasplat.passes.beam_emission import narrowed

EVEN = CumulativeSpectrum(np.array([0.0, 1.0]), np.outer([0.0, 2.0], [1.0, 1.0, 1.0, 1.0]))
"""2 W, spread evenly over x."""
LINE = CumulativeSpectrum(np.array([0.0, 0.4, 0.4, 1.0]), np.outer([0.0, 0.0, 3.0, 3.0], np.ones(4)))
SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
KEY = 12345


def edges_of(corners: np.ndarray, move: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Half-planes of a counter-clockwise polygon that moves by `move` over the band."""
    along = np.roll(corners, -1, axis=0) - corners
    inward = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    c = -np.einsum("ij,ij->i", inward, corners)
    return np.column_stack([inward, c, inward, c - inward @ np.array(move)])


def piece(
    corners: np.ndarray = SQUARE,
    move: tuple[float, float] = (0.0, 0.0),
    band: tuple[float, float] = (0.2, 0.7),
    weight: tuple[float, float, float] = (1.0, 1.0, 1.0),
    light: int = 0,
) -> BeamPieces:
    """A piece whose rays start at (q_u, q_v, 0) and go along z."""
    moved = corners + np.array(move)
    low, high = np.minimum(corners, moved).min(axis=0), np.maximum(corners, moved).max(axis=0)
    hull = corners if not any(move) else np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    position = np.zeros((1, 3, 3, 3))
    position[..., 1, 0] = position[..., 2, 1] = 1.0
    direction = np.zeros((1, 3, 3, 3))
    direction[..., 0, 2] = 1.0
    one = np.zeros(1, np.int32)
    return BeamPieces(
        light=one + light,
        source=one,
        depth=one + 1,
        x_lo=np.array([band[0]]),
        x_hi=np.array([band[1]]),
        centre=np.zeros((1, 2)),
        position=position,
        direction=direction,
        weight=np.array([weight]),
        last_triangle=one,
        last_object=one,
        is_inside=one.astype(bool),
        inside=one.astype(np.uint64),
        key=np.zeros(1, np.int64),
        is_tail=np.zeros(1, bool),
        flux=np.ones(1),
        state=np.zeros((1, 3, 6)),
        edge_start=np.array([0, len(corners)], np.int32),
        edges=edges_of(corners, move),
        hull_start=np.array([0, len(hull)], np.int32),
        hulls=hull,
    )


def numbered(pieces: BeamPieces) -> BeamPieces:
    return replace(pieces, key=np.arange(1, len(pieces) + 1))


def rays_of(pieces: BeamPieces, count: int, key: int = KEY) -> PieceRays:
    lattice = PieceLattice(numbered(pieces), [EVEN, LINE], [1.0, 1.0])
    (rays,) = lattice.portions(int(pieces.light[0]), count, (1 << 30, 3 << 29), key)
    return rays


def triangle(base: float, height: float) -> np.ndarray:
    return np.array([[0.0, 0.0], [base, 0.0], [0.3 * base, height]])


SHAPES = {"square": (SQUARE, 4.0), "sliver": (triangle(3.0, 0.004), 0.006), "triangle": (triangle(2.0, 1.5), 1.5)}


@pytest.mark.parametrize("count", [1, 2, 7, 60, 4000])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_piece_is_carried_whole(shape: str, count: int) -> None:
    corners, area = SHAPES[shape]
    rays = rays_of(piece(corners, weight=(1.0, 2.0, 3.0)), count)
    # 2 W a unit of x, half of it, twice the weight on average
    assert rays.flux_w.sum() == pytest.approx(area * 2.0 * 0.5 * 2.0, rel=1e-9)
    assert 0.8 * count <= len(rays) <= 1.6 * count + 4
    held = 0.25 * (rays.throughput[:, 0] + 2.0 * rays.throughput[:, 1] + rays.throughput[:, 2])
    assert held * 2.0 * np.ptp(rays.band, axis=1) == pytest.approx(rays.flux_w, rel=1e-9)
    inside = edges_of(corners)[:, :2] @ rays.position[:, :2].T + edges_of(corners)[:, 2:3]
    assert inside.min() > 0.0 and rays.position[:, 2] == pytest.approx(0.0)
    assert len(np.unique(rays.number)) == len(rays)
    if count > 50:
        centre = rays.flux_w @ rays.position[:, :2] / rays.flux_w.sum()
        middle = np.array(corners).mean(axis=0)
        assert centre == pytest.approx(middle, abs=0.02 * np.ptp(corners, axis=0).max())


def test_cells_inside_are_a_lattice_and_those_at_edges_as_wide_as_their_part() -> None:
    rays = rays_of(piece(), 400)
    spacing = np.linalg.norm(rays.dposition[:, :2], axis=2)
    whole = np.isclose(rays.flux_w, rays.flux_w.max(), rtol=1e-6)
    assert whole.sum() > 300 and spacing[whole] == pytest.approx(0.1, rel=1e-6)
    assert rays.flux_w[whole] == pytest.approx(0.1**2, rel=1e-6)
    # A part of a cell reaches from its middle to the edge and no farther.
    to_edge = 1.0 - np.abs(rays.position[~whole, :2]).max(axis=1)
    narrow = spacing[~whole].min(axis=1)
    assert np.all(narrow < 0.1 + 1e-9) and narrow == pytest.approx(2.0 * to_edge, abs=1e-6)


@pytest.mark.parametrize("move", [(0.5, 0.0), (30.0, 0.0), (0.0, 4.0)])
@pytest.mark.parametrize("count", [5, 300, 20_000])
@pytest.mark.parametrize("widest", [1.0, 0.35])
def test_what_moves_is_lit_for_as_long_as_it_is_there(move: tuple[float, float], count: int, widest: float) -> None:
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    whole = replace(piece(corners, move, band=(0.0, 1.0)), is_tail=np.array([widest < 1.0]))
    rays = rays_of(narrowed(whole, widest), count)
    assert np.ptp(rays.band, axis=1).max() < widest + 1e-9
    assert rays.flux_w.sum() == pytest.approx(2.0 * 2.0, rel=5e-3 if count > 100 else 0.05)
    if count < 1000:
        return
    # Light at x lies about the middle of the polygon at x.
    x = np.linspace(0.05, 0.95, 10)
    for place in x:
        lit = (rays.band[:, 0] <= place) & (place <= rays.band[:, 2])
        at = rays.position + rays.dposition[:, 2] * (place - rays.band[:, 1:2])
        power = rays.throughput[:, 1] * lit
        middle = np.array([1.0, 0.5]) + place * np.array(move)
        assert power @ at[:, :2] / power.sum() == pytest.approx(middle, abs=0.02)
        assert power.sum() == pytest.approx(2.0, rel=0.03)
        spread = np.sqrt(power @ (at[:, :2] - middle) ** 2 / power.sum())
        assert spread == pytest.approx(np.array([2.0, 1.0]) / np.sqrt(12.0), rel=0.03)


def test_rays_follow_a_sliver_that_moves_over_their_cells() -> None:
    """A sliver a hundredth as wide as it moves: at each x light is where the sliver is, not all over the cells."""
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.04], [0.0, 0.04]])
    rays = rays_of(piece(corners, (0.0, 4.0), band=(0.0, 1.0)), 300)
    assert rays.flux_w.sum() == pytest.approx(2.0 * 0.08, rel=5e-3)
    for end in (0, 1, 2):
        place = rays.band[:, end]
        v = rays.position[:, 1] + rays.dposition[:, 2, 1] * (place - rays.band[:, 1])
        assert v - 0.02 == pytest.approx(4.0 * place, abs=0.025)
    assert np.median(rays.dposition[:, 2, 1]) == pytest.approx(4.0, rel=0.1)
    assert np.linalg.norm(rays.dposition[:, :2], axis=2).min(axis=1).max() < 0.06
    # Together they are lit all the time, each at any place once.
    covered = [np.sum(rays.flux_w[(rays.band[:, 0] <= x) & (x < rays.band[:, 2])]) for x in np.linspace(0.01, 0.99, 50)]
    assert min(covered) > 0.0


def test_no_colour_is_coarser_than_another() -> None:
    """A band of a hundredth of the power has as many points; two halves of a band have as many as the whole."""
    faint = CumulativeSpectrum(np.array([0.0, 0.5, 1.0]), np.outer([0.0, 0.01, 1.0], np.ones(4)))
    halves = joined([piece(band=(0.0, 0.5)), piece(band=(0.5, 0.75)), piece(band=(0.75, 1.0))])
    (rays,) = PieceLattice(numbered(halves), [faint], [1.0]).portions(0, 4000, (0, 0), KEY)
    assert np.bincount(rays.piece) == pytest.approx(np.array([2000, 1000, 1000]), rel=0.12)
    assert np.bincount(rays.piece, rays.flux_w) == pytest.approx([0.04, 1.98, 1.98], rel=1e-6)


def test_many_small_pieces_are_stood_for_by_some() -> None:
    sizes = np.linspace(0.5, 1.5, 1000)
    pieces = joined([piece(size * SQUARE, weight=(3.0, 3.0, 3.0)) for size in sizes])
    lattice = PieceLattice(numbered(pieces), [EVEN], [0.5])
    assert lattice.flux_w == pytest.approx(4.0 * sizes**2 * 3.0 * 0.5, rel=1e-9)
    mean = np.zeros(1000)
    for key in range(400):
        (rays,) = lattice.portions(0, 100, (0, 0), key * 0x9E3779B9)
        assert 90 <= len(rays) <= 110
        assert rays.flux_w.sum() == pytest.approx(lattice.flux_w.sum(), rel=0.011)
        np.add.at(mean, rays.piece, rays.flux_w / 400)
    assert mean.reshape(10, 100).sum(axis=1) == pytest.approx(lattice.flux_w.reshape(10, 100).sum(axis=1), rel=0.1)


def test_a_line_has_no_width() -> None:
    rays = rays_of(piece(band=(0.4, 0.4), light=1), 50)
    assert rays.flux_w.sum() == pytest.approx(4.0 * 3.0, rel=1e-9)
    assert np.all(rays.band == 0.4) and np.all(rays.dposition[:, 2] == 0.0)


def test_derivatives_are_those_of_the_rays() -> None:
    """Rays of a wider fan that bends with x: position and direction a spacing on, and at the ends of the band."""
    one = piece(0.01 * SQUARE, band=(0.3, 0.5))
    rng = np.random.default_rng(3)
    position, direction = rng.normal(size=(2, 1, 3, 3, 3))
    direction[:, :, 0] = [0.0, 0.0, 1.0]
    direction[:, 2, 0] = [0.1, 0.0, np.sqrt(0.99)]
    direction[:, 1, 0] = [0.05, 0.0, np.sqrt(1.0 - 0.05**2)]
    rays = rays_of(replace(one, position=position, direction=direction), 100)

    def true(q: np.ndarray, x: float) -> tuple[np.ndarray, np.ndarray]:
        t = (x - 0.3) / 0.2
        weights = np.array([2.0 * (t - 0.5) * (t - 1.0), 4.0 * t * (1.0 - t), 2.0 * t * (t - 0.5)])
        place = np.array([1.0, *q])
        p, d = (np.einsum("k,kcj,c->j", weights, array[0], place) for array in (position, direction))
        return p, d / np.linalg.norm(d)

    columns = np.einsum("k,kcj->cj", [0.0, 1.0, 0.0], position[0])
    for n in np.flatnonzero(np.isclose(rays.band[:, 1], 0.4))[::7]:
        q = np.linalg.lstsq(columns[1:].T, rays.position[n] - columns[0], rcond=None)[0]
        assert np.allclose(true(q, 0.4), [rays.position[n], rays.direction[n]], atol=1e-9)
        for axis in range(2):
            step = np.linalg.lstsq(columns[1:].T, rays.dposition[n, axis], rcond=None)[0]
            high, low = true(q + 1e-3 * step, 0.4), true(q - 1e-3 * step, 0.4)
            assert np.allclose((high[0] - low[0]) / 2e-3, rays.dposition[n, axis], atol=1e-9)
            assert np.allclose((high[1] - low[1]) / 2e-3, rays.ddirection[n, axis], atol=1e-6)
        ends = true(q, 0.3), true(q, 0.5)
        assert np.allclose((ends[1][0] - ends[0][0]) / 0.2, rays.dposition[n, 2], atol=1e-9)
        assert np.allclose((ends[1][1] - ends[0][1]) / 0.2, rays.ddirection[n, 2], atol=1e-9)
