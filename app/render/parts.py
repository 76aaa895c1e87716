"""One picture on many machines: each traces a share of the rounds, and the sums of all are the picture's maps.

Random numbers are counters, so a share is exactly what one process would have traced in its rounds: nothing has to be
agreed upon but the number of rounds. Only light is divided; the camera sees the merged maps once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ..base.errors import UserError
from ..base.version import __version__
from ..edit.parameters import Stage
from ..gpu.context import Context
from ..model.scene import Scene
from ..model.scene_key import picture_key
from ..model.settings import RenderSettings
from ..passes.trace import FluxTally
from .frames import FrameRenderer, Stop
from .light_pass import LightPass
from .light_stats import LightStats
from .pass_sizes import pass_sizes
from .sampling import LightSampling

_SETTINGS = (
    "width",
    "height",
    "photons",
    "seed",
    "method",
    "camera_method",
    "layer",
    "bins",
    "max_depth",
    "spp",
    "smoothing",
    "local_gain",
)
"""What decides the picture besides the scene."""


@dataclass(frozen=True)
class Share:
    """Which part of a rendering: `index` of `count`, from 1 on."""

    index: int
    count: int


@dataclass(frozen=True)
class PartHeader:
    """What a part is; plain values."""

    name: str
    """The scene's."""
    scene: str
    """Its file."""
    key: str
    """Hash of everything that decides the picture."""
    settings: Mapping[str, Any]
    share: Share
    rounds: int
    """Rounds of the whole rendering, over all parts."""
    layout: str
    """Hash of the maps' places (`layout_key`)."""
    size: tuple[int, int]
    targets: int
    """Textures, each float32 (height, width, 4)."""
    photon_weight: float
    stats: Mapping[str, Any]
    renderer: str
    others: tuple[int, ...] = ()
    """Parts that were merged into this one, besides `share`."""

    @property
    def indices(self) -> tuple[int, ...]:
        """All parts that it holds."""
        return (self.share.index, *self.others)

    def light_stats(self) -> LightStats:
        """What was counted."""
        values = dict(self.stats)
        return LightStats(**values | {"tally": FluxTally(**values["tally"])})


@dataclass
class Part:
    """A part as it was traced."""

    header: PartHeader
    sums: list[np.ndarray] = field(default_factory=list)
    """Float32 (height, width, 4) for every texture of the maps."""


def rendering_key(scene: Scene, settings: RenderSettings) -> str:
    """Key of everything that decides a picture of `scene`: only equal ones are parts of one picture."""
    dabs = [item.local_dispersion for item in scene.objects]
    return picture_key(scene, __version__, repr(dabs), *(getattr(settings, name) for name in _SETTINGS))


def settings_of(header: PartHeader) -> RenderSettings:
    """The settings of the rendering that a part belongs to."""
    return RenderSettings(**{name: header.settings[name] for name in _SETTINGS})


def trace_part(
    context: Context,
    scene: Scene,
    settings: RenderSettings,
    share: Share,
    scene_file: str,
    progress: Callable[[float], None] = lambda done: None,
    stop: Stop = lambda: False,
) -> Part | None:
    """Trace one share of a rendering; None where `stop()` turned true before it was whole.

    Raises `UserError` where the rendering has fewer rounds than parts.
    """
    with _prepared(context, scene, settings, stop) as (light, settings):
        if light is None:
            return None
        sampling = LightSampling.of(scene, settings)
        sizes = pass_sizes(light.features.method, sampling.photons)
        rounds, groups = _rounds_and_groups(light, sampling)
        if sum(groups) < share.count:
            way_out = "give fewer parts, more photons or a smaller --batch"
            if light.survey.only_beams:
                way_out = "beams carry its light, in rounds of a million photons: --method srd-photons has more"
            raise UserError(
                f"{share.count} parts: this rendering is traced in {sum(groups)} rounds, which are not enough to "
                f"share out; {way_out}"
            )
        mine, done = len(range(share.index - 1, sum(groups), share.count)), 0
        light.begin(sizes[0], sampling.seed)
        for number, photons in enumerate(sizes):
            light.plan(photons, number)
            first = (share.index - 1 - sum(groups[:number])) % share.count
            for step in light.pass_steps(number, photons, 0, first, share.count):
                done += step.round_done
                progress(done / mine)
                if stop():
                    return None
        light.finish()
        header = PartHeader(
            scene.name,
            scene_file,
            rendering_key(scene, settings),
            {name: getattr(settings, name) for name in _SETTINGS},
            share,
            rounds,
            layout_key(light),
            light.maps.atlas.size,
            light.maps.atlas.targets,
            light.maps.photon_weight,
            _plain(light.stats),
            context.renderer,
        )
        return Part(header, [_texels(light, target) for target in range(light.maps.atlas.targets)])


