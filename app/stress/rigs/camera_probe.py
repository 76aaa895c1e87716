"""What the stress sweep's camera cases share: one picture by the camera pass with its fall-backs, closed forms to hold
it against, and skies.

No light is traced: what a case is about lies between the camera and what shines by itself, or is lit directly. Pictures
are small, and most of them of the same few programs, which are kept while a case runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import wraps

import numpy as np

from ...features.features import Features
from ...gpu import shader
from ...gpu.context import Context
from ...gpu.map_channels import MapChannels
from ...gpu.scene_buffers import SceneBuffers
from ...model.environment import direction_of
from ...model.optics.colorimetry import K_M, cmf_xyz, daylight_per_lumen, rgb709_to_xyz, xyz_to_rgb709
from ...model.scene import Camera, Scene, SceneObject
from ...model.settings import RenderSettings
from ...model.texture import Environment
from ...passes.camera import CameraPass
from ...passes.spectrum_choice import Spectrum
from ...render.device_scene import spectral_axis
from ..case import Measurement
from .probe import nonfinite

PROBE = RenderSettings(width=48, height=32, spp=16)
"""What a case looks at unless it is about just that."""
WHITE = (1.0, 1.0, 1.0)
UNCHECKED = np.inf
CHANCE = 4.0
"""Standard deviations of chance that an error may have: one in sixteen thousand is larger."""


@dataclass(frozen=True)
class Sight:
    """What the camera saw."""

    picture: np.ndarray
    """float64 (H, W, 3), linear Rec.709."""
    nonfinite: int
    """Values of the picture (bins included) that are NaN or infinite."""
    fallbacks: dict[str, int]
    samples: int
    """Camera samples over all pixels."""
    bands: int
    spectral: np.ndarray | None = None
    """float64 (H, W, bins)."""

    @property
    def mean(self) -> np.ndarray:
        """Mean colour, (3,)."""
        return self.picture.mean(axis=(0, 1))

    def share(self, fallback: str) -> float:
        """How often a fall-back was taken for each camera sample."""
        return self.fallbacks[fallback] / self.samples


def sharing_programs(measure: Callable[[Context], Iterator[Measurement]]) -> Callable[[Context], Iterator[Measurement]]:
    """A case's `measure` during which a program that was compiled before is not compiled again."""

    @wraps(measure)
    def sharing(context: Context) -> Iterator[Measurement]:
        shader.keep_programs(context.ctx)
        try:
            yield from measure(context)
        finally:
            shader.forget_programs(context.ctx)

    return sharing


@contextmanager
def opened_camera_pass(context: Context, scene: Scene, settings: RenderSettings = PROBE) -> Iterator[CameraPass]:
    """The camera pass of `scene`, without caustics; freed afterwards."""
    features = Features.of(scene, settings)
    buffers = SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
    edges = None if settings.bins is None else tuple(np.linspace(380.0, 780.0, settings.bins + 1).tolist())
    try:
        camera_pass = CameraPass(context, buffers, settings.layer, maps=MapChannels(edges))
        try:
            yield camera_pass
        finally:
            camera_pass.release()
    finally:
        buffers.release()


def render_probe(context: Context, scene: Scene, settings: RenderSettings = PROBE, bands: int | None = None) -> Sight:
    """A picture of `scene` in so many bands (None: as many as a rendering would choose), `settings.spp` samples a pixel
    or a whole cycle more."""
    with opened_camera_pass(context, scene, settings) as camera_pass:
        return look_with(camera_pass, scene.camera, settings, bands)


