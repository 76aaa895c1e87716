"""Caustic maps as the camera's pass looks them up: windows, charts, the pixel's filter, layers and channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from spectrasplat.gpu.map_channels import MapChannels
from spectrasplat.gpu.records import NONE, PLACEMENT, RECEIVER
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import AreaLight, PointLight
from spectrasplat.model.optics import glass, spectrum
from spectrasplat.model.optics.colorimetry import xyz_to_rgb709
from spectrasplat.model.scene import Dielectric, Diffuse, SceneObject

from tests.gpu.camera_rig import (
    ABOVE,
    REFLECTANCE,
    WHITE,
    at,
    flat_maps,
    floor,
    floor_points,
    horizontal,
    opened_camera_pass,
    released,
    render,
    white_texels,
)

DOWNWARD = replace(ABOVE, position=(0, 0, -0.5), target=(0, 0, -1))
"""From below the floor, away from it."""


@pytest.mark.parametrize("layer", ["beauty", "caustic"])
def test_nested_windows_show_the_finest_map_that_covers_a_place(gl, layer):
    camera_pass = opened_camera_pass(
        gl,
        [floor(), SceneObject("far glass", primitives.box((1, 1, 1)), Dielectric(glass.constant(1.5)), at(40, 3, 0))],
        layer=layer,
    )
    rng = np.random.default_rng(5)
    lumens = rng.uniform(1, 2, (16, 24))
    # A fine window of 8² texels over [-0.5, 0.5]², a coarse one of 6² over [-1.5, 1.5]².
    maps = flat_maps(
        gl,
        camera_pass.scene,
        [(-0.5, -0.5, 1.0, 1, 2, 8), (-1.5, -1.5, 3.0, 12, 5, 6)],
        white_texels(lumens),
        scale=0.5,
    )
    size = (64, 64)
    camera_pass.run(ABOVE, *size, 1, maps=maps)
    rgb = camera_pass.read_rgb()
    x, y = np.moveaxis(floor_points(size, ABOVE)[..., :2], -1, 0)

    def bilinear(u, v, ax, ay, count):
        u, v = np.clip(u - 0.5, 0, count - 1), np.clip(v - 0.5, 0, count - 1)
        i, j = np.minimum(u.astype(int), count - 2), np.minimum(v.astype(int), count - 2)
        tile = lumens[ay : ay + count, ax : ax + count]
        fu, fv = u - i, v - j
        return (tile[j, i] * (1 - fu) + tile[j, i + 1] * fu) * (1 - fv) + (
            tile[j + 1, i] * (1 - fu) + tile[j + 1, i + 1] * fu
        ) * fv

    fine = bilinear((x + 0.5) * 8, (y + 0.5) * 8, 1, 2, 8) * 64
    coarse = bilinear((x + 1.5) * 2, (y + 1.5) * 2, 12, 5, 6) * 4
    inside_fine, inside = np.maximum(abs(x), abs(y)) < 0.5, np.maximum(abs(x), abs(y)) < 1.5
    expected = 0.5 * REFLECTANCE / np.pi * np.where(inside_fine, fine, np.where(inside, coarse, 0.0))
    # Clamping the coordinate or the texels is the same thing at the border; 1e-3 is for half-texel rounding.
    assert rgb[..., 1] == pytest.approx(expected, rel=1e-3)


def test_charts_have_a_placement_a_triangle(gl):
    """A receiver of two triangles whose charts lie apart in the atlas, after another object's triangles."""
    blocker = horizontal(50, 51, 50, 51, 1, Diffuse((0, 0, 0)), "elsewhere")
    camera_pass = opened_camera_pass(
        gl, [blocker, horizontal(-2, 2, -2, 2, 0, Diffuse((REFLECTANCE,) * 3))], charts=True
    )
    lumens = np.zeros((16, 40))
    lumens[2:10, 2:10], lumens[5:13, 20:28] = 1.0, 3.0
    maps = flat_maps(gl, camera_pass.scene, [(-2, -2, 4.0, 2, 2, 8), (-2, -2, 4.0, 20, 5, 8)], white_texels(lumens))
    placements = np.frombuffer(maps.placements.read(), PLACEMENT.dtype).copy()
    placements["kind"], placements["next"] = 1, NONE
    maps.placements.write(placements.tobytes())
    receivers = RECEIVER.zeros(4)
    receivers["placement"] = NONE, NONE, 0, NONE
    receivers["kind"][2], receivers["first_triangle"][2] = 1, 2
    maps = replace(maps, receivers=gl.ctx.buffer(receivers.tobytes()))
    camera_pass.run(ABOVE, 32, 32, 1, maps=maps)
    x, y = np.moveaxis(floor_points((32, 32), ABOVE)[..., :2], -1, 0)
    expected = REFLECTANCE / np.pi * np.where(y < x, 1.0, 3.0) * 4
    off_diagonal = np.abs(x - y) > 1e-6
    assert camera_pass.read_rgb()[..., 1][off_diagonal] == pytest.approx(expected[off_diagonal], rel=1e-5)


