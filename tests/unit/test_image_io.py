"""Picture files: what is written comes back, in the layout other programs expect."""

from __future__ import annotations

import numpy as np
import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import channel_name, check_suffix, read_image, write_image

pytestmark = pytest.mark.core


@pytest.fixture
def picture() -> np.ndarray:
    rng = np.random.default_rng(7)
    return rng.normal(0.5, 0.8, (7, 5, 3)).astype(np.float32)


@pytest.mark.parametrize("suffix", [".exr", ".npy", ".EXR"])
def test_linear_formats_keep_every_bit_and_negatives(tmp_path, picture, suffix):
    assert picture.min() < 0
    write_image(tmp_path / f"a{suffix}", picture)
    back = read_image(tmp_path / f"a{suffix}")
    assert back.rgb.dtype == np.float32
    assert np.array_equal(back.rgb, picture)
    assert back.spectral is None


def test_spectral_exr_has_the_published_layout(tmp_path, picture):
    import OpenEXR

    edges = np.array([400.0, 500.0, 555.0, 700.0])
    spectral = np.random.default_rng(1).random((7, 5, 3)).astype(np.float32)
    path = tmp_path / "a.exr"
    write_image(path, picture, spectral=spectral, bin_edges_nm=edges)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert set(file.channels()) == {"R", "G", "B", "S0.450,000000nm", "S0.527,500000nm", "S0.627,500000nm"}
        assert np.array_equal(file.channels()["S0.527,500000nm"].pixels, spectral[:, :, 1])
        assert file.header()["spectralLayoutVersion"] == "1.0"
        assert file.header()["emissiveUnits"] == "W.m^-2.sr^-1"
        assert file.header()["spectralBinEdgesNm"] == "400 500 555 700"
    back = read_image(path)
    assert np.array_equal(back.spectral, spectral)
    assert np.array_equal(back.wavelengths_nm, [450.0, 527.5, 627.5])
    assert np.array_equal(back.rgb, picture)


def test_channel_names_use_a_decimal_comma_after_the_stokes_index():
    assert channel_name(550) == "S0.550,000000nm"
    assert channel_name(1234.5678) == "S0.1234,567800nm"


def test_spectral_channels_must_match_the_picture(tmp_path, picture):
    with pytest.raises(ValueError, match="spectral"):
        write_image(tmp_path / "a.exr", picture, spectral=np.zeros((7, 5, 3)), bin_edges_nm=np.array([400.0, 500.0]))
    assert list(tmp_path.iterdir()) == []


def test_png_row_order_exposure_and_metadata(tmp_path):
    from PIL import Image

    rgb = np.full((4, 3, 3), 0.18, np.float32)
    rgb[0] = 0.0  # the top row
    write_image(tmp_path / "a.png", rgb)
    with Image.open(tmp_path / "a.png") as image:
        pixels = np.asarray(image)
        assert image.text["Exposure"].endswith(" EV")
    assert pixels.shape == (4, 3, 3)
    assert np.all(pixels[0] == 0)
    assert np.all(pixels[1:] == 118)  # sRGB of middle grey 0.18: 0.4613 x 255
    write_image(tmp_path / "b.png", rgb, exposure_ev=1.0)
    assert np.allclose(read_image(tmp_path / "b.png").rgb[1:], 0.36, atol=0.004)


@pytest.mark.parametrize("name", ["a.gif", "a", "a.png.txt"])
def test_unknown_suffix_names_the_known_ones(tmp_path, picture, name):
    with pytest.raises(UserError, match=r"\.png, .*\.exr, \.npy"):
        write_image(tmp_path / name, picture)
    with pytest.raises(UserError, match=r"a"):
        check_suffix(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_an_exr_that_cannot_be_written_is_a_user_error(tmp_path, picture, monkeypatch):
    import OpenEXR

    def refuse(self, name):
        raise RuntimeError(f'Cannot open image file "{name}". No space left on device.')

    monkeypatch.setattr(OpenEXR.File, "write", refuse)
    with pytest.raises(UserError, match="cannot write"):
        write_image(tmp_path / "a.exr", picture)
    assert list(tmp_path.iterdir()) == []


def test_empty_pictures_are_refused(tmp_path):
    with pytest.raises(ValueError, match="not empty"):
        write_image(tmp_path / "a.png", np.zeros((0, 4, 3)))
