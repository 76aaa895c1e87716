"""The display pass: tone curves against float64 and app/base/tone_map.py, false colour, wipe, error map, scaling."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import tone
from spectrasplat.base import tone_map
from spectrasplat.base.colour_maps import ERROR, FALSE_COLOUR, sample
from spectrasplat.edit.state import Compare
from spectrasplat.edit.state import Display as Settings
from spectrasplat.passes.display import ERROR_FLOOR, ERROR_RANGE, Display
from spectrasplat.stress.rigs.glsl_function import as_f32, evaluate

COUNT = 4096


def colours(seed: int) -> np.ndarray:
    """Scene colours over sixteen stops, a third of them far outside the gamut as spectral light is."""
    rng = np.random.default_rng(seed)
    rgb = rng.random((COUNT, 3)) * 2.0 ** rng.uniform(-8, 8, (COUNT, 1))
    rgb[::3] += rng.normal(0, 0.5, (len(rgb[::3]), 3)) * rgb[::3].max(axis=1, keepdims=True)
    rgb[:4] = [(0, 0, 0), (1, 1, 1), (1e4, 0, 0), (-1, -2, -3)]
    return as_f32(rgb)


def test_each_tone_function_has_its_twin(gl) -> None:
    rgb, other = colours(1), colours(2)
    floor_value = as_f32(np.random.default_rng(3).uniform(1e-3, 1, COUNT))
    body = """
    y = luminance_709(rgb); norm = p_norm(abs(rgb)); inside = into_gamut(rgb); rolled = roll_off(abs(rgb));
    own = tone_spectrasplat(rgb); aces = tone_aces(rgb); reinhard = tone_reinhard(rgb);
    fifth = fifth_powers(abs(rgb)); keeps = tone_keeps(rgb) ? 1.0 : 0.0;
    code = srgb_encode(clamp(rgb, 0.0, 1.0)); error = signed_error(rgb, other, floor_value);
    """
    outputs = dict.fromkeys(("y", "norm", "fifth", "keeps", "error"), "float") | dict.fromkeys(
        ("inside", "rolled", "own", "aces", "reinhard", "code"), "vec3"
    )
    got = evaluate(gl.ctx, ["lib/tone.glsl"], body, {"rgb": rgb, "other": other, "floor_value": floor_value}, outputs)
    size = np.abs(rgb).max(axis=1)
    assert (np.abs(got["y"] - tone.luminance_709(rgb)) <= 1e-6 * size + 1e-9).all()
    assert (np.abs(got["norm"] - tone.p_norm(np.abs(rgb))) <= 2e-6 * size + 1e-9).all()
    assert (np.abs(got["fifth"] / np.sum(np.abs(rgb) ** 5, axis=1).clip(1e-30) - 1)[1:] < 1e-5).all()
    # Near black luminance cancels: what is compared is the colour, in units of the largest channel that went in.
    clear = tone.luminance_709(rgb) > 0.02 * size
    assert clear.mean() > 0.8
    assert (np.abs(got["inside"] - tone.into_gamut(rgb))[clear] <= 2e-4 * size[clear, None]).all()
    assert np.abs(got["rolled"] - tone.roll_off(np.abs(rgb))).max() < 3e-6
    assert np.abs(got["own"] - tone.tone_spectrasplat(rgb))[clear].max() < 3e-4
    keeps, bending = got["keeps"] > 0.5, tone.bending(rgb)
    assert 0.1 < keeps.mean() < 0.5
    assert (keeps == (bending < 0.0))[clear & (np.abs(bending) > 1e-4)].all()
    assert np.abs(tone.tone_spectrasplat(rgb) - rgb)[keeps].max() < 1e-7
    assert np.abs(got["aces"] - tone.tone_aces(rgb)).max() < 1e-5
    assert np.abs(got["reinhard"] - tone.tone_reinhard(rgb))[clear].max() < 1e-5
    assert np.abs(got["code"] - tone.srgb_encode(np.clip(rgb, 0, 1))).max() < 3e-6
    want = tone.signed_error(rgb, other, floor_value)
    sure = np.abs(tone.luminance_709(rgb - other)) > 1e-5 * np.abs(rgb - other).max(axis=1)
    assert (np.abs(got["error"] - want)[sure] <= 1e-5 * np.abs(want[sure]) + 1e-6).all()


def overexposed_edges(size: tuple[int, int] = (48, 40)) -> np.ndarray:
    """(H, W, 3): a beam twenty times white across dark paper, a coloured one, a disc, a glint within one pixel, a soft
    glow, and colours at random: every pixel the mean of 8 by 8 points."""
    width, height = size
    y, x = np.mgrid[0 : 8 * height, 0 : 8 * width] / 8.0
    rgb = np.full((*x.shape, 3), 0.12)
    rgb[np.abs(y - 6.0 - 0.23 * x) < 1.7] = 20.0
    rgb[np.abs(y + 0.6 * x - 33.0) < 1.2] = (0.1, 9.0, 2.0)
    rgb[(x - 40.3) ** 2 + (y - 5.4) ** 2 < 0.8] = 300.0
    rgb[(x - 44.5) ** 2 + (y - 20.5) ** 2 < 0.06] = 300.0
    rgb[(x - 44.0) ** 2 + (y - 15.0) ** 2 < 0.3] = 300.0
    rgb += 6.0 * np.exp(-((x - 37.0) ** 2 + (y - 31.0) ** 2) / 20.0)[..., None] * np.array([1.0, 0.6, 0.2])
    rgb = rgb.reshape(height, 8, width, 8, 3).mean(axis=(1, 3))
    rgb[-8:, :10] = 2.0 ** np.random.default_rng(8).uniform(-3, 4, (8, 10, 1)) * (1.0, 0.7, 0.5)
    return rgb.astype(np.float32)


@pytest.mark.parametrize("name", ["spectrasplat", "aces", "reinhard", "linear"])
def test_highlights_are_antialiased_alike_in_window_files_and_float64(gl, display, name: str) -> None:
    curve = {"aces": tone.tone_aces, "reinhard": tone.tone_reinhard, "linear": lambda rgb: np.clip(rgb, 0, 1)}
    rgb = overexposed_edges()
    rgb[12, 20] = np.nan
    source, settings = texture_of(gl, rgb), Settings(tone=name)
    size = (rgb.shape[1], rgb.shape[0])
    shown = codes(display.run(source, settings, 0.5, size, antialias=True)).astype(int)
    plain = codes(display.run(source, settings, 0.5, size)).astype(int)
    magnified = codes(display.magnify(source, (9, 8), settings, 0.5, zoom=3, pixels=7, antialias=True)).astype(int)
    source.release()
    clean = np.where(np.isfinite(rgb), rgb, 0.0).astype(float) * 2.0**0.5
    want = 255 * tone.srgb_encode(tone.antialiased(clean, curve.get(name, tone.tone_spectrasplat)))
    want[12, 20] = 255, 0, 255
    assert np.abs(shown - want).max() <= 1.5
    if name == "spectrasplat":
        assert np.abs(shown - tone_map.tone_map_8bit(rgb, 0.5, antialias=True)).max() <= 1
        assert (plain - shown).max() > 60
    assert (magnified[1::3, 1::3] == shown[5:12, 6:13]).all()


@pytest.mark.parametrize(
    ("height", "width", "sides"), [(2, 2, 8), (1, 3, 8), (3, 3, 12), (4, 1, 0), (4, 4, 0), (1, 9, 0)]
)
def test_a_glint_of_a_few_pixels_is_a_dot(height: int, width: int, sides: int) -> None:
    """Two by two pixels of the sun were a hard square; its sides have what those of a single pixel have, its corners
    nothing. Larger or longer ones are no glints, and stay."""
    rgb = np.full((11, 15, 3), 0.1, np.float32)
    rgb[3 : 3 + height, 3 : 3 + width] = 80.0
    plain, dotted = (tone_map.to_display(rgb, 0.0, antialias=on) for on in (False, True))
    brighter = (dotted > plain + 1e-4).all(axis=-1)
    assert brighter.sum() == sides and not brighter[[2, 2], [2, 3 + width]].any()
    assert (dotted[3 : 3 + height, 3 : 3 + width] == plain[3 : 3 + height, 3 : 3 + width]).all()
    if sides:
        assert dotted[2, 3] == pytest.approx(plain[2, 3] + 0.135 * (plain[3, 3] - plain[2, 3]), rel=1e-3)


@pytest.mark.parametrize("size", [(48, 40), (24, 20), (96, 80)])
def test_highlights_of_pictures_of_other_sizes(gl, display, size: tuple[int, int]) -> None:
    """Shrunk: as the shrunk picture's own, to the pixel. Enlarged: something is smoothed, at edges only, and no pixel
    becomes brighter but round a glint."""
    rgb = overexposed_edges()
    source = texture_of(gl, rgb)
    plain, shown = (
        codes(display.run(source, Settings(), 0.0, size, antialias=antialias)).astype(int)
        for antialias in (False, True)
    )
    source.release()
    if size[0] <= rgb.shape[1]:
        k = rgb.shape[1] // size[0]
        small = rgb.reshape(size[1], k, size[0], k, 3).mean(axis=(1, 3))
        assert np.abs(shown - tone_map.tone_map_8bit(small, 0.0, antialias=True)).max() <= 1
    assert (shown > plain).any(axis=-1).mean() < 0.02 and 0.02 < (shown < plain - 10).any(axis=-1).mean() < 0.3


@pytest.fixture
def display(gl):
    made = Display(gl)
    yield made
    made.release()


def texture_of(gl, rgb: np.ndarray):
    height, width, _ = rgb.shape
    data = np.concatenate([rgb, np.zeros((height, width, 1))], axis=-1).astype(np.float32)
    return gl.ctx.texture((width, height), 4, data.tobytes(), dtype="f4")


def codes(texture) -> np.ndarray:
    """uint8 (H, W, 3) as the window shows it, row 0 on top."""
    return np.frombuffer(texture.read(), np.uint8).reshape(texture.height, texture.width, 4)[..., :3]


def test_the_own_curve_is_that_of_written_pictures(gl, display) -> None:
    rgb = colours(4).reshape(64, 64, 3).astype(np.float32)
    rgb[3, 5], rgb[9, 1], rgb[20, 20] = np.nan, np.inf, (1e20, 1e18, 0)
    source = texture_of(gl, rgb)
    shown = codes(display.run(source, Settings(), -1.5, (64, 64))).astype(int)
    source.release()
    want = tone_map.tone_map_8bit(rgb, -1.5).astype(int)
    apart = np.abs(shown - want).max(axis=-1)
    # Where luminance cancels to nothing, float32 itself does not tell the colour.
    clear = ~np.isfinite(rgb).all(axis=-1) | (
        tone_map.luminance(np.nan_to_num(rgb, posinf=1e3)) > 0.02 * np.nan_to_num(np.abs(rgb), posinf=1e3).max(axis=-1)
    )
    assert clear.mean() > 0.8
    assert apart[clear].max() <= 1
    assert (shown[3, 5] == (255, 0, 255)).all() and (shown[9, 1] == (255, 0, 255)).all()


def test_false_colour_reads_in_stops_and_marks_what_is_out_of_range(gl, display) -> None:
    stops = np.linspace(-10.0, 6.0, 65)
    rgb = np.repeat(2.0 ** stops[None, :, None], 3, axis=2)
    source = texture_of(gl, rgb)
    settings = Settings(false_colour=True, false_colour_stops=(-8.0, 4.0))
    shown = codes(display.run(source, settings, 0.0, (65, 1)))[0]
    source.release()
    inside = (stops > -7.99) & (stops < 3.99)
    want = 255 * sample(FALSE_COLOUR, (stops[inside] + 8) / 12)
    assert np.abs(shown[inside] - want).max() <= 1.0
    assert (shown[stops < -8.01] == 0).all() and (shown[stops > 4.01] == 255).all()


def flat(gl, value: float, size: tuple[int, int] = (40, 10)):
    return texture_of(gl, np.full((size[1], size[0], 3), value))


def test_wipe_and_hold_show_one_picture_beside_or_instead_of_the_other(gl, display) -> None:
    first, second = flat(gl, 0.1), flat(gl, 0.4)
    linear = Settings(tone="linear")
    low, high = (round(255 * float(tone.srgb_encode(np.float64(v)))) for v in (0.1, 0.4))

    def row(**changes) -> np.ndarray:
        return codes(display.run(first, linear, 0.0, (40, 10), second, Compare(**changes)))[4, :, 0].astype(int)

    wiped = row(mode="wipe", wipe=0.25)
    assert (wiped[:8] == low).all() and (wiped[9:11] == 255).all() and (wiped[12:] == high).all()
    assert (row(mode="hold") == low).all()
    assert (row(mode="hold", holding=True) == high).all()
    assert (codes(display.run(first, linear, 0.0, (40, 10), None, Compare(mode="wipe")))[..., 0] == low).all()
    first.release()
    second.release()


def test_the_error_map_is_signed_and_relative(gl, display) -> None:
    reference = np.full((1, 5, 3), 0.5)
    picture = reference * np.array([0.5, 0.9, 1.0, 1.1, 3.0])[None, :, None]
    picture[0, 2, 0] = np.nan
    first, second = texture_of(gl, picture), texture_of(gl, reference)
    shown = codes(display.run(first, Settings(), 0.0, (5, 1), second, Compare(mode="error")))[0].astype(float)
    first.release()
    second.release()
    length = 0.5 * np.sqrt(3)
    relative = np.array([-0.5, -0.1, 0.0, 0.1, 2.0]) * length / (length + ERROR_FLOOR)
    want = 255 * sample(ERROR, 0.5 + 0.5 * relative / ERROR_RANGE)
    want[2] = (255, 0, 255)
    assert np.abs(shown - want).max() <= 1.5


def test_small_pictures_are_blended_near_ones_squares_large_ones_averaged(gl, display) -> None:
    linear = Settings(tone="linear")
    steps = texture_of(gl, np.array([[[0.0] * 3, [1.0] * 3]]))
    blended = codes(display.run(steps, linear, 0.0, (8, 4)))[0, :, 0]
    assert (np.diff(blended.astype(int)) >= 0).all() and len(set(blended.tolist())) > 3
    squares = codes(display.run(steps, linear, 0.0, (16, 8)))[0, :, 0]
    assert squares.tolist() == [0] * 8 + [255] * 8
    steps.release()
    board = texture_of(gl, np.indices((8, 8)).sum(axis=0)[..., None] % 2 * np.ones(3))
    mean = codes(display.run(board, linear, 0.0, (4, 4)))
    assert np.abs(mean.astype(float) - 255 * float(tone.srgb_encode(np.float64(0.5)))).max() <= 1
    board.release()


def test_the_magnifier_shows_the_pixels_about_a_pixel_top_row_first(gl, display) -> None:
    rgb = np.zeros((20, 30, 3))
    rgb[6, 11] = 1.0
    rgb[5, 11, 1] = 1.0
    source = texture_of(gl, rgb)
    shown = codes(display.magnify(source, (11, 6), Settings(tone="linear"), 0.0, zoom=4, pixels=5))
    source.release()
    assert shown.shape == (20, 20, 3)
    assert (shown[8:12, 8:12] == 255).all()
    assert (shown[4:8, 8:12] == (0, 255, 0)).all()
    assert shown[12:].max() == 0 and shown[:4].max() == 0


@pytest.mark.parametrize("antialias", [False, True])
def test_pixels_are_the_same_read_as_images_and_as_texels(gl, monkeypatch, antialias: bool) -> None:
    """A software renderer reads images, which costs it less, other devices texels."""
    rng = np.random.default_rng(5)
    rgb = 2.0 ** rng.uniform(-6, 6, (41, 53, 3))
    rgb[7, 9] = np.nan
    shown = []
    for as_images in (False, True):
        monkeypatch.setattr(gl, "traits", replace(gl.traits, texels_as_images=as_images))
        one = Display(gl)
        picture = gl.ctx.texture((53, 41), 4, np.dstack([rgb, np.ones((41, 53))]).astype("f4").tobytes(), dtype="f4")
        shown.append(one.run(picture, Settings(), 0.0, (53, 41), antialias=antialias).read())
        assert any(variant.as_image for variant in one._programs) == as_images
        picture.release()
        one.release()
    assert shown[0] == shown[1]
