"""A still's survey: what looks the same all over a pixel and round it is looked at a few times only."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.model.geometry import primitives
from spectrasplat.model.lights import DirectionalLight
from spectrasplat.model.optics import glass
from spectrasplat.model.scene import Camera, Dielectric, Diffuse, SceneObject
from spectrasplat.passes import camera as camera_module
from spectrasplat.passes import listed_pixels

from tests.gpu.camera_rig import WHITE, floor, horizontal, opened_camera_pass, released

SIZE = (48, 36)
CAMERA = Camera(
    position=(0.4, -0.3, 10), target=(0.4, -0.3, 0), up=(0.1, 1, 0), kind="orthographic", vertical_extent=4.0
)
SUN = DirectionalLight("sun", WHITE, (0.4, 0.2, -1.0), 8.0)
IS_EVEN = 4
SHARP = DirectionalLight("sharp", WHITE, (-0.3, 0.2, -1.0), 0.0)


def room():
    """A dispersing cube and a dark shelf over a floor; the shelf has hard shadows and soft ones."""
    cube = SceneObject("cube", primitives.box((0.8, 0.8, 0.8)), Dielectric(glass.from_abbe(1.78, 25.0)))
    shelf = horizontal(0.9, 1.7, -1.3, -0.4, 0.6, Diffuse((0.1, 0.1, 0.1)), "shelf")
    # 0.27 pixels wide.
    return [floor(), cube, shelf, horizontal(-1.9, 1.9, -1.52, -1.49, 0.9, Diffuse((0.0, 0.0, 0.0)), "wire")]


def picture(gl, surveys: bool, monkeypatch, samples=16, stop_after=None):
    """Linear picture, the keys of even pixels, and samples taken."""
    monkeypatch.setattr(camera_module, "SURVEY_FROM", 4 if surveys else 1 << 20)
    camera_pass = opened_camera_pass(gl, room(), [SUN, SHARP], camera=CAMERA)
    taken = 0

    for _ in camera_pass.samples(CAMERA, *SIZE, samples):
        if stop_after is not None and camera_pass.samples_taken >= stop_after and camera_pass.is_even:
            break
    rgb, taken = camera_pass.read_rgb(), camera_pass.samples_taken
    keys = None
    if surveys:
        keys = even_keys(camera_pass)
    released(camera_pass)
    return rgb, keys, taken


def surveyed_keys(camera_pass):
    """uint32 (H, W)."""
    survey_at = len(listed_pixels._NOTHING) + camera_pass.listed.room
    words = np.frombuffer(camera_pass.listed._list.read(), "u4")[survey_at:]
    return words[: 4 * SIZE[0] * SIZE[1]].reshape(SIZE[1], SIZE[0], 4)[..., 0]


def even_keys(camera_pass):
    """The same, 0 where a pixel is not even."""
    keys = surveyed_keys(camera_pass)
    return np.where(keys & IS_EVEN, keys, 0)


@pytest.fixture(scope="module")
def both(gl):
    """Without and with a survey."""
    with pytest.MonkeyPatch.context() as patch:
        plain, _, _ = picture(gl, False, patch)
        surveyed, keys, _ = picture(gl, True, patch)
    return plain, surveyed, keys


def test_what_is_even_is_left_alone_and_all_else_is_as_it_was(both):
    plain, surveyed, keys = both
    spared = keys != 0
    assert 0.5 < spared.mean() < 0.95
    assert np.array_equal(plain[~spared], surveyed[~spared])  # outlines, shadows' edges and the glass's rim
    seen = spared & (keys & 3 == 1)
    assert surveyed[seen] == pytest.approx(plain[seen], rel=1e-2)  # eight looks and sixty-four in a penumbra's lattice
    assert np.quantile(np.abs(surveyed[seen] / plain[seen] - 1.0), 0.99) < 2e-3
    glass_inside = spared & (keys & 3 == 2)
    assert glass_inside.sum() > 10
    assert surveyed[glass_inside].mean() == pytest.approx(plain[glass_inside].mean(), rel=0.02)


def test_a_wire_thinner_than_a_pixel_is_not_lost(both):
    plain, surveyed, _ = both
    assert plain[10:-10].mean(axis=(1, 2)).min() < 0.99 * plain[0].mean()
    assert surveyed.mean(axis=(1, 2)) == pytest.approx(plain.mean(axis=(1, 2)), rel=3e-3)


def test_a_stop_leaves_a_picture_as_bright(gl, monkeypatch):
    whole, _, _ = picture(gl, True, monkeypatch)
    stopped, keys, taken = picture(gl, True, monkeypatch, stop_after=5)
    assert 5 <= taken < 16
    seen = keys & 3 == 1
    assert stopped[seen] == pytest.approx(whole[seen], rel=1e-5)


def test_a_pixel_is_even_among_eight_like_it(gl, monkeypatch):
    monkeypatch.setattr(camera_module, "SURVEY_FROM", 4)
    camera_pass = opened_camera_pass(gl, room(), [SUN, SHARP], camera=CAMERA)
    camera_pass.run(CAMERA, *SIZE, 4)
    marked = surveyed_keys(camera_pass)
    released(camera_pass)
    keys = marked & ~np.uint32(IS_EVEN)
    padded, alike = np.pad(keys, 1, mode="edge"), keys != 0
    for row, column in np.ndindex(3, 3):
        alike &= padded[row : row + SIZE[1], column : column + SIZE[0]] == keys
    assert 0.1 < alike.mean() < 0.95
    assert np.array_equal(marked & IS_EVEN != 0, alike)


def test_few_samples_and_later_ones_have_no_survey(gl, monkeypatch):
    """A second launch, of maps that may have changed, looks everywhere."""
    monkeypatch.setattr(camera_module, "SURVEY_FROM", 4)
    camera_pass = opened_camera_pass(gl, room(), [SUN, SHARP], camera=CAMERA)
    camera_pass.run(CAMERA, *SIZE, 2)
    assert not camera_pass.listed._surveyed
    camera_pass.run(CAMERA, *SIZE, 8, sample_offset=2)
    assert not camera_pass.listed._surveyed
    released(camera_pass)
