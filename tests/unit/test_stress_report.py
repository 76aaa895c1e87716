"""The stress runner and its reports on made-up measurements: verdicts, errors, stops, and numbers that JSON has no word
for."""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.stress.case import Case, Measurement
from spectrasplat.stress.report import case_table, html_text
from spectrasplat.stress.results import StressResult, write_json
from spectrasplat.stress.runner import all_cases, choose, run


class NoContext:
    """Stands for a `Context` that made-up cases never touch."""

    ctx = None

    def check(self, _where: str) -> None:
        """Nothing was drawn."""


GOOD = Measurement(1e-3, "1e-3 rad", 0, {"energy": 2e-4, "shown only": 0.5}, {"energy": 1e-3}, 3e-8, {"band_cut": 7})
BAD = Measurement(1e-4, "1e-4 rad", 0, {"energy": 2e-2}, {"energy": 1e-3}, 3e-8)
NOT_FINITE = Measurement(
    1e-5,
    "1e-5 rad",
    3,
    {"energy": math.nan, "other": math.inf, "shown only": -math.inf},
    {"energy": 1e-3, "other": 1.0},
    math.nan,
)


def case(
    name: str,
    *measurements: Measurement,
    steps: int | None = None,
    fails: BaseException | None = None,
) -> Case:
    def measured(_: object, sweep: range) -> Iterator[Measurement]:
        yield from measurements
        if fails is not None:
            raise fails

    sweep = range(len(measurements) if steps is None else steps)
    return Case(name, f"the title of {name}", "why <it> matters & how", "margin, rad", measured, sweep)


def ran(*cases: Case) -> StressResult:
    result = StressResult(
        "0", "2026-01-01T00:00:00+00:00", "spectrasplat stress -o out", {"renderer": "made <up>"}, len(cases)
    )
    result.finished = run(result, cases, NoContext(), lambda fraction, text: None, lambda so_far: None)  # type: ignore[attr-defined, arg-type]
    return result


def test_kept_promises_are_told_so() -> None:
    result = ran(case("one", GOOD))
    assert result.broken() == [] and not result.partial
    assert "every promise holds" in result.summary()
    assert "Every promise holds" in html_text(result)


@pytest.mark.parametrize(
    ("measurement", "said"),
    [
        (BAD, "error of energy 2.00e-02 > 1.00e-03"),
        (NOT_FINITE, "3 values are not finite"),
        (NOT_FINITE, "error of energy nan"),
        (NOT_FINITE, "flux does not close"),
        (Measurement(1.0, "x", 0, flux_imbalance=2e-3), "flux does not close"),
        (Measurement(1.0, "x", 0, dropped=2, fallbacks={"footprint_dropped": 1}), "2 photons were degraded but only 1"),
    ],
)
def test_each_broken_promise_is_told(measurement: Measurement, said: str) -> None:
    result = ran(case("one", GOOD, measurement))
    assert any(said in sentence for sentence in result.broken())
    assert "every promise" not in result.summary()
    assert said.replace(">", "&gt;") in html_text(result)


def test_a_case_that_fails_is_a_broken_promise_and_the_others_go_on() -> None:
    result = ran(case("first", GOOD, fails=RuntimeError("the driver\nwent away"), steps=2), case("second", GOOD))
    assert [len(c.measurements) for c in result.cases] == [1, 1]
    assert result.broken() == ["first, stopped by an error: RuntimeError: the driver went away"]
    assert not result.partial


def test_a_case_that_yields_too_little_is_a_broken_promise() -> None:
    assert ran(case("one", GOOD, steps=3)).broken() == ["one, stopped by an error: measured 1 of 3 severities"]


def test_ctrl_c_keeps_what_is_done() -> None:
    result = ran(case("first", GOOD), case("second", GOOD, fails=KeyboardInterrupt(), steps=2), case("third", GOOD))
    assert not result.finished  # type: ignore[attr-defined]
    assert [c.case.name for c in result.cases] == ["first", "second"]
    assert result.partial and result.broken() == []
    assert "stopped early; 2 of 3 cases, 2 severities" in result.summary()
    page = html_text(result)
    assert "This report is partial" in page and "Stopped after 1 of 2 severities" in page


def test_what_is_done_is_kept_after_every_case() -> None:
    kept: list[int] = []
    result = StressResult("0", "", "", {}, 2)
    run(
        result,
        (case("a", GOOD), case("b", GOOD)),
        NoContext(),
        lambda *_: None,
        lambda so_far: kept.append(len(so_far.cases)),
    )  # type: ignore[arg-type]
    assert kept == [1, 2]


def test_json_holds_everything_and_no_nan(tmp_path: Path) -> None:
    file = tmp_path / "stress.json"
    write_json(ran(case("one", GOOD, NOT_FINITE)), file)

    def refuse(text: str) -> None:
        raise AssertionError(f"{text} is not JSON")

    held = json.loads(file.read_text(encoding="utf-8"), parse_constant=refuse)
    first, second = held["cases"][0]["measurements"]
    assert (
        first["errors"] == {"energy": 2e-4, "shown only": 0.5}
        and first["bounds"] == {"energy": 1e-3}
        and first["fallbacks"] == {"band_cut": 7}
    )
    assert (
        second["errors"] == {"energy": None, "other": None, "shown only": None}
        and second["flux_imbalance"] is None
        and second["nonfinite"] == 3
    )
    assert held["partial"] is False and len(held["broken"]) == 4


def test_the_page_stands_alone_and_escapes() -> None:
    page = html_text(ran(case("one", GOOD, BAD), case("two", GOOD)))
    assert "<script" not in page and "http" not in page and "src=" not in page
    assert "why &lt;it&gt; matters &amp; how" in page and "made &lt;up&gt;" in page
    ids = re.findall(r'\bid="([^"]*)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]*)"', page)) <= set(ids)


def test_the_table_shows_every_severity_and_verdict() -> None:
    from rich.console import Console

    console = Console(width=200, record=True, file=io.StringIO())
    for found in ran(case("one", GOOD, BAD), case("failed", fails=RuntimeError("oh"), steps=1)).cases:
        console.print(case_table(found).on_screen())
    text = console.export_text()
    assert "1e-3 rad" in text and "1e-4 rad" in text and "band cut 7" in text
    assert text.count("BROKEN") == 2 and text.count(" holds ") == 1 and "! energy 0.02" in text


def test_cases_have_names_of_their_own_and_are_chosen_by_them() -> None:
    cases = all_cases()
    names = [c.name for c in cases]
    assert len(names) == len(set(names))
    assert all(c.steps > 0 and c.title and c.why and c.severity_name for c in cases)
    assert [c.name for c in choose(cases, "stack, gap")] == ["gap", "stack"]
    assert {c.name.split("/")[0] for c in choose(cases, "prism/")} == {"prism"}
    assert choose(cases, None) == cases
    with pytest.raises(UserError, match="did you mean 'stack'"):
        choose(cases, "stak")
    with pytest.raises(UserError, match="names no case"):
        choose(cases, " , ")
