"""The tables of a feature report on the screen, and the same as JSON and as a page."""

from __future__ import annotations

from pathlib import Path

import msgspec

from ...base.atomic import atomic_output, check_writable
from ...base.errors import UserError
from ..report.page import Table, render
from .results import FeatureReport, Percent

_PAGE_ALONE = ("adds", "symbols looked for")
_READING = (
    "Percentages are of the time without the feature: the median over turns with and without, then the interval that "
    "holds the true median with 95 %. An interval on both sides of 0 means that no cost was found."
)


def check(directory: Path) -> None:
    """Makes the folder; raises `UserError` where it cannot be made or written."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"-o {directory}: the folder cannot be made ({error.strerror}); name another") from error
    for name in ("features.json", "features.html"):
        check_writable(directory / name)


def write(report: FeatureReport, directory: Path) -> None:
    """features.json and features.html in `directory`, each whole or not at all."""
    with atomic_output(directory / "features.json") as temporary:
        temporary.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=1))
    with atomic_output(directory / "features.html") as temporary:
        temporary.write_text(page(report), encoding="utf-8")


def show(report: FeatureReport) -> None:
    """The tables on stdout; what would make them too wide is on the page."""
    from rich.console import Console

    console = Console(markup=False, emoji=False)
    console.print(_heading(report))
    for table in _tables(report):
        console.print(table.on_screen(_PAGE_ALONE))
    console.print(_READING)


def page(report: FeatureReport) -> str:
    """One self-contained page."""
    return render(
        "features.html", scene=report.scene, heading=_heading(report), tables=_tables(report), reading=_READING
    )


def _tables(report: FeatureReport) -> list[Table]:
    included = {True: "in", False: "out"}
    costs = [
        (
            cost.feature,
            included[cost.included],
            cost.reason,
            _percent(cost.trace),
            _percent(cost.splat),
            cost.bytes,
            _note(cost.note, cost.map_difference),
        )
        for cost in report.costs
    ]
    proof = [
        (
            proved.feature,
            included[proved.included],
            ", ".join(s for s in proved.symbols if " " not in s),
            ", ".join(proved.programs) or "no program",
            "as it must be" if proved.holds else "NOT as it must be",
        )
        for proved in report.proof
    ]
    programs = [(p.name, p.lines, p.flattened_lines, ", ".join(p.features)) for p in report.programs]
    return [
        Table(
            ("feature", "", "why", "trace", "splat", "adds", "note"),
            costs,
            title="Cost of each feature (in: what it costs; out: what leaving it out saves)",
            words=("", "why", "adds", "note"),
        ),
        Table(
            ("feature", "", "symbols looked for", "found in", ""),
            proof,
            title="Is what the scene does not need absent from every program?",
            words=("", "symbols looked for", "found in"),
        ),
        Table(
            ("program", "lines", "of", "holds code of"),
            programs,
            title="Compiled texts: lines that can run, of lines written",
            words=("holds code of",),
        ),
    ]


def _heading(report: FeatureReport) -> str:
    rest = "" if report.complete else " Stopped early: the features that follow were not measured."
    return (
        f"Scene '{report.scene}' on {report.renderer}, by {report.clock}: about {report.photons:,} photons a run, "
        f"trace {1e3 * report.trace_seconds:.0f} ms, splat {1e3 * report.splat_seconds:.0f} ms; {report.repeats} "
        f"turns. {report.records}{rest}"
    )


def _percent(value: Percent | None) -> str:
    return "" if value is None else f"{value.median:+.1f} % [{value.low:+.1f}, {value.high:+.1f}]"


def _note(note: str, difference: float | None) -> str:
    if difference is None:
        return note
    same = "same map to the last bit" if difference == 0.0 else f"maps differ by {difference:.0e} of their energy"
    return f"{note}; {same}" if note else same
