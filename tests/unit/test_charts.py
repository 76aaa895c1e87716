"""Charts cover the mesh once, their rows agree with its geometry, and energy survives the seams."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from reference.chart_folds import fill, fold
from spectrasplat.base.errors import UserError
from spectrasplat.model.geometry import primitives
from spectrasplat.model.geometry.charts import ChartAtlas, build_charts
from spectrasplat.model.geometry.mesh import Mesh, make_mesh

MESHES = {
    "box": primitives.box((1.0, 2.0, 0.5)),
    "sphere": primitives.sphere(1.0, 2_000),
    "torus": primitives.torus(1.0, 0.4, 3_000),
    "water": primitives.rippled_water(resolution=40),
}


@cache
def atlas_of(name: str) -> ChartAtlas:
    return build_charts(MESHES[name], total_texels=160_000)


def _point_at(mesh: Mesh, atlas: ChartAtlas, triangle: np.ndarray, texel: np.ndarray) -> np.ndarray:
    """Points (N, 3) in the triangles' planes at texel coordinates (N, 2)."""
    corners = mesh.corners()[triangle]
    flat = np.einsum("nij,nkj->nki", atlas.rows[triangle, :, :3], corners) + atlas.rows[triangle, None, :, 3]
    edges = np.stack([flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]], axis=2)
    weights = np.linalg.solve(edges, (texel - flat[:, 0])[..., None])[..., 0]
    return corners[:, 0] + np.einsum("nk,nkj->nj", weights, corners[:, 1:] - corners[:, :1])


def _texel_positions(mesh: Mesh, atlas: ChartAtlas) -> np.ndarray:
    """World position of every covered texel's centre, zero elsewhere, (height, width, 3)."""
    y, x = np.nonzero(atlas.owner >= 0)
    out = np.zeros((atlas.height, atlas.width, 3))
    out[y, x] = _point_at(mesh, atlas, atlas.owner[y, x], np.stack([x, y], axis=1) + 0.5)
    return out


@pytest.mark.parametrize("name", MESHES)
def test_charts_cover_the_mesh_once(name: str) -> None:
    mesh, atlas = MESHES[name], atlas_of(name)
    assert 0.8 * 160_000 <= atlas.width * atlas.height <= 160_000
    covered = atlas.owner[atlas.owner >= 0]
    assert atlas.texel_area[covered].sum() == pytest.approx(mesh.areas().sum(), rel=0.01)
    # Rectangles are disjoint and hold their own triangles only.
    image = np.zeros((atlas.height, atlas.width), int)
    for chart, (x0, y0, x1, y1) in enumerate(atlas.rects):
        image[y0:y1, x0:x1] += 1
        held = atlas.owner[y0:y1, x0:x1]
        assert set(atlas.chart_of[held[held >= 0]]) <= {chart}
    assert image.max() == 1
    flat = np.einsum("tij,tcj->tci", atlas.rows[:, :, :3], mesh.corners()) + atlas.rows[:, None, :, 3]
    rects = atlas.triangle_rects
    assert (flat >= rects[:, None, :2] + 6 - 1e-9).all() and (flat <= rects[:, None, 2:] - 6 + 1e-9).all()


@pytest.mark.parametrize("name", MESHES)
def test_rows_are_the_triangles_own_plane(name: str) -> None:
    mesh, atlas = MESHES[name], atlas_of(name)
    scale = np.abs(atlas.rows[:, :, :3]).max()
    assert np.abs(np.einsum("tij,tj->ti", atlas.rows[:, :, :3], mesh.face_normals())).max() < 1e-9 * scale
    singular = np.linalg.svd(atlas.rows[:, :, :3], compute_uv=False)
    np.testing.assert_allclose(singular.prod(axis=1) * atlas.texel_area, 1.0, rtol=1e-9)
    assert (singular[:, 0] / singular[:, 1]).max() < 2.0


def test_number_of_charts_is_modest() -> None:
    assert len(atlas_of("box").rects) == 6
    assert len(atlas_of("sphere").rects) == 14
    assert np.ptp(atlas_of("box").texel_area) < 1e-12


@pytest.mark.parametrize("name", MESHES)
def test_every_uncovered_texel_of_a_chart_has_a_covered_destination(name: str) -> None:
    atlas = atlas_of(name)
    in_rect = np.zeros((atlas.height, atlas.width), bool)
    for x0, y0, x1, y1 in atlas.rects:
        in_rect[y0:y1, x0:x1] = True
    expected = np.argwhere(in_rect & (atlas.owner < 0))[:, ::-1]
    np.testing.assert_array_equal(np.unique(atlas.gutter_texel_xy, axis=0), np.unique(expected, axis=0))
    x, y = atlas.destination_xy.T
    assert (atlas.owner[y, x] >= 0).all()


