"""One picture, one caustic map: each in a context of its own, gone afterwards."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..base.errors import UserError
from ..base.generators import finished
from .arguments import Count, Size, check_scene, settings_of
from .device import Cancel, Progress, Report, run
from .picture import CausticMap, Picture, Statistics
from .scene import Scene

if TYPE_CHECKING:
    from ..gpu.context import Context
    from ..render.still import RenderResult

DEFAULT_MAP_SIZE = (1024, 1024)


def render(
    scene: Scene,
    *,
    size: Size | None = None,
    photons: Count | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    method: str | None = None,
    camera_method: str | None = None,
    layers: str | Sequence[str] = "beauty",
    bins: int | None = None,
    exposure: float | None = None,
    max_depth: int | None = None,
    spp: int | None = None,
    batch: Count | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Picture:
    """Render `scene`; what is not given is as the scene has it.

    `size`: width and height in pixels. `photons` to emit ("4M" will do), or `seconds` to emit them for. `seed`: of the
    random numbers, 1 by default. `method`, `camera_method`: how wavelengths are sampled, "srd" by default. `layers`:
    "beauty", "caustic", both, or one "map:RECEIVER". `bins`: 4 to 32 spectral bins. `exposure`: stops, for pictures to
    look at. `max_depth`: specular events on a light path at most. `spp`: camera samples a pixel. `batch`: photons in
    flight at once, which never changes the picture. Pictures are those of `spectrasplat render`, to the bit.

    `progress(share, text)` is called now and then; once `cancel()` returns true, the picture is what was done by then.
    Raises `UserError`, in one sentence with a way out, for anything that cannot be rendered.
    """
    first, *more = _layers(layers)
    settings = settings_of(
        scene,
        size=size,
        photons=photons,
        seconds=seconds,
        seed=seed,
        method=method,
        camera_method=camera_method,
        layer=first,
        bins=bins,
        exposure=exposure,
        max_depth=max_depth,
        spp=spp,
        batch=batch,
    )
    for layer in more:
        settings_of(scene, layer=layer)
    model = scene._model

    def work(context: Context, report: Report, stopped: Cancel) -> Picture:
        from ..render.still import render

        result = render(model, settings, report, stopped, context, more_layers=more)
        named = {first: result.rgb} | {name: picture.rgb for name, picture in result.layers.items()}
        stats = _statistics(result, stopped())
        stops, antialias = settings.exposure_ev or 0.0, model.render.antialias_highlights
        return Picture(result.rgb, result.spectral, result.bin_edges_nm, stats, named, stops, settings.glare, antialias)

    return run(work, progress, cancel)


def caustic(
    scene: Scene,
    receiver: str,
    *,
    size: Size = DEFAULT_MAP_SIZE,
    photons: Count | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    method: str | None = None,
    bins: int | None = None,
    max_depth: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> CausticMap:
    """The light that glass and mirrors throw on an object, as a map with its place: what `spectrasplat bake` writes.

    `size`: about how many texels; the rest as for `render`. Raises `UserError`.
    """
    settings = settings_of(
        scene, size=size, photons=photons, seconds=seconds, seed=seed, method=method, bins=bins, max_depth=max_depth
    )
    model = scene._model

    def work(context: Context, report: Report, stopped: Cancel) -> CausticMap:
        from ..edit.parameters import Stage
        from ..render import bake

        started = time.perf_counter()
        steps = bake.bake_map(context, Stage(model, model.camera), settings, receiver, stopped)
        baked = finished(steps, lambda share: report(share, "baking"))
        took, count = time.perf_counter() - started, baked.photons
        notices = tuple(baked.notices)
        stats = Statistics(count, count, 0, took, context.renderer, context.is_software, stopped(), notices)
        (picture,) = baked.pictures
        return CausticMap(
            picture.rgb, picture.spectral, picture.bin_edges_nm, stats, receiver, baked.placement, _scene=model
        )

    check_receiver(scene, receiver)
    return run(work, progress, cancel)


def check_receiver(scene: Scene, receiver: str) -> None:
    """Raise `UserError` where `receiver` is none of `scene`'s, naming those there are."""
    from ..render.bake import check_receiver as check

    check_scene(scene)
    check(scene._model, receiver)


def _layers(layers: str | Sequence[str]) -> list[str]:
    names = [layers] if isinstance(layers, str) else list(dict.fromkeys(layers))
    if not names:
        raise UserError("layers is empty: give 'beauty', 'caustic', or both")
    if len(names) > 1 and any(not isinstance(n, str) or n.startswith("map:") for n in names):
        raise UserError("layers holds a map and others: a map has no camera, give it alone, or use caustic()")
    return names


def _statistics(result: RenderResult, stopped: bool) -> Statistics:
    stats = result.stats
    emitted = stats.light.tally.emitted or 1.0
    return Statistics(
        stats.photons,
        stats.photons,
        stats.camera_pass.samples,
        stats.seconds,
        stats.renderer,
        stats.is_software,
        stopped,
        stats.notices,
        {name: flux / emitted for name, flux in stats.light.tally.ended.items()},
    )
