"""Beam polygons drawn into maps, against exact polygons in exact texels at 400 indices: shape, energy, lines, windows.

What W is compared in has the same power at every wavelength; XYZ, over a whole band as here, changes by orders of
magnitude, and its tolerance is that of texels in which an edge takes long to pass.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from reference.beam_polygons import area_of, deposited, polygon, regular
from reference.beam_rig import PLANE, BeamRig, all_of
from spectrasplat.beams.polygons import BeamPolygons, joined
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.gpu.records import NONE, RECEIVER
from spectrasplat.gpu.tiles import pack
from spectrasplat.model.optics import spectrum
from spectrasplat.passes.beam_records import levels
from spectrasplat.passes.map_atlas import MapAtlas, placement_rows
from spectrasplat.passes.map_layout import MapLayout
from spectrasplat.passes.plane_frame import TexelMap

BAND = 0.25, 0.5
W = 3


@pytest.fixture(scope="module")
def rig(gl) -> BeamRig:
    return BeamRig(gl.ctx)


def moving(rng: np.random.Generator, size: float, motion: float, turn: float = 0.03) -> BeamPolygons:
    """A polygon about the middle of the map."""
    corners, stretch = int(rng.integers(3, 7)), float(np.exp(rng.uniform(0.0, 1.5)))
    heading, angle = rng.uniform(0.0, 2.0 * np.pi, 2)
    step = motion * np.array([np.cos(heading), np.sin(heading)])
    centre, radius = 32.0 + rng.uniform(-0.5, 0.5, 2) - 0.5 * step, 0.5 * size / np.sqrt(stretch)
    start = regular(corners, centre, radius, angle, stretch)
    end = regular(corners, centre + step, radius * rng.uniform(0.95, 1.05), angle + rng.uniform(-turn, turn), stretch)
    return polygon(start, end, BAND, (1.0, *rng.uniform(0.97, 1.03, 2)))


def errors(rig: BeamRig, one: BeamPolygons) -> tuple[float, float, float]:
    """Largest error and root of the mean square over the largest and that of the reference, relative error of the
    energy; of W."""
    image = rig.draw(one)[..., W]
    reference = deposited(one, rig.axis, rig.light, rig.channels, rig.size)[..., W]
    apart = image - reference
    rms = np.sqrt((apart**2).sum() / (reference**2).sum())
    return float(np.abs(apart).max() / reference.max()), float(rms), float(image.sum() / reference.sum() - 1.0)


@pytest.mark.parametrize(
    ("size", "motion"), [(0.3, 0.1), (0.3, 24.0), (1.0, 6.0), (12.0, 0.1), (12.0, 24.0), (30.0, 6.0)]
)
def test_swept_polygons_match_single_indices(rig: BeamRig, size: float, motion: float) -> None:
    rng = np.random.default_rng(int(100 * size + motion))
    found = np.array([errors(rig, moving(rng, size, motion)) for _ in range(6)])
    assert found[:, 0].max() < 0.03, found
    assert found[:, 1].max() < (0.03 if size < 1.0 else 0.012), found
    assert np.abs(found[:, 2]).max() < 2e-3, found


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
def test_edges_that_move_by_texels_agree_to_a_thousandth(rig: BeamRig, angle: float) -> None:
    """Sides across the motion and along it; only texels that a side along the motion crosses are left out."""
    step = 20.0 * np.array([np.cos(angle), np.sin(angle)])
    start = regular(4, np.array([32.2, 31.9]) - 0.5 * step, 9.0, angle + np.pi / 4)
    one = polygon(start, start + step, BAND)
    image = rig.draw(one)[..., W]
    reference = deposited(one, rig.axis, rig.light, rig.channels, rig.size, 2000)[..., W]
    y, x = np.mgrid[:64, :64] + 0.5
    across = np.abs(-np.sin(angle) * (x - 32.2) + np.cos(angle) * (y - 31.9))
    inner = across < 9.0 / np.sqrt(2.0) - 1.5
    assert np.abs(image - reference)[inner].max() < 1e-3 * reference.max()
    assert np.abs(image - reference).max() < 0.02 * reference.max()


def test_energy_at_every_size_and_place(rig: BeamRig) -> None:
    """From 1e-11 of a texel's area up, anywhere on the grid, still or moving."""
    rng = np.random.default_rng(7)
    for motion in (0.0, 0.4, 3.0):
        for area in np.geomspace(1e-11, 300.0, 40):
            one = replace(moving(rng, np.sqrt(area), motion, turn=0.0), density=np.ones((1, 3)))
            t = (np.arange(16) + 0.5) / 16
            lines = one.edges[None, :, :3] + t[:, None, None] * (one.edges[:, 4:7] - one.edges[:, :3])
            power = np.diff(rig_curve(rig).at(0.25 + 0.25 * np.linspace(0.0, 1.0, 17))[:, W])
            expected = sum(p * area_of(each) for p, each in zip(power, lines, strict=True))
            assert rig.draw(one)[..., W].sum() == pytest.approx(expected, rel=3e-3), (motion, area)


