"""Writes what a bench run has found: plots as PNG and SVG, and one page that stands alone.

    DIR/plots/SCENE_error_time.png .svg    DIR/plots/SCENE_error_photons.png .svg (the camera pass: _samples)
    DIR/plots/overview.png .svg            DIR/plots/scenes.png .svg (the README's figure)
    DIR/plots/speed_up.png .svg            DIR/report.html, DIR/tables.md

A run that was stopped can be reported as well: what is missing is named where it would stand.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from ...base.atomic import atomic_output
from ...base.errors import UserError
from ...base.progress import ProgressReporter
from ..measured_passes import MEASURED_PASSES
from ..results import BenchResult, SceneResult
from . import fair_field, markdown, text
from . import scene as report_scene
from . import style as report_style
from .curve_plots import error_against
from .overview import overview, small_multiples
from .page import inlined, render
from .prose import PROSE


def write_report(result: BenchResult, directory: Path) -> None:
    """Write plots and page into `directory`, where the files that `SceneResult.pictures` names lie as well.

    Each file appears whole or not at all. Raises `UserError` where one cannot be written.
    """
    plots = directory / "plots"
    try:
        plots.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"cannot make the folder {plots}: {error.strerror or error}; choose another place") from error
    names = file_names([scene.scene for scene in result.scenes])
    scenes = []
    with report_style.plot_style(), ProgressReporter("report") as progress:
        for index, (scene, name) in enumerate(zip(result.scenes, names, strict=True)):
            progress(index / (len(names) + 1), scene.scene)
            scenes.append(report_scene.view(scene, f"scene-{name}", _curve_plots(scene, name, plots), directory))
        glance = inlined(
            report_style.save(overview(result), plots / "overview"),
            "overview",
            "time to equal error of each method in each scene, as a ratio to stochastic",
        )
        headline = fair_field.speed_up_over_error(result)
        curve = None
        if headline is not None:
            label = "speed-up of srd over the best baseline against target error, by scene"
            curve = inlined(report_style.save(headline, plots / "speed_up"), "speed-up", label)
        readme_plot(result, plots / "scenes")
        progress(1.0, "page")
    with atomic_output(directory / "report.html") as temporary:
        temporary.write_text(document(result, scenes, glance, curve), encoding="utf-8")
    with atomic_output(directory / "tables.md") as temporary:
        temporary.write_text(markdown.tables(result), encoding="utf-8")


def readme_plot(result: BenchResult, stem: Path) -> None:
    """Write the README's figure, error against time of `srd` and two baselines in each scene, to `stem`.png and
    `stem`.svg."""
    with report_style.plot_style():
        report_style.save(small_multiples(result), stem)


def _curve_plots(scene: SceneResult, name: str, plots: Path) -> list[Markup]:
    """Error over time and over photons or samples: saved, and as SVG for the page."""
    drawn, measured = [], MEASURED_PASSES[scene.measured_pass]
    for abscissa, ending, words in (("seconds", "time", measured.time), ("photons", measured.units, measured.unit)):
        saved = report_style.save(error_against(scene, abscissa), plots / f"{name}_error_{ending}")
        label = f"{scene.scene}: relMSE of each method against {words}, logarithmic axes"
        drawn.append(inlined(saved, f"{name}-{ending}", label))
    return drawn


def file_names(scenes: list[str]) -> list[str]:
    """Names fit for files and anchors, each used once: letters, digits, hyphen, underscore."""
    taken: list[str] = []
    for scene in scenes:
        base = re.sub(r"[^A-Za-z0-9_-]+", "_", scene)[:60].strip("_") or "scene"
        name, count = base, 1
        while name in taken or name in ("overview", "scenes"):
            count += 1
            name = f"{base}_{count}"
        taken.append(name)
    return taken


# ---- the page --------------------------------------------------------------------------------


def document(
    result: BenchResult, scenes: Sequence[report_scene.SceneView], glance: Markup, speed_up: Markup | None
) -> str:
    """The whole page; `glance`: the ratios of all scenes to `stochastic`, `speed_up`: to the best baseline, drawn."""
    prose = PROSE[result.settings.measured_pass]
    used = report_style.by_rank(sorted({curve.method for scene in result.scenes for curve in scene.curves}))
    return render(
        "bench.html",
        result=result,
        measured=MEASURED_PASSES[result.settings.measured_pass],
        prose=prose,
        headline=text.headline(result),
        run={
            "version": f"SpectraSplat {result.version}",
            "date": result.date,
            **{"OpenGL" if key == "opengl" else key: value for key, value in result.machine.items()},
            "effort": _effort(result),
        },
        scenes=scenes,
        is_judged=any(scene.claims for scene in result.scenes),
        glance=glance,
        speed_up=speed_up,
        speed_ups=fair_field.summary_table(result),
        glance_caption=text.sentence(prose.metrics["time to equal error"]),
        methods={name: prose.methods.get(name, "Not described.") for name in used},
        failed=[(f"{scene}, {claim.name}", text.limit_sentence(claim)) for scene, claim in text.limits(result)],
        doubts=[(scene.scene, warning) for scene in result.scenes for warning in text.warnings_of(scene)],
    )


def _effort(result: BenchResult) -> str:
    settings, count = result.settings, len(result.scenes)
    return (
        f"{settings.seconds:g} s of {MEASURED_PASSES[settings.measured_pass].time} for each method's longest "
        "rendering, "
        f"{text.seeds_text(settings.seeds)}, {count} scene{'' if count == 1 else 's'}"
    )