def test_small_texels_are_averaged_by_the_pixel_and_keep_their_energy(gl):
    camera_pass = opened_camera_pass(gl, [floor()])
    lumens = np.zeros((256, 256))
    lumens[100, 37] = 3.0  # one focus
    maps = flat_maps(gl, camera_pass.scene, [(-2, -2, 4.0, 0, 0, 256)], white_texels(lumens))
    camera_pass.run(ABOVE, 32, 32, 64, maps=maps)
    rgb = camera_pass.read_rgb()[..., 1]
    pixel_area = (4 / 32) ** 2
    # The samples' shares of the pixel do not quite tile it: one texel of 64 is weighed to a tenth.
    assert rgb.sum() * pixel_area * np.pi / REFLECTANCE == pytest.approx(3.0, rel=0.1)
    assert np.count_nonzero(rgb) == 1 and rgb[31 - 100 // 8, 37 // 8] > 0


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_few_samples_fill_the_pixel(gl, samples: int) -> None:
    """Pixels of 2 by 2 texels: a bright one counts once, wherever in its pixel it lies (strips of a third meet it in
    parts)."""
    camera_pass = opened_camera_pass(gl, [floor()])
    for x, y in ((37, 40), (36, 40), (37, 41), (36, 41)):
        lumens = np.zeros((64, 64))
        lumens[y, x] = 3.0
        camera_pass.run(
            ABOVE,
            32,
            32,
            samples,
            maps=flat_maps(gl, camera_pass.scene, [(-2, -2, 4.0, 0, 0, 64)], white_texels(lumens)),
        )
        rgb = camera_pass.read_rgb()[..., 1]
        assert rgb.sum() * (4 / 32) ** 2 * np.pi / REFLECTANCE == pytest.approx(3.0, rel=0.01), (x, y)
    released(camera_pass)


def test_samples_weigh_texels_by_their_share_of_the_pixel(gl):
    """Pixels of 2.3 texels, every texel different: 16 samples give the box-filtered map to 6 %, its mean to half a per
    cent."""
    camera_pass = opened_camera_pass(gl, [floor()])
    rng = np.random.default_rng(3)
    lumens = rng.uniform(0.0, 1.0, (74, 74)) ** 4
    maps = flat_maps(gl, camera_pass.scene, [(-2, -2, 4.0, 0, 0, 74)], white_texels(lumens))
    camera_pass.run(ABOVE, 32, 32, 16, maps=maps)
    edges = np.linspace(0, 74, 33)
    share = np.clip(
        np.minimum(edges[1:, None], np.arange(1, 75)) - np.maximum(edges[:-1, None], np.arange(74)), 0, None
    )
    expected = (share @ lumens @ share.T)[::-1] / (4 / 32) ** 2 * REFLECTANCE / np.pi
    got = camera_pass.read_rgb()[..., 1]
    assert np.sqrt(np.mean((got - expected) ** 2)) < 0.06 * expected.mean()
    assert got.mean() == pytest.approx(expected.mean(), rel=5e-3)


def test_spectra_of_less_light_than_none_keep_the_colour_of_the_map(gl):
    """Where splats cancel, some channels of a texel's spectrum are negative and their sum is anything. Shares of
    it that were quotients of such sums put 1e30 into `wine_glass`."""
    tents = MapChannels(tents_nm=tuple(np.linspace(400.0, 700.0, 4)))
    pane = SceneObject("pane", primitives.box((9.0, 9.0, 0.5)), Dielectric(glass.from_abbe(1.0005, 20.0)), at(0, 0, 1))
    camera_pass = opened_camera_pass(gl, [floor(), pane], channels=tents)
    pictures = []
    for watts in ([0.01] * 4, [0.01, -0.08, 0.03, 0.02], [0.01, -0.02, 0.0103, 0.0], [-0.01] * 4):
        texels = np.concatenate([white_texels(np.full((4, 4), 3.0)), np.full((4, 4, 4), watts)], axis=-1)
        maps = flat_maps(gl, camera_pass.scene, [(-2, -2, 4.0, 0, 0, 4)], texels)
        camera_pass.run(ABOVE, 16, 16, 2, maps=maps)
        pictures.append(camera_pass.read_rgb()[4:12, 4:12])
    released(camera_pass)
    assert pictures[0].mean() == pytest.approx(3.0 * REFLECTANCE / np.pi, rel=0.01)
    for picture in pictures[1:]:
        assert picture == pytest.approx(pictures[0], rel=0.01)


@pytest.mark.parametrize("shown", ["background", "light"])
def test_a_bin_is_shown_in_its_own_colour(gl, shown):
    """White light cut into 32 bins is still white: each bin's colour is that of its own waves."""
    bins = MapChannels(tuple(np.linspace(380, 780, 33)))
    lamp = AreaLight("panel", WHITE, position=(0, 0, -2), direction=(0, 0, 1), radius=9.0)
    lights, background = ([lamp], 0.0) if shown == "light" else ([], 1000.0)
    rgb = render(gl, [floor()], lights, camera=DOWNWARD, background=(background,) * 3, channels=bins)
    assert rgb[12, 16] == pytest.approx([1000, 1000, 1000], rel=0.02)


def test_spectral_reflectance_class_acts_on_direct_light(gl):
    red_only = np.where(np.arange(380, 781) > 600, 1.0, 0.0)
    item = replace(floor(), material=Diffuse(reflectance=red_only))
    camera_pass = opened_camera_pass(
        gl, [item], [PointLight("lamp", WHITE, position=(0, 0, 1.5))], reflectances=(None, red_only)
    )
    maps = flat_maps(gl, camera_pass.scene, [(-2, -2, 4.0, 0, 0, 4)], white_texels(np.zeros((4, 4))))
    receivers = RECEIVER.zeros(1)
    receivers["reflectance_class"] = 1
    maps.receivers.write(receivers.tobytes())
    camera_pass.run(ABOVE, 17, 17, 1, maps=maps)
    expected = xyz_to_rgb709(spectrum.Spectrum(WHITE.density * red_only).xyz()) / np.pi / 1.5**2
    assert expected[0] > 20 * expected[2] > 0 or expected[2] <= 0
    assert camera_pass.read_rgb()[8, 8] == pytest.approx(expected, rel=1e-3)
