"""Tables of a feature report for the screen, and the same as JSON and as a page."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from ...base.atomic import atomic_output, check_writable
from ...base.errors import UserError

if TYPE_CHECKING:
    from .cost import FeatureReport, Percent

_COST_HEADINGS = ("feature", "", "why", "trace", "splat", "adds", "note")
_PROOF_HEADINGS = ("feature", "", "symbols looked for", "found in", "")
_PROGRAM_HEADINGS = ("program", "lines", "of", "holds code of")
_NUMBERS = ("trace", "splat", "lines", "of")
_PAGE_ALONE = ("adds", "symbols looked for")

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title>
<style>
:root {{ color-scheme: light dark; --ink: #1c1e21; --muted: #5b6068; --line: #e2e4e7; --paper: #fefefe; }}
@media (prefers-color-scheme: dark) {{ :root {{ --ink: #e9eaec; --muted: #a4aab3; --line: #33373d; --paper: #15171a; }} }}
body {{ font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }}
table {{ border-collapse: collapse; margin: 0.5rem 0 2rem; }}
th, td {{ text-align: left; padding: 0.25rem 0.8rem 0.25rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }}
th, .muted {{ color: var(--muted); font-weight: normal; }} .number {{ text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }}
.wide {{ overflow-x: auto; }} code {{ font-size: 0.9em; }}
</style></head><body>
<h1>{title}</h1>
{body}
</body></html>
"""


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
    from rich.console import Console
    from rich.table import Table

    console = Console()
    console.print(_heading(report))
    for title, headings, rows in _tables(report):
        table = Table(title=title, title_justify="left")
        narrow = [index for index, heading in enumerate(headings) if heading not in _PAGE_ALONE]
        for index in narrow:
            table.add_column(
                headings[index], justify="right" if headings[index] in _NUMBERS else "left", overflow="fold"
            )
        for row in rows:
            table.add_row(*(row[index] for index in narrow))
        console.print(table)
    console.print(_reading(report))


def page(report: FeatureReport) -> str:
    """One self-contained page."""
    parts = [f"<p>{html.escape(_heading(report))}</p>"]
    for title, headings, rows in _tables(report):
        head = "".join(f"<th>{html.escape(h)}</th>" for h in headings)
        lines = []
        for row in rows:
            cells = zip(headings, row, strict=True)
            lines.append(
                "<tr>" + "".join(f"<td{_class(heading)}>{html.escape(cell)}</td>" for heading, cell in cells) + "</tr>"
            )
        parts.append(
            f'<h2>{html.escape(title)}</h2><div class="wide"><table><tr>{head}</tr>{"".join(lines)}</table></div>'
        )
    parts.append(f'<p class="muted">{html.escape(_reading(report))}</p>')
    return _PAGE.format(title=html.escape(f"What each feature costs in '{report.scene}'"), body="\n".join(parts))


# -- private ------------------------------------------------------------------------------


def _class(heading: str) -> str:
    return ' class="number"' if heading in _NUMBERS else ""


def _tables(report: FeatureReport) -> list[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
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
            ", ".join(s for s in p.symbols if " " not in s) or "more than one colour target",
            ", ".join(p.programs) or "no program",
            "as it must be" if p.holds else "NOT as it must be",
        )
        for p in report.proof
    ]
    programs = [(p.name, str(p.lines), str(p.flattened_lines), ", ".join(p.features)) for p in report.programs]
    return [
        ("Cost of each feature (in: what it costs; out: what leaving it out saves)", _COST_HEADINGS, costs),
        ("Is what the scene does not need absent from every program?", _PROOF_HEADINGS, proof),
        ("Compiled texts: lines that can run, of lines written", _PROGRAM_HEADINGS, programs),
    ]


def _heading(report: FeatureReport) -> str:
    rest = "" if report.complete else " Stopped early: the features that follow were not measured."
    return (
        f"Scene '{report.scene}' on {report.renderer}, by {report.clock}: about {report.photons:,} photons a run, "
        f"trace {1e3 * report.trace_seconds:.0f} ms, splat {1e3 * report.splat_seconds:.0f} ms; {report.repeats} turns. {report.records}{rest}"
    )


def _reading(report: FeatureReport) -> str:
    return (
        "Percentages are of the time without the feature: the median over turns with and without, then the interval that holds "
        "the true median with 95 %. An interval on both sides of 0 means that no cost was found."
    )


def _percent(value: Percent | None) -> str:
    return "" if value is None else f"{value.median:+.1f} % [{value.low:+.1f}, {value.high:+.1f}]"


def _note(note: str, difference: float | None) -> str:
    if difference is None:
        return note
    same = "same map to the last bit" if difference == 0.0 else f"maps differ by {difference:.0e} of their energy"
    return f"{note}; {same}" if note else same
