"""One rendering, top to bottom: file's Scene → Features → buffers → light pass → camera pass → picture."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ..gpu.context import Context, create_context
from ..gpu.scene_buffers import SceneBuffers
from ..model.features import Features
from ..model.optics.colorimetry import xyz_to_rgb709
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.camera import CameraPass, CausticMaps
from ..passes.present import Channels
from ..passes.spectrum_choice import Spectrum
from .light_pass import LightPass, LightStats, spectral_axis

FIRST_PASS_PHOTONS = 1 << 17
"""Photons of a timed rendering's first pass, which finds out how fast the scene goes."""
DEFAULT_SAMPLES = 16
"""Camera samples a pixel."""

Progress = Callable[[float, str], None]
Cancelled = Callable[[], bool]


@dataclass(frozen=True)
class CameraStats:
    """What the camera pass did."""

    samples: int = 0
    """A pixel."""
    spectrum: Spectrum = Spectrum()
    """How samples saw it."""
    fallbacks: Mapping[str, int] = field(default_factory=dict)


@dataclass
class RenderStats:
    """What was done, for the summary line and `--stats`."""

    renderer: str
    is_software: bool
    light: LightStats
    seconds: float = 0.0
    prepare_seconds: float = 0.0
    camera_seconds: float = 0.0
    atlas_size: tuple[int, int] = (0, 0)
    bytes: int = 0
    map_flux_w: float = 0.0
    camera_pass: CameraStats = CameraStats()

    @property
    def photons(self) -> int:
        """Photons emitted."""
        return self.light.photons

    @property
    def splats(self) -> int:
        """Photons that landed and were splatted."""
        return self.light.splats

    def lines(self) -> list[str]:
        """The energy balance and the times, one line each."""
        tally = self.light.tally
        total = tally.emitted or 1.0
        text = [f"emitted             {tally.emitted:.6e} W of scene flux per pass weight"]
        text += [f"  {name:<17} {flux / total:10.6f}" for name, flux in tally.ended.items()]
        text += [
            f"  {'roulette':<17} {tally.roulette / total:10.6f}",
            f"  {'unaccounted':<17} {tally.imbalance:10.2e}   (emitted − all of the above)",
            f"map holds           {self.map_flux_w / max(tally.ended['deposited'], 1e-300):10.6f} of what was deposited; "
            f"outside every map {self.light.outside_map_w / max(tally.ended['deposited'], 1e-300):.6f}",
            "fall-backs          "
            + ", ".join(f"{name} {count}" for name, count in tally.fallbacks.items())
            + f", splat_footprint_dropped {self.light.footprints_dropped} ({self.light.dropped_w / max(tally.ended['deposited'], 1e-300):.1e} of what was deposited)",
            "bands × points      "
            + ", ".join(
                f"{name} {count} × {self.light.light_points[name]}" for name, count in self.light.bands.items()
            ),
            f"camera                 {self.camera_pass.samples} samples a pixel, {self.camera_pass.spectrum.words}; "
            + ", ".join(f"{name} {count}" for name, count in self.camera_pass.fallbacks.items()),
            f"maps                {self.atlas_size[0]}×{self.atlas_size[1]} texels, buffers {self.bytes / 2**20:.0f} MiB",
            f"seconds             prepare {self.prepare_seconds:.2f}, emit and trace {self.light.trace_seconds:.2f}, "
            f"splat {self.light.splat_seconds:.2f}, camera {self.camera_seconds:.2f}, all {self.seconds:.2f}",
        ]
        return text


@dataclass(frozen=True)
class RenderResult:
    """A finished picture."""

    rgb: np.ndarray
    """float32 (H, W, 3), linear Rec.709, lm/(sr unit²) for white; top row first."""
    spectral: np.ndarray | None
    """float32 (H, W, bins), W/(sr unit²) per bin, or None."""
    bin_edges_nm: np.ndarray | None
    stats: RenderStats


def render(
    scene: Scene,
    settings: RenderSettings,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
    context: Context | None = None,
) -> RenderResult:
    """Render `scene`. What was done when `cancelled()` turned true is kept and shown."""
    started = time.perf_counter()
    own = context is None
    context = context or create_context()
    try:
        return _render(context, scene, settings, progress, cancelled, started)
    finally:
        if own:
            context.release()


