"""What the camera cases share: one picture by the camera pass with its fall-backs, closed forms to compare it with, and
skies.

No light is traced: a case is about what is between the camera and what shines by itself, or is lit directly. Pictures
are small, and most of them come from the same few programs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...features.features import Features
from ...gpu.context import Context
from ...gpu.map_channels import MapChannels
from ...gpu.scene_buffers import SceneBuffers
from ...model.environment import direction_of
from ...model.optics.colorimetry import K_M, cmf_xyz, daylight_per_lumen, rgb709_to_xyz, xyz_to_rgb709
from ...model.scene import Camera, Scene, SceneObject
from ...model.settings import RenderSettings
from ...model.texture import Environment
from ...model.vectors import vec3
from ...passes.camera import CameraPass
from ...passes.spectrum_choice import Spectrum
from ...render.device_scene import spectral_axis
from ..case import Held, Measurement, judged, not_finite

PROBE = RenderSettings(width=48, height=32, spp=16)
"""The picture that a case takes unless it is about just that."""
FEW = replace(PROBE, width=12, height=8, spp=64)
"""Of flat glass, which appears the same in every pixel."""
WHITE = (1.0, 1.0, 1.0)
CHANCE = 4.0
"""Standard deviations of chance that an error may have: one in sixteen thousand is larger."""
ANY = dict.fromkeys(("depth_reached", "columns_dropped", "band_uncut", "stack_full"), np.inf)
"""Fall-backs that may be taken however often."""


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


def together(first: Sight, *others: Sight) -> Sight:
    """The first, with what is not finite in any of them and all their fall-backs."""
    sights = (first, *others)
    fallbacks = {name: sum(s.fallbacks[name] for s in sights) for name in first.fallbacks}
    samples, bad = (sum(getattr(s, name) for s in sights) for name in ("samples", "nonfinite"))
    return replace(first, nonfinite=bad, fallbacks=fallbacks, samples=samples)


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
        for _ in camera_pass.choosing_spectrum(camera, settings.width, settings.height, samples):
            pass
        bands = camera_pass.spectrum.bands
    before = camera_pass.fallbacks
    samples = -(-samples // bands) * bands
    camera_pass.run(camera, settings.width, settings.height, samples, seed=settings.seed)
    picture = camera_pass.read_rgb().astype(float)
    spectral = camera_pass.read_spectral().astype(float) if settings.bins else None
    bad = not_finite([picture] if spectral is None else [picture, spectral])
    taken = {name: count - before[name] for name, count in camera_pass.fallbacks.items()}
    return Sight(picture, bad, taken, samples * settings.width * settings.height, bands, spectral)


def seen(
    severity: float, label: str, sight: Sight, held: Held, shares: Mapping[str, float] | None = None, note: str = ""
) -> Measurement:
    """A sight's measurement: finite, and no fall-back taken more often than `shares`, as a share of the samples
    (those not named: never)."""
    allowed = dict.fromkeys(sight.fallbacks, 0.0) | dict(shares or {})
    taken = {name.replace("_", " "): (sight.share(name), most) for name, most in allowed.items() if np.isfinite(most)}
    errors, bounds = judged({**held, **taken})
    bands = f"{sight.bands} band{'s' if sight.bands > 1 else ''}"
    noted = f"{note}; {bands}" if note else bands
    return Measurement(severity, label, sight.nonfinite, errors, bounds, fallbacks=dict(sight.fallbacks), note=noted)


# ---- what is to be seen ----------------------------------------------------------------------


def straight(foot: ArrayLike, direction: ArrayLike, extent: float, distance: float = 3.0) -> Camera:
    """Parallel rays along `direction` (3,) in the plane z = 0 or near it, which meet `foot` after `distance`."""
    position = np.asarray(foot, float) - distance * np.asarray(direction, float)
    return Camera(
        vec3(position), vec3(np.asarray(foot, float)), (0.0, 0.0, 1.0), "orthographic", vertical_extent=extent
    )


def sky(radiance: Callable[[np.ndarray], np.ndarray], height: int = 128) -> Environment:
    """`radiance` of world directions (…, 3), grey (…) or RGB (…, 3), as a picture of `height` rows."""
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height)
    value = np.asarray(radiance(direction_of(Environment(np.zeros((1, 1, 3), np.float32)), u, v)), float)
    rgb = np.repeat(value[..., None], 3, axis=-1) if value.ndim == 2 else value
    return Environment(np.ascontiguousarray(rgb, np.float32))


def ahead(directions: np.ndarray) -> np.ndarray:
    """Radiance (…) of directions (…, 3): white towards x, black on the other side."""
    return (directions[..., 0] > 0.0).astype(float)


def slope(directions: np.ndarray) -> np.ndarray:
    """Radiance (…) of directions (…, 3) that changes in every one: a small error of direction shows."""
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


def in_furnace(picture: np.ndarray, mean: float, worst: float) -> Held:
    """A furnace's two promises: over the picture, and of each pixel (its luminance)."""
    luminance = rgb709_to_xyz(picture)[..., 1]
    error = np.abs(picture.mean(axis=(0, 1)) - 1.0).max()
    return {"energy": (error, mean), "energy of a pixel": (np.abs(luminance - 1.0).max(), worst)}


def resized(settings: RenderSettings, width: int, height: int, spp: int | None = None) -> RenderSettings:
    """Other size and samples."""
    return replace(settings, width=width, height=height, spp=settings.spp if spp is None else spp)
