"""What the bench report says in words: numbers as people read them, the protocol, definitions, warnings and limits.

Plain text only; `report_html` escapes it.
"""

from __future__ import annotations

import itertools
import math
import statistics

from app.bench.results import BenchResult, Claim, Curve, SceneResult

METHODS = {
    "srd": "The default. Each photon carries spectral ray differentials by refractive index, one column for each dispersive glass, "
    "and leaves an anisotropic Gaussian swept along its spectrum, drawn in closed form. As many spectral bands as the measured "
    "error of a chord asks for.",
    "srd-lambda": "The published method (Elek et al. 2014): one column by wavelength, one anchor in the middle of the band.",
    "stochastic": "One random wavelength a photon, spatial footprint. The baseline: unbiased in wavelength, noisy in colour.",
    "stochastic-even": "The same with wavelengths from a low-discrepancy sequence instead of chance: the usual answer at its best.",
    "stochastic-point": "One random wavelength a photon, one texel. Unbiased light tracing.",
    "regular-7": "Seven fixed wavelengths a photon path, a splat each. Shows banding where the spectrum is spread wider than a footprint.",
    "regular-16": "Sixteen fixed wavelengths a photon path, a splat each.",
    "progressive": "The default made consistent: anchors and kernels change from pass to pass so that the bias goes to zero.",
}

METRICS = {
    "relMSE": "mean over pixels and over X, Y, Z of (I − R)² / (R² + ε), I the picture, R the reference, ε = 10⁻² · (mean of R over the lit pixels)². "
    "The reference's own variance is taken off.",
    "relMSE trimmed": "the same without the 0.1 % of pixels with the largest error: what single fireflies cannot sway.",
    "relMSE, ε of the whole picture": "the same with ε from the mean of R over all pixels: where most of a picture is dark, that ε is small and a faint blur over the edge of a shadow weighs most.",
    "bias² and variance": "relMSE told apart over n seeds: bias² = mean[((Ī − R)² − Var/n) / (R² + ε)] with Ī the mean picture, "
    "variance = mean[Var / (R² + ε)]. An estimate of bias² at or below zero means that no bias could be detected.",
    "SMAPE": "mean of |I − R| / (|I| + |R| + √ε), 0 to 1.",
    "Δu'v'": "mean distance in CIE 1976 u'v' over the pixels that the reference lights: chromatic noise that luminance hides.",
    "nRMSE": "root mean square error over the root mean square of the reference, the reference's variance taken off.",
    "HDR-FLIP": "mean perceived difference over a range of exposures (Andersson et al. 2021), 0 to 1, on linear Rec.709; of the equal-time pictures alone.",
    "energy": "sum of the picture over sum of the reference; 1 is right.",
    "tail slope": "exponent of relMSE against photons over the curve's second half, with its 95 % confidence interval. "
    "Pure noise of independent photons gives −1; a bias floor bends it towards 0.",
    "time to equal error": "time that stochastic needs for its longest rendering, over the time that the method needs to reach the same mean error, "
    "read off the curves by log-log interpolation. ≥ marks a method whose shortest rendering is already better.",
}

MEASURES = {"relmse_whole": "relMSE, ε of the whole picture", "relmse_trimmed": "relMSE trimmed", "nrmse": "nRMSE", "smape": "SMAPE", "chroma": "Δu'v'"}
"""Names of `results.OTHER_MEASURES` as the reader sees them."""

STAGES = {
    "trace": "emission and tracing of photons",
    "splat": "footprints and drawing into the caustic maps",
    "resolve": "putting the maps together (display, not photon time)",
}

PROTOCOL = (
    "One process and one OpenGL context; all methods share emission, tracing, accumulation and display and use the same seeds. "
    "They differ in sampling and splat alone, so a difference between curves is a difference between methods.",
    "Every point is an independent rendering from nothing with one photon budget; budgets rise in equal ratios. Methods take turns "
    "within a seed, so that disturbances of the machine reach all alike.",
    "Photon time is trace + splat + resolve. Not in it: set-up of the scene (tree, uploads, compilation, pilot photons), "
    "the plan of spectral bands before each rendering (all listed by themselves), and the camera's pass, which is the same for every method.",
    "Errors are taken on linear XYZ of the caustic layer before tone mapping and gamut clipping, against a reference that shares no "
    "splat code: random wavelength, one photon one pixel.",
)

