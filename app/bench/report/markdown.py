"""The findings of a bench run as Markdown tables, to be pasted into a document: `tables.md` beside the page.

Every table has a row a scene, in the order they were named, so that two runs can be laid side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from ..curves import error_at_time, points_by
from ..measured_passes import MEASURED_PASSES
from ..results import TARGETS, BenchResult, Curve, SceneResult, SpeedUp
from .fair_field import cell, percent
from .style import by_rank
from .text import number, signed

_NONE = "–"
_ESCAPED_BAR = r"\|"
_BASELINE_LETTERS = {
    "stochastic": "s",
    "stochastic-even": "e",
    "stochastic-point": "p",
    "progressive-stochastic": "ps",
    "hero": "h",
    "regular-7": "r7",
    "regular-16": "r16",
    "srd-lambda": "λ",
}
"""What names the best baseline in a cell, where its whole name would make the table too wide to read."""


def tables(result: BenchResult) -> str:
    """The run's tables with their headings; ends with a line break."""
    measured = MEASURED_PASSES[result.settings.measured_pass]
    methods = by_rank(sorted({curve.method for scene in result.scenes for curve in scene.curves if curve.points}))
    machine = ", ".join(value for key, value in result.machine.items() if key != "program")
    parts = [f"`{result.command}`, {result.date[:10]}; {machine}."]
    if speed_ups := _speed_ups(result):
        parts += [f"## How many times sooner `srd` is there, by {measured.time} (and whole processes)", speed_ups]
    for seconds in measured.compared_seconds:
        if seconds < max((scene.seconds for scene in result.scenes), default=0.0):
            heading = f"## relMSE after {seconds:g} s of {measured.time}"
            parts += [heading, _by_method(result, methods, partial(_after, seconds))]
    ends = _by_method(result, methods, _end, {"reference's own": _own_error})
    parts += [f"## relMSE at the end, after so many seconds of {measured.time}", ends]
    parts += ["## nRMSE at the end", _by_method(result, methods, _last_nrmse)]
    parts += ["## Exponent of relMSE over the second half of the curve", _by_method(result, methods, _slope)]
    return "\n\n".join(parts) + "\n"


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; what would end a cell is escaped."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(one.replace('|', _ESCAPED_BAR) for one in line)} |" for line in lines)


def _speed_ups(result: BenchResult) -> str:
    """A row a scene; the cells name the best baseline by letters that a line below explains. "" where nothing was
    compared."""
    rows, named = [], set()
    for scene in result.scenes:
        found = {(one.clock, one.target): one for one in scene.speed_ups}
        if found:
            named |= {one.baseline for one in scene.speed_ups if one.clock == "photon" and one.baseline}
            cells = [_pair(found.get(("photon", target)), found.get(("whole", target))) for target in TARGETS]
            rows.append([f"`{scene.scene}`", *cells])
    if not rows:
        return ""
    letters = ", ".join(f"{_letters(name)}: `{name}`" for name in by_rank(sorted(named)))
    return "\n\n".join(
        part for part in (table(["scene", *(percent(target) for target in TARGETS)], rows), letters) if part
    )


def _pair(photon: SpeedUp | None, whole: SpeedUp | None) -> str:
    if photon is None:
        return _NONE
    baseline = f" {_letters(photon.baseline)}" if photon.baseline else ""
    return f"{cell(photon)}{baseline} ({cell(whole)})"


def _letters(baseline: str) -> str:
    return _BASELINE_LETTERS.get(baseline, baseline)


def _by_method(
    result: BenchResult,
    methods: Sequence[str],
    value: Callable[[Curve], str],
    more: Mapping[str, Callable[[SceneResult], str]] | None = None,
) -> str:
    """A column a method, with what `value` says of its curve; behind them `more` by heading."""
    rows = []
    for scene in result.scenes:
        curves = {curve.method: curve for curve in scene.curves if curve.points}
        cells = [value(curves[name]) if name in curves else _NONE for name in methods]
        rows.append([f"`{scene.scene}`", *cells, *(told(scene) for told in (more or {}).values())])
    return table(["scene", *(f"`{name}`" for name in methods), *(more or {})], rows)


def _after(seconds: float, curve: Curve) -> str:
    return number(error_at_time(curve.points, seconds))


def _end(curve: Curve) -> str:
    return f"{number(curve.points[-1].relmse)}, {curve.points[-1].seconds:.2g} s"


def _last_nrmse(curve: Curve) -> str:
    return number(points_by(curve, "nrmse")[-1].relmse)


def _own_error(scene: SceneResult) -> str:
    return _NONE if scene.reference is None else number(scene.reference.relmse)


def _slope(curve: Curve) -> str:
    if not curve.slope_half_width > 0.0:
        return _NONE
    return f"{signed(curve.slope)} ± {curve.slope_half_width:.2f}"
