"""Single splats: their energy, their shape against float64 quadrature, and where they may and may not be drawn. Those
that collapse to a point or whose columns overflow: `app/stress/cases/splats.py`, in test_stress_cases.py."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from reference import chart_folds
from reference.splat_reference import splat_image
from spectrasplat.features.features import Features
from spectrasplat.gpu import splat_tables
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.gpu.records import RECEIVER
from spectrasplat.gpu.tiles import pack
from spectrasplat.model.geometry.charts import build_charts
from spectrasplat.model.geometry.primitives import box
from spectrasplat.model.optics import spectrum
from spectrasplat.model.optics.colorimetry import K_M, VISIBLE_NM, cmf_xyz
from spectrasplat.passes.footprint import Photons
from spectrasplat.passes.map_atlas import MapAtlas, placement_rows
from spectrasplat.passes.resolve import Resolve
from spectrasplat.stress.rigs.splat_rig import Rig, photons

PLAIN = Features(spectral_groups=1)
CUTS = Features(spectral_groups=1, band_cuts=True)
TINY = np.array([1e-3, 0.0])


def frame(angle_rad: float, long: float, short: float) -> tuple[np.ndarray, np.ndarray]:
    along = np.array([np.cos(angle_rad), np.sin(angle_rad)])
    return along * long, np.array([-along[1], along[0]]) * short


def xyzw(light: spectrum.Spectrum) -> np.ndarray:
    return np.append(light.xyz(), light.power_w())


def relative_error(image: np.ndarray, reference: np.ndarray) -> float:
    return float(np.sqrt(((image - reference) ** 2).sum() / (reference**2).sum()))


@pytest.fixture(scope="module")
def rig(gl) -> Rig:
    return Rig(gl.ctx, PLAIN)


@pytest.fixture(scope="module")
def cut_rig(gl) -> Rig:
    return Rig(gl.ctx, CUTS)


def spectrum_samples(count: int) -> tuple[np.ndarray, np.ndarray]:
    """D65's XYZW in `count` equal parts of the range: places (-½..½) and energies (count, 4)."""
    light = spectrum.illuminant("D65")
    energy = light.density[:, None] * np.column_stack([K_M * cmf_xyz(), np.ones(401)])
    place = (VISIBLE_NM - 380.0) / 400.0 - 0.5
    place[0], place[-1] = -0.5 + 0.125 / 400.0, 0.5 - 0.125 / 400.0
    part = np.minimum(((place + 0.5) * count).astype(int), count - 1)
    energies = np.zeros((count, 4))
    np.add.at(energies, part, energy)
    places = np.array([place[part == i].mean() for i in range(count)])
    return places, energies


@pytest.mark.parametrize("case", range(10))
def test_shape_of_resolved_splats_matches_quadrature(rig: Rig, case: int) -> None:
    rng = np.random.default_rng(case)
    axes = frame(rng.uniform(0.0, np.pi), rng.uniform(1.0, 3.0), rng.uniform(0.9, 2.0))
    chord = rng.uniform(0.5, 16.0) * np.array(frame(rng.uniform(0.0, 2.0 * np.pi), 1.0, 1.0)[0])
    centre = 32.0 + rng.uniform(-0.5, 0.5, 2)
    image = rig.draw(photons(PLAIN, centre, *axes, chord))
    covariance = np.outer(axes[0], axes[0]) + np.outer(axes[1], axes[1])
    reference = splat_image((64, 64), centre, covariance, chord, *spectrum_samples(100))
    errors = [relative_error(image[..., c], reference[..., c]) for c in range(4)]
    assert max(errors) < 0.02, errors
    assert image.sum(axis=(0, 1)) == pytest.approx(reference.sum(axis=(0, 1)), rel=8e-3)


@pytest.mark.parametrize("long_axis", [0.02, 1.0])
def test_light_thin_along_its_sweep_stays_in_its_texels(cut_rig: Rig, long_axis: float) -> None:
    """A focus that a band sweeps over eight tenths of a texel lies in that column of texels; sampled at their middles,
    a sixth of it lay in the two beside."""
    image = cut_rig.draw(photons(CUTS, np.array([32.5, 32.5]), (0.02, 0.0), (0.0, long_axis), (0.8, 0.0)))
    assert image[:, 32].sum(axis=0) == pytest.approx(image.sum(axis=(0, 1)), rel=0.01)
    assert image.sum(axis=(0, 1)) == pytest.approx(xyzw(cut_rig.light), rel=8e-3)


