"""Writes what a bench run has found: plots as PNG and SVG, and one page that needs no other file.

    DIR/plots/SCENE_error_time.png .svg    DIR/plots/SCENE_error_photons.png .svg (the camera pass: _samples)
    DIR/plots/scenes.png .svg (the README's figure)
    DIR/report.html, DIR/tables.md

A run that was stopped can be reported as well: what is missing is named in its place.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ...base.atomic import atomic_output
from ...base.errors import UserError
from ...base.progress import ProgressReporter
from ..measured_passes import MEASURED_PASSES
from ..results import BenchResult, SceneResult
from . import curve_plots, pictures, run_plots, style, tables, text
from .page import PROSE, inlined, render


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
    with style.plot_style(), ProgressReporter("report") as progress:
        for index, (scene, name) in enumerate(zip(result.scenes, names, strict=True)):
            progress(index / (len(names) + 1), scene.scene)
            scenes.append(_scene(scene, name, plots))
        readme_plot(result, plots / "scenes")
        progress(1.0, "page")
    with atomic_output(directory / "report.html") as temporary:
        temporary.write_text(document(result, scenes), encoding="utf-8")
    with atomic_output(directory / "tables.md") as temporary:
        temporary.write_text(tables.markdown(result), encoding="utf-8")


def readme_plot(result: BenchResult, stem: Path) -> None:
    """Write the README's figure, error against time of `srd` and two baselines in each scene, to `stem`.png and
    `stem`.svg."""
    with style.plot_style():
        style.save(run_plots.small_multiples(result), stem)


def file_names(scenes: list[str]) -> list[str]:
    """Names fit for files and anchors, each used once: letters, digits, hyphen, underscore."""
    taken: list[str] = []
    for scene in scenes:
        base = re.sub(r"[^A-Za-z0-9_-]+", "_", scene)[:60].strip("_") or "scene"
        name, count = base, 1
        while name in taken or name == "scenes":
            count += 1
            name = f"{base}_{count}"
        taken.append(name)
    return taken


# -- the page -----------------------------------------------------------------------------


def document(result: BenchResult, scenes: Sequence[dict[str, object]]) -> str:
    """The whole page."""
    prose, settings, count = PROSE[result.settings.measured_pass], result.settings, len(result.scenes)
    measured = MEASURED_PASSES[settings.measured_pass]
    used = style.by_rank(sorted({curve.method for scene in result.scenes for curve in scene.curves}))
    return render(
        "bench.html",
        result=result,
        measured=measured,
        prose=prose,
        headline=text.headline(result),
        run={
            "version": f"SpectraSplat {result.version}",
            "date": result.date,
            **{"OpenGL" if key == "opengl" else key: value for key, value in result.machine.items()},
            "effort": f"{settings.seconds:g} s of {measured.time} for each method's longest rendering, "
            f"{text.seeds_text(settings.seeds)}, {count} scene{'' if count == 1 else 's'}",
        },
        scenes=scenes,
        speed_ups=tables.summary_table(result),
        methods={name: prose.methods.get(name, "Not described.") for name in used},
        doubts=[(scene.scene, warning) for scene in result.scenes for warning in text.warnings_of(scene)],
    )


def _scene(scene: SceneResult, name: str, plots: Path) -> dict[str, object]:
    """What the page shows of one scene; its curves over time and over photons or samples are saved as well."""
    anchor, measured = f"scene-{name}", MEASURED_PASSES[scene.measured_pass]

    curves = []
    for abscissa, ending, words in (("seconds", "time", measured.time), ("photons", measured.units, measured.unit)):
        saved = style.save(curve_plots.error_against(scene, abscissa), plots / f"{name}_error_{ending}")
        label = f"{scene.scene}: relMSE of each method against {words}, logarithmic axes"
        curves.append(inlined(saved, f"{name}-{ending}", label))
    return {
        "name": scene.scene,
        "title": scene.title,
        "anchor": anchor,
        "setting": _setting(scene),
        "warnings": text.warnings_of(scene),
        "curves": curves,
        "speed_ups": tables.speed_up_table(scene),
        "speed": tables.speed_table(scene),
        "kernels": tables.kernel_table(scene),
        "errors": tables.error_table(scene),
        "pictures": pictures.matrix(scene, plots.parent),
        "cost": tables.cost_table(scene),
    }


def _setting(scene: SceneResult) -> str:
    """Size, effort, glass and reference in one sentence."""
    measured, own = MEASURED_PASSES[scene.measured_pass], scene.reference
    glass = f"strongest glass {scene.strongest_glass} (Abbe number {scene.strongest_abbe:.1f})"
    parts = [
        f"{scene.size[0]}×{scene.size[1]} pixels",
        text.seeds_text(scene.seeds),
        f"{scene.seconds:g} s of {measured.time}",
        glass if scene.strongest_abbe > 0 else "no dispersion",
    ]
    if own is not None:
        parts.append(f"reference: {own.method}, {text.count(own.photons)} {measured.unit} in {own.seconds:.0f} s")
        if own.caustic_photons:
            parts.append(
                f"its caustic: {text.count(own.caustic_photons)} photons, whose noise is about "
                f"{text.number(own.caustic_relmse)} of its relMSE"
            )
        parts.append(f"its own relMSE {text.number(own.relmse)}, its key {own.key[:12]}")
    return "; ".join(parts) + "."
