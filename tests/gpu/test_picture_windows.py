"""Maps on a picture's own pixels: that texels are pixels, that what falls in them is exact, and that a pixel shows its
own texels and nothing of its neighbours'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.beam_polygons import polygon, regular
from reference.beam_rig import PLANE, BeamRig, all_of
from spectrasplat.base.paths import assets_dir
from spectrasplat.gpu.gpu_space import GpuSpace
from spectrasplat.gpu.records import PLACEMENT, RECEIVER
from spectrasplat.gpu.tiles import pack
from spectrasplat.model.io.scene_file import load_scene
from spectrasplat.model.scene import Camera
from spectrasplat.model.settings import RenderSettings
from spectrasplat.passes import map_layout
from spectrasplat.passes.caustic_maps import CausticMaps
from spectrasplat.passes.map_atlas import MapAtlas, placement_rows
from spectrasplat.passes.map_layout import MapLayout, project
from spectrasplat.passes.picture_window import PictureWindow, picture_window
from spectrasplat.passes.plane_frame import TexelMap, plane_frame
from spectrasplat.render.still import render

from tests.gpu.camera_rig import REFLECTANCE, floor, opened_camera_pass, released, white_texels

W = 3
SPACE = GpuSpace(np.array([0.4, -1.0, 0.2]), 0.5)
SLANTED = Camera(position=(0.3, -6.0, 3.0), target=(0.1, 0.0, 0.0), up=(0.1, 0.0, 1.0), vertical_fov_deg=40.0)
VIEWS = {
    "from above": SLANTED,
    "from below": replace(SLANTED, position=(0.3, -6.0, -3.0)),
    "orthographic": replace(SLANTED, kind="orthographic", vertical_extent=5.0),
    "at the horizon": replace(SLANTED, target=(0.1, 0.0, 2.9)),
}
SIZE = 96, 60


def floor_window(camera: Camera, per_pixel: int = 2) -> tuple[PictureWindow, TexelMap]:
    """Of light spread over a floor at z = 0, most of it in sight."""
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-3, 3, (400, 2)), np.zeros(400)])
    frame = plane_frame(SPACE.to_gpu(points))
    window = picture_window(camera, SPACE, frame, SPACE.to_gpu(points), np.ones(400), SIZE, per_pixel, 4096)
    assert window is not None
    tiles, _ = pack([window.texels])
    placement = placement_rows(tiles[0], window.texel_rows(1), window.texel_area(frame, 1) / SPACE.scale**2)[0]
    return window, TexelMap.of(placement, frame)


@pytest.mark.parametrize("view", VIEWS)
def test_texels_are_parts_of_pixels(view: str) -> None:
    camera = VIEWS[view]
    window, to_texels = floor_window(camera)
    frame = plane_frame(SPACE.to_gpu(np.array([[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0.0]])))
    x, y = np.meshgrid(np.arange(window.pixels[0] + 1), np.arange(window.pixels[1] + 1))
    corners = to_texels.rect[:2] + 2.0 * np.stack([x, y], axis=-1)
    rng = np.random.default_rng(3)
    own = plane_frame(SPACE.to_gpu(np.column_stack([rng.uniform(-3, 3, (400, 2)), np.zeros(400)])))
    places = SPACE.to_world(own.at(to_texels.points(corners)))
    assert np.abs(places[np.isfinite(places[..., 0])][:, 2]).max() < 1e-9
    pixels = project(camera, SIZE, places.reshape(-1, 3)).reshape(places.shape[:2] + (2,))
    expected = np.stack([x, y], axis=-1) + window.low
    seen = np.isfinite(pixels[..., 0])
    if pixels[-1, 0, 1] < pixels[-2, 0, 1]:  # rows count from the bottom
        expected[..., 1] = SIZE[1] - expected[..., 1]
    assert seen.all() or view == "at the horizon"
    assert np.abs(pixels - expected)[seen].max() < 1e-4  # placements are float32
    assert np.linalg.det(to_texels.matrix) > 0.0
    assert frame.axes.shape == (2, 3)


@pytest.mark.parametrize("view", VIEWS)
def test_areas_of_texels_are_those_of_their_outlines(view: str) -> None:
    _, to_texels = floor_window(VIEWS[view])
    rng = np.random.default_rng(8)
    low, high = to_texels.rect[:2], to_texels.rect[2:]
    texel = np.floor(rng.uniform(low, high, (200, 2)))
    corner = to_texels.points(texel[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]))
    corner = corner[np.isfinite(corner).all(axis=(1, 2))]
    following = np.roll(corner, -1, axis=1)
    area = 0.5 * (corner[..., 0] * following[..., 1] - corner[..., 1] * following[..., 0]).sum(axis=1)
    middle = to_texels.points(to_texels.texels(corner).mean(axis=1))
    near = np.linalg.norm(middle, axis=1) < 4.0
    assert area[near] == pytest.approx(1.0 / to_texels.density(middle[near]), rel=0.02)


def test_there_is_none_where_it_would_be_of_no_use() -> None:
    points = np.column_stack([np.random.default_rng(1).uniform(-3, 3, (50, 2)), np.zeros(50)])
    frame = plane_frame(SPACE.to_gpu(points))

    def window(camera: Camera, largest: int = 4096) -> PictureWindow | None:
        return picture_window(camera, SPACE, frame, SPACE.to_gpu(points), np.ones(50), SIZE, 2, largest)

    assert window(SLANTED) is not None
    assert window(replace(SLANTED, target=(0.3, -12.0, 3.0))) is None  # looks away
    assert window(replace(SLANTED, position=(0, -9, 1e-3), target=(0, 0, 0))) is None  # edge-on
    assert window(SLANTED, largest=20) is None  # more pixels than that
    fewer = window(SLANTED, largest=100)
    assert fewer is not None
    assert fewer.per_pixel == 1


PERSPECTIVE = np.array([[70.0, 9.0, 0.0, 900.0], [-6.0, 60.0, 0.0, 700.0], [0.3, 0.9, 0.0, 28.0]])
"""Of a plane seen aslant: texels grow to 40 times their area across the map."""


@pytest.mark.parametrize(("size", "motion"), [(1.0, 0.0), (12.0, 6.0), (60.0, 0.0), (60.0, 6.0)])
def test_swept_polygons_in_perspective(gl, size: float, motion: float) -> None:
    """Against points of every texel, each with its own area on the receiver; the largest goes behind the camera."""
    rig = BeamRig(gl.ctx)
    matrix = np.delete(PERSPECTIVE, 2, axis=1)
    placement = placement_rows(rig.tile, PERSPECTIVE, 1.0 / np.linalg.det(matrix))
    layout = replace(rig.layout, placements=placement)
    middle = TexelMap.of(placement[0], PLANE).points(np.array([33.0, 31.0]))
    start = regular(5, middle - 0.5 * motion, size, 0.3)
    one = polygon(start, start + motion, (0.25, 0.5), slope=(0.01 / size, -0.02 / size))
    rig.atlas.clear()
    all_of(rig.splatter.steps(one, {0: PLANE}, layout, rig.tables, rig.atlas))
    drawn = rig.atlas.read_tile(rig.tile)[..., W].astype(float)

    parts, steps = (32, 1) if motion == 0.0 else (8, 64)
    at = (np.arange(64 * parts) + 0.5) / parts
    texels = np.stack(np.meshgrid(at, at), axis=-1) + (rig.tile.x, rig.tile.y)
    to_texels = TexelMap.of(placement[0], PLANE)
    points = to_texels.points(texels)
    weight = np.nan_to_num(1.0 / to_texels.density(points)) / parts**2
    weight *= np.maximum(1.0 + np.nan_to_num(points - one.centre[0]) @ one.slope[0], 0.0)
    curve = rig_curve(rig).at(0.25 + 0.25 * np.linspace(0.0, 1.0, steps + 1))[:, W]
    total = np.zeros(points.shape[:2])
    for k, power in enumerate(np.diff(curve)):
        t = (k + 0.5) / steps
        lines = one.edges[:, :4] + t * (one.edges[:, 4:] - one.edges[:, :4])
        inside = np.all(points @ lines[:, :2].T + lines[:, 2] >= 0.0, axis=-1)
        total += power * np.where(inside, weight, 0.0)
    expected = total.reshape(64, parts, 64, parts).sum(axis=(1, 3))
    assert expected.max() > 0.0
    assert drawn.sum() == pytest.approx(expected.sum(), rel=4e-3)
    # Near the horizon a texel's area changes within it, of which its middle's is taken.
    assert np.abs(drawn - expected).max() < (0.06 if size > 50.0 else 0.03) * expected.max()


def rig_curve(rig: BeamRig):
    from spectrasplat.model.optics.spectral_tables import cumulative

    return cumulative(rig.axis, rig.light, rig.channels.cell_weights())


@pytest.mark.parametrize("samples", [1, 4, 8, 16, 64])
def test_a_pixel_shows_its_own_texels_only(gl, samples: int) -> None:
    """Noise, texel by texel; a share of a neighbour's would be seen."""
    camera_pass = opened_camera_pass(gl, [floor()], camera=SLANTED)
    space = camera_pass.scene.space
    points = np.column_stack([np.random.default_rng(3).uniform(-2, 2, (400, 2)), np.zeros(400)])
    frame = plane_frame(space.to_gpu(points))
    window = picture_window(SLANTED, space, frame, space.to_gpu(points), np.ones(400), SIZE, 2, 4096)
    assert window is not None
    width, height = window.texels
    tiles, size = pack([(width, height)])
    placement = placement_rows(tiles[0], window.texel_rows(1), window.texel_area(frame, 1) / space.scale**2)
    x, y, x1, y1 = tiles[0].rect
    energy = np.random.default_rng(9).exponential(size=(height, width)) ** 2
    to_texels = TexelMap.of(placement[0], frame)
    centres = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1) + 0.5 + (x, y)
    area = 1.0 / (to_texels.density(to_texels.points(centres)) * space.scale**2)
    texels = np.zeros((size[1], size[0], 4), np.float32)
    texels[y:y1, x:x1] = white_texels(energy * area)
    receivers = RECEIVER.zeros(1)
    receivers["reflectance_rgb"] = REFLECTANCE
    maps = CausticMaps(
        [gl.ctx.texture(size, 4, texels.tobytes(), dtype="f4")],
        gl.ctx.buffer(receivers.tobytes()),
        gl.ctx.buffer(placement.tobytes()),
        1.0,
    )
    camera_pass.run(SLANTED, *SIZE, samples, maps=maps)
    rgb = camera_pass.read_rgb()[..., 1]
    released(camera_pass)
    low, high = window.low, window.high
    mean = energy.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))
    below = project(SLANTED, SIZE, space.to_world(frame.at(to_texels.points(centres[[0, -1], 0]))))[:, 1]
    if below[0] > below[1]:  # rows count from the bottom
        mean, low, high = mean[::-1], SIZE[1] - high, SIZE[1] - low
        low[0], high[0] = window.low[0], window.high[0]
    shown = rgb[low[1] : high[1], low[0] : high[0]] * np.pi / REFLECTANCE
    # Perspective within a pixel: its texels' areas differ by a few parts in a hundred.
    assert np.abs(shown / mean - 1.0).max() < 0.04
    assert placement.dtype == PLACEMENT.dtype


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["prism", "ball"])
def test_pictures_are_those_of_fine_maps_along_the_plane(gl, monkeypatch: pytest.MonkeyPatch, scene: str) -> None:
    """Beams, and photons whose footprints are bent by the view; blurred over blocks, since filters differ."""
    settings = RenderSettings(width=96, height=54, photons=60_000, spp=4, layer="caustic", seed=5)
    loaded = load_scene(assets_dir() / "scenes" / f"{scene}.toml")
    pictures = []
    for still in (map_layout.STILL, map_layout.Fineness(6.0, 3072, 1024, 0)):
        monkeypatch.setattr("spectrasplat.render.map_fit.STILL", still)
        monkeypatch.setattr("spectrasplat.render.map_fit.MapFit.fineness_for", lambda self, targets, still=still: still)
        pictures.append(np.asarray(render(loaded, settings, context=gl).rgb, float))
    blocks = [p.reshape(9, 6, 16, 6, 3).mean(axis=(1, 3)) for p in pictures]
    assert blocks[0].sum() == pytest.approx(blocks[1].sum(), rel=5e-3)
    assert np.abs(blocks[0] - blocks[1]).max() < 0.02 * blocks[1].max()