def _render(
    context: Context, scene: Scene, settings: RenderSettings, progress: Progress, cancelled: Cancelled, started: float
) -> RenderResult:
    progress(0.0, "preparing")
    features = Features.of(scene, settings)
    buffers = SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
    light = LightPass(context, scene, settings, features, buffers)
    stats = RenderStats(context.renderer, context.is_software, light.stats)
    try:
        light.prepare()
        stats.prepare_seconds = time.perf_counter() - started
        if settings.seconds is None:
            _trace_and_splat(light, settings.photons or scene.render.photons, settings.seed, progress, cancelled)
        else:
            _trace_for(light, settings.seconds, settings.seed, progress, cancelled)
        light.finish()
        stats.light = light.stats
        stats.atlas_size = light.layout.size
        stats.bytes = buffers.bytes + light.trace.bytes
        camera_started = time.perf_counter()
        if settings.layer.startswith("map:"):
            rgb, spectral = _map_layer(light)
        else:
            rgb, spectral = _camera_layer(context, scene, settings, buffers, light, stats, progress, cancelled)
        stats.camera_seconds = time.perf_counter() - camera_started
        stats.seconds = time.perf_counter() - started
        if settings.tally:
            stats.map_flux_w = light.map_flux()
        return RenderResult(rgb, spectral, light.bin_edges_nm, stats)
    finally:
        light.release()
        buffers.release()


def _trace_and_splat(light: LightPass, photons: int, seed: int, progress: Progress, cancelled: Cancelled) -> None:
    """One pass of so many photons."""

    def proceed(fraction: float) -> bool:
        progress(0.9 * fraction, "tracing photons")
        return not cancelled()

    light.begin(photons, seed)
    light.run_pass(0, photons, proceed)


def _trace_for(light: LightPass, seconds: float, seed: int, progress: Progress, cancelled: Cancelled) -> None:
    """Passes as fine as `seconds` allow.

    Coarse footprints blur, and what they blurred stays in the sum: so a first small pass only tells how
    fast this scene goes, and everything starts anew with one pass that fills the time that is left.
    """
    begun = time.perf_counter()

    def in_time(_: float) -> bool:
        spent = (time.perf_counter() - begun) / seconds
        progress(0.9 * min(spent, 1.0), "tracing photons")
        return spent < 1.0 and not cancelled()

    photons = FIRST_PASS_PHOTONS
    light.begin(photons, seed)
    complete = light.run_pass(0, photons, in_time) and in_time(0.0)
    spent = light.stats.trace_seconds + light.stats.splat_seconds
    left = seconds - (time.perf_counter() - begun)
    affordable = int(left * light.stats.photons / max(spent, 1e-6))
    if not complete or affordable < 2 * photons:
        number = 1
    else:
        number, photons = 0, affordable
        light.begin(photons, seed)
    while in_time(0.0) and light.run_pass(number, photons, in_time):
        number += 1


def _map_layer(light: LightPass) -> tuple[np.ndarray, np.ndarray | None]:
    """The caustic map itself as a picture: irradiance (or reflected light) on the receiver, lm/unit²."""
    receiver = light.map_receiver
    assert receiver is not None
    record = light.layout.receivers[receiver]
    area = light.layout.placements["texel_area"][record["placement"]]
    texels = light.resolved_map(receiver)[::-1] * np.float32(light.map_scale / area)
    if light.bin_edges_nm is None:
        return xyz_to_rgb709(texels[..., :3].astype(float)).astype(np.float32), None
    channels = Channels(tuple(light.bin_edges_nm.tolist()))
    return channels.to_rgb709(texels), channels.to_spectral(texels)


def camera_features(scene: Scene, settings: RenderSettings) -> Features:
    """What the camera's rays need: those of its own method, where it has one."""
    method = settings.camera_method or settings.method
    return Features.of(scene, replace(settings, method="stochastic" if method == "stochastic-point" else method))


def _camera_layer(
    context: Context,
    scene: Scene,
    settings: RenderSettings,
    buffers: SceneBuffers,
    light: LightPass,
    stats: RenderStats,
    progress: Progress,
    cancelled: Cancelled,
) -> tuple[np.ndarray, np.ndarray | None]:
    """The camera's picture and, where asked for, its spectral bins."""
    own = None
    if (settings.camera_method or settings.method) != settings.method:
        features = camera_features(scene, settings)
        own = SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
    camera_pass = CameraPass(context, own or buffers, settings.layer, light.reflectances, light.map_channels)
    maps = CausticMaps(light.resolved_textures(), light.receivers, light.atlas.placements, light.map_scale)
    try:
        # A stop asked for while tracing still wants a picture: only the first sample is owed then.
        samples = settings.spp or DEFAULT_SAMPLES
        stop_at_once = cancelled()
        if not stop_at_once:
            # Every stretch of the spectrum has its turn equally often.
            camera_pass.may_be_single = True
            samples = camera_pass.choose_spectrum(scene.camera, settings.width, settings.height, samples, maps).samples(
                samples
            )
        camera_pass.run(
            scene.camera,
            settings.width,
            settings.height,
            1 if stop_at_once else samples,
            0,
            maps,
            settings.seed,
            lambda fraction: progress(0.9 + 0.1 * fraction, "looking"),
            None if stop_at_once else cancelled,
        )
        stats.camera_pass = CameraStats(
            camera_pass.samples_taken, camera_pass.spectrum, camera_pass.fallbacks if settings.tally else {}
        )
        return camera_pass.read_rgb(), camera_pass.read_spectral() if light.bin_edges_nm is not None else None
    finally:
        camera_pass.release()
        if own is not None:
            own.release()