@pytest.mark.parametrize(("angle_deg", "limit"), [(0.0, 0.02), (20.0, 0.06), (45.0, 0.06), (80.0, 0.06)])
def test_thin_line_keeps_its_width(rig: Rig, angle_deg: float, limit: float) -> None:
    axes = frame(np.radians(angle_deg), 3.0, 0.15)
    centre = np.array([32.2, 31.7])
    image = rig.draw(photons(PLAIN, centre, *axes))
    covariance = np.outer(axes[0], axes[0]) + np.outer(axes[1], axes[1])
    reference = splat_image((64, 64), centre, covariance, np.zeros(2), np.zeros(1), xyzw(rig.light)[None])
    assert relative_error(image, reference) < limit


def test_violet_lies_at_the_low_end_of_the_chord(rig: Rig) -> None:
    image = rig.draw(photons(PLAIN, [[32.0, 32.0]], [1.0, 0.0], [0.0, 1.0], [20.0, 0.0]))
    place = (np.arange(64) + 0.5) @ image.sum(axis=0) / image.sum(axis=(0, 1))
    light, nm = spectrum.illuminant("D65").density, (VISIBLE_NM - 380.0) / 400.0
    for channel, weight in enumerate(cmf_xyz().T):
        expected = 22.0 + 20.0 * np.sum(nm * light * weight) / np.sum(light * weight)
        assert place[channel] == pytest.approx(expected, abs=0.03)


def test_a_sweep_lies_between_its_band_s_ends_whichever_wavelength_is_traced(rig: Rig) -> None:
    axes, chord, centre = frame(0.4, 1.5, 0.8), np.array([9.0, 5.0]), np.array([31.0, 33.0])
    middle = rig.draw(photons(PLAIN, centre, *axes, chord))
    for anchor in (0.0, 0.2, 1.0):
        moved = rig.draw(photons(PLAIN, centre + (anchor - 0.5) * chord, *axes, chord, x_anchor=anchor))
        assert relative_error(moved, middle) < 1e-3


def test_cut_bands_add_up_to_the_whole(cut_rig: Rig) -> None:
    axes, chord, centre = frame(0.4, 1.5, 0.8), np.array([9.0, 5.0]), np.array([31.0, 33.0])
    whole = cut_rig.draw(photons(CUTS, centre, *axes, chord))
    parts = np.zeros_like(whole)
    edges = [0.0, 0.3, 0.301, 0.7, 1.0]
    for lo, hi in itertools.pairwise(edges):
        middle = 0.5 * (lo + hi)
        part = cut_rig.draw(photons(CUTS, centre + (middle - 0.5) * chord, *axes, chord, lo, hi))
        nm = 380.0 + 400.0 * np.array([lo, hi])
        expected = np.diff(
            np.interp(nm, np.append(VISIBLE_NM - 0.5, 780.5), np.append(0.0, np.cumsum(cut_rig.light.density)))
        )
        # A sliver of a band has a hard-edged box for its blur: 0.7 % by where that falls on the grid.
        assert part[..., 3].sum() == pytest.approx(expected[0], rel=1e-2)
        parts += part
    # A cut band is blurred by the box of the same variance, so its two ends differ from the whole band's Gaussian ones.
    assert relative_error(parts[..., 1], whole[..., 1]) < 0.12
    assert parts.sum(axis=(0, 1)) == pytest.approx(whole.sum(axis=(0, 1)), rel=8e-3)


def test_cut_of_a_small_splat_takes_its_share(cut_rig: Rig) -> None:
    part = cut_rig.draw(photons(CUTS, [[20.2, 20.7]], TINY, TINY, x_lo=0.25, x_hi=0.5))
    expected = spectrum.illuminant("D65").density[100:200].sum()
    assert part[..., 3].sum() == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize("features", [CUTS, Features(spectral_groups=0)], ids=["small", "broad, of one colour"])
def test_a_line_at_a_band_s_end_is_all_there(gl, features: Features) -> None:
    """Powers below x are known at few places: the line had a part of its power in a band that does not hold it."""
    lamp, place = spectrum.Spectrum(np.zeros(401), ((540.0, 1.0),)), 0.4 + 1e-4
    rig = Rig(gl.ctx, features, light=lamp, bands=((0.0, place), (place, 1.0)))
    axes = (TINY, TINY) if features == CUTS else ([2.0, 0.0], [0.0, 2.0])
    drawn = rig.draw(photons(features, [[32.0, 32.0]], *axes, x_lo=0.0, x_hi=place))
    assert drawn[..., 3].sum() == pytest.approx(1.0, rel=5e-3)