def parts_at_most(context: Context, scene: Scene, settings: RenderSettings) -> int:
    """Into how many parts a rendering can be divided; traces nothing but its pilots."""
    with _prepared(context, scene, settings) as (light, settings):
        assert light is not None
        return max(sum(_rounds_and_groups(light, LightSampling.of(scene, settings))[1]), 1)


@contextmanager
def _prepared(
    context: Context, scene: Scene, settings: RenderSettings, stop: Stop = lambda: False
) -> Iterator[tuple[LightPass | None, RenderSettings]]:
    """The light pass of a rendering, ready to be traced (None where `stop()` turned true before that), and its settings
    with the number of photons."""
    settings = replace(settings, photons=settings.photons or scene.render.photons)
    stage = Stage(scene, scene.camera)
    renderer = FrameRenderer(context, settings, [stage])
    try:
        stopped = any(stop() for _ in renderer.preparing(stage))
        yield None if stopped else renderer.light, settings
    finally:
        renderer.release()


def _rounds_and_groups(light: LightPass, sampling: LightSampling) -> tuple[int, list[int]]:
    """Rounds of all passes, and for each pass how many groups of rounds may be traced apart: what has its beams
    together belongs to one part."""
    sizes = pass_sizes(light.features.method, sampling.photons)
    light.begin(sizes[0], sampling.seed)
    rounds, groups = 0, []
    for number, photons in enumerate(sizes):
        light.plan(photons, number)
        planned = light.pass_of(number, photons)
        rounds += planned.count
        groups.append(-(-planned.count // planned.together))
    return rounds, groups


def layout_key(light: LightPass) -> str:
    """Hash of the maps' places and of what their channels are."""
    digest = hashlib.sha256(repr((light.layout.size, light.maps.atlas.targets, light.bin_edges_nm)).encode())
    digest.update(np.ascontiguousarray(light.layout.placements).tobytes())
    return digest.hexdigest()


def check_maps(light: LightPass, header: PartHeader, name: str) -> None:
    """Raise `UserError` where a part, called `name`, was traced for other maps than those of `light`."""
    if (layout_key(light), light.maps.atlas.size, light.maps.atlas.targets) != (
        header.layout,
        header.size,
        header.targets,
    ):
        raise UserError(
            f"{name} was traced by '{header.renderer}', whose maps have other places than those of "
            f"'{light.context.renderer}': merge where the parts were traced"
        )


def merged_header(headers: Sequence[PartHeader]) -> PartHeader:
    """Headers of parts of one rendering, none of which holds what another does, merged into one."""
    first, *others = sorted(index for header in headers for index in header.indices)
    stats = merged_stats(header.light_stats() for header in headers)
    weight = sum(header.photon_weight for header in headers)
    share = replace(headers[0].share, index=first)
    return replace(headers[0], share=share, others=tuple(others), photon_weight=weight, stats=_plain(stats))


def merged_stats(stats: Iterable[LightStats]) -> LightStats:
    """What all counted together."""
    merged = LightStats()
    for part in stats:
        merged.tally.merge(part.tally)
        for name in ("photons", "splats", "trace_seconds", "splat_seconds", "splats_w", "polygons_w", "outside_map_w",
                     "footprints_dropped", "dropped_w"):  # fmt: skip
            setattr(merged, name, getattr(merged, name) + getattr(part, name))
    return merged


def merged_light(
    headers: list[PartHeader], sums: Iterable[np.ndarray], refuse: Callable[[LightPass], None]
) -> Callable[[LightPass, LightSampling, Stop], Iterator[float]]:
    """What fills the maps of a rendering with parts; `sums` of all, texture by texture. `refuse` may raise where the
    light pass is another than the parts'."""

    def fill(light: LightPass, sampling: LightSampling, stopped: Stop) -> Iterator[float]:
        light.begin(pass_sizes(light.features.method, sampling.photons)[0], sampling.seed)
        refuse(light)
        weight = sum(header.photon_weight for header in headers)
        light.take(sums, weight, merged_stats(header.light_stats() for header in headers))
        yield 1.0

    return fill


def _texels(light: LightPass, target: int) -> np.ndarray:
    width, height = light.maps.atlas.size
    texels = np.empty((height, width, 4), np.float32)
    light.context.ctx.memory_barrier()
    light.maps.atlas.total_textures[target].read_into(texels)
    return texels


def _plain(stats: LightStats) -> dict[str, Any]:
    """Counts only: bands and buffers are the same in all parts."""
    values = asdict(stats)
    return {name: value for name, value in values.items() if name not in ("bands", "light_points", "buffers")}
