"""Veiling glare: energy, its fall-off, the same halo at every size, and which files have it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.glare import with_glare
from spectrasplat.base.image_io import read_image, write_image
from spectrasplat.commands.options import parse_glare
from spectrasplat.model.io.scene_file import load_scene


def spot(height: int) -> np.ndarray:
    """One unit of light in the middle of a black picture, whatever its size."""
    rgb = np.zeros((height, height, 3), np.float32)
    rgb[height // 2, height // 2] = height**2
    return rgb


def test_nothing_scattered_is_the_picture_itself() -> None:
    rgb = spot(64)
    assert with_glare(rgb, 0.0) is rgb


def test_energy_is_kept_and_falls_off_as_the_square() -> None:
    rgb = spot(512)
    shown = with_glare(rgb, 0.1)
    assert shown.sum() == pytest.approx(rgb.sum(), rel=0.01)
    assert shown.min() > -1e-6 * shown.max()
    near, far = shown[256, 256 + 16, 0], shown[256, 256 + 32, 0]
    assert 3.0 < near / far < 5.0  # 1/θ²: 4


def test_a_halo_is_as_wide_at_every_size() -> None:
    small, large = with_glare(spot(128), 0.1), with_glare(spot(512), 0.1)
    for share in (0.0625, 0.125, 0.25):
        of_small = small[64, 64 + int(share * 128), 1]
        assert of_small == pytest.approx(large[256, 256 + int(share * 512), 1], rel=0.05)


def test_light_beyond_the_border_does_not_come_back() -> None:
    rgb = np.zeros((64, 96, 3), np.float32)
    rgb[0, 0] = 1.0
    shown = with_glare(rgb, 0.5)
    assert shown[-1, -1].max() < 1e-2 * shown[8, 8].max()


def test_only_pictures_to_look_at_have_it(tmp_path: Path) -> None:
    rgb = 0.1 + 1e-3 * spot(48)
    for name in ("a.png", "a.npy", "a.exr"):
        write_image(tmp_path / name, rgb)
        write_image(tmp_path / f"glare_{name}", rgb, glare=0.2)
        same = np.array_equal(read_image(tmp_path / name).rgb, read_image(tmp_path / f"glare_{name}").rgb)
        assert same == (name != "a.png")


def test_what_is_no_share_is_refused(tmp_path: Path) -> None:
    assert parse_glare("0.03") == 0.03
    with pytest.raises(UserError, match="--glare 2 is out of range"):
        parse_glare("2")
    scene = tmp_path / "a.toml"
    scene.write_text('[[objects]]\nshape = "sphere"\n[render]\nglare = 0.7\n')
    with pytest.raises(UserError, match="glare"):
        load_scene(scene)
    scene.write_text('[[objects]]\nshape = "sphere"\n[render]\nglare = 0.02\n')
    assert load_scene(scene).render.glare == 0.02