@pytest.mark.parametrize("name", MESHES)
def test_gutter_next_to_a_seam_unfolds_to_where_it_is(name: str) -> None:
    mesh, atlas = MESHES[name], atlas_of(name)
    positions = _texel_positions(mesh, atlas)
    texel = np.sqrt(atlas.texel_area.max())
    checked = 0
    offsets = []
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        x, y = (atlas.gutter_texel_xy + (dx, dy)).T
        ok = (x >= 0) & (x < atlas.width) & (y >= 0) & (y < atlas.height)
        ok[ok] &= atlas.owner[y[ok], x[ok]] >= 0
        beside = atlas.owner[y[ok], x[ok]]
        extrapolated = _point_at(mesh, atlas, beside, atlas.gutter_texel_xy[ok] + 0.5)
        to = atlas.destination_xy[ok]
        offsets.append(np.linalg.norm(positions[to[:, 1], to[:, 0]] - extrapolated, axis=1) / texel)
        checked += int(ok.sum())
    distance = np.concatenate(offsets)
    assert checked > 500
    assert distance.max() < 2.5
    assert np.quantile(distance, 0.99) < 2.0 and np.median(distance) < 1.0


def _splat(atlas: ChartAtlas, triangle: int, hit: np.ndarray, sigma: float) -> np.ndarray:
    """A round Gaussian of unit energy about `hit` drawn in the triangle's own chart, inside its rectangle."""
    row = atlas.rows[triangle]
    centre = row[:, :3] @ hit + row[:, 3]
    inverse = np.linalg.inv(row[:, :3] @ row[:, :3].T * sigma**2)
    image = np.zeros((atlas.height, atlas.width))
    x0, y0, x1, y1 = atlas.triangle_rects[triangle]
    x, y = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
    d = np.stack([x, y], axis=2) - centre
    image[y0:y1, x0:x1] = np.exp(-0.5 * np.einsum("yxi,ij,yxj->yx", d, inverse, d))
    return image * np.sqrt(np.linalg.det(inverse)) / (2.0 * np.pi)


@pytest.mark.parametrize("name", MESHES)
def test_splats_across_seams_keep_energy_and_place(name: str) -> None:
    mesh, atlas = MESHES[name], atlas_of(name)
    positions = _texel_positions(mesh, atlas)
    texel = float(np.sqrt(np.median(atlas.texel_area)))
    # Hits on covered texels right beside a gutter.
    uncovered = np.pad(atlas.owner < 0, 1, constant_values=True)
    beside = (atlas.owner >= 0) & (uncovered[1:-1, 2:] | uncovered[2:, 1:-1])
    rng = np.random.default_rng(11)
    spilled = []
    for y, x in rng.permutation(np.argwhere(beside))[:12]:
        triangle = int(atlas.owner[y, x])
        hit = positions[y, x]
        image = _splat(atlas, triangle, hit, 1.5 * texel)
        folded = fold(atlas, image)
        assert image.sum() == pytest.approx(1.0, abs=0.01)
        assert folded.sum() == pytest.approx(image.sum(), rel=1e-12)
        spilled.append(image[atlas.owner < 0].sum())
        assert folded[atlas.owner < 0].sum() == 0.0
        centroid = np.einsum("yx,yxj->j", folded, positions) / folded.sum()
        # A sharp edge bends half the splat away by its mean half-width, 0.8 σ, along the other face.
        assert np.linalg.norm(centroid - hit) < (1.0 if name in ("box", "water") else 0.35) * texel
    assert 0.2 < np.mean(spilled) < 0.8


def test_uniform_energy_stays_uniform_and_gutters_are_filled() -> None:
    atlas = atlas_of("sphere")
    density = np.where(atlas.owner >= 0, atlas.texel_area[np.maximum(atlas.owner, 0)], 0.0)
    filled = fill(atlas, density)
    x, y = atlas.gutter_texel_xy.T
    assert (filled[y, x] > 0.5 * density.max()).all()
    two = fill(atlas, np.stack([density, 2.0 * density], axis=2))
    np.testing.assert_allclose(two[..., 1], 2.0 * filled)