def test_throughput_over_the_band(rig: Rig) -> None:
    """Linear throughput over a chord of equal energy: the moments are those of quadrature."""
    image = rig.draw(photons(PLAIN, [[32.0, 32.0]], [1.0, 0.0], [0.0, 1.0], [24.0, 0.0], throughput=(0.2, 0.5, 0.9)))
    place = (VISIBLE_NM - 380.0) / 400.0
    weight = np.interp(place, [0.0, 0.5, 1.0], [0.2, 0.5, 0.9]) * rig.light.density
    assert image[..., 3].sum() == pytest.approx(weight.sum(), rel=3e-3)
    centroid = (np.arange(64) + 0.5) @ image[..., 3].sum(axis=0) / image[..., 3].sum()
    assert centroid == pytest.approx(20.0 + 24.0 * (place @ weight) / weight.sum(), abs=0.06)


def test_bins_hold_their_own_light_and_sum_to_all(gl) -> None:
    features = Features(spectral_groups=1, bins=8)
    edges = np.linspace(380.0, 780.0, 6)
    rig = Rig(gl.ctx, features, channels=MapChannels(tuple(float(e) for e in edges)))
    image = rig.draw(photons(features, [[32.0, 32.0]], [1.0, 0.0], [0.0, 1.0], [10.0, 0.0])).sum(axis=(0, 1))
    cells = np.append(VISIBLE_NM - 0.5, 780.5)
    cells[0], cells[-1] = 380.0, 780.0
    expected = np.diff(np.interp(edges, cells, np.append(0.0, np.cumsum(rig.light.density))))
    assert image[:5] == pytest.approx(expected, rel=8e-3)
    assert np.all(image[5:] == 0.0)


def test_laser_lines_land_at_their_wavelengths(gl) -> None:
    light = spectrum.laser(430.0, 2.0) + spectrum.laser(690.0, 1.0)
    rig = Rig(gl.ctx, PLAIN, light=light)
    row = rig.draw(photons(PLAIN, [[32.0, 32.0]], [0.5, 0.0], [0.0, 0.5], [40.0, 0.0]))[..., 3].sum(axis=0)
    x = np.arange(64) + 0.5
    for nm, power in light.lines:
        near = np.abs(x - (12.0 + 40.0 * (nm - 380.0) / 400.0)) < 5.0
        assert row[near].sum() == pytest.approx(power, rel=0.025)
        assert (x[near] @ row[near]) / row[near].sum() == pytest.approx(12.0 + 40.0 * (nm - 380.0) / 400.0, abs=0.02)


def test_one_wavelength_a_photon_averages_to_the_spectrum(gl) -> None:
    features = Features(spectral_groups=0, point_spectrum=True)
    rig = Rig(gl.ctx, features)
    count = 4096
    records = photons(features, np.full((count, 2), 32.3), [0.8, 0.0], [0.0, 0.8])
    records["x_anchor"] = records["x_lo"] = records["x_hi"] = (np.arange(count) + 0.5) / count
    assert rig.draw(records).sum(axis=(0, 1)) / count == pytest.approx(xyzw(rig.light), rel=1e-3)
    band = rig.draw(photons(features, [[32.3, 32.3]], [0.8, 0.0], [0.0, 0.8]))
    assert band.sum(axis=(0, 1)) == pytest.approx(xyzw(rig.light), rel=3e-3)


def test_nothing_is_drawn_outside_the_tile_and_outside_flux_is_counted(rig: Rig) -> None:
    centres = [[63.8, 30.0], [-5.0, 30.0], [30.0, 90.0]]
    axes = frame(0.3, 2.0, 1.0)
    image = rig.draw(photons(PLAIN, centres, *axes))
    total = rig.atlas.read_total()
    assert total.sum(dtype=np.float64) == pytest.approx(image.sum(), rel=1e-6)
    assert 0.4 < image[..., 3].sum() / rig.light.power_w() < 0.7
    counts = rig.splatter.footprints.counts()
    assert counts["outside_map_w"] == pytest.approx(2.0 * rig.light.power_w(), rel=1e-5)
    assert counts["splats_w"] == pytest.approx(3.0 * rig.light.power_w(), rel=1e-5)
    assert counts["footprints_dropped"] == counts["dropped_w"] == 0


