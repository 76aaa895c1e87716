"""What the bench report says about the whole run: what was measured and how, the claims, and the limits."""

from __future__ import annotations

from collections.abc import Mapping

from ..measured_passes import MEASURED_PASSES
from ..results import BenchResult
from . import text as text
from .html import Html, element, figure
from .prose import PROSE
from .style import by_rank

_KNOWN_AS = {"opengl": "OpenGL"}


def header(result: BenchResult) -> Html:
    """Title, findings in a few sentences, machine, and the command that repeats the run."""
    view_model = {
        "version": f"SpectraSplat {result.version}",
        "date": result.date,
        **{_KNOWN_AS.get(key, key): value for key, value in result.machine.items()},
        "effort": _effort(result),
    }
    return element(
        "header",
        element("p", f"SpectraSplat bench: the {result.settings.measured_pass} pass", cls="muted"),
        element("h1", "Error against run time"),
        [element("p", sentence, cls="lead") for sentence in text.headline(result)],
        element(
            "dl",
            [element("div", element("dt", key), element("dd", value)) for key, value in view_model.items()],
            cls="facts",
        ),
        element("p", "The command that repeats it:"),
        element("pre", element("code", result.command)),
    )


def _effort(result: BenchResult) -> str:
    settings = result.settings
    return (
        f"{settings.seconds:g} s of {MEASURED_PASSES[settings.measured_pass].time} for each method's longest rendering, {text.seeds_text(settings.seeds)}, "
        f"{len(result.scenes)} scene{'' if len(result.scenes) == 1 else 's'}"
    )


def contents(result: BenchResult, anchors: list[str]) -> Html:
    """Links to every part of the page."""
    scenes = [(scene.scene, anchor) for scene, anchor in zip(result.scenes, anchors, strict=True)]
    links = [("Claims", "claims"), ("How it was measured", "method"), *scenes, ("Limits", "limits")]
    return element(
        "nav",
        element("ul", [element("li", element("a", name, href=f"#{target}")) for name, target in links]),
        aria_label="Contents",
    )


def claims(result: BenchResult, overview_svg: Html) -> Html:
    """Every claim of every scene, and the ratios at a glance."""
    rows = []
    for scene in result.scenes:
        for index, claim in enumerate(scene.claims):
            first = element("th", scene.scene, scope="rowgroup", rowspan=len(scene.claims)) if index == 0 else None
            cells = [
                claim.name,
                claim.asked,
                claim.measured,
                element("span", "yes" if claim.holds else "no", cls="yes" if claim.holds else "no"),
                claim.why,
            ]
            rows.append(element("tr", first, [element("td", cell) for cell in cells]))
    head = element(
        "tr", [element("th", name, scope="col") for name in ("scene", "claim", "asked", "measured", "holds", "why not")]
    )
    body = element("table", element("thead", head), element("tbody", rows), cls="claims")
    return element(
        "section",
        element("h2", "Claims", id="claims", cls="flow"),
        element("div", body, cls="wide")
        if rows
        else element("p", "No claim could be judged: it takes srd and a method to compare it with."),
        figure(overview_svg, text.sentence(PROSE[result.settings.measured_pass].metrics["time to equal error"]), "most"),
    )


def definitions(result: BenchResult) -> Html:
    """The protocol in short; every method and every metric."""
    used = by_rank(sorted({curve.method for scene in result.scenes for curve in scene.curves}))
    prose = PROSE[result.settings.measured_pass]
    described = {name: prose.methods.get(name, "Not described.") for name in used}
    return element(
        "section",
        element("h2", "How it was measured", id="method"),
        element("ul", [element("li", sentence) for sentence in prose.protocol]),
        element(
            "div",
            element(
                "div",
                element("h3", "Methods"),
                _terms(described),
                element("h3", f"Stages of {MEASURED_PASSES[result.settings.measured_pass].time}"),
                _terms(prose.stages),
            ),
            element("div", element("h3", "Metrics"), _terms(prose.metrics)),
            cls="two",
        ),
    )


def _terms(entries: Mapping[str, str]) -> Html:
    pairs = [
        (element("dt", term, cls="srd" if term == "srd" else None), element("dd", meaning))
        for term, meaning in entries.items()
    ]
    return element("dl", pairs, cls="terms")


def limits(result: BenchResult) -> Html:
    """In words: each claim that does not hold, by how much and why; and what the run itself leaves open."""
    failed = text.limits(result)
    told = [
        element("li", element("strong", f"{scene}, {claim.name}. "), text.limit_sentence(claim))
        for scene, claim in failed
    ]
    doubts = [
        element("li", element("strong", f"{scene.scene}. "), warning)
        for scene in result.scenes
        for warning in text.warnings_of(scene)
    ]
    judged = any(scene.claims for scene in result.scenes)
    sound = (
        "Every reference is at least ten times better than the smallest error reported, and every scene is complete."
    )
    nothing = "Every claim that could be judged holds in every scene." if judged else "No claim was judged."
    return element(
        "section",
        element("h2", "Limits", id="limits"),
        element("h3", "Claims that do not hold"),
        element("ul", told) if told else element("p", nothing),
        element("h3", "Doubts about the measurement"),
        element("ul", doubts) if doubts else element("p", sound),
        element("h3", "What this does not cover"),
        _terms(PROSE[result.settings.measured_pass].not_covered),
    )
