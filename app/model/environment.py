"""Makes what lies beyond everything: a panorama from a file, a gradient, or a sky, always as one picture.

One representation keeps everything after this simple: whatever was wanted, the camera filters one
latitude-longitude picture (`texture.Environment` says how it is oriented).
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..base.errors import UserError
from .placement import frame_from_z, rotation_about
from .texture import Environment
from .vectors import Vec3, frozen, vec3

MAX_WIDTH, MAX_HEIGHT = 4096, 2048
"""Largest map kept: 128 MB on the GPU, and a texel is 0.09°."""
BAKED_WIDTH, BAKED_HEIGHT = 512, 256
"""Size of gradients and skies. Between the rows, 0.7° apart, they are straight to 1e-3."""
DEFAULT_SKY_TYPE = 12
Z_UP: Vec3 = (0.0, 0.0, 1.0)


def from_map(
    path: str | os.PathLike[str],
    intensity: float = 1.0,
    rotation_deg: float = 0.0,
    up: Vec3 = Z_UP,
    notes: list[str] | None = None,
    lights: bool = True,
) -> Environment:
    """The latitude-longitude picture in `path`, its values times `intensity` taken as lm/(sr unit²).

    `rotation_deg` turns it about `up`, anticlockwise seen from above; at 0 the picture's middle lies in the direction
    of the world's x (`world_to_local` says what happens where `up` is x). A picture larger than MAX_WIDTH × MAX_HEIGHT
    is averaged down. What was assumed goes to `notes`. Raises UserError for a picture that cannot be read or an
    impossible number.
    """
    from .io.picture_files import read_picture

    path = Path(path).resolve()
    if not (math.isfinite(intensity) and intensity >= 0.0):
        raise UserError(f"{path}: the intensity is {intensity:g}; give a number of 0 or more")
    rgb, read_notes = read_picture(path)
    height, width = rgb.shape[:2]
    assumed = list(read_notes)
    if width != 2 * height:
        assumed.append(
            f"{path.name} is {width} × {height}; a latitude-longitude picture is twice as wide as high, so it is "
            "stretched."
        )
    if width > MAX_WIDTH or height > MAX_HEIGHT:
        rgb = averaged_down(rgb, MAX_HEIGHT, MAX_WIDTH)
        assumed.append(f"{path.name} is {width} × {height}; it was averaged down to {rgb.shape[1]} × {rgb.shape[0]}.")
    with np.errstate(over="ignore"):
        rgb = np.ascontiguousarray(rgb) * np.float32(intensity)
    if not np.isfinite(rgb).all():
        raise UserError(f"{path}: intensity {intensity:g} takes its brightest value out of range; give a smaller one")
    if notes is not None:
        notes += assumed
    parameters = {"intensity": intensity, "rotation_deg": rotation_deg, "up": up}
    return _made("map", rgb, parameters, lights, str(path))


def gradient(
    zenith: Vec3, horizon: Vec3, nadir: Vec3 | None = None, up: Vec3 = Z_UP, intensity: float = 1.0, lights: bool = True
) -> Environment:
    """Radiances, linear Rec.709 in lm/(sr unit²), straight up, all round and straight down (None: as all round), and
    smoothly between.

    With s the sine of the elevation, the blend is s²(3 − 2|s|): level at the horizon as at the poles.
    Raises UserError for a radiance that is negative or not finite.
    """
    radiances = {"zenith": zenith, "horizon": horizon, "nadir": horizon if nadir is None else nadir}
    colours = {key: intensity * np.array(value, dtype=np.float64) for key, value in radiances.items()}
    for key, colour in colours.items():
        if not (np.isfinite(colour).all() and (colour >= 0.0).all()):
            raise UserError(f"gradient: {key} must be three radiances of 0 or more; correct it")
    sine = _baked_directions()[..., 2]
    blend = (sine**2 * (3.0 - 2.0 * np.abs(sine)))[..., None]
    pole = np.where(sine[..., None] > 0.0, colours["zenith"], colours["nadir"])
    rgb = colours["horizon"] + blend * (pole - colours["horizon"])
    return _made("gradient", rgb, radiances | {"intensity": intensity, "up": up}, lights)


def sky(
    sun_elevation_deg: float = 45.0,
    sun_azimuth_deg: float = 0.0,
    luminance: float = 1.0,
    sky_type: int = DEFAULT_SKY_TYPE,
    ground: Vec3 = (0.2, 0.2, 0.2),
    up: Vec3 = Z_UP,
    lights: bool = True,
) -> Environment:
    """A CIE standard general sky of the colour of D65, without the sun's disc (a directional light shows that).

    sun_azimuth_deg: anticlockwise about `up`, 0 in the direction of the world's x. luminance: of the zenith, in lm/(sr
    unit²). ground: reflectance, linear Rec.709, of a Lambertian ground that the sky alone lights. Raises UserError for
    a type other than 1 to 15, a sun below the horizon, and colours or luminances out of range.
    """
    if sky_type not in SKY_TYPES:
        raise UserError(
            f"sky: type {sky_type} is not known; the CIE's are 1 (overcast) to {len(SKY_TYPES)}, 12 is clear"
        )
    if not 0.0 <= sun_elevation_deg <= 90.0:
        raise UserError(
            f"sky: sun_elevation_deg is {sun_elevation_deg:g}; the sun must stand at 0 to 90 degrees above the horizon"
        )
    if not math.isfinite(sun_azimuth_deg):
        raise UserError(f"sky: sun_azimuth_deg is {sun_azimuth_deg}; give an angle")
    if not (math.isfinite(luminance) and luminance >= 0.0):
        raise UserError(f"sky: luminance is {luminance:g}; give a number of 0 or more")
    reflectance = np.array(ground, dtype=np.float64)
    if not ((reflectance >= 0.0).all() and (reflectance <= 1.0).all()):
        raise UserError("sky: ground must be a reflectance, every channel between 0 and 1")
    elevation, azimuth = math.radians(sun_elevation_deg), math.radians(sun_azimuth_deg)
    toward_sun = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    half = BAKED_HEIGHT // 2
    directions = _baked_directions()
    upper = luminance * relative_luminance(sky_type, directions[:half], toward_sun)
    rgb = np.empty((BAKED_HEIGHT, BAKED_WIDTH, 3))
    rgb[:half] = upper[..., None]  # D65 is white in Rec.709
    rgb[half:] = reflectance * horizontal_illuminance(upper) / math.pi
    parameters = {
        "type": int(sky_type),
        "sun_elevation_deg": sun_elevation_deg,
        "sun_azimuth_deg": sun_azimuth_deg,
        "luminance": luminance,
        "ground": ground,
        "up": up,
    }
    return _made("sky", rgb, parameters, lights)


def constant(radiance: Vec3, lights: bool = True) -> Environment:
    """The same radiance, linear Rec.709 in lm/(sr unit²), from everywhere. Raises UserError for one that is negative or
    not finite."""
    colour = np.array(radiance, dtype=np.float64)
    if not (np.isfinite(colour).all() and (colour >= 0.0).all()):
        raise UserError("constant: radiance must be three numbers of 0 or more; correct it")
    return _made("constant", np.broadcast_to(colour, (8, 16, 3)), {"radiance": radiance}, lights)


def horizontal_illuminance(upper: np.ndarray) -> float:
    """Illuminance, lm/unit², on level ground under the luminances `upper` (H, W) of the upper half of a picture."""
    height, width = upper.shape
    edges = np.cos(0.5 * np.pi * np.arange(height + 1) / height)
    # ∫ cos θ sin θ dθ over each row, exactly.
    weights = 0.5 * (edges[:-1] ** 2 - edges[1:] ** 2)
    return float(weights @ upper.sum(axis=1)) * 2.0 * math.pi / width


def world_to_local(up: Vec3, rotation_deg: float = 0.0) -> np.ndarray:
    """Rotation, float64 (3, 3), whose local z is `up` and whose local x is the picture's middle.

    Local x is as near to the world's x as `up` lets it be (where `up` is x or −x: the world's y), turned by
    `rotation_deg` about `up`. Raises UserError when `up` is zero or a number is not finite.
    """
    direction = np.array(up, dtype=np.float64)
    length = float(np.linalg.norm(direction))
    if not (math.isfinite(length) and length > 0.0 and math.isfinite(rotation_deg)):
        raise UserError("environment: up must be a direction other than zero, and rotation_deg a finite number")
    axis = vec3(direction / length)
    frame = frame_from_z(axis, (1.0, 0.0, 0.0))
    if frame is None:
        frame = frame_from_z(axis, (0.0, 1.0, 0.0))
        assert frame is not None
    return frozen((rotation_about(axis, math.radians(rotation_deg)) @ frame).T)


def up_and_rotation(environment: Environment) -> tuple[Vec3, float]:
    """`up` and `rotation_deg` that give back an environment's `world_to_local`."""
    x, _, z = environment.world_to_local
    up = vec3(z)
    unturned = world_to_local(up)
    return up, math.degrees(math.atan2(float(unturned[1] @ x), float(unturned[0] @ x)))


