"""The stress result on the screen: a line a severity, its errors against their bounds, the verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .case import Measurement
from .runner import CaseResult, StressResult

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text


def summary(result: StressResult) -> str:
    """One line: how many cases and severities, how many promises are broken."""
    broken = result.broken()
    state = "stopped early; " if result.partial else ""
    verdict = "every promise holds" if not broken else f"{len(broken)} promise{'s' if len(broken) > 1 else ''} broken"
    if result.partial and not broken:
        verdict = "every promise measured so far holds"
    return (
        f"{state}{len(result.cases)} of {result.asked} cases, {result.measured} severities in {result.seconds:.0f} s: "
        f"{verdict}"
    )


def table(result: StressResult) -> Table:
    """All measurements."""
    from rich.table import Table

    shown = Table(title="stress", title_justify="left", header_style="bold", pad_edge=False)
    for name, options in (
        ("case", {"no_wrap": True}),
        ("severity", {"overflow": "fold", "max_width": 34}),
        ("not finite", {"justify": "right"}),
        ("flux off", {"justify": "right"}),
        ("fall-backs", {"overflow": "fold", "max_width": 28}),
        ("errors / bounds", {"overflow": "fold"}),
        ("verdict", {"overflow": "fold"}),
    ):
        shown.add_column(name, **options)
    for case in result.cases:
        _add_case(shown, case)
    return shown


def _add_case(shown: Table, result: CaseResult) -> None:
    from rich.text import Text

    for number, m in enumerate(result.measurements):
        shown.add_row(
            result.case.name if number == 0 else "",
            Text(m.label),
            str(m.nonfinite),
            "" if m.flux_imbalance is None else f"{m.flux_imbalance:.0e}",
            Text(", ".join(f"{name} {count}" for name, count in m.fallbacks.items() if count)),
            _errors(m),
            _verdict(m.broken()),
        )
    if result.failure:
        shown.add_row(
            result.case.name if not result.measurements else "", "", "", "", "", "", _verdict([result.failure])
        )
    shown.add_section()


def _errors(m: Measurement) -> Text:
    """ "energy 3e-04 / 1e-03", those beyond their bound in red; a bounded error of exactly zero is not worth the
    room."""
    from rich.text import Text

    text = Text()
    for name, error in m.errors.items():
        bound = m.bounds.get(name)
        if error == 0.0 and bound is not None:
            continue
        held = bound is None or error <= bound
        part = f"{name} {error:.1e}" + ("" if bound is None else f" / {bound:.0e}")
        text.append((", " if text else "") + part, style=None if held else "bold red")
    return text


def _verdict(broken: list[str]) -> Text:
    from rich.text import Text

    return Text("ok", style="green") if not broken else Text("BROKEN: " + "; ".join(broken), style="bold red")