def rig_curve(rig: BeamRig):
    from spectrasplat.model.optics.spectral_tables import cumulative

    return cumulative(rig.axis, rig.light, rig.channels.cell_weights())


def test_the_energy_test_would_see_a_texel_that_takes_the_polygon_s_middle_for_all(rig: BeamRig) -> None:
    """A mutant: a hull that leaves out the texels at its border."""
    one = moving(np.random.default_rng(3), 8.0, 2.0)
    middle = one.hulls.mean(axis=0)
    whole, cut = rig.draw(one)[..., W].sum(), rig.draw(replace(one, hulls=middle + 0.8 * (one.hulls - middle)))
    assert cut[..., W].sum() < 0.99 * whole


@pytest.mark.parametrize("motion", [0.0, 8.0])
def test_slivers_keep_their_width(rig: BeamRig, motion: float) -> None:
    """Two opposite sides in one texel: neither one side's ramp nor the product of two."""
    step = motion * np.array([np.sin(0.3), -np.cos(0.3)])
    start = regular(4, np.array([31.0, 33.0]) - 0.5 * step, 0.1, 0.3, 200.0)
    largest, rms, energy = errors(rig, polygon(start, start + step, BAND))
    assert largest < 0.01
    assert rms < 0.01
    assert abs(energy) < 1e-3


def test_many_edges_and_two_that_are_the_same(rig: BeamRig) -> None:
    """More edges than programs hold as inputs; and an edge that two facets share."""
    for corners in (7, 9, 14):
        start = regular(corners, (31.2, 32.4), 9.0, 0.1)
        largest, _, energy = errors(rig, polygon(start, start + (5.0, 2.0), BAND))
        assert largest < 0.02
        assert abs(energy) < 1e-3
    small = polygon(regular(9, (31.9, 32.1), 0.6))
    assert errors(rig, small)[0] < 1e-4
    square = polygon(regular(4, (31.3, 32.2), 6.0, 0.2))
    twice = replace(square, edges=np.repeat(square.edges, 2, axis=0), edge_start=2 * square.edge_start)
    assert rig.draw(twice) == pytest.approx(rig.draw(square), rel=1e-4, abs=1e-4)


def test_density_over_band_and_place(rig: BeamRig) -> None:
    start = regular(4, (24.0, 30.0), 9.0, 0.3)
    one = polygon(start, start + (14.0, 3.0), BAND, density=(1.0, 1.4, 1.2), slope=(0.02, -0.01))
    largest, rms, energy = errors(rig, one)
    assert largest < 0.01
    assert rms < 0.01
    assert abs(energy) < 2e-3


def test_emission_lines_are_drawn_as_they_are_and_only_once(gl) -> None:
    light = spectrum.Spectrum(spectrum.illuminant("D65").density, ((435.8, 30.0), (546.1, 70.0)))
    rig = BeamRig(gl.ctx, light=light)
    square = regular(4, (30.0, 31.0), 8.0, 0.2)
    for nm in (435.8, 546.1):
        x = float(rig.axis.x_of_nm(nm))
        line = polygon(square, square + 9.0, (x, x))
        image = rig.draw(line)
        reference = deposited(line, rig.axis, light, rig.channels, rig.size)
        assert image == pytest.approx(reference, rel=1e-4, abs=1e-4 * reference.max())
    band = polygon(square)
    assert rig.draw(band)[..., W].sum() == pytest.approx(light.density.sum() * 128.0, rel=1e-4)
    with pytest.raises(ValueError, match="no band width"):
        rig.draw(polygon(square, band=(0.1, 0.1)))


def test_bins_and_reflectances(gl) -> None:
    channels = MapChannels(tuple(np.linspace(380.0, 780.0, 8).tolist()))
    rig = BeamRig(gl.ctx, channels=channels)
    start = regular(5, (26.0, 30.0), 8.0, 0.3)
    one = polygon(start, start + (10.0, 4.0))
    image, reference = rig.draw(one), deposited(one, rig.axis, rig.light, channels, rig.size)
    assert image.shape[2] == 8
    assert image.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=5e-3)