NOT_COVERED = {
    "other machines": "Times hold for the machine above. Ratios move where tracing and drawing differ in speed, as between a CPU and a GPU.",
    "the view": "Errors are those of the pixels the camera sees; light that falls elsewhere costs time and earns nothing here, for every method alike.",
    "one scene setting": "Each scene was measured at one picture size and one camera; a finer picture shows the bias of footprints sooner.",
}

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
    """A number of photons: 16.4 M, 250 k."""
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
    told = []
    least = smallest_error(scene)
    if scene.reference is None:
        told.append("There is no reference yet, so there are no errors.")
    elif not math.isfinite(scene.reference.relmse):
        told.append("The reference's own error is not known.")
    elif least > 0 and scene.reference.relmse > REFERENCE_SHARE * least:
        share = scene.reference.relmse / least
        told.append(
            f"The reference's own error ({number(scene.reference.relmse)}) is {share:.2g} times the smallest error reported "
            f"({number(least)}), above the tenth that the protocol asks for. Its variance has been taken off, yet errors near it are less "
            "certain than the band between seeds shows, and a ratio read there is less certain too."
        )
    elif scene.reference_too_coarse:
        told.append("The reference's own error is above a tenth of the smallest error reported.")
    if any(p.relmse <= 0 for c in scene.curves for p in c.points):
        told.append("Where a debiased error is zero or below, the picture cannot be told from the reference; the plots show a hollow triangle on the floor.")
    busy = [curve.method for curve in scene.curves if _times_fall(curve)]
    if busy:
        told.append(
            f"Photon time does not rise with the number of photons for {', '.join(busy)}: the machine was busy with other work, so times and time ratios "
            "here are rough. Errors against photons are not touched by that."
        )
    unfinished = [curve.method for curve in scene.curves if not curve.points]
    if unfinished:
        told.append(f"No finished point yet: {', '.join(unfinished)}.")
    if not scene.complete:
        told.append("The run was stopped before this scene was complete; the same command goes on where it stopped.")
    if scene.seeds < 5:
        told.append(f"Only {seeds_text(scene.seeds)}: the band over seeds and the parting of bias and variance are weak; the protocol asks for five.")
    return told


def _times_fall(curve: Curve) -> bool:
    """Whether more photons once took clearly less time."""
    seconds = [point.seconds for point in sorted(curve.points, key=lambda point: point.photons)]
    return any(later < BUSY_SHARE * earlier for earlier, later in itertools.pairwise(seconds))


def headline(result: BenchResult) -> list[str]:
    """The findings in two or three sentences."""
    claims = [claim for scene in result.scenes for claim in scene.claims]
    compared = [s for s in result.scenes if {"srd", "stochastic"} <= {curve.method for curve in s.curves if curve.points}]
    ratios = sorted(r for s in compared if (r := s.time_to_equal_error.get("srd", 0.0)) > 0 and math.isfinite(r))
    told = []
    if compared:
        enough = sum(ratio >= 30 for ratio in ratios)
        told.append(
            f"srd reached the error that stochastic ends with in at most 1/30 of its time in {enough} of {len(compared)} "
            f"scene{'' if len(compared) == 1 else 's'}{_range_of(ratios)}."
        )
        if len(ratios) < len(compared):
            told.append(f"In {len(compared) - len(ratios)} of them it never got there.")
    if claims:
        told.append(f"{sum(claim.holds for claim in claims)} of {len(claims)} claims hold; what does not is told under Limits.")
    if not told:
        told.append("Nothing has been compared yet: the run was stopped early or had one method only.")
    return told


def _range_of(ratios: list[float]) -> str:
    """A clause with the least, the median and the largest of rising `ratios`."""
    if not ratios:
        return ""
    if len(ratios) < 3:
        return f"; it took {' and '.join(ratio_text(ratio) for ratio in ratios)} less time"
    return f"; times less: {ratio_text(ratios[0])} at least, {ratio_text(statistics.median(ratios))} in the median, {ratio_text(ratios[-1])} at most"


def limits(result: BenchResult) -> list[tuple[str, Claim]]:
    """(scene, claim) for every claim that does not hold."""
    return [(scene.scene, claim) for scene in result.scenes for claim in scene.claims if not claim.holds]


def limit_sentence(claim: Claim) -> str:
    """One failed claim in words."""
    why = claim.why.strip() or "the numbers do not tell why."
    return f"Asked: {claim.asked}. Measured: {claim.measured}. Why: {why}"


def bias_share(curve: Curve) -> float | None:
    """Share of bias² in bias² + variance at the largest budget, 0 to 1; None where it cannot be told."""
    if not curve.points:
        return None
    last = max(curve.points, key=lambda point: point.photons)
    bias2, variance = max(last.bias2, 0.0), max(last.variance, 0.0)
    return bias2 / (bias2 + variance) if bias2 + variance > 0 and math.isfinite(bias2 + variance) else None


def seeds_text(seeds: int) -> str:
    """"one seed" or "5 seeds"."""
    return "one seed" if seeds == 1 else f"{seeds} seeds"


def signed(value: float) -> str:
    """Two decimals with a true minus sign."""
    return f"{value:.2f}".replace("-", "−")


def sentence(words: str) -> str:
    """With a capital at its start."""
    return words[:1].upper() + words[1:]
