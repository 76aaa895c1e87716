"""Splats that compute shaders add against the same splats drawn by the rasteriser.

Both work texels out by the same functions (`light/splat_texel.glsl`); what can differ is which texels a splat covers
and where in it they lie. Texels whose middles lie on a splat's side to a rounding (1/256 of a texel in a rasteriser)
may be one's and not the other's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.features.features import Features
from spectrasplat.gpu import splat_way
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.gpu.splat_way import FLOAT_ATOMICS, SplatWay
from spectrasplat.passes.footprint import MOST_GROUPS, PIECE_TEXELS, SPLAT, TEAMS, VERTICES
from spectrasplat.passes.map_atlas import MapAtlas
from spectrasplat.stress.rigs.splat_rig import Rig, photons

SIZE = 130, 101
"""No multiple of the sums' blocks."""
SMALL, SWEPT, CUT, EDGE = 1, 2, 3, 4
BINS = MapChannels(tuple(np.linspace(380.0, 780.0, 7).tolist()))
ONE_COLOUR = Features(spectral_groups=0, point_spectrum=True)
CASES = {
    "small": (SMALL, Features(spectral_groups=1)),
    "small of cut bands": (SMALL, Features(spectral_groups=1, band_cuts=True)),
    "small beside contacts": (SMALL, Features(spectral_groups=1, contact_lines=True)),
    "swept": (SWEPT, Features(spectral_groups=1)),
    "swept in bins": (SWEPT, Features(spectral_groups=1, bins=8)),
    "swept of one colour": (SWEPT, ONE_COLOUR),
    "swept of four wavelengths": (SWEPT, replace(ONE_COLOUR, hero=True)),
    "cut": (CUT, Features(spectral_groups=1, band_cuts=True)),
    "cut in bins beside contacts": (CUT, Features(spectral_groups=1, band_cuts=True, contact_lines=True, bins=8)),
    "fanning": (EDGE, Features(spectral_groups=1)),
    "fanning at light edges": (EDGE, Features(spectral_groups=1, light_edges=True)),
    "fanning beside contacts": (EDGE, Features(spectral_groups=1, contact_lines=True, light_edges=True)),
    "fanning of one colour": (EDGE, ONE_COLOUR),
}


