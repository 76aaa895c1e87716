"""What splatting asks of a GPU: how many dispatches, of how many rounds, and that nothing waits for a number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from unittest import mock

import moderngl
import numpy as np
import pytest
from gl_counts import counted
from spectrasplat.base.paths import shipped_scenes
from spectrasplat.features.features import Features
from spectrasplat.gpu import device_traits, splat_way
from spectrasplat.gpu.context import Context, create_context
from spectrasplat.gpu.device_traits import DeviceTraits
from spectrasplat.gpu.packed_records import read_records
from spectrasplat.gpu.splat_way import way_of
from spectrasplat.gpu.tiles import pack
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes.footprint import KIND_WORDS, PIECE_TEXELS, TEAMS, Footprints, Photons
from spectrasplat.passes.map_atlas import MapAtlas
from spectrasplat.passes.resolve import Resolve
from spectrasplat.render.device_scene import scene_buffers
from spectrasplat.render.light_pass import LightPass
from spectrasplat.render.photon_batches import Deposit
from spectrasplat.render.still import render
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
    footprints = rig.splatter.footprints
    splats = read_records(footprints.splat, footprints.splats, 400)
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


@pytest.mark.parametrize(
    ("features", "by_compute"),
    [(FEATURES, False), (Features(spectral_groups=1, band_cuts=True), True)],
    ids=["whole, drawn", "cut, added"],
)
def test_packed_records_make_the_same_maps(
    gl: Context, monkeypatch: pytest.MonkeyPatch, features: Features, by_compute: bool
) -> None:
    """Photons of 80 bytes instead of 112, splats of 96 instead of 144: 19 of 20 texels within 1e-4 of the maps' mean
    (the others at the sides of needles, and at the ends where splats are cut off: a texel comes or goes there with any
    rounding), all light within 1e-5; also of photons that are all alike, whose rounding adds up."""
    records = broad(20_000)
    records["x_hi"][::2], records["throughput"][::3] = 0.7, (0.31, 0.77, 0.93)
    alike = photons(features, np.random.default_rng(3).uniform(20.0, 280.0, (5000, 2)), (1.3, 0.2), (-0.3, 0.9), (7, 1))
    alike["throughput"] = 0.5001
    for some in (records, alike):
        maps, strides = [], []
        for packs in (False, True):
            monkeypatch.setitem(splat_way._ways, gl.ctx, replace(way_of(gl.ctx), packs=packs))
            rig = Rig(gl.ctx, features, (300, 300), by_compute=by_compute)
            maps.append(rig.draw(some, 0.45))
            strides.append((rig.splatter.footprints.photon.stride, rig.splatter.footprints.splat.stride))
        want, got = maps
        assert strides == [(112, 144), (80, 96)]
        assert np.quantile(np.abs(got - want), 0.95) < 1e-4 * want.mean()
        assert np.sqrt(np.mean((got - want) ** 2)) < 2e-3 * want.mean()
        np.testing.assert_allclose(got.sum(axis=(0, 1)), want.sum(axis=(0, 1)), rtol=1e-5)


@pytest.fixture(params=[True, False], ids=["added", "drawn"])
def gpu(request: pytest.FixtureRequest, gl: Context) -> Iterator[Context]:
    """A device that is taken for a GPU, with either way of adding splats."""
    with device_traits.assumed(DeviceTraits(splats_by_compute=request.param)), create_context() as context:
        yield context
    gl.ctx.__enter__()


def test_a_pass_is_eight_dispatches_one_clear_and_one_resolve(gpu: Context) -> None:
    """After the trace, whatever the number of photons; and no sum is moved, nor anything read or waited for."""
    scene = load_scene(shipped_scenes()["prism"])
    settings = RenderSettings(width=96, height=54, photons=4000, method="srd-photons")
    buffers = scene_buffers(gpu, scene, settings)
    light = LightPass(gpu, scene, settings, buffers.features, buffers)
    light.prepare()
    light.begin(4000, 1)
    light.batches.splatting.dispatch_seconds = 1e3  # nothing is cut, however slow the device
    given: list[tuple[moderngl.Buffer, int]] = []
    splat = light.batches.splat

    def noted(
        photons: moderngl.Buffer, most: int, into: Deposit, **further: tuple[moderngl.Buffer, int]
    ) -> Iterator[None]:
        held = further.get("held")
        count = most if held is None else min(most, int(np.frombuffer(held[0].read(4, offset=held[1]), np.uint32)[0]))
        given.append((gpu.ctx.buffer(photons.read(count * light.trace.photon.stride)), count))
        return splat(photons, most, into, **further)

    with mock.patch.object(light.batches, "splat", noted):
        for _ in light.pass_steps(0, 4000):
            pass
    want = [np.frombuffer(texture.read(), np.float32) for texture in light.maps.resolved_textures()]
    for _ in range(2):
        with counted() as clearing:
            light.maps.clear()
        with counted() as counts:
            for photons, count in given:
                for _ in light.splat_steps(photons, count):
                    pass
            got = light.maps.resolved_textures()
        with counted() as resolving:
            light.maps.resolved_textures()
    if light.maps.splatter.by_compute:
        assert len(given) > 1 or counts.dispatches <= 8
        assert clearing.dispatches == 1
    assert counts.waits == 0 and not counts.made and not clearing.made
    assert counts.dispatches + counts.draws <= len(given) * 6 + resolving.dispatches
    assert resolving.dispatches <= 2 and resolving.draws == 0
    assert not light.maps.atlas.has_totals or not light.maps.splatter.by_compute
    for texture, sums in zip(got, want, strict=True):
        np.testing.assert_allclose(np.frombuffer(texture.read(), np.float32), sums, rtol=1e-3, atol=1e-5 * sums.max())
    light.release()
    buffers.release()


@pytest.mark.parametrize("scene", ["prism", pytest.param("lens", marks=pytest.mark.slow)])
def test_pictures_of_a_gpu_are_those_of_the_processor(gpu: Context, gl: Context, scene: str) -> None:
    """With the same photons: other groups, lists and sums, and maps resolved without a flush."""
    assert gpu.traits.splats_by_compute == way_of(gpu.ctx).by_compute and way_of(gpu.ctx).in_bulk
    settings = RenderSettings(width=96, height=54, photons=20_000, spp=1)
    pictures = []
    for context in (gl, gpu):
        context.ctx.__enter__()
        pictures.append(render(load_scene(shipped_scenes()[scene]), settings, context=context).rgb.astype(np.float64))
    wanted, found = pictures
    assert np.mean((wanted - found) ** 2 / (wanted**2 + 1e-2 * wanted.mean() ** 2)) < 1e-6


@pytest.mark.parametrize("in_bulk", [False, True])
def test_windows_are_resolved_from_the_widest_texels_on(
    gl: Context, monkeypatch: pytest.MonkeyPatch, in_bulk: bool
) -> None:
    """Four levels, the last in whole pixels, sides that are no multiples, and totals that are resolved in place: as
    numpy adds them up."""
    monkeypatch.setitem(splat_way._ways, gl.ctx, replace(way_of(gl.ctx), in_bulk=in_bulk))
    sizes = [(159, 111), (53, 37), (27, 19), (14, 10), (20, 20)]
    tiles, size = pack(sizes)
    rng = np.random.default_rng(5)
    atlas = MapAtlas(gl.ctx, size, np.zeros(0))
    values = rng.uniform(size=(size[1], size[0], 4)).astype(np.float32)
    atlas.ready_totals()
    atlas.total_textures[0].write(values)
    folds = [(tiles[3], tiles[2], 0), (tiles[2], tiles[1], 0), (tiles[1], tiles[0], 3)]
    resolve = Resolve(gl.ctx, 1, [tiles[0], tiles[4]], folds, [], False)
    resolve.run(atlas, atlas.total_textures)
    got = np.frombuffer(atlas.total_textures[0].read(), np.float32).reshape(values.shape)

    def held(level: int) -> np.ndarray:
        x0, y0, x1, y1 = tiles[level].rect
        return values[y0:y1, x0:x1].astype(np.float64)

    want = held(3)
    for level in (2, 1):
        fine = held(level)
        places = [(np.arange(n) + 0.5) / 2.0 - 0.5 for n in fine.shape[:2]]
        low = [np.floor(place).astype(int) for place in places]
        below, above = ([np.clip(i + k, 0, n - 1) for i, n in zip(low, want.shape, strict=False)] for k in (0, 1))
        v, u = (place - i for place, i in zip(places, low, strict=True))
        v, u = v[:, None, None], u[None, :, None]
        rows = [(1.0 - u) * want[np.ix_(r, below[1])] + u * want[np.ix_(r, above[1])] for r in (below[0], above[0])]
        want = fine + 0.25 * ((1.0 - v) * rows[0] + v * rows[1])
    want = held(0) + want.repeat(3, axis=0).repeat(3, axis=1) / 9.0
    x0, y0, x1, y1 = tiles[0].rect
    np.testing.assert_allclose(got[y0:y1, x0:x1], want, rtol=1e-5)
    x0, y0, x1, y1 = tiles[4].rect
    np.testing.assert_array_equal(got[y0:y1, x0:x1], values[y0:y1, x0:x1])
