"""What the texture filter is for: means over patches of a picture or of the sky, against means by brute force.

The filter reads a few prefiltered texels, so it is near to such a mean, not equal. How near is stated relative to the
picture's own standard deviation, and mutants (another axis, another level) show that the limits can fail.
"""

from __future__ import annotations

import numpy as np
import pytest
from reference import textures as cpu_reference
from spectrasplat.model.texture import Texture
from spectrasplat.stress.rigs.glsl_function import as_f32
from test_textures_gpu import COUNT, picture, run, scene_of, store_of

SIDE = 128


def noise() -> np.ndarray:
    """White noise, the hardest picture there is: standard deviation 1 about 4."""
    rgb = picture(SIDE, SIDE)
    return (rgb / rgb.std() + 4.0 - rgb.mean() / rgb.std()).astype(np.float32)


def natural() -> np.ndarray:
    """Amplitudes fall as 1 / frequency, as in photographs; standard deviation 1 about 4."""
    frequency = np.hypot(*np.meshgrid(*[np.fft.fftfreq(SIDE)] * 2))
    frequency[0, 0] = np.inf
    waves = np.real(np.fft.ifft2(np.fft.fft2(np.random.default_rng(1).normal(size=(SIDE, SIDE))) / frequency))
    return np.repeat((4.0 + waves / waves.std())[..., None], 3, axis=2).astype(np.float32)


def patches(ratio: float, width_texels: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Sides (COUNT, 2) of rectangles in any orientation, in texture coordinates: the longer, the shorter."""
    angle = rng.uniform(0, 2 * np.pi, COUNT)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1) * ratio * width_texels / SIDE
    across = np.stack([-np.sin(angle), np.cos(angle)], axis=1) * width_texels / SIDE
    return as_f32(along), as_f32(across)


@pytest.mark.parametrize(
    ("make", "limit", "ratio"), [(noise, 0.42, 1.0), (noise, 0.42, 8.0), (natural, 0.18, 2.0), (natural, 0.18, 8.0)]
)
def test_a_patch_shows_its_mean(gl, make, limit: float, ratio: float) -> None:
    """A lookup averages with a kernel about as wide as the patch but of another shape, and one that hangs on where
    texels lie. At white noise that leaves up to 0.38 standard deviations of the picture (the means themselves spread by
    0.46 to 0.16), at a natural picture up to 0.16 (0.87 to 0.70): as sharp as the patch, at the price of some grain,
    which a pixel's samples average out; `ratio` lookups side by side err apart, so that their mean errs by 1/√ratio of
    it."""
    rng = np.random.default_rng(int(ratio))
    rgb = make()
    store = store_of(gl, scene_of(Texture(rgb)))
    uv = as_f32(rng.random((COUNT, 2)))

    def value(at: np.ndarray) -> np.ndarray:
        return cpu_reference.bilinear(rgb, np.column_stack([at[:, 0], 1.0 - at[:, 1]]), (True, True))

    body = (
        "rgb = texture_filtered(pictures[0], uv, s, t); other = texture_filtered(pictures[0], uv, vec2(-s.x, s.y), "
        "vec2(-t.x, t.y));"
    )
    for width in (1.5, 2.0, 3.0, 5.0):
        s, t = patches(ratio, width, rng)
        got = run(gl, store, body, {"uv": uv, "s": s, "t": t}, {"rgb": "vec3", "other": "vec3"})
        want = cpu_reference.mean_by_force(value, uv, s, t, steps=24)
        error = np.sqrt(np.mean((got["rgb"] - want) ** 2))
        assert error < limit / np.sqrt(ratio), (width, error)
        assert abs((got["rgb"] - want).mean()) < 4.0 * error / np.sqrt(COUNT) + 1e-4
        if ratio >= 4.0:  # mutant: patches mirrored
            assert np.sqrt(np.mean((got["other"] - want) ** 2)) > 1.5 * error
    store.release()


def test_long_patches_blur_instead_of_missing_texels(gl) -> None:
    """Past eight lookups the level rises: a patch right across a striped picture still shows its mean."""
    stripes = np.zeros((64, 64, 3), np.float32)
    stripes[:, ::2] = 1.0
    store = store_of(gl, scene_of(Texture(stripes)))
    uv = as_f32(np.random.default_rng(3).random((COUNT, 2)))
    got = run(
        gl,
        store,
        "rgb = texture_filtered(pictures[0], uv, vec2(1.0, 0.0), vec2(0.0, 1e-4));",
        {"uv": uv},
        {"rgb": "vec3"},
    )
    assert np.abs(got["rgb"] - 0.5).max() < 0.02
    store.release()


# -- the environment ------------------------------------------------------------------------


def directions(rng: np.random.Generator, polar: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit directions at polar angles, and two unit tangents across each, turned at random."""
    azimuth, turn = rng.uniform(-np.pi, np.pi, (2, len(polar)))
    d = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    east = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], axis=1)
    north = np.cross(d, east)
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]
    return as_f32(d), cosine * east + sine * north, cosine * north - sine * east