def direction_of(environment: Environment, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """World directions (…, 3) of picture coordinates: the inverse of the mapping `texture.Environment` states."""
    azimuth, polar = 2.0 * np.pi * (0.5 - np.asarray(u)), np.pi * np.asarray(v)
    local = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth], axis=-1
    )
    return local @ environment.world_to_local


def _baked_directions() -> np.ndarray:
    """Local unit directions of the texels' centres of a baked picture, float64 (BAKED_HEIGHT, BAKED_WIDTH, 3)."""
    u = (np.arange(BAKED_WIDTH) + 0.5) / BAKED_WIDTH
    v = (np.arange(BAKED_HEIGHT)[:, None] + 0.5) / BAKED_HEIGHT
    return direction_of(Environment(np.zeros((1, 1, 3), np.float32)), u, v)


def texel_solid_angles(height: int, width: int) -> np.ndarray:
    """Those of a panorama's texels, row by row: float64 (H, 1), sr."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return ((edges[:-1] - edges[1:]) * 2.0 * np.pi / width)[:, None]


def averaged_down(rgb: np.ndarray, height: int, width: int) -> np.ndarray:
    """A picture of at most this size, float32 (h, w, 3): area-weighted means of one that is larger."""
    return _averaged_rows(_averaged_rows(rgb, height).swapaxes(0, 1), width).swapaxes(0, 1)


def _averaged_rows(rgb: np.ndarray, rows: int) -> np.ndarray:
    """Area-weighted means over the first axis where it is longer than `rows`."""
    from scipy.sparse import csr_matrix

    source = rgb.shape[0]
    if rows >= source:
        return rgb
    # Cut the range at the borders of both grids: every piece lies in one row of each.
    cuts = np.union1d(np.arange(source + 1.0), np.arange(rows + 1.0) * source / rows)
    middles, shares = 0.5 * (cuts[1:] + cuts[:-1]), np.diff(cuts) * rows / source
    target = np.minimum((middles * rows / source).astype(np.int64), rows - 1)
    weights = csr_matrix((shares, (target, middles.astype(np.int64))), shape=(rows, source))
    return (weights @ rgb.reshape(source, -1)).astype(np.float32).reshape(rows, *rgb.shape[1:])


def _made(
    kind: Literal["map", "gradient", "sky", "constant"],
    rgb: np.ndarray,
    parameters: dict[str, Any],
    lights: bool,
    source: str | None = None,
) -> Environment:
    """An environment of this picture; `parameters`: the scene file's keys, without `lights`, which is added
    where it is false."""
    turned = world_to_local(parameters.get("up", Z_UP), parameters.get("rotation_deg", 0.0))
    parameters = {key: value if isinstance(value, int) else _plain(value) for key, value in parameters.items()}
    parameters |= {} if lights else {"lights": False}
    return Environment(frozen(np.asarray(rgb, np.float32)), turned, kind, parameters, source, lights)


def _plain(value: Any) -> float | list[float]:
    return [float(v) for v in value] if np.ndim(value) else float(value)


SKY_TYPES: dict[int, tuple[float, float, float, float, float]] = {
    1: (4.0, -0.70, 0.0, -1.0, 0.00),
    2: (4.0, -0.70, 2.0, -1.5, 0.15),
    3: (1.1, -0.80, 0.0, -1.0, 0.00),
    4: (1.1, -0.80, 2.0, -1.5, 0.15),
    5: (0.0, -1.00, 0.0, -1.0, 0.00),
    6: (0.0, -1.00, 2.0, -1.5, 0.15),
    7: (0.0, -1.00, 5.0, -2.5, 0.30),
    8: (0.0, -1.00, 10.0, -3.0, 0.45),
    9: (-1.0, -0.55, 2.0, -1.5, 0.15),
    10: (-1.0, -0.55, 5.0, -2.5, 0.30),
    11: (-1.0, -0.55, 10.0, -3.0, 0.45),
    12: (-1.0, -0.32, 10.0, -3.0, 0.45),
    13: (-1.0, -0.32, 16.0, -3.0, 0.30),
    14: (-1.0, -0.15, 16.0, -3.0, 0.30),
    15: (-1.0, -0.15, 24.0, -2.8, 0.15),
}
"""Type -> a, b (gradation) and c, d, e (indicatrix), table 1 of the standard. 1 is overcast, 5 uniform, 12 clear, 15
hazy and bright round the sun."""


def relative_luminance(sky_type: int, toward_sky: np.ndarray, toward_sun: np.ndarray) -> np.ndarray:
    """Luminance over that of the zenith, float64 (…,), seen along unit vectors `toward_sky` (…, 3) with z ≥ 0.

    `toward_sun` (3,): unit vector, z ≥ 0. Equations 1 to 6 of the standard.
    """
    a, b, c, d, e = SKY_TYPES[sky_type]

    def gradation(cosine_of_zenith: np.ndarray | float) -> np.ndarray:
        # φ(90°) is 1: the exponential has gone long before the smallest cosine kept here.
        return 1.0 + a * np.exp(b / np.maximum(cosine_of_zenith, 2e-3))

    def indicatrix(cosine_to_sun: np.ndarray | float) -> np.ndarray:
        angle_rad = np.arccos(np.clip(cosine_to_sun, -1.0, 1.0))
        return 1.0 + c * (np.exp(d * angle_rad) - math.exp(0.5 * math.pi * d)) + e * np.square(cosine_to_sun)

    towards = np.asarray(toward_sky, dtype=np.float64)
    sun = np.asarray(toward_sun, dtype=np.float64)
    return indicatrix(towards @ sun) * gradation(towards[..., 2]) / (indicatrix(sun[2]) * gradation(np.float64(1.0)))