def look_with(
    camera_pass: CameraPass, camera: Camera, settings: RenderSettings = PROBE, bands: int | None = None
) -> Sight:
    """The same with a pass that is there already."""
    samples = settings.spp or 1
    if bands is not None:
        camera_pass.spectrum = Spectrum(bands)
    else:
        bands = camera_pass.choose_spectrum(camera, settings.width, settings.height, samples).bands
    before = camera_pass.fallbacks
    samples = -(-samples // bands) * bands
    camera_pass.run(camera, settings.width, settings.height, samples, seed=settings.seed)
    picture = camera_pass.read_rgb()
    spectral = camera_pass.read_spectral() if settings.bins else None
    bad = nonfinite(picture) + (0 if spectral is None else nonfinite(spectral))
    taken = {name: count - before[name] for name, count in camera_pass.fallbacks.items()}
    in_bins = None if spectral is None else spectral.astype(float)
    return Sight(picture.astype(float), bad, taken, samples * settings.width * settings.height, bands, in_bins)


@dataclass
class Judged:
    """Errors and bounds of one severity, side by side."""

    errors: dict[str, float] = field(default_factory=dict)
    bounds: dict[str, float] = field(default_factory=dict)

    def hold(self, name: str, error: float, bound: float) -> Judged:
        """Add one promise."""
        self.errors[name], self.bounds[name] = float(error), float(bound)
        return self

    def tell(self, name: str, error: float) -> Judged:
        """Add a number that is shown and not judged."""
        self.errors[name] = float(error)
        return self


def measurement_of(
    severity: float, label: str, sight: Sight, judged: Judged, shares: dict[str, float] | None = None, note: str = ""
) -> Measurement:
    """A sight's measurement: finite, and no fall-back taken more often than `shares` says, as a share of the samples
    (those not named: never)."""
    allowed = dict.fromkeys(sight.fallbacks, 0.0) | (shares or {})
    for name, most in allowed.items():
        if np.isfinite(most):
            judged.hold(name.replace("_", " "), sight.share(name), most)
    bands = f"{sight.bands} band{'s' if sight.bands > 1 else ''}"
    noted = f"{note}; {bands}" if note else bands
    return Measurement(
        severity, label, sight.nonfinite, judged.errors, judged.bounds, fallbacks=dict(sight.fallbacks), note=noted
    )


# ---- what is to be seen ----------------------------------------------------------------------


def sky(radiance: Callable[[np.ndarray], np.ndarray], height: int = 128) -> Environment:
    """`radiance` of world directions (…, 3), grey (…) or RGB (…, 3), as a picture of `height` rows."""
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height)
    value = np.asarray(radiance(direction_of(Environment(np.zeros((1, 1, 3), np.float32)), u, v)), float)
    rgb = np.repeat(value[..., None], 3, axis=-1) if value.ndim == 2 else value
    return Environment(np.ascontiguousarray(rgb, np.float32))


def half_sky(toward: tuple[float, float, float]) -> Environment:
    """White on the side of `toward`, black on the other."""
    axis = np.asarray(toward, float)
    return sky(lambda d: (d @ axis > 0.0).astype(float))


def slope(directions: np.ndarray) -> np.ndarray:
    """Radiance (…) of directions (…, 3) that changes in every one: a little wrong way shows."""
    return 1.0 + 0.8 * (directions @ np.array([0.36, 0.48, 0.8]))


def slope_sky() -> Environment:
    """`slope` as a sky."""
    return sky(slope)


def white_furnace(*objects: SceneObject, camera: Camera, **more) -> Scene:
    """Objects before a white that is the same all round: what neither absorbs nor loses light cannot be seen in it."""
    return Scene("furnace", camera, (), objects, background_rgb=WHITE, **more)


def with_sky(*objects: SceneObject, camera: Camera, environment: Environment) -> Scene:
    """Objects under a sky, without any light."""
    return Scene("sky", camera, (), objects, environment=environment)


def at(x: float, y: float, z: float) -> np.ndarray:
    """Placement of an object's origin, (4, 4)."""
    place = np.eye(4)
    place[:3, 3] = x, y, z
    return place


# ---- what is to be expected ------------------------------------------------------------------


def daylight_mean(values: np.ndarray) -> np.ndarray:
    """Linear Rec.709 (…, 3) of white light of radiance 1 whose share `values` (…, 401) arrives at 380, 381, … 780
    nm."""
    return xyz_to_rgb709(np.asarray(values) @ (K_M * daylight_per_lumen()[:, None] * cmf_xyz()))


def fresnel(cosine: np.ndarray | float, n: np.ndarray | float) -> np.ndarray:
    """Unpolarised reflectance on the way into a medium of relative index `n`, float64; 1 beyond the critical angle."""
    cosine, n = np.broadcast_arrays(np.asarray(cosine, float), np.asarray(n, float))
    inner = 1.0 - (1.0 - cosine**2) / n**2
    beyond = np.sqrt(np.maximum(inner, 0.0))
    across = (cosine - n * beyond) / (cosine + n * beyond)
    along = (n * cosine - beyond) / (n * cosine + beyond)
    return np.where(inner > 0.0, 0.5 * (across**2 + along**2), 1.0)


def difference(picture: np.ndarray, expected: np.ndarray) -> float:
    """Root mean square of the difference over the mean of what is expected."""
    with np.errstate(all="ignore"):
        return float(np.sqrt(np.mean((picture - expected) ** 2)) / max(np.abs(np.mean(expected)), 1e-300))


def furnace_errors(judged: Judged, picture: np.ndarray, mean: float, worst: float) -> Judged:
    """A furnace's two promises: over the picture, and of each pixel (its luminance)."""
    luminance = rgb709_to_xyz(picture)[..., 1]
    judged.hold("energy", np.abs(picture.mean(axis=(0, 1)) - 1.0).max(), mean)
    return judged.hold("energy of a pixel", np.abs(luminance - 1.0).max(), worst)


def resized(settings: RenderSettings, width: int, height: int, spp: int | None = None) -> RenderSettings:
    """Other size and samples."""
    return replace(settings, width=width, height=height, spp=settings.spp if spp is None else spp)