def test_gather_lists_are_the_fold() -> None:
    atlas = atlas_of("sphere")
    energy = np.random.default_rng(2).random((atlas.height, atlas.width))
    destinations, offsets, sources = atlas.gather_lists()
    gathered = energy.copy()
    gathered[atlas.gutter_texel_xy[:, 1], atlas.gutter_texel_xy[:, 0]] = 0.0
    sums = np.add.reduceat(energy[sources[:, 1], sources[:, 0]], offsets[:-1])
    gathered[destinations[:, 1], destinations[:, 0]] += sums
    np.testing.assert_allclose(gathered, fold(atlas, energy), rtol=1e-12)


def test_energy_beyond_an_open_border_is_lost() -> None:
    ball = primitives.sphere(1.0, 2_000)
    upper = ball.corners().mean(axis=1)[:, 2] > 0.0
    dome = replace(ball, triangles=ball.triangles[upper], corner_normals=None)
    atlas = build_charts(dome, total_texels=90_000)
    lost = atlas.destination_xy[:, 0] < 0
    assert lost.any() and not lost.all()
    image = np.zeros((atlas.height, atlas.width))
    x, y = atlas.gutter_texel_xy.T
    image[y, x] = 1.0
    assert fold(atlas, image).sum() == pytest.approx((~lost).sum())


def _wavy_sheet(own_uv: np.ndarray | None) -> Mesh:
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 21), np.linspace(0.0, 1.0, 21))
    points = np.stack([x, y, 0.05 * np.sin(9.0 * x)], axis=2).reshape(-1, 3)
    k = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + 22], 1), np.stack([k, k + 22, k + 21], 1)])
    uv = points[:, :2] if own_uv is None else own_uv
    return make_mesh("sheet", points, faces, uv=uv[faces])


def test_own_texture_coordinates_are_used_when_sound() -> None:
    atlas = build_charts(_wavy_sheet(None), total_texels=40_000)
    assert atlas.from_own_uv and len(atlas.rects) == 1
    grid = _wavy_sheet(None).vertices[:, :2]
    mirrored = build_charts(_wavy_sheet(grid * (-1.0, 1.0)), total_texels=40_000)
    assert mirrored.from_own_uv
    assert mirrored.texel_area.sum() == pytest.approx(atlas.texel_area.sum(), rel=0.02)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda uv: uv * (1.0, 0.0),  # collapsed
        lambda uv: np.abs(uv - 0.5),  # folded over itself
        lambda uv: uv * (1.0, 0.01),  # sheared beyond use
        lambda uv: np.stack([uv[:, 0] * np.cos(9 * uv[:, 1]), uv[:, 0] * np.sin(9 * uv[:, 1])], axis=1),  # overlaps
        lambda uv: uv * np.nan,
    ],
)
def test_unsound_texture_coordinates_are_refused(spoil) -> None:
    atlas = build_charts(_wavy_sheet(spoil(_wavy_sheet(None).vertices[:, :2])), total_texels=40_000)
    assert not atlas.from_own_uv
    assert atlas.texel_area[atlas.owner[atlas.owner >= 0]].sum() == pytest.approx(
        _wavy_sheet(None).areas().sum(), rel=0.02
    )


def test_spiral_ramp_is_cut_until_it_does_not_overlap() -> None:
    t = np.linspace(0.0, 6.0 * np.pi, 300)
    inner = np.stack([0.5 * np.cos(t), 0.5 * np.sin(t), 0.03 * t], axis=1)
    points = np.concatenate([inner, inner * (2.0, 2.0, 1.0)])
    k = np.arange(299)
    faces = np.concatenate([np.stack([k, k + 300, k + 301], 1), np.stack([k, k + 301, k + 1], 1)])
    ramp = make_mesh("ramp", points, faces)
    atlas = build_charts(ramp, total_texels=60_000)
    assert len(atlas.rects) >= 3
    covered = atlas.owner[atlas.owner >= 0]
    assert atlas.texel_area[covered].sum() == pytest.approx(ramp.areas().sum(), rel=0.02)


def test_absurd_numbers_of_texels_are_refused() -> None:
    with pytest.raises(UserError, match="more than 0"):
        build_charts(MESHES["box"], total_texels=0)
    with pytest.raises(UserError, match="ask for fewer"):
        build_charts(MESHES["box"], total_texels=10**11)


def test_sliver_triangles_do_no_harm() -> None:
    box = MESHES["box"]
    extra = np.vstack([box.triangles, (0, 1, 0), (2, 3, 8)])
    vertices = np.vstack([box.vertices, 0.5 * (box.vertices[2] + box.vertices[3])])
    atlas = build_charts(make_mesh("b", vertices, extra), total_texels=40_000)
    assert np.isfinite(atlas.rows).all() and np.isfinite(atlas.texel_area).all()