@pytest.mark.parametrize("angle_deg", [0.0, 31.0, 45.0])
@pytest.mark.parametrize("long_axis", [400.0, 7000.0])
def test_far_larger_than_the_map_and_thin(rig: Rig, long_axis: float, angle_deg: float) -> None:
    """Its covariance has no digits left in float32 for the thin side."""
    axes = frame(np.radians(angle_deg), long_axis, 0.8)
    skew = np.array([[1.0, 1.0], [-1.0, 1.0]]) @ np.array(axes) / np.sqrt(2.0)  # the same Gaussian by other axes
    centre = np.array([32.2, 31.7])
    covariance = np.outer(axes[0], axes[0]) + np.outer(axes[1], axes[1])
    reference = splat_image((64, 64), centre, covariance, np.zeros(2), np.zeros(1), xyzw(rig.light)[None])
    assert relative_error(rig.draw(photons(PLAIN, centre, *skew)), reference) < 0.05


@pytest.mark.parametrize("window", ["one", "coarse"])
@pytest.mark.parametrize("far", [1e4, 1e6, 1e9, 1e12])
def test_too_large_ones_are_drawn_as_large_as_can_be_and_counted(gl, far: float, window: str) -> None:
    """Light that leaves glass at a grazing angle: no firefly, nothing that is not a number, whichever window it is in,
    and whether or not the picture's window has it in front."""
    along, across = frame(0.7, far, 1.0)
    rows = np.array([[0.25, 0.0, 0.0, 24.0], [0.0, 0.25, 0.0, 24.0]])
    for features, chord in ((PLAIN, [0.0, 0.0]), (CUTS, [0.3 * far, 0.2 * far])):
        coarser = [((64, 64), rows, 16.0)] * (window == "coarse")
        own = replace(features, nested_windows=len(coarser))
        rig = Rig(gl.ctx, own, coarser=coarser)
        records = photons(own, [[20.5, 20.5], [40.5, 41.5]], along + 1e-3 * across, along - 1e-3 * across, chord)
        records["x_hi"][1] = 0.8
        for tile in range(1 + len(coarser)):
            image = rig.draw(records, tile=tile)
            assert np.isfinite(image).all() and image.max() < 0.05 * rig.light.power_w()
        assert image.sum() > 0.0 and (rig.splatter.footprints.counts()["footprints_dropped"] > 0) == (far > 1e5)


@pytest.mark.parametrize("by_compute", [False, True])
def test_nested_windows_are_complete_where_they_are_read(gl, by_compute: bool) -> None:
    """Three, one in the other: texels of each hold all light, once, but for those deep inside of the finer one."""
    features = Features(spectral_groups=1, nested_windows=2)
    rows = [np.array([[scale, 0.0, 0.0, at], [0.0, scale, 0.0, at]]) for scale, at in ((0.25, 24.0), (0.0625, 26.0))]
    coarser = [((64, 64), rows[0], 16.0), ((64, 64), rows[1], 256.0)]
    rig = Rig(gl.ctx, features, coarser=coarser, by_compute=by_compute)
    rng = np.random.default_rng(5)
    records = photons(features, rng.uniform(-220.0, 284.0, (40000, 2)), [1.2, 0.3], [-0.2, 1.0], [3.0, 1.0])
    broad = photons(features, rng.uniform(-220.0, 284.0, (2000, 2)), [30.0, 3.0], [-9.0, 40.0], [3.0, 1.0])
    records = np.concatenate([records, broad])
    alone = Rig(gl.ctx, Features(spectral_groups=1), size=(64, 64), by_compute=by_compute)
    scale, offset = 1.0, 0.0
    for tile in range(3):
        of_tile = records.copy()
        of_tile["position"][:, :2] = scale * records["position"][:, :2] + offset
        for name in ("dposition_ds", "dposition_dt", "dposition_dvar0"):
            of_tile[name] *= scale
        got, want = rig.draw(records, tile=tile), alone.draw(of_tile)
        # Texels 24 to 39 of the second, 22 to 37 of the third are under finer ones, which are read there.
        read, first = np.ones((64, 64), bool), (0, 24, 22)[tile]
        read[first + 1 : first + 15, first + 1 : first + 15] = tile == 0
        np.testing.assert_allclose(got[read], want[read], rtol=2e-3, atol=2e-3 * want.max())
        assert tile == 0 or got[first + 8, first + 8, 3] < 0.3 * want[first + 8, first + 8, 3]
        scale, offset = ((0.25, 24.0), (0.0625, 26.0), (0.0, 0.0))[tile]
    assert rig.splatter.footprints.counts()["outside_map_w"] < 1e-6 * rig.splatter.footprints.counts()["splats_w"]


