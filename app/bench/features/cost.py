"""`bench --features SCENE`: what each compile-time feature costs here, and that what is left out is absent.

Each feature's two programs take turns in one process over the same lattice, so a ratio compares
neighbours in time; its median over the turns is reported with the interval that holds the true median.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from math import comb
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...base.errors import UserError
from ...base.version import __version__
from ...features.facts import Facts
from ...features.features import Features
from ...model.settings import RenderSettings
from ...render.device_scene import spectral_axis
from ...render.light_pass import LightPass
from . import report as report_page
from .compiled import compiled_sources, program_sizes, prove, record_words, static_costs
from .results import FeatureCost, FeatureReport, Percent
from .rig import Rig, Work, map_difference
from .variants import Trial, Variant, trials

if TYPE_CHECKING:
    from ...gpu.context import Context
    from ...model.scene import Scene

REPEATS = 9
MAP_TOLERANCE = 1e-2
"""Two programs that must draw the same map may differ by this share of its energy. Most agree to the last bit; a
Gaussian from a table and one in closed form differ by 3e-3, the sum of coarse bins and the radiant power of XYZ maps by
5e-3."""
_TARGET_SECONDS = 0.4
"""Time of one traced and splatted lattice: long against the clock, short against the patience."""
_PHOTONS = (2048, 1 << 16)


def command(scene: Scene, output: Path | None) -> int:
    """Measure, print and (with `output`, a folder) write features.json and features.html; returns the exit code.

    1 where a feature that is out left a trace in a program, or a forced one changed the map. Raises
    `UserError` where no light meets glass or a mirror.
    """
    from ...base.progress import ProgressReporter
    from ...gpu.context import create_context

    if output is not None:
        report_page.check(output)
    report = None
    try:
        with create_context() as context, ProgressReporter("features") as progress:
            for report, share in measure(context, scene):
                progress(share, f"{len(report.costs)} features")
    finally:
        # Also after Ctrl-C: what is measured is shown.
        if report is not None:
            report_page.show(report)
            if output is not None:
                report_page.write(report, output)
    assert report is not None
    return 0 if all(p.holds for p in report.proof) and all(agrees(c) for c in report.costs) else 1


def agrees(cost: FeatureCost) -> bool:
    """Whether a pair that must draw the same map did."""
    return cost.map_difference is None or cost.map_difference <= MAP_TOLERANCE


def measure(
    context: Context, scene: Scene, repeats: int = REPEATS, seconds: float = _TARGET_SECONDS
) -> Iterator[tuple[FeatureReport, float]]:
    """(the report so far, share done) after the proof and after each feature."""
    settings = RenderSettings(
        width=scene.render.width,
        height=scene.render.height,
        max_depth=scene.render.max_depth,
        method="srd-photons",
    )
    features = Features.of(scene, settings)
    report = FeatureReport(
        __version__,
        datetime.now(UTC).isoformat(timespec="seconds"),
        scene.name,
        context.renderer,
        "processor time" if context.is_software else "wall clock",
        0,
        repeats,
        0.0,
        0.0,
        "",
        [],
        [],
        [],
        complete=False,
    )
    light = _begun(context, scene, settings, features)
    try:
        features = light.features
        facts = Facts(scene, settings)
        wanted = trials(facts, features)
        report.records = record_words(features)
        report.programs = program_sizes(compiled_sources(context, scene, settings))
        included = {name: is_in for name, is_in, _ in features.explain(facts)}
        report.proof = prove(report.programs, included)
        if not light.plans:
            raise UserError(
                f"scene '{scene.name}': no light meets glass or a mirror, so no feature costs anything; name a scene "
                "with a caustic"
            )
        work = _calibrated(report, light, seconds, context)
        sizes = static_costs(facts, features)
        for index, trial in enumerate(wanted):
            report.costs.append(cost_of(trial, sizes.get(trial.feature, ""), context, work, repeats))
            report.complete = index + 1 == len(wanted)
            yield report, (index + 1) / len(wanted)
    finally:
        light.release()
        light.buffers.release()


def _begun(context: Context, scene: Scene, settings: RenderSettings, features: Features) -> LightPass:
    from ...gpu.scene_buffers import SceneBuffers

    buffers = SceneBuffers(context.ctx, scene, features, spectral_axis(scene, features))
    light = LightPass(context, scene, settings, features, buffers)
    light.prepare()
    light.begin(scene.render.photons, settings.seed)
    return light


def _calibrated(report: FeatureReport, light: LightPass, seconds: float, context: Context) -> Work:
    """Work of about `seconds` for the scene as it is; its costs go to the report."""
    whole = light.scene.render.photons
    photons, work = _PHOTONS[0], Work.of(light, whole, _PHOTONS[0])
    for attempt in range(2):
        rig = Rig(context, Variant(light.scene, light.features), work)
        rig.run()
        cost = rig.run()
        rig.release()
        report.photons, report.trace_seconds, report.splat_seconds = photons, cost.trace, cost.splat
        if attempt == 0:
            photons = int(np.clip(photons * seconds / max(cost.trace + cost.splat, 1e-6), *_PHOTONS))
            work = Work.of(light, whole, photons)
    return work


def cost_of(trial: Trial, size: str, context: Context, work: Work, repeats: int) -> FeatureCost:
    """Time and measure one trial: its two programs in turns, `repeats` times."""
    if trial.carried is None or trial.absent is None:
        return FeatureCost(trial.feature, trial.included, trial.reason, size, None, None, None, trial.note)
    rigs = [Rig(context, variant, work) for variant in (trial.carried, trial.absent)]
    try:
        for rig in rigs:
            rig.run()  # compiles
        difference = map_difference(*(rig.map() for rig in reversed(rigs))) if trial.same_map else None
        ratios = np.empty((repeats, 2))
        for turn in range(repeats):
            # With and without, without and with: a drift of the machine's speed cancels.
            first = turn % 2
            costs = {index: rigs[index].run() for index in (first, 1 - first)}
            ratios[turn] = costs[0].trace / costs[1].trace, costs[0].splat / costs[1].splat
    finally:
        for rig in rigs:
            rig.release()
    trace, splat = (percent_of(ratios[:, stage]) for stage in range(2))
    return FeatureCost(
        trial.feature,
        trial.included,
        trial.reason,
        size,
        trace,
        splat if trial.same_splats else None,
        difference,
        trial.note,
    )


def percent_of(ratios: np.ndarray) -> Percent:
    """Ratios with : without as a cost in percent; the interval holds the true median with 95 % at least.

    Without the k outermost of n at each end it misses with 2 P(at most k of n coins show heads), whatever the
    distribution; fewer than six ratios cannot promise that much and give their extremes.
    """
    ordered = 100.0 * (np.sort(ratios) - 1.0)
    count, dropped = len(ordered), 0
    while 2 * sum(comb(count, heads) for heads in range(dropped + 2)) <= 0.05 * 2**count:
        dropped += 1
    return Percent(float(np.median(ordered)), float(ordered[dropped]), float(ordered[-1 - dropped]))
