"""One rendering: a single frame, with a report of what was done for it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ..base.memory import peak_bytes
from ..base.progress import Phase
from ..edit.parameters import Stage
from ..gpu.context import Context, create_context
from ..model.scene import Scene
from ..model.settings import RenderSettings
from ..passes.spectrum_choice import Spectrum
from .frames import Fill, FrameRenderer, Picture
from .light_stats import LightStats
from .notices import environment_notices, frame_notices

if TYPE_CHECKING:
    from .beam_light import BeamStats

Progress = Callable[[float, str], None]
Cancelled = Callable[[], bool]


@dataclass(frozen=True)
class CameraStats:
    """What the camera pass did."""

    samples: int = 0
    """A pixel."""
    spectrum: Spectrum = field(default_factory=Spectrum)
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
    map_flux_w: float
    camera_pass: CameraStats
    beams: BeamStats | None
    expected_bytes: int = 0
    """Peak of the process, as estimated before maps were made."""
    notices: tuple[str, ...] = ()
    """What must be reported in any case (`notices`)."""

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
        light, tally, camera = self.light, self.light.tally, self.camera_pass
        total, drawn = tally.emitted or 1.0, max(light.drawn_w, 1e-300)
        bands = (f"{name} {count} × {light.light_points[name]}" for name, count in light.bands.items())
        dropped = f"{light.footprints_dropped} ({light.dropped_w / drawn:.1e} of what was drawn)"
        return [
            f"emitted             {tally.emitted:.6e} W of scene flux per pass weight",
            *(f"  {name:<17} {flux / total:10.6f}" for name, flux in tally.ended.items()),
            f"  {'roulette':<17} {tally.roulette / total:10.6f}",
            *(
                [f"  {'carried on':<17} {-tally.carried_on / total:10.6f}   (beams left it to photons)"]
                if tally.carried_on
                else []
            ),
            f"  {'unaccounted':<17} {tally.imbalance:10.2e}   (emitted − all of the above)",
            (
                f"map holds           {self.map_flux_w / drawn:10.6f} of what was drawn; "
                f"outside every map {light.outside_map_w / drawn:.6f}"
            ),
            f"fall-backs          {_counted(tally.fallbacks)}, splat_footprint_dropped {dropped}",
            *self._beam_lines(),
            *([f"bands × points      {', '.join(bands)}"] if light.bands else []),
            (
                f"camera              {camera.samples} samples a pixel, {camera.spectrum.words}; "
                f"{_counted(camera.fallbacks)}"
            ),
            (f"maps                {self.atlas_size[0]}×{self.atlas_size[1]} texels"),
            (
                "buffers             "
                + ", ".join(f"{name} {size / 2**20:.0f}" for name, size in light.buffers.items())
                + f" MiB; peak of the process {peak_bytes() / 2**20:.0f} MiB, "
                f"{self.expected_bytes / 2**20:.0f} expected"
            ),
            (
                f"seconds             prepare {self.prepare_seconds:.2f}, emit and trace {light.trace_seconds:.2f}, "
                f"splat {light.splat_seconds:.2f}, camera {self.camera_seconds:.2f}, all {self.seconds:.2f}"
            ),
        ]

    def _beam_lines(self) -> list[str]:
        """What went by beams, and what by photons."""
        beams = self.beams
        if beams is None:
            return []
        emitted = self.light.tally.emitted / max(self.light.photons, 1)
        return [
            (
                f"beams               {beams.beams} followed, {beams.polygons} polygons, found in "
                f"{beams.find_seconds:.2f} s, drawn in {beams.draw_seconds:.2f} s"
            ),
            (
                f"carried             {beams.entered_w:.6e} W by beams, of which they left {beams.left_w:.3e} W to "
                f"photons on the way; {max(emitted - beams.entered_w, 0.0):.6e} W by photons from the lights on"
            ),
        ]


def _counted(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


@dataclass(frozen=True)
class RenderResult(Picture):
    """A finished picture and what was done for it."""

    stats: RenderStats = field(kw_only=True)
    layers: Mapping[str, Picture] = field(default_factory=dict, kw_only=True)
    """Layers requested besides the settings' own."""


def render(
    scene: Scene,
    settings: RenderSettings,
    progress: Progress = lambda fraction, text: None,
    cancelled: Cancelled = lambda: False,
    context: Context | None = None,
    begun: float | None = None,
    more_layers: Sequence[str] = (),
    fill: Fill | None = None,
) -> RenderResult:
    """Render `scene`. What was done when `cancelled()` turned true is kept and shown. `begun`: the
    `time.perf_counter()` from which `settings.seconds` count; None: now.

    `more_layers`: of "beauty" and "caustic", seen of the same photons. `fill`: see `FrameRenderer`."""
    begun = time.perf_counter() if begun is None else begun
    own = context is None
    context = context or create_context()
    stage = Stage(scene, scene.camera)
    frames = FrameRenderer(context, settings, [stage], begun, fill)
    try:
        for share in frames.steps(stage, cancelled):
            progress(share, Phase(frames.phase, frames.phase_ends))
        picture = frames.picture
        notices = tuple(frame_notices(frames.light, scene.camera, settings, picture.rgb))
        assert frames.traced is not None
        notices += tuple(environment_notices(frames.traced.environment, frames.traced.bounces))
        stats = replace(_stats(context, frames, settings), notices=notices)
        layers = {}
        for layer in more_layers:
            for share in frames.steps_of_layer(layer, stage, cancelled):
                progress(share, Phase(frames.phase, frames.phase_ends))
            layers[layer] = frames.picture
        return RenderResult(**vars(picture), stats=stats, layers=layers)
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
        light.maps.flux() if settings.tally else 0.0,
        camera,
        None if light.survey.beams is None else light.survey.beams.stats,
        frames.memory.peak if frames.memory is not None else 0,
    )
