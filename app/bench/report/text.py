"""What the bench report says in words: numbers as people read them, warnings, findings and limits.

Plain text only; the page escapes it.
"""

from __future__ import annotations

import itertools
import math
import statistics

from ..measured_passes import MEASURED_PASSES
from ..results import ERROR_SOUGHT, BenchResult, Claim, Curve, SceneResult

MEASURES = {
    "relmse_whole": "relMSE, ε of the whole picture",
    "relmse_trimmed": "relMSE trimmed",
    "nrmse": "nRMSE",
    "smape": "SMAPE",
    "chroma": "Δu'v'",
}
"""Names of `results.OTHER_MEASURES` as the reader sees them."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
BUSY_SHARE = 0.9
"""A larger budget that took less than this times the time of the one before it gives a busy machine away."""
REFERENCE_SHARE = 0.1
"""A reference's own error above this share of the smallest error measured calls for a warning."""


def superscript(value: float) -> str:
    """A tick such as 10⁻³ or 3·10⁻³."""
    exponent = math.floor(math.log10(value) + 1e-9)
    digit = round(value / 10.0**exponent)
    power = f"10{str(exponent).translate(_SUPERSCRIPTS)}"
    return power if digit == 1 else f"{digit}·{power}"


def number(value: float | None, digits: int = 2) -> str:
    """A table's number: "–" when there is none, plain between 0.001 and 10⁵, else with a power of ten."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    mantissa, exponent_text = f"{abs(value):.{digits - 1}e}".split("e")
    sign, exponent = "−" if value < 0 else "", int(exponent_text)
    if -3 <= exponent < 5:
        return f"{sign}{float(f'{mantissa}e{exponent}'):.{max(digits - 1 - exponent, 0)}f}"
    return f"{sign}{mantissa}·10{str(exponent).translate(_SUPERSCRIPTS)}"


def count(value: float) -> str:
    """A number of photons or samples: 16.4 M, 250 k."""
    for unit, suffix in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= unit:
            return f"{value / unit:.3g}{suffix}"
    return f"{value:.0f}"


def ratio_text(ratio: float, lower_bound: bool = False) -> str:
    """A time ratio: 45×, 2.3×, ≥ 120×."""
    digits = f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.2g}"
    return f"{'≥ ' if lower_bound else ''}{digits}×"


def smallest_error(scene: SceneResult) -> float:
    """The least positive mean relMSE of any curve; 0 when there is none."""
    errors = [p.relmse for c in scene.curves for p in c.points if p.relmse > 0 and math.isfinite(p.relmse)]
    return min(errors, default=0.0)


def warnings_of(scene: SceneResult) -> list[str]:
    """What a reader must know before trusting a scene's numbers."""
    said = []
    least = smallest_error(scene)
    if scene.reference is None:
        said.append("There is no reference yet, so there are no errors.")
    elif not math.isfinite(scene.reference.relmse):
        said.append("The reference's own error is not known.")
    elif least > 0 and scene.reference.relmse > REFERENCE_SHARE * least:
        share = scene.reference.relmse / least
        said.append(
            f"The reference's own error ({number(scene.reference.relmse)}) is {share:.2g} times the smallest error "
            "reported "
            f"({number(least)}), above the tenth that the protocol asks for. Its variance has been taken off, yet "
            "errors near it are less "
            "certain than the band between seeds shows, and a ratio read there is less certain too."
        )
    elif scene.reference_too_coarse:
        said.append("The reference's own error is above a tenth of the smallest error reported.")
    if any(p.relmse <= 0 for c in scene.curves for p in c.points):
        said.append(
            "Where a debiased error is zero or below, the picture cannot be told from the reference; the plots show a "
            "hollow triangle on the floor."
        )
    busy = [curve.method for curve in scene.curves if _times_fall(curve)]
    if busy:
        measured = MEASURED_PASSES[scene.measured_pass]
        said.append(
            f"{sentence(measured.time)} does not rise with the number of {measured.unit} for {', '.join(busy)}: the "
            "machine was busy with other work, so times and time ratios "
            f"here are rough. Errors against {measured.units} are not touched by that."
        )
    unfinished = [curve.method for curve in scene.curves if not curve.points]
    if unfinished:
        said.append(f"No finished point yet: {', '.join(unfinished)}.")
    if not scene.complete:
        said.append("The run was stopped before this scene was complete; the same command goes on where it stopped.")
    if scene.seeds < 5:
        said.append(
            f"Only {seeds_text(scene.seeds)}: the band over seeds and the parting of bias and variance are weak; the "
            "protocol asks for five."
        )
    return said


