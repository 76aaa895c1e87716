"""The bench report's numbers as people read them, and its sentences: findings and warnings. Plain text; the page
escapes it."""

from __future__ import annotations

import itertools
import math
import statistics

from ..measured_passes import MEASURED_PASSES
from ..results import ERROR_SOUGHT, BenchResult, Curve, SceneResult, SpeedUp

NONE = "–"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
BUSY_SHARE = 0.9
"""A larger budget that took less than this times the time of the one before it shows that the machine was busy."""
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
        return NONE
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
        if value >= unit * 0.9995:
            return f"{value / unit:.3g}{suffix}"
    return f"{value:.3g}"


def percent(share: float) -> str:
    """A share as a heading."""
    return f"{100 * share:.3g} %"


def times(ratio: float) -> str:
    """45×, 2.3×."""
    return f"{ratio:.0f}×" if ratio >= 10 else f"{ratio:.2g}×"


def ratio_text(ratio: float | None, lower_bound: bool = False) -> str:
    """A time ratio: 45×, ≥ 120×; "never" where there is none."""
    if ratio is None or not (ratio > 0 and math.isfinite(ratio)):
        return "never"
    return f"{'≥ ' if lower_bound else ''}{times(ratio)}"


def speed_up_text(one: SpeedUp | None) -> str:
    """ "12×", "≥ 30×" where it is a bound, "not reached" where srd does not get there, "both at once" where it cannot
    be known."""
    if one is None:
        return NONE
    if one.ratio is None:
        return "not reached"
    return "both at once" if one.bound == "~" else f"{one.bound} {times(one.ratio)}".strip()


def slope_text(curve: Curve) -> str:
    """The exponent of the error and its confidence interval."""
    if not curve.slope_half_width > 0.0:
        return NONE
    return f"{curve.slope:.2f} ± {curve.slope_half_width:.2f}".replace("-", "−")


def clock_name(clock: str, measured_pass: str) -> str:
    """ "photon time", "whole process"."""
    return MEASURED_PASSES[measured_pass].time if clock == "photon" else "whole process"


def seeds_text(seeds: int) -> str:
    """ "one seed" or "5 seeds"."""
    return "one seed" if seeds == 1 else f"{seeds} seeds"


def sentence(words: str) -> str:
    """With a capital at its start."""
    return words[:1].upper() + words[1:]


def smallest_error(scene: SceneResult) -> float:
    """The least positive mean relMSE of any curve; 0 when there is none."""
    errors = [p.relmse for c in scene.curves for p in c.points if p.relmse > 0 and math.isfinite(p.relmse)]
    return min(errors, default=0.0)


def warnings_of(scene: SceneResult) -> list[str]:
    """What a reader must know before trusting a scene's numbers."""
    found = []
    least, measured = smallest_error(scene), MEASURED_PASSES[scene.measured_pass]
    if scene.reference is None:
        found.append("There is no reference yet, so there are no errors.")
    elif not math.isfinite(scene.reference.relmse):
        found.append("The reference's own error is not known.")
    elif 0 < REFERENCE_SHARE * least < scene.reference.relmse:
        found.append(
            f"The reference's own error ({number(scene.reference.relmse)}) is {scene.reference.relmse / least:.2g} "
            f"times the smallest error reported ({number(least)}), above the tenth that the protocol asks for. Its "
            "variance has been taken off, yet errors and ratios near it are less certain than the band between seeds "
            "shows; --reference-seconds lowers it."
        )
    if any(p.relmse <= 0 for c in scene.curves for p in c.points):
        found.append(
            "Where a debiased error is zero or below, the picture cannot be distinguished from the reference; the "
            "plots show a hollow triangle on the floor."
        )
    if busy := [curve.method for curve in scene.curves if _times_fall(curve)]:
        found.append(
            f"{sentence(measured.time)} does not rise with the number of {measured.unit} for {', '.join(busy)}: the "
            "machine was busy with other work, so times and time ratios here are rough; errors against "
            f"{measured.units} are not affected."
        )
    if unfinished := [curve.method for curve in scene.curves if not curve.points]:
        found.append(f"No finished point yet: {', '.join(unfinished)}.")
    if not scene.complete:
        found.append("The run was stopped before this scene was complete; the same command goes on where it stopped.")
    if scene.seeds < 5:
        found.append(
            f"Only {seeds_text(scene.seeds)}: the band over seeds and the split of errors into bias and variance are "
            "weak; the protocol asks for five."
        )
    if scene.picture_samples and not any("flip" in sample.metrics for sample in scene.picture_samples.values()):
        found.append(
            "FLIP is not available; 'pip install flip-evaluator' brings it, on Pythons that it has wheels for."
        )
    return found


def _times_fall(curve: Curve) -> bool:
    """Whether a larger budget once took clearly less time."""
    seconds = [point.seconds for point in sorted(curve.points, key=lambda point: point.photons)]
    return any(later < BUSY_SHARE * earlier for earlier, later in itertools.pairwise(seconds))


def headline(result: BenchResult) -> list[str]:
    """The findings in a sentence or two: srd against the best baseline by both clocks."""
    found = []
    for clock in ("photon", "whole"):
        known = [one for s in result.scenes for one in s.speed_ups if one.clock == clock and one.target == ERROR_SOUGHT]
        known = [one for one in known if one.bound != "~"]
        ratios = [one.ratio for one in known if one.ratio is not None]
        bounds = sum(bool(one.bound) for one in known if one.ratio is not None)
        if known:
            found.append(
                f"To a relMSE of 1 % srd is, by {clock_name(clock, result.settings.measured_pass)}, faster than the "
                f"best of all baselines, each with its best kernel, in {sum(ratio > 1.0 for ratio in ratios)} of "
                f"{len(known)} scenes{_range_of(ratios)}{f' ({bounds} of these are bounds)' if bounds else ''}."
            )
    return found or ["Nothing has been compared yet: the run was stopped early or had one method only."]


def _range_of(ratios: list[float]) -> str:
    """A clause with the least, the median and the largest of `ratios`."""
    if not ratios:
        return ""
    if len(ratios) < 3:
        return f"; it took {' and '.join(map(times, sorted(ratios)))} less time"
    median = times(statistics.median(ratios))
    return f"; times less: {times(min(ratios))} at least, {median} in the median, {times(max(ratios))} at most"
