"""One rendering: a frame that stands alone, with what was done for it told."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..edit.parameters import Stage
from ..gpu.context import Context, create_context
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.spectrum_choice import Spectrum
from .frames import FrameRenderer, Picture
from .light_pass import LightStats

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


@dataclass(frozen=True)
class RenderStats:
    """What was done, for the summary line and `--stats`."""

    renderer: str
    is_software: bool
    light: LightStats
    seconds: float
    prepare_seconds: float
    camera_seconds: float
    atlas_size: tuple[int, int]
    bytes: int
    map_flux_w: float
    camera_pass: CameraStats

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
            f"camera              {self.camera_pass.samples} samples a pixel, {self.camera_pass.spectrum.words}; "
            + ", ".join(f"{name} {count}" for name, count in self.camera_pass.fallbacks.items()),
            f"maps                {self.atlas_size[0]}×{self.atlas_size[1]} texels, buffers {self.bytes / 2**20:.0f} MiB",
            f"seconds             prepare {self.prepare_seconds:.2f}, emit and trace {self.light.trace_seconds:.2f}, "
            f"splat {self.light.splat_seconds:.2f}, camera {self.camera_seconds:.2f}, all {self.seconds:.2f}",
        ]
        return text


@dataclass(frozen=True)
class RenderResult(Picture):
    """A finished picture and what was done for it."""

    stats: RenderStats = field(kw_only=True)


def render(
    scene: Scene,
    settings: RenderSettings,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
    context: Context | None = None,
) -> RenderResult:
    """Render `scene`. What was done when `cancelled()` turned true is kept and shown."""
    own = context is None
    context = context or create_context()
    stage = Stage(scene, scene.camera)
    frames = FrameRenderer(context, settings, [stage])
    try:
        for share in frames.steps(stage, cancelled):
            progress(share, frames.phase)
        picture = frames.picture
        return RenderResult(**vars(picture), stats=_stats(context, frames, settings))
    finally:
        frames.release()
        if own:
            context.release()


def _stats(context: Context, frames: FrameRenderer, settings: RenderSettings) -> RenderStats:
    light, camera_pass = frames.light, frames.camera_pass
    camera = CameraStats()
    if camera_pass is not None:
        fallbacks = camera_pass.fallbacks if settings.tally else {}
        camera = CameraStats(camera_pass.samples_taken, camera_pass.spectrum, fallbacks)
    return RenderStats(
        context.renderer,
        context.is_software,
        light.stats,
        time.perf_counter() - frames.seconds.started,
        frames.seconds.prepare,
        frames.seconds.camera,
        light.layout.size,
        light.buffers.bytes + light.trace.bytes,
        light.map_flux() if settings.tally else 0.0,
        camera,
    )
