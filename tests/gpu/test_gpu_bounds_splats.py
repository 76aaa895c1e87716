"""What splatting asks of a GPU: how many dispatches, of how many rounds, and that nothing waits for a number."""

from __future__ import annotations

import numpy as np
import pytest
from gl_counts import counted
from spectrasplat.features.features import Features
from spectrasplat.gpu.context import Context
from spectrasplat.passes.footprint import KIND_WORDS, PIECE_TEXELS, SPLAT, TEAMS, Footprints, Photons
from spectrasplat.stress.rigs.splat_rig import Rig, photons

FEATURES = Features(spectral_groups=1)


@pytest.mark.parametrize("by_compute", [False, True])
@pytest.mark.parametrize(("start", "stride", "held"), [(0, 1, 700), (5, 3, 601), (0, 1, 0), (900, 1, 700)])
def test_photons_of_which_only_the_device_knows_how_many(
    gl: Context, by_compute: bool, start: int, stride: int, held: int
) -> None:
    """The bound may be larger: what lies behind the last record is left alone, and nothing is read back."""
    rig = Rig(gl.ctx, FEATURES, by_compute=by_compute)
    rng = np.random.default_rng(1)
    records = photons(FEATURES, rng.uniform(0.0, 64.0, (1000, 2)), (2.0, 0.0), (0.0, 1.0), (3.0, 1.0))
    buffer, state = gl.ctx.buffer(records), gl.ctx.buffer(np.array([7, held, 7], np.uint32))
    there = len(range(start, held, stride))
    given = Photons(buffer, there, start, stride), Photons(buffer, (1000 - start) // stride, start, stride, (state, 4))
    pictures = []
    for some in given:
        rig.atlas.clear()
        with counted() as counts:
            rig.splatter.run(some, rig.spectra, rig.atlas, rig.receivers, 1.0)
        assert counts.waits == 0
        pictures.append(rig.atlas.read_tile(rig.tile))
    want, got = pictures
    assert (want.max() > 0.0) == (there > 0)
    np.testing.assert_allclose(got, want, rtol=1e-5, atol=1e-6 * want.max())


def broad(count: int) -> np.ndarray:
    """Photons whose splats are from a texel to the whole map, round and long, straight and turned."""
    rng = np.random.default_rng(2)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    turned = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    along = turned * 10.0 ** rng.uniform(-1.0, 2.0, (count, 1))
    aside = np.stack([-turned[:, 1], turned[:, 0]], axis=1) * 10.0 ** rng.uniform(-1.0, 1.5, (count, 1))
    chord = rng.normal(size=(count, 2)) * 10.0 ** rng.uniform(-1.0, 1.5, (count, 1))
    return photons(FEATURES, rng.uniform(-20.0, 320.0, (count, 2)), along, aside, chord)


def texels_of_pieces(splat: np.ndarray) -> np.ndarray:
    """Texels of each piece of a splat of straight sides, counted one by one."""
    x0, y0, x1, y1 = splat["rect"].astype(int)
    y, x = np.mgrid[y0:y1, x0:x1] + 0.5
    frame = np.stack([splat["along"], splat["across"]], axis=1).astype(float)
    at = np.einsum("ij,jhw->ihw", np.linalg.inv(frame), np.stack([x, y]) - splat["centre"][:, None, None])
    within = (np.abs(at) <= 1.0).all(axis=0)
    reach = np.abs(frame).sum(axis=1)
    low, high = np.maximum(splat["centre"] - reach, (x0, y0)), np.minimum(splat["centre"] + reach, (x1, y1))
    first, end = np.ceil(low - 0.5).astype(int), np.floor(high - 0.5).astype(int) + 1
    sides = end - first
    axis = 0 if splat["kind"] & 8 else 1
    lines = within.sum(axis=axis)[first[axis] - (y0 if axis else x0) :][: sides[axis]]
    pieces = int(splat["kind"] >> 4)
    if pieces >= len(lines):
        return -(-lines // max(pieces // max(len(lines), 1), 1))
    together = -(-len(lines) // pieces)
    return np.add.reduceat(lines, np.arange(0, len(lines), together))


def test_no_work_group_takes_more_than_sixteen_rounds(gl: Context) -> None:
    """However large splats are: they are added in pieces, few of which the map cuts off."""
    rig = Rig(gl.ctx, FEATURES, (300, 300), by_compute=True)
    rig.draw(broad(400))
    footprints = rig.splatter._footprints
    splats = np.frombuffer(footprints.splats.read(400 * SPLAT.stride), SPLAT.dtype)
    splats = splats[splats["kind"] > 0]
    words = np.frombuffer(footprints.commands.read(16 * KIND_WORDS), np.uint32).reshape(4, KIND_WORDS)
    pieces, kinds = (splats["kind"] >> 4).astype(int), splats["kind"] & 7
    for kind in range(1, 5):
        of_kind = pieces[kinds == kind]
        assert list(words[kind - 1, 3:6]) == [len(of_kind), of_kind.sum(), of_kind.sum()]
        assert words[kind - 1, 0] == -(-of_kind.sum() // TEAMS)
    straight = splats[(kinds > 1) & (splats["fan"] == 0.0).all(axis=1)]
    texels = [texels_of_pieces(splat) for splat in straight]
    assert max(of_splat.max(initial=0) for of_splat in texels) <= PIECE_TEXELS
    assert sum(of_splat.sum() for of_splat in texels) > 0.25 * PIECE_TEXELS * (straight["kind"] >> 4).sum()
    assert pieces.max() > 300 and np.median(pieces) < 20


def test_a_list_without_room_for_all_pieces_holds_all_light(gl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    """An entry then stands for several pieces."""
    rig = Rig(gl.ctx, FEATURES, (300, 300), by_compute=True)
    want = rig.draw(broad(200))
    monkeypatch.setattr(Footprints, "entries", 300)
    got = rig.draw(broad(200))
    np.testing.assert_allclose(got, want, rtol=1e-4, atol=1e-6 * want.max())
    assert want.max() > 0.0
