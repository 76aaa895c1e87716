"""Picture files: what each format holds comes out linear and whole, and what is damaged is refused in one sentence."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from spectrasplat.base.errors import UserError
from spectrasplat.base.image_io import write_image
from spectrasplat.model.io.picture_files import read_picture

from tests.unit.picture_bytes import HEADER, hdr_file, new_rows, old_rows, radiance_of, random_rgbe


def write(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(UserError) as caught:
        read_picture(path)
    sentence = str(caught.value)
    assert "\n" not in sentence and path.name in sentence
    return sentence


# -- Radiance -----------------------------------------------------------------------------


@pytest.mark.parametrize("encode", [new_rows, old_rows, lambda rgbe: rgbe.tobytes()], ids=["new", "old", "flat"])
@pytest.mark.parametrize("size", [(64, 32), (700, 3), (5, 4)])
def test_every_coding_gives_the_same_pixels(tmp_path: Path, encode, size: tuple[int, int]) -> None:
    if encode is new_rows and size[0] < 8:
        pytest.skip("new-style rows have at least eight pixels")
    rgbe = random_rgbe(*size)
    rgb, notes = read_picture(write(tmp_path / "a.hdr", hdr_file(encode(rgbe), *size)))
    assert rgb.dtype == np.float32 and notes == ()
    np.testing.assert_array_equal(rgb, radiance_of(rgbe))


def test_a_sun_of_one_pixel_survives_beside_the_dark(tmp_path: Path) -> None:
    rgbe = np.zeros((4, 8, 4), np.uint8)
    rgbe[..., :] = (128, 128, 128, 110)
    rgbe[1, 5] = (200, 180, 160, 150)
    rgbe[2, 2] = (255, 255, 255, 255)
    rgbe[3, 3] = (7, 8, 9, 0)
    rgb, _ = read_picture(write(tmp_path / "sun.pic", hdr_file(rgbe.tobytes(), 8, 4)))
    np.testing.assert_allclose(rgb[1, 5], np.array([200, 180, 160]) * 2.0**14, rtol=1e-7)
    np.testing.assert_allclose(rgb[0, 0], 2.0**-19, rtol=1e-7)
    assert rgb[2, 2, 0] == np.float32(255.0 * 2.0**119)
    assert (rgb[3, 3] == 0.0).all()


@pytest.mark.parametrize(
    ("lines", "divisor", "note"),
    [
        (b"EXPOSURE=2.0\nSOFTWARE=x\nEXPOSURE= 4\nVIEW=-vtv\n", 8.0, None),
        (b"COLORCORR= 2 1 0.5\nEXPOSURE=2\n", (4.0, 2.0, 1.0), None),
        (b"PRIMARIES=0.64 0.33 0.3 0.6 0.15 0.06 0.3127 0.329\n", 1.0, None),
        (b"EXPOSURE=0\n", 1.0, "its line EXPOSURE is not a number above 0"),
        (b"EXPOSURE=bright\nEXPOSURE=2\n", 2.0, "its line EXPOSURE"),
    ],
)
def test_what_a_header_says(tmp_path: Path, lines: bytes, divisor: object, note: str | None) -> None:
    rgbe = random_rgbe(16, 2)
    rgb, notes = read_picture(write(tmp_path / "a.hdr", hdr_file(new_rows(rgbe), 16, 2, HEADER + lines)))
    np.testing.assert_allclose(rgb, radiance_of(rgbe) / np.array(divisor), rtol=1e-7)
    assert note in notes[0] if note else notes == ()


@pytest.mark.parametrize("rows", ["-Y", "+Y"])
@pytest.mark.parametrize("columns", ["+X", "-X"])
def test_pixels_in_any_order(tmp_path: Path, rows: str, columns: str) -> None:
    rgbe = random_rgbe(16, 9)
    stored = rgbe[:: 1 if rows == "-Y" else -1, :: 1 if columns == "+X" else -1]
    for content in (
        hdr_file(new_rows(stored), 16, 9, axes=(rows, columns)),
        hdr_file(new_rows(stored.swapaxes(0, 1)), 9, 16, axes=(columns, rows)),
    ):
        np.testing.assert_array_equal(read_picture(write(tmp_path / "a.hdr", content))[0], radiance_of(rgbe))


# Expected: the published matrices of ACEScg (AMPAS S-2014-004, Bradford) and of Rec.2020 (ITU-R BT.2087).
ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)


@pytest.mark.parametrize(
    ("chromaticities", "stored", "expected"),
    [
        (ACESCG, (0.1, 0.8, 0.1), (-0.335, 0.899, 0.010)),
        (ACESCG, (1.0, 1.0, 1.0), (1.0, 1.0, 1.0)),
        (REC2020, (0.0, 1.0, 0.0), (-0.5876, 1.1329, -0.1006)),
        ((1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3), (0.9505, 1.0, 1.089), (1.0, 1.0, 1.0)),
    ],
)
def test_other_primaries(tmp_path: Path, chromaticities, stored, expected) -> None:
    channels = {name: np.full((4, 8), value) for name, value in zip("RGB", stored, strict=True)}
    exr(tmp_path / "a.exr", channels, chromaticities=chromaticities)
    rgb, notes = read_picture(tmp_path / "a.exr")
    assert rgb[1, 2] == pytest.approx(expected, abs=2e-3) and "converted to Rec.709" in notes[0]
    codes = np.array([*(np.array(stored) * 128), 129]).astype(np.uint8)
    line = b"PRIMARIES=" + " ".join(map(str, chromaticities)).encode() + b"\n"
    rgb, notes = read_picture(write(tmp_path / "a.hdr", hdr_file(codes.tobytes() * 2, 2, 1, HEADER + line)))
    assert rgb[0, 0] == pytest.approx(expected, abs=0.05) and "converted to Rec.709" in notes[0]


def exr(path: Path, channels: dict[str, np.ndarray], **header) -> None:
    """An OpenEXR file of half floats; channels "part|name" go into parts of their own."""
    import OpenEXR

    parts: dict[str, dict[str, np.ndarray]] = {}
    for name, values in channels.items():
        part, _, channel = name.rpartition("|")
        parts.setdefault(part, {})[channel] = values.astype(np.float16)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header
    held = [OpenEXR.Part(dict(header), pixels, name) for name, pixels in parts.items()]
    with OpenEXR.File(held) if len(held) > 1 else OpenEXR.File(header, parts[next(iter(parts))]) as file:
        file.write(str(path))


def layer(name: str, value: float, letters: str = "RGB") -> dict[str, np.ndarray]:
    return {f"{name}{letter}": np.full((4, 8), value) for letter in letters}


COMBINED, DEPTH = layer("ViewLayer.Combined.", 0.5, "RGBA"), layer("ViewLayer.Depth.", 9.0, "Z")
NORMAL = layer("ViewLayer.Normal.", 0.1, "XYZ")


@pytest.mark.parametrize(
    ("channels", "wanted", "said"),
    [
        (COMBINED | DEPTH | NORMAL, "", ""),
        (COMBINED | layer("ViewLayer.Diffuse.", 2.0), "", "'ViewLayer.Combined' was taken"),
        (COMBINED | layer("Other.Combined.", 2.0), "viewlayer.combined", ""),
        (COMBINED | layer("ViewLayer.Diffuse.", 2.0), "Combined", ""),
        (layer("", 0.5) | COMBINED | layer("diffuse.", 2.0), "", ""),
        (layer("rgba|", 0.5) | layer("depth|", 3.0, "Z"), "", ""),
        (layer("left|", 0.5) | layer("right|", 3.0), "left", ""),
        (layer("", 0.5, "Y"), "", "luminance only"),
        (layer("", 0.5, "rgb"), "", ""),
        (COMBINED | layer("Other.Combined.", 2.0), "", "error: name one of 'Other.Combined', 'ViewLayer.Combined'"),
        (layer("a|", 0.5) | layer("b|", 3.0), "", "error: name one of 'a', 'b', as in \"a.exr:b\""),
        (COMBINED, "Diffuse", "error: no such layer; name one of 'ViewLayer.Combined'"),
        (DEPTH | NORMAL, "", "error: holds no colours, only the channels ViewLayer.Depth.Z, ViewLayer.Normal.X"),
    ],
)
def test_layers(tmp_path: Path, channels: dict[str, np.ndarray], wanted: str, said: str) -> None:
    exr(tmp_path / "a.exr", channels)
    name = f"{tmp_path / 'a.exr'}:{wanted}" if wanted else tmp_path / "a.exr"
    if said.startswith("error: "):
        with pytest.raises(UserError, match=re.escape(said.removeprefix("error: "))):
            read_picture(name)
        return
    rgb, notes = read_picture(name)
    assert rgb.shape == (4, 8, 3) and (rgb == 0.5).all()
    assert said in " ".join(notes) and len(notes) == bool(said)


def test_what_is_cropped_keeps_its_place(tmp_path: Path) -> None:
    window = (np.array([-2, 1], np.int32), np.array([7, 6], np.int32))
    exr(tmp_path / "a.exr", layer("", 0.5), displayWindow=window, whiteLuminance=100.0)
    rgb, notes = read_picture(tmp_path / "a.exr")
    assert rgb.shape == (6, 10, 3) and (rgb[:3, 2:] == 0.5).all() and rgb.sum() == 0.5 * 3 * 24
    assert "is cropped" in notes[0] and "intensity = 100" in notes[1]


@pytest.mark.parametrize("encode", [new_rows, old_rows, lambda rgbe: rgbe.tobytes()], ids=["new", "old", "flat"])
def test_a_truncated_file_is_told_with_its_row(tmp_path: Path, encode) -> None:
    whole = hdr_file(encode(random_rgbe(40, 20)), 40, 20)
    rows = set()
    for keep in np.linspace(len(HEADER) + 20, len(whole) - 1, 25).astype(int):
        sentence = refusal(write(tmp_path / "cut.hdr", whole[:keep]))
        assert "the file ends in row" in sentence and "of 20; copy or export it again" in sentence
        rows.add(sentence)
    assert len(rows) > 10


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "is not a Radiance picture"),
        (b"GIF89a", "is not a Radiance picture"),
        (HEADER + b"\nno size\n", "the line that gives its size is missing"),
        (hdr_file(b"", 4, 4, axes=("+Y", "+Y")), "has no X and Y"),
        (hdr_file(b"", 4, 4, axes=("*X", "-Y")), "has no X and Y"),
        (hdr_file(b"", 0, 4), "each side must be 1 to 65536"),
        (hdr_file(b"", 60_000, 60_000), "more than 64 million"),
        (hdr_file(b"", 4, 4, b"#?RADIANCE\nFORMAT=32-bit_rle_yuve\n"), "its format is not 32-bit_rle_rgbe"),
        (hdr_file(bytes(64), 4, 4, HEADER + b"PRIMARIES=0 0 0 0 0 0 0 0\n"), "its primaries and white are not eight"),
        (hdr_file(bytes([2, 2, 0, 9]) + bytes(99), 10, 1), "holds a run that leaves its row"),
        (hdr_file(bytes([2, 2, 0, 10, 128 + 11, 7]) + bytes(99), 10, 1), "holds a run that leaves its row"),
        (hdr_file(bytes([2, 2, 0, 10, 0, 7]) + bytes(99), 10, 1), "holds a run that leaves its row"),
        (hdr_file(bytes([1, 1, 1, 3]) + bytes(99), 10, 1), "holds a run that leaves its row"),
        (hdr_file(bytes([9, 9, 9, 99, 1, 1, 1, 200]), 10, 1), "holds a run that leaves its row"),
    ],
)
def test_what_is_no_radiance_picture_is_refused(tmp_path: Path, content: bytes, expected: str) -> None:
    assert expected in refusal(write(tmp_path / "bad.hdr", content))


# -- 8 bit --------------------------------------------------------------------------------


def saved(image: Image.Image, format: str, **options) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, format, **options)
    return buffer.getvalue()


def test_png_levels_are_decoded_from_srgb(tmp_path: Path) -> None:
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    rgb, notes = read_picture(write(tmp_path / "a.png", saved(Image.fromarray(levels), "PNG")))
    assert rgb.shape == (16, 16, 3) and rgb.dtype == np.float32 and notes == ()
    assert rgb[0, 0, 0] == 0.0 and rgb[15, 15, 2] == 1.0
    # IEC 61966-2-1: level 188 is the middle grey of 0.5029, level 10 lies on the straight part.
    assert rgb[11, 12, 1] == pytest.approx(((188 / 255 + 0.055) / 1.055) ** 2.4, rel=1e-6)
    assert rgb[0, 10, 0] == pytest.approx(10 / 255 / 12.92, rel=1e-6)


def test_row_zero_is_the_top_and_palettes_work(tmp_path: Path) -> None:
    picture = np.zeros((4, 6, 3), np.uint8)
    picture[0] = (255, 0, 0)
    palette = Image.fromarray(picture).convert("P")
    for name, image in (("rgb", Image.fromarray(picture)), ("palette", palette)):
        rgb, _ = read_picture(write(tmp_path / f"{name}.png", saved(image, "PNG")))
        assert (rgb[0] == (1.0, 0.0, 0.0)).all() and (rgb[1:] == 0.0).all()


def test_transparency_is_told_only_where_there_is_some(tmp_path: Path) -> None:
    solid = np.full((2, 2, 4), 255, np.uint8)
    assert read_picture(write(tmp_path / "a.png", saved(Image.fromarray(solid), "PNG")))[1] == ()
    solid[0, 0, 3] = 254
    assert "transparency" in read_picture(write(tmp_path / "b.png", saved(Image.fromarray(solid), "PNG")))[1][0]


def test_a_photograph_is_turned_as_its_camera_says(tmp_path: Path) -> None:
    image = Image.fromarray(np.full((8, 16, 3), 128, np.uint8))
    exif = Image.Exif()
    exif[0x0112] = 6
    rgb, _ = read_picture(write(tmp_path / "a.jpg", saved(image, "JPEG", exif=exif)))
    assert rgb.shape == (16, 8, 3) and abs(float(rgb.mean()) - 0.2159) < 0.01


def test_damaged_and_mistaken_8_bit_files_are_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (40, 40, 3)).astype(np.uint8)
    for format, suffix in (("PNG", ".png"), ("JPEG", ".jpg")):
        whole = saved(Image.fromarray(noise), format)
        assert "the picture is damaged" in refusal(write(tmp_path / f"cut{suffix}", whole[: len(whole) // 2]))
        for content in (b"", b"nothing of the kind", whole[:2]):
            assert "neither a PNG nor a JPEG" in refusal(write(tmp_path / f"bad{suffix}", content))
    grey16 = Image.fromarray(np.full((4, 4), 40_000, np.uint16))
    assert "more than 8 bits" in refusal(write(tmp_path / "deep.png", saved(grey16, "PNG")))
    assert "more than 64 million" in refusal(write(tmp_path / "huge.png", saved(Image.new("1", (9000, 9000)), "PNG")))


# -- floating point -----------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".npy", ".exr"])
def test_floating_point_pictures_come_back_and_noise_is_clamped(tmp_path: Path, suffix: str) -> None:
    rgb = np.random.default_rng(2).random((6, 9, 3)).astype(np.float32)
    write_image(tmp_path / f"a{suffix}", rgb)
    np.testing.assert_array_equal(read_picture(tmp_path / f"a{suffix}")[0], rgb)
    rgb[0, 0] = (1000.0, -0.9, -0.5)
    write_image(tmp_path / f"b{suffix}", rgb)
    again, notes = read_picture(tmp_path / f"b{suffix}")
    assert again.min() == 0.0 and "2 slightly negative values (down to -0.9) were set to 0" in notes[0]


@pytest.mark.parametrize("suffix", [".npy", ".exr"])
def test_values_that_are_no_light_are_counted(tmp_path: Path, suffix: str) -> None:
    rgb = np.ones((4, 4, 3), np.float32)
    rgb[0, 0, :2] = np.nan
    rgb[1, 1, 2] = np.inf
    _written_all_the_same(tmp_path / f"a{suffix}", rgb)
    assert "2 values are not a number and 1 infinite" in refusal(tmp_path / f"a{suffix}")
    rgb = np.ones((4, 4, 3), np.float32)
    rgb[2, :, 1] = -0.01
    write_image(tmp_path / f"b{suffix}", rgb)
    assert "4 values are negative (down to -0.01)" in refusal(tmp_path / f"b{suffix}")
    write_image(tmp_path / f"c{suffix}", np.full((2, 2, 3), -1e-9))
    assert "12 values are negative" in refusal(tmp_path / f"c{suffix}"), (
        "all-negative has no bright value to be noise of"
    )


def _written_all_the_same(path: Path, rgb: np.ndarray) -> None:
    """A picture that the program itself refuses to write."""
    if path.suffix == ".npy":
        np.save(path, rgb)
        return
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": OpenEXR.Channel(rgb)}) as file:
        file.write(str(path))


def test_missing_empty_and_unknown_files_are_refused(tmp_path: Path) -> None:
    for suffix in (".hdr", ".png", ".exr", ".npy", ".jpeg"):
        assert "No such file" in refusal(tmp_path / f"gone{suffix}")
    np.save(tmp_path / "empty.npy", np.zeros((0, 4, 3), np.float32))
    assert "the picture is empty (4 × 0 pixels)" in refusal(tmp_path / "empty.npy")
    np.save(tmp_path / "codes.npy", np.zeros((2, 4, 3), np.uint8))
    assert "it holds whole numbers (uint8)" in refusal(tmp_path / "codes.npy")
    for suffix in (".exr", ".npy"):
        assert "it is not a whole" in refusal(write(tmp_path / f"bad{suffix}", b""))
        assert "it is not a whole" in refusal(write(tmp_path / f"bad{suffix}", b"nothing of the kind"))
    assert "'.tif' is not a picture format" in refusal(write(tmp_path / "a.tif", b"II*"))
    (tmp_path / "folder.png").mkdir()
    assert "cannot read" in refusal(tmp_path / "folder.png")
