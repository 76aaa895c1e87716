"""What the bench report says about the whole run: what was measured and how, the claims, and the limits."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from ..measured_passes import MEASURED_PASSES
from ..results import BenchResult
from . import fair_field, text
from .page import render
from .prose import PROSE
from .scene import SceneView
from .style import by_rank

_KNOWN_AS = {"opengl": "OpenGL"}


def document(result: BenchResult, scenes: Sequence[SceneView], glance: Markup, speed_up: Markup | None) -> str:
    """The whole page; `glance`: the ratios of all scenes to `stochastic`, `speed_up`: to the best baseline, drawn."""
    prose = PROSE[result.settings.measured_pass]
    used = by_rank(sorted({curve.method for scene in result.scenes for curve in scene.curves}))
    return render(
        "bench.html",
        result=result,
        measured=MEASURED_PASSES[result.settings.measured_pass],
        prose=prose,
        headline=text.headline(result),
        run={
            "version": f"SpectraSplat {result.version}",
            "date": result.date,
            **{_KNOWN_AS.get(key, key): value for key, value in result.machine.items()},
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
