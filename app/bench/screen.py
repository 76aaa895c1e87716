"""A scene's bench as a table on the screen: one line a method."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.bench.curves import error_at_time
from app.bench.results import Curve, SceneResult

if TYPE_CHECKING:
    from rich.table import Table

_TIMES_S = (0.1, 1.0)


def scene_table(scene: SceneResult) -> Table:
    """Errors at a few times and at the end, bias, slope and the time to equal error."""
    from rich.table import Table

    width, height = scene.size
    own = "" if scene.reference is None else f", reference's own relMSE {scene.reference.relmse:.2g}"
    table = Table(title=f"{scene.scene}, {width}×{height}, {scene.seeds} seed{'s' * (scene.seeds != 1)}{own}", title_justify="left")
    table.add_column("method")
    times = [t for t in _TIMES_S if t < scene.seconds]
    for t in times:
        table.add_column(f"relMSE at {t:g} s", justify="right")
    for name in ("at the end", "after", "photons", "bias² share", "slope", "time to equal error"):
        table.add_column(name, justify="right")
    for curve in scene.curves:
        if curve.points:
            table.add_row(curve.method, *(_error(error_at_time(curve.points, t)) for t in times), *_ending(scene, curve))
    return table


def _ending(scene: SceneResult, curve: Curve) -> list[str]:
    last = curve.points[-1]
    total = last.bias2 + last.variance
    ratio = scene.time_to_equal_error.get(curve.method)
    return [
        _error(last.relmse),
        f"{last.seconds:.2f} s",
        f"{last.photons:,}",
        f"{100.0 * last.bias2 / total:.0f} %" if total > 0.0 else "–",
        f"{curve.slope:+.2f} ± {curve.slope_half_width:.2f}" if curve.slope_half_width > 0.0 else "–",
        "not reached" if ratio is None else f"1/{ratio:.3g}" if ratio >= 1.0 else f"{1.0 / ratio:.3g}×",
    ]


def _error(error: float | None) -> str:
    return "–" if error is None else f"{error:.3g}"
