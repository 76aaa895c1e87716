"""Tables of a feature report for the screen, and the same as JSON and as a page."""

from __future__ import annotations

from pathlib import Path

import msgspec

from ...base.atomic import atomic_output, check_writable
from ...base.errors import UserError
from ..report.page import Table, render
from .results import FeatureReport, Percent

_COST_HEADINGS = ("feature", "", "why", "trace", "splat", "adds", "note")
_PROOF_HEADINGS = ("feature", "", "symbols looked for", "found in", "")
_PROGRAM_HEADINGS = ("program", "lines", "of", "holds code of")
_NUMBERS = ("trace", "splat", "lines", "of")
_PAGE_ALONE = ("adds", "symbols looked for")


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
    """Three tables on stdout; what would make them too wide is on the page."""
    import rich.table
    from rich.console import Console

    console = Console()
    console.print(_heading(report))
    for made in _tables(report):
        shown = rich.table.Table(title=made.title, title_justify="left")
        narrow = [index for index, heading in enumerate(made.headings) if heading not in _PAGE_ALONE]
        for index in narrow:
            heading = made.headings[index]
            shown.add_column(heading, justify="right" if heading in _NUMBERS else "left", overflow="fold")
        for row in made.rows:
            shown.add_row(*(str(row[index]) for index in narrow))
        console.print(shown)
    console.print(_reading())


def page(report: FeatureReport) -> str:
    """One self-contained page."""
    return render(
        "features.html",
        scene=report.scene,
        heading=_heading(report),
        tables=_tables(report),
        reading=_reading(),
    )


# -- private ------------------------------------------------------------------------------


def _tables(report: FeatureReport) -> list[Table]:
    costs = [
        (
            c.feature,
            "in" if c.included else "out",
            c.reason,
            _percent(c.trace),
            _percent(c.splat),
            c.bytes,
            _note(c.note, c.map_difference),
        )
        for c in report.costs
    ]
    proof = [
        (
            p.feature,
            "in" if p.included else "out",
            ", ".join(s for s in p.symbols if " " not in s),
            ", ".join(p.programs) or "no program",
            "as it must be" if p.holds else "NOT as it must be",
        )
        for p in report.proof
    ]
    programs = [(p.name, str(p.lines), str(p.flattened_lines), ", ".join(p.features)) for p in report.programs]
    return [
        Table(headings, rows, title=title, numbers=_NUMBERS)
        for title, headings, rows in (
            ("Cost of each feature (in: what it costs; out: what leaving it out saves)", _COST_HEADINGS, costs),
            ("Is what the scene does not need absent from every program?", _PROOF_HEADINGS, proof),
            ("Compiled texts: lines that can run, of lines written", _PROGRAM_HEADINGS, programs),
        )
    ]


def _heading(report: FeatureReport) -> str:
    rest = "" if report.complete else " Stopped early: the features that follow were not measured."
    return (
        f"Scene '{report.scene}' on {report.renderer}, by {report.clock}: about {report.photons:,} photons a run, "
        f"trace {1e3 * report.trace_seconds:.0f} ms, splat {1e3 * report.splat_seconds:.0f} ms; {report.repeats} "
        f"turns. {report.records}{rest}"
    )


def _reading() -> str:
    return (
        "Percentages are of the time without the feature: the median over turns with and without, then the interval "
        "that holds "
        "the true median with 95 %. An interval on both sides of 0 means that no cost was found."
    )


def _percent(value: Percent | None) -> str:
    return "" if value is None else f"{value.median:+.1f} % [{value.low:+.1f}, {value.high:+.1f}]"


def _note(note: str, difference: float | None) -> str:
    if difference is None:
        return note
    same = "same map to the last bit" if difference == 0.0 else f"maps differ by {difference:.0e} of their energy"
    return f"{note}; {same}" if note else same