def sky_of(function, height: int = 128) -> np.ndarray:
    """A latitude-longitude picture of a function of directions (N, 3) → (N,)."""
    rows, columns = np.indices((height, 2 * height)).reshape(2, -1)
    polar, azimuth = np.pi * (rows + 0.5) / height, np.pi * (1.0 - (columns + 0.5) / height)
    d = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    return np.repeat(function(d)[:, None], 3, axis=1).reshape(height, 2 * height, 3).astype(np.float32)


RADIANCE = "rgb = environment_radiance(d, s, t);"


BANDS = {"north": (0.0, 0.06), "south": (np.pi - 0.06, np.pi), "between": (0.4, 2.7)}


@pytest.mark.parametrize("name", BANDS)
def test_poles_and_seam_show_a_smooth_sky_as_it_is(gl, name: str) -> None:
    """Smooth over the sphere, so the mean over a patch is nearly the value at its middle; one wave round the pole is
    what a filter that smears along the picture's rows would lose."""

    def smooth(d: np.ndarray) -> np.ndarray:
        return 2.0 + d[:, 0] + 0.5 * d[:, 1] + 0.5 * d[:, 0] * d[:, 1]

    rng = np.random.default_rng(4)
    store = store_of(gl, scene_of(environment=sky_of(smooth)))
    at = rng.uniform(*BANDS[name], COUNT)
    at[:8] = BANDS[name][1 if name == "south" else 0]
    d, a, b = directions(rng, at)
    if name == "between":
        half = slice(COUNT // 2)  # at the seam
        d[half, :2] = np.column_stack([-np.hypot(d[half, 0], d[half, 1]), rng.normal(0, 1e-3, COUNT // 2)])
        d = as_f32(d / np.linalg.norm(d, axis=1, keepdims=True))
    for size, ratio in ((0.0, 1.0), (0.02, 1.0), (0.05, 1.0), (0.02, 8.0)):
        got = run(gl, store, RADIANCE, {"d": d, "s": as_f32(a * size * ratio), "t": as_f32(b * size)}, {"rgb": "vec3"})
        want = smooth(d)
        assert np.isfinite(got["rgb"]).all()
        # A texel is 0.025 high: what interpolation and the patch's own curvature change is below.
        assert np.abs(got["rgb"][:, 0] - want).max() < 0.02 + 0.5 * size, (size, ratio)
    store.release()


def test_a_patch_of_the_sky_shows_its_mean(gl) -> None:
    """Noise. Towards a pole a patch covers more and more columns, so that means spread less (by 0.32, 0.20, 0.08), and
    so must errors."""
    rgb = noise()
    sky = np.concatenate([rgb, rgb[:, ::-1]], axis=1)
    store = store_of(gl, scene_of(environment=sky))

    def value(d: np.ndarray) -> np.ndarray:
        return cpu_reference.bilinear(sky, cpu_reference.environment_place(d), (True, False))

    rng = np.random.default_rng(5)
    row = np.pi / SIDE
    for polar, limit in (((1.0, 2.1), 0.2), ((0.2, 0.5), 0.13), ((0.0, 0.1), 0.08)):
        d, a, b = directions(rng, rng.uniform(*polar, COUNT))
        for width, ratio in ((2.5, 1.0), (4.0, 1.0), (2.5, 4.0)):
            s, t = as_f32(a * width * ratio * row), as_f32(b * width * row)
            got = run(gl, store, RADIANCE, {"d": d, "s": s, "t": t}, {"rgb": "vec3"})
            want = cpu_reference.mean_by_force(value, d, s, t, steps=24)
            error = np.sqrt(np.mean((got["rgb"] - want) ** 2))
            assert error < limit / np.sqrt(ratio), (polar, width, ratio, error)
    store.release()


@pytest.mark.parametrize("width", [0.0, 0.05, 0.2, 0.6, 1.5])
def test_filtering_keeps_the_light_of_the_whole_sky(gl, width: float) -> None:
    """A lamp near the zenith, a bright ground and noise; means over the sphere from 20 000 evenly spread directions."""

    def lit(d: np.ndarray) -> np.ndarray:
        lamp = np.exp(-np.sum((d - [0.2, 0.1, np.sqrt(0.95)]) ** 2, axis=1) / 0.02)
        return 0.3 + 10.0 * lamp + (d[:, 2] < -0.3)

    sky = sky_of(lit) * (0.5 + picture(128, 256))
    store = store_of(gl, scene_of(environment=sky))
    count = 20000
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    azimuth = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    d = as_f32(np.stack([np.sqrt(1 - z * z) * np.cos(azimuth), np.sqrt(1 - z * z) * np.sin(azimuth), z], axis=1))
    a = np.cross(d, [0.36, 0.48, 0.8])
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    got = run(
        gl, store, RADIANCE, {"d": d, "s": as_f32(width * a), "t": as_f32(width * np.cross(d, a))}, {"rgb": "vec3"}
    )
    borders = np.cos(np.pi * np.arange(129) / 128)
    whole = (-np.diff(borders)[:, None, None] * sky).sum(axis=(0, 1)) / 2.0 / 256
    np.testing.assert_allclose(got["rgb"].mean(axis=0), whole, rtol=0.012)  # directions alone leave 0.001
    by_area = sky.mean(axis=(0, 1))
    assert (np.abs(by_area / whole - 1.0) > 0.1).all()  # the mutant whose levels are means over the picture
    store.release()


def test_no_derivative_breaks_it(gl) -> None:
    rng = np.random.default_rng(6)
    store = store_of(gl, scene_of(Texture(picture(16, 16)), environment=picture(16, 32)))
    sizes = np.concatenate([[0.0, 1e-38, 1e-20, 1e10, 1e30, 3e38], rng.uniform(0, 1, 250)]).astype(np.float32)
    d, a, b = directions(rng, rng.uniform(0, np.pi, len(sizes)))
    d[:4] = [[0, 0, 1], [0, 0, -1], [-1, 0, 0], [1, 0, 0]]
    inputs = {"d": d, "uv": as_f32(d[:, :2]), "a": a, "b": b, "size": sizes}
    body = """
    sky = environment_radiance(d, size * a, size * b); thin = environment_radiance(d, size * a, vec3(0.0));
    rgb = texture_filtered(pictures[0], uv, size * a.xy, size * b.xy);
    float huge = size / 0.0; endless = texture_filtered(pictures[0], uv, vec2(huge, 0.0), vec2(0.0, huge));
    """
    got = run(gl, store, body, inputs, dict.fromkeys(("sky", "thin", "rgb", "endless"), "vec3"))
    for name in ("sky", "thin", "rgb"):
        assert np.isfinite(got[name]).all() and got[name].min() >= 0.0 and got[name].max() <= 1.0, name
    assert np.isfinite(got["endless"][1:]).all()
    store.release()