def test_a_coarse_window_takes_what_lies_outside(gl) -> None:
    """Polygons across the picture's border and behind the camera are in the coarse map, all of them."""
    rig = BeamRig(gl.ctx)
    tiles, size = pack([(64, 64), (256, 256)])
    fine = placement_rows(tiles[0], PERSPECTIVE, 1.0 / np.linalg.det(np.delete(PERSPECTIVE, 2, axis=1)))
    coarse = placement_rows(tiles[1], np.array([[1.0, 0.0, 0.0, 128.0], [0.0, 1.0, 0.0, 128.0]]), 1.0)
    fine["next"] = 1
    placements = np.concatenate([fine, coarse])
    layout = MapLayout(size, placements, RECEIVER.zeros(1), {0: tiles}, {}, {}, ())
    atlas = MapAtlas(gl.ctx, size, placements)
    inside = TexelMap.of(fine[0], PLANE).points(np.array([32.0, 32.0]))
    for centre, radius in ((inside, 60.0), (np.array([0.0, -80.0]), 20.0)):
        atlas.clear()
        all_of(rig.splatter.steps(polygon(regular(6, centre, radius, 0.2)), {0: PLANE}, layout, rig.tables, atlas))
        x0, y0, x1, y1 = tiles[1].rect
        held = atlas.read_total()[y0:y1, x0:x1, W].sum() / rig.light.power_w()
        assert held == pytest.approx(1.5 * np.sin(np.pi / 3.0) * 2.0 * radius**2, rel=2e-3)
    atlas.release()