@pytest.mark.parametrize("softness", [0.5, 2.0, 6.0])
def test_penumbrae_keep_the_energy_and_have_their_width(rig: BeamRig, softness: float) -> None:
    for size in (0.2, 2.0, 20.0):
        one = soft(polygon(regular(4, (31.7, 32.1), size / np.sqrt(2.0), 0.3)), softness)
        assert rig.draw(one)[..., W].sum() == pytest.approx(size**2 * rig.light.power_w(), rel=8e-3)
    box = np.array([[-40.0, -40.0], [32.0, -40.0], [32.0, 100.0], [-40.0, 100.0]])
    profile = rig.draw(soft(polygon(box), softness))[30, :, W] / rig.light.power_w()
    x = np.arange(64) + 0.5
    window = np.sqrt(1.0 + 4.0 * softness**2)
    assert profile == pytest.approx(np.clip(0.5 + (32.0 - x) / window, 0.0, 1.0), abs=2e-3)


@pytest.mark.parametrize(("size", "stretch"), [(1e-4, 1e2), (1e-3, 1e3), (1e-2, 10.0)])
def test_slivers_in_wide_penumbrae_keep_their_energy(gl, size: float, stretch: float) -> None:
    """Up to a millionth of the penumbra wide: windows are what float32 must resolve them in, not texels; slivers
    of 1 : 1000 were drawn 1.4 times as bright. 0.5 % would be noticed."""
    rig = BeamRig(gl.ctx, size=(256, 256))
    sliver = polygon(regular(4, (128.3, 127.6), size / np.sqrt(2.0), 0.3, stretch))
    drawn = rig.draw(soft(sliver, 40.0))[..., W].sum()
    assert drawn == pytest.approx(size**2 * stretch * rig.light.power_w(), rel=5e-3)


def soft(one: BeamPolygons, softness: float) -> BeamPolygons:
    edges = one.edges.copy()
    edges[:, [3, 7]] = softness
    middle = one.hulls.mean(axis=0)
    return replace(one, edges=edges, hulls=one.hulls + softness * np.sign(one.hulls - middle))