def test_picture_does_not_depend_on_batches(rig: Rig) -> None:
    rng = np.random.default_rng(2)
    count = 70000
    angles, sizes = rng.uniform(0.0, np.pi, count), rng.uniform(0.1, 2.0, count)
    axis = np.stack([np.cos(angles), np.sin(angles)], axis=1) * sizes[:, None]
    records = photons(PLAIN, rng.uniform(5.0, 59.0, (count, 2)), axis, 0.5 * axis[:, ::-1] * [1, -1], axis[::-1])
    whole = rig.draw(records)
    # Atomics add in any order.
    rounding = 2e-6 if rig.splatter.by_compute else 0.0
    np.testing.assert_allclose(rig.draw(records, batch=32768), whole, rtol=rounding)
    np.testing.assert_allclose(rig.draw(records, batch=10007), whole, rtol=2e-6)


def test_charts_splat_by_triangle_and_seams_fold_home(gl) -> None:
    """Photons all over a box, drawn through its charts: folded on the GPU as on the CPU, all energy kept."""
    charts = build_charts(box((1.0, 1.0, 1.0)), total_texels=4096)
    tiles, size = pack([(30, 20), (charts.width, charts.height)])
    placements = placement_rows(tiles[1], charts.rows, charts.texel_area, charts.triangle_rects)
    rig = Rig(gl.ctx, PLAIN)
    atlas = MapAtlas(gl.ctx, size, placements)
    receiver = RECEIVER.zeros(1)
    receiver["kind"], receiver["first_triangle"] = 1, 100
    mesh = box((1.0, 1.0, 1.0))
    rng = np.random.default_rng(4)
    corners = mesh.vertices[mesh.triangles]
    weights = rng.dirichlet(np.ones(3), (400, len(corners)))
    records = photons(PLAIN, np.zeros((400 * len(corners), 2)))
    records["position"] = np.einsum("ntk,tkd->ntd", weights, corners).reshape(-1, 3)
    records["triangle"] = 100 + np.tile(np.arange(len(corners)), 400)
    spread = rng.normal(size=(2, len(records), 3)) * np.sqrt(charts.texel_area.mean())
    records["dposition_ds"], records["dposition_dt"] = spread
    buffer = gl.ctx.buffer(records)
    rig.splatter.run(Photons(buffer, len(records)), rig.spectra, atlas, gl.ctx.buffer(receiver), 0.8)
    total = atlas.read_total()
    resolve = Resolve(gl.ctx, 1, [tiles[1]], [], [(tiles[1], charts)], by_compute=False)
    resolved = gl.ctx.texture(size, 4, dtype="f4")
    resolve.run(atlas, [resolved])
    image = np.frombuffer(resolved.read(), np.float32).reshape(size[1], size[0], 4)
    x0, y0, x1, y1 = tiles[1].rect
    folded = chart_folds.fold(charts, total[y0:y1, x0:x1])
    np.testing.assert_allclose(
        image[y0:y1, x0:x1], chart_folds.fill(charts, folded), rtol=1e-4, atol=1e-5 * folded.max()
    )
    carried = len(records) * rig.light.power_w()
    assert folded[..., 3].sum() == pytest.approx(carried, rel=0.01)
    assert total[y0:y1, x0:x1, 3][charts.owner < 0].sum() > 0.02 * carried


@pytest.mark.parametrize("by_compute", [False, True])
def test_tables_that_lie_below_others_in_a_layer_draw_the_same(gl, monkeypatch, by_compute: bool) -> None:
    """A texture array has 2,048 layers: two tinted panes asked for 2,112, and nothing was drawn."""
    bands = [(k / 8.0, (k + 1) / 8.0) for k in range(8)]

    def drawn() -> np.ndarray:
        rig = Rig(gl.ctx, PLAIN, bands=bands, by_compute=by_compute)
        long, short = frame(0.4, 3.0, 2.0)
        sweeps = [
            photons(PLAIN, (20.0 + 3.0 * k, 32.0), long, short, (90.0, 20.0), lo, hi, band=k)
            for k, (lo, hi) in enumerate(bands)
        ]
        return rig.draw(np.concatenate(sweeps))

    whole = drawn()
    # Atomics add a texel's splats, one a band at most, in any order.
    rounding = 2.0 * (len(bands) - 1) * 2.0**-24 if by_compute else 0.0
    monkeypatch.setattr(splat_tables, "MOST_LAYERS", 3)
    np.testing.assert_allclose(drawn(), whole, rtol=rounding, atol=0.0)
    monkeypatch.setattr(splat_tables, "MOST_BYTES", 1 << 20)
    narrow = drawn()
    assert 0.0 < relative_error(narrow, whole) < 0.03 and narrow.sum() == pytest.approx(whole.sum(), rel=2e-3)