def _times_fall(curve: Curve) -> bool:
    """Whether a larger budget once took clearly less time."""
    seconds = [point.seconds for point in sorted(curve.points, key=lambda point: point.photons)]
    return any(later < BUSY_SHARE * earlier for earlier, later in itertools.pairwise(seconds))


def headline(result: BenchResult) -> list[str]:
    """The findings in two or three sentences."""
    claims = [claim for scene in result.scenes for claim in scene.claims]
    compared = [
        s for s in result.scenes if {"srd", "stochastic"} <= {curve.method for curve in s.curves if curve.points}
    ]
    ratios = sorted(r for s in compared if (r := s.time_to_equal_error.get("srd", 0.0)) > 0 and math.isfinite(r))
    said = _against_the_best(result)
    if compared:
        asked = MEASURED_PASSES[result.settings.measured_pass].asked_ratio
        enough = sum(ratio >= asked for ratio in ratios)
        said.append(
            f"srd reached the error that stochastic ends with in at most 1/{asked:.0f} of its time in {enough} of "
            f"{len(compared)} "
            f"scene{'' if len(compared) == 1 else 's'}{_range_of(ratios)}."
        )
        if len(ratios) < len(compared):
            said.append(f"In {len(compared) - len(ratios)} of them it never got there.")
    if claims:
        said.append(
            f"{sum(claim.holds for claim in claims)} of {len(claims)} claims hold; what does not is listed under "
            "Limits."
        )
    if not said:
        said.append("Nothing has been compared yet: the run was stopped early or had one method only.")
    return said


def _against_the_best(result: BenchResult) -> list[str]:
    """srd against the best baseline at 1 %, by both clocks; nothing where nothing was compared."""
    said = []
    for clock in ("photon", "whole"):
        found = [one for s in result.scenes for one in s.speed_ups if one.clock == clock and one.target == ERROR_SOUGHT]
        found = [one for one in found if one.bound != "~"]
        ratios = sorted(one.ratio for one in found if one.ratio is not None)
        if not found:
            continue
        time = MEASURED_PASSES[result.settings.measured_pass].time if clock == "photon" else "time of a whole process"
        bounds = sum(bool(one.bound) for one in found if one.ratio is not None)
        said.append(
            f"To a relMSE of 1 % srd is, by {time}, faster than the best of all baselines, each with its best kernel, "
            f"in {sum(ratio > 1.0 for ratio in ratios)} of {len(found)} scene{'' if len(found) == 1 else 's'}"
            f"{_range_of(ratios)}{f' ({bounds} of these are bounds)' if bounds else ''}."
        )
    return said


def _range_of(ratios: list[float]) -> str:
    """A clause with the least, the median and the largest of rising `ratios`."""
    if not ratios:
        return ""
    if len(ratios) < 3:
        return f"; it took {' and '.join(ratio_text(ratio) for ratio in ratios)} less time"
    least, median, most = (ratio_text(ratio) for ratio in (ratios[0], statistics.median(ratios), ratios[-1]))
    return f"; times less: {least} at least, {median} in the median, {most} at most"


def limits(result: BenchResult) -> list[tuple[str, Claim]]:
    """(scene, claim) for every claim that does not hold."""
    return [(scene.scene, claim) for scene in result.scenes for claim in scene.claims if not claim.holds]


def limit_sentence(claim: Claim) -> str:
    """One failed claim in words."""
    why = claim.why.strip() or "the numbers do not tell why."
    return f"Asked: {claim.asked}. Measured: {claim.measured}. Why: {why}"


def bias_share(curve: Curve) -> float | None:
    """Share of bias² in bias² + variance at the largest budget, 0 to 1; None where it cannot be known."""
    if not curve.points:
        return None
    last = max(curve.points, key=lambda point: point.photons)
    bias2, variance = max(last.bias2, 0.0), max(last.variance, 0.0)
    return bias2 / (bias2 + variance) if bias2 + variance > 0 and math.isfinite(bias2 + variance) else None


def seeds_text(seeds: int) -> str:
    """ "one seed" or "5 seeds"."""
    return "one seed" if seeds == 1 else f"{seeds} seeds"


def signed(value: float) -> str:
    """Two decimals with a true minus sign."""
    return f"{value:.2f}".replace("-", "−")


def sentence(words: str) -> str:
    """With a capital at its start."""
    return words[:1].upper() + words[1:]