@pytest.fixture(params=["compare and swap", "float atomics"])
def adding(gl: Context, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """How sums are added to, in all that is made meanwhile."""
    extensions = () if request.param == "compare and swap" else (FLOAT_ATOMICS,)
    if extensions and FLOAT_ATOMICS not in gl.ctx.extensions:
        pytest.skip(f"no {FLOAT_ATOMICS} here")
    monkeypatch.setitem(splat_way._ways, gl.ctx, SplatWay(False, "a test", 1 << 27, extensions))


def frames(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return along, np.stack([-along[:, 1], along[:, 0]], axis=1)


def splats(rig: Rig, rng: np.random.Generator, count: int, kind: int) -> np.ndarray:
    """Splat records (count,) of one kind, of all sizes and shapes, within and around the map."""
    records = SPLAT.zeros(count)
    records["kind"] = kind
    records["centre"] = rng.uniform([-8.0, -8.0], np.array(SIZE) + 8.0, (count, 2))
    records["rect"] = (0.0, 0.0, *rig.atlas.size)
    records["amplitude"] = rng.uniform(0.5, 1.0, count)
    records["layer"] = rng.integers(0, 3, count).astype(np.uint32) << 30 if rig.features.contact_lines else 0
    records["throughput"] = rng.uniform(0.0, 1.0, (count, 4))
    records["x_range"] = np.sort(rng.uniform(0.0, 1.0, (count, 2)), axis=1)
    if rig.features.hero:
        records["x_range"] = rng.integers(0, 200, (count, 2))
    if kind != SWEPT:
        # Rectangles that cut, and one in three that does not.
        cuts = rng.uniform(size=count) < 0.67
        low = np.floor(rng.uniform(0.0, 60.0, (count, 2)))
        records["rect"][cuts] = np.concatenate([low, low + np.floor(rng.uniform(5.0, 70.0, (count, 2)))], axis=1)[cuts]
    if kind == SMALL:
        sigma = 10.0 ** rng.uniform(-1.5, 0.3, (count, 2))
        records["along"], records["across"] = 0.5 + 3.0 * sigma, np.sqrt(0.5) / sigma
        records["xi_half"] = rng.integers(0, 2, count) if rig.features.band_cuts else 0.0
        return records
    along, aside = frames(rng, count)
    reach, edge = 10.0 ** rng.uniform(0.2, 1.9, (2, count, 1))
    edge = np.minimum(edge, 1.0 + 0.5 * reach)
    records["along"] = reach * along
    records["across"] = edge * (aside + rng.normal(size=(count, 1)) * along)
    records["y_edge"] = rng.uniform(2.0, 2.5, count)
    records["y_box"] = 0.5 * records["y_edge"] / edge[:, 0]
    records["table_row"] = (rng.integers(0, rig.tables.rows, count) + 0.5) / rig.tables.rows
    records["xi_half"] = rng.uniform(0.1, 0.9, count)
    records["inverse_sigma_xi"] = rng.uniform(2.0, 9.0, count)
    records["waves"] = rng.normal(size=(count, 4))
    records["ripple"][:, :2] = rng.uniform(0.0, 0.05, (count, 2))
    records["lit"] = rng.uniform(-0.3, 1.3, count)
    if kind == EDGE:
        fan = np.stack([rng.uniform(-0.8, 0.8, count), rng.uniform(-0.05, 0.05, count)], axis=1)
        turned = rng.uniform(size=count) < 0.5
        fan[turned] = fan[turned, ::-1]
        records["fan"] = fan
        if rig.features.light_edges:
            records["x_range"] = rng.normal(size=(count, 2))
    return records


def rigs(gl: Context, features: Features) -> tuple[Rig, Rig]:
    """Drawn by the rasteriser, and added by compute shaders."""
    channels = BINS if features.targets > 1 else MapChannels()
    made = tuple(Rig(gl.ctx, features, SIZE, channels=channels, by_compute=way) for way in (False, True))
    if features.contact_lines:
        words = np.random.default_rng(5).integers(0, 1 << 32, made[0].atlas.size[::-1], dtype=np.uint32)
        words[::2] &= 0xFFFF0000
        for rig in made:
            texture = gl.ctx.texture(rig.atlas.size, 1, words.tobytes(), dtype="u4")
            rig.atlas.contact_words = texture
    return made[0], made[1]


def drawn(rig: Rig, records: np.ndarray, most_groups: int = MOST_GROUPS) -> np.ndarray:
    """The map after these splat records alone, float64; `most_groups` that add them."""
    footprints, atlas = rig.splatter.footprints, rig.atlas
    atlas.clear()
    kind, count = int(records["kind"][0]), len(records)
    assert (records["kind"] == kind).all() and count <= footprints.capacity
    commands = footprints._no_commands.copy()
    if rig.splatter.by_compute:
        pieces = pieces_at_most(records)
        records = records.copy()
        records["kind"] |= pieces << 4
        entries = np.column_stack([np.repeat(np.arange(count), pieces), np.concatenate([np.arange(n) for n in pieces])])
        commands[kind - 1, [0, 3, 4, 5]] = min(-(-len(entries) // TEAMS), most_groups), count, *[len(entries)] * 2
        footprints.lists.write(entries.astype(np.uint32).tobytes())
    else:
        commands[:, 0] = 0
        commands[kind - 1, 0] = VERTICES[kind - 1] * count
        footprints.lists.write(np.arange(count, dtype=np.uint32), offset=4 * (kind - 1) * footprints.capacity)
    footprints.splats.write(records.tobytes())
    footprints.commands.write(commands)
    rig.ctx.memory_barrier()
    rig.splatter.draw(rig.tables, atlas)
    atlas.pending = count
    return atlas.read_tile(rig.tiles[0]).astype(np.float64)


def pieces_at_most(records: np.ndarray) -> np.ndarray:
    """Pieces (n,) in which each could be added by rows if it filled its box."""
    with np.errstate(all="ignore"):
        across = 0.0 if records["kind"][0] == SMALL else records["across"]
        reach = (np.abs(records["along"]) + np.abs(across)) / 0.15
        sides = np.nan_to_num(2.0 * reach, nan=1e9, posinf=1e9).clip(1.0, SIZE).astype(int)
    return (sides[:, 1] * -(-sides[:, 0] // PIECE_TEXELS)).astype(np.uint32)


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """Σ|a − b| / Σ|a|."""
    return float(np.abs(a - b).sum() / np.abs(a).sum())


def agree(gl: Context, case: str, count: int = 300, most: float = 3e-4) -> None:
    kind, features = CASES[case]
    raster, compute = rigs(gl, features)
    records = splats(raster, np.random.default_rng(3), count, kind)
    want, got = drawn(raster, records), drawn(compute, records)
    assert np.abs(want).sum() > 0.0
    assert difference(want, got) < most
    # Each splat alone: its texels to rounding, but for a few on its sides.
    for record in records[:12]:
        want, got = drawn(raster, record[None]), drawn(compute, record[None])
        off = (np.abs(got - want) > 2e-3 * np.abs(want).max()).any(axis=-1)
        assert off.sum() <= 2 + 0.02 * np.count_nonzero(want[..., 1]), record


@pytest.mark.parametrize(
    ("adding", "case"),
    [
        *(("compare and swap", case) for case in CASES),
        *(("float atomics", case) for case in ("small", "swept in bins")),
    ],
    indirect=["adding"],
)
@pytest.mark.usefixtures("adding")
def test_every_kind_is_added_as_it_is_drawn(gl: Context, case: str) -> None:
    agree(gl, case)


def alone(rig: Rig, **fields: object) -> np.ndarray:
    """A swept splat with some fields set, on its own."""
    record = splats(rig, np.random.default_rng(1), 1, SWEPT)
    record["centre"] = 65.2, 50.3
    record["ripple"] = 0.0
    for name, value in fields.items():
        record[name] = value
    return record


def test_long_thin_diagonals_keep_their_light(gl: Context) -> None:
    """Thousands of texels long and two wide; lines of either direction."""
    raster, compute = rigs(gl, Features(spectral_groups=1))
    for angle in np.radians([0.0, 3.0, 44.0, 45.0, 46.0, 87.0, 90.0, 133.0]):
        along = np.array([np.cos(angle), np.sin(angle)])
        record = alone(raster, along=5000.0 * along, across=1.2 * np.array([-along[1], along[0]]))
        want, got = drawn(raster, record), drawn(compute, record)
        assert np.count_nonzero(want[..., 1]) > 100
        # Middles of a texel in a hundred lie on a side, to a rasteriser's fixed point over such a length.
        assert difference(want, got) < 0.01 and got.sum() == pytest.approx(want.sum(), rel=5e-3)


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf, 1e38, 0.0])
@pytest.mark.parametrize("field", ["centre", "along", "across", "rect", "fan"])
def test_what_is_no_splat_ends_and_harms_nothing_beside_it(gl: Context, field: str, broken: float) -> None:
    """No loop depends on such numbers, and of a splat without width nothing is drawn."""
    _, compute = rigs(gl, Features(spectral_groups=1))
    good = splats(compute, np.random.default_rng(1), 1, EDGE)
    good["centre"], good["rect"], good["along"], good["across"] = 20.0, (0.0, 0.0, 40.0, 40.0), (8.0, 0.0), (0.0, 8.0)
    bad = good.copy()
    bad["centre"], bad["rect"] = 70.0, (50.0, 50.0, 90.0, 90.0)
    bad[field] = broken
    want, got = drawn(compute, good), drawn(compute, np.concatenate([bad, good]))
    if field in {"along", "across"}:
        assert np.isfinite(got).all()
    if field != "rect":
        np.testing.assert_array_equal(got[:40, :40], want[:40, :40])


def test_more_splats_than_groups_are_all_added(gl: Context) -> None:
    """A dispatch has no more groups than OpenGL promises: each then adds several."""
    raster, compute = rigs(gl, Features(spectral_groups=1))
    record = splats(compute, np.random.default_rng(2), 1, SMALL)
    record["centre"], record["rect"] = 40.5, (0.0, 0.0, *SIZE)
    count = 3000
    one, all_of_them = drawn(raster, record), drawn(compute, np.repeat(record, count), most_groups=7)
    np.testing.assert_allclose(all_of_them, count * one, rtol=2e-3, atol=1e-4 * count * one.max())


def mixed(features: Features, count: int) -> np.ndarray:
    """Photons of all kinds of splat, over and around a map of `SIZE`."""
    rng = np.random.default_rng(7)
    along, _ = frames(rng, count)
    along *= 10.0 ** rng.uniform(-1.5, 1.2, (count, 1))
    chord = frames(rng, count)[0] * 10.0 ** rng.uniform(-1.0, 1.4, (count, 1))
    aside = 0.5 * along[:, ::-1] * [1.0, -1.0] * rng.uniform(0.05, 1.0, (count, 1))
    places = rng.uniform([-5.0, -5.0], np.array(SIZE) + 5.0, (count, 2))
    records = photons(features, places, along, aside, chord, throughput=(0.5, 0.8, 1.0))
    if features.band_cuts:
        records["x_lo"][::2] = 0.2
    return records


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.usefixtures("adding")
def test_photons_come_to_the_same_maps(gl: Context, nested: bool) -> None:
    """By their own lists, in groups and flushes of their own, into both of two windows."""
    features = Features(spectral_groups=1, band_cuts=True, nested_windows=nested)
    coarser = [((64, 64), np.array([[0.25, 0.0, 0.0, 16.0], [0.0, 0.25, 0.0, 16.0]]), 16.0)] * nested
    raster, compute = (Rig(gl.ctx, features, SIZE, coarser=coarser, by_compute=way) for way in (False, True))
    records = mixed(features, 6000)
    for tile in range(1 + nested):
        want, got = raster.draw(records, 0.6, tile=tile), compute.draw(records, 0.6, tile=tile)
        assert difference(want, got) < 5e-5
        np.testing.assert_allclose(got.sum(axis=(0, 1)), want.sum(axis=(0, 1)), rtol=2e-5)
    # What was drawn is forgotten with everything else.
    np.testing.assert_allclose(compute.draw(records, 0.6, tile=tile), got, rtol=1e-4, atol=1e-6 * got.max())
    assert compute.splatter.footprints.counts() == raster.splatter.footprints.counts()


def test_an_atlas_forgets_and_gives_back_its_sums(gl: Context) -> None:
    _, compute = rigs(gl, Features(spectral_groups=1))
    atlas = compute.atlas
    textures = atlas.scratch_bytes
    drawn(compute, splats(compute, np.random.default_rng(1), 10, SMALL))
    assert atlas.scratch_bytes == textures + splat_way.sums_bytes(atlas.size, 1)
    compute.splatter.draw(compute.tables, atlas)
    atlas.clear()
    atlas.pending = 1
    assert not atlas.read_total().any()
    atlas.settle()
    assert atlas.scratch_bytes == 0
    atlas.release()


def test_targets_without_scratch_textures_are_added_to_as_well(gl: Context) -> None:
    features = Features(spectral_groups=1, bins=8)
    raster, compute = rigs(gl, features)
    records = splats(raster, np.random.default_rng(3), 100, SWEPT)
    want = drawn(raster, records)
    compute.atlas.release()
    compute.atlas = MapAtlas(gl.ctx, raster.atlas.size, np.zeros(0), 2, scratched=1)
    assert difference(want, drawn(compute, records)) < 3e-4


def test_only_known_ways_can_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(splat_way.ENVIRONMENT_VARIABLE, "computer")
    with pytest.raises(UserError, match="SPECTRASPLAT_SPLATS is 'computer', which is no way to draw splats.*'compute'"):
        create_context()


def test_a_software_renderer_draws_and_a_probe_tells_how_fast_it_blends(gl: Context) -> None:
    if gl.is_software:
        assert splat_way.way_of(gl.ctx).sentence == "drawn by the rasteriser (as on all software renderers)"
    assert 1e6 < splat_way.blending_rate(gl.ctx) < 1e13
    assert gl.ctx.error == "GL_NO_ERROR"


def test_maps_beyond_a_storage_block_are_drawn() -> None:
    way = SplatWay(True, "a test", largest_block=1 << 27)
    assert way.for_maps((2048, 2048), 1) and not way.for_maps((2048, 2048), 3)
    assert splat_way.sums_bytes((5, 3), 2) == 2 * 2 * 2 * 128