def test_the_order_of_drawing_is_fixed_and_groups_add_up(rig: BeamRig, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    many = joined([moving(rng, size, 3.0) for size in np.geomspace(0.1, 20.0, 60)])
    first = rig.draw(many)
    assert np.array_equal(first, rig.draw(many))
    monkeypatch.setattr("spectrasplat.passes.beam_splat.GROUP", 7)
    assert rig.draw(many) == pytest.approx(first, rel=1e-4, abs=1e-5 * first.max())


def test_drawing_pauses_after_every_portion(rig: BeamRig, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of a fine search at once made a window stand still for up to 14 s on a busy processor."""
    rng = np.random.default_rng(4)
    many = joined([moving(rng, size, 3.0) for size in np.geomspace(0.1, 20.0, 60)])
    counts: list[int] = []
    steps = rig.splatter.steps

    def counted(*arguments, **named) -> Iterator[int]:
        for count in steps(*arguments, **named):
            counts.append(count)
            yield count

    monkeypatch.setattr("spectrasplat.passes.beam_splat.GROUP", 7)
    monkeypatch.setattr(rig.splatter, "steps", counted)
    rig.draw(many)
    assert len(counts) >= 60 // 7 and max(counts) <= 7 and sum(counts) == 60


def test_a_coarse_window_gets_what_is_not_inside_the_fine_one(gl) -> None:
    """The fine window shows 16 of the coarse one's 64 units, four times as fine; nothing leaves a window's tile."""
    rig = BeamRig(gl.ctx)
    tiles, size = pack([(64, 64), (64, 64)])
    fine = placement_rows(tiles[0], np.array([[4.0, 0.0, 0.0, -96.0], [0.0, 4.0, 0.0, -96.0]]), 1.0 / 16.0)
    coarse = placement_rows(tiles[1], np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]), 1.0)
    fine["next"] = 1
    assert coarse["next"][0] == NONE
    placements = np.concatenate([fine, coarse])
    layout = MapLayout(size, placements, RECEIVER.zeros(1), {0: tiles}, {}, {}, ())
    atlas = MapAtlas(gl.ctx, size, placements)
    power = rig.light.power_w()

    def drawn(one: BeamPolygons) -> tuple[np.ndarray, np.ndarray]:
        atlas.clear()
        all_of(rig.splatter.steps(one, {0: PLANE}, layout, rig.tables, atlas, weight=3.0))
        total = atlas.read_total()[..., W] / (3.0 * power)
        kept = [total[y0:y1, x0:x1].sum() for x0, y0, x1, y1 in (tile.rect for tile in tiles)]
        assert total.sum() == pytest.approx(sum(kept), rel=1e-6)
        return tuple(kept)

    assert drawn(polygon(regular(4, (32.0, 32.0), 2.0, 0.3))) == pytest.approx((8.0, 0.0), rel=1e-4)
    across = drawn(polygon(np.array([[20.0, 30.0], [30.0, 30.0], [30.0, 33.0], [20.0, 33.0]])))
    assert across == pytest.approx((18.0, 30.0), rel=1e-4)
    outside = polygon(np.array([[60.0, 30.0], [90.0, 30.0], [90.0, 31.0], [60.0, 31.0]]))
    assert drawn(outside) == pytest.approx((0.0, 4.0), rel=1e-4)
    atlas.release()


def test_anisotropic_texels_and_an_oblique_frame(gl) -> None:
    """A plane's frame that is turned against the map's rows, and texels that are not square: the area stays."""
    rig = BeamRig(gl.ctx)
    turn = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
    rows = np.zeros((2, 4))
    rows[:, :2] = np.diag([2.0, 5.0]) @ turn
    rows[:, 3] = (32.0, 32.0)
    placements = placement_rows(rig.tile, rows, 0.1)
    layout = replace(rig.layout, placements=placements)
    start = regular(5, (0.3, 0.2), 3.0, 0.3)
    one = polygon(start, start + (4.0, 1.0), (0.0, 1.0))
    area = area_of(polygon(start + 20.0).edges[:, :3])
    rig.atlas.clear()
    all_of(rig.splatter.steps(one, {0: PLANE}, layout, rig.tables, rig.atlas))
    drawn = rig.atlas.read_tile(rig.tile)[..., W].sum()
    assert drawn == pytest.approx(area * rig.light.power_w(), rel=2e-3)


def test_broad_penumbrae_go_to_wider_texels_with_all_their_light(gl) -> None:
    """A window kept in texels of 1, 2 and 4: each polygon goes to the widest that its penumbra allows."""
    rig = BeamRig(gl.ctx)
    tiles, size = pack([(64, 64), (32, 32), (16, 16)])
    placements = np.concatenate(
        [
            placement_rows(tile, np.eye(2, 4) / step, float(step * step))
            for tile, step in zip(tiles, (1, 2, 4), strict=True)
        ]
    )
    placements["blurred"] = 1, 2, NONE
    layout = MapLayout(size, placements, RECEIVER.zeros(1), {0: tiles[:1]}, {}, {}, ())
    atlas = MapAtlas(gl.ctx, size, placements)
    for softness, level in ((0.0, 0), (3.0, 0), (4.5, 1), (9.0, 2)):
        for side in (0.5, 3.0):
            atlas.clear()
            one = soft(polygon(regular(4, (32.3, 31.8), side / np.sqrt(2.0), 0.3)), softness)
            all_of(rig.splatter.steps(one, {0: PLANE}, layout, rig.tables, atlas))
            total = atlas.read_total()[..., W] / rig.light.power_w()
            held = [total[y0:y1, x0:x1].sum() for x0, y0, x1, y1 in (tile.rect for tile in tiles)]
            expected = np.zeros(3)
            expected[level] = side * side
            assert held == pytest.approx(expected.tolist(), rel=1e-3, abs=1e-6), (softness, side)
    atlas.release()


def test_a_mask_asks_for_texels_an_eighth_as_wide_as_a_narrow_polygon_s_penumbrae(rig: BeamRig) -> None:
    """What stands before a mask's line fills no map at the finest: a picture of haze was drawn forty times as long."""
    to_texels = TexelMap.of(rig.layout.placements[0], PLANE)
    narrow, wide = (soft(polygon(regular(4, (32.0, 32.0), side, 0.3)), 40.0) for side in (0.5, 400.0))
    for one, is_masked, level in ((narrow, False, 4), (narrow, True, 1), (wide, True, 0)):
        edges = one.edges.copy()
        edges[:1, [3, 7]] = -0.1 if is_masked else 40.0
        assert levels(replace(one, edges=edges), np.arange(1), to_texels).tolist() == [level], (is_masked, level)
