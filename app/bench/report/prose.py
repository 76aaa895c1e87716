"""What the bench report says of methods, metrics and protocol, for each pass of the renderer. Plain text only;
`report_html` escapes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Prose:
    """One pass's explanations."""

    methods: Mapping[str, str]
    metrics: Mapping[str, str]
    stages: Mapping[str, str]
    protocol: tuple[str, ...]
    not_covered: Mapping[str, str]


_LIGHT_METHODS = {
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

_METRICS = {
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

_LIGHT_STAGES = {
    "trace": "emission and tracing of photons",
    "splat": "footprints and drawing into the caustic maps",
    "resolve": "putting the maps together (display, not photon time)",
}

_LIGHT_PROTOCOL = (
    "One process and one OpenGL context; all methods share emission, tracing, accumulation and display and use the same seeds. "
    "They differ in sampling and splat alone, so a difference between curves is a difference between methods.",
    "Every point is an independent rendering from nothing with one photon budget; budgets rise in equal ratios. Methods take turns "
    "within a seed, so that disturbances of the machine reach all alike.",
    "Photon time is trace + splat. Not in it: set-up of the scene (tree, uploads, compilation, pilot photons), "
    "the plan of spectral bands before each rendering (all listed by themselves), and the camera's pass, which is the same for every method.",
    "Errors are taken on linear XYZ of the caustic layer before tone mapping and gamut clipping, against a reference that shares no "
    "splat code: random wavelength, one photon one pixel.",
)

_LIGHT_NOT_COVERED = {
    "other machines": "Times hold for the machine above. Ratios move where tracing and drawing differ in speed, as between a CPU and a GPU.",
    "the view": "Errors are those of the pixels the camera sees; light that falls elsewhere costs time and earns nothing here, for every method alike.",
    "one scene setting": "Each scene was measured at one picture size and one camera; a finer picture shows the bias of footprints sooner.",
}

_CAMERA_METHODS = {
    "srd": "The default. Each camera ray carries spectral ray differentials by refractive index, one column for each dispersive glass, and looks "
    "up what lies along its spectrum with filtered taps. A band is cut where its colours part; as many bands, or single wavelengths, as a pilot of the picture asks for.",
    "srd-lambda": "The method as published (Elek et al. 2014): one column by wavelength, the whole spectrum from one anchor.",
    "stochastic": "One random wavelength a camera path. The baseline: unbiased in wavelength, noisy in colour.",
    "stochastic-even": "The same with wavelengths from a low-discrepancy sequence instead of chance: the usual answer at its best.",
    "regular-7": "Seven fixed wavelengths, taken in turn by the samples of a pixel. Shows banding where the spectrum is spread wider than what is seen is smooth.",
    "regular-16": "Sixteen fixed wavelengths, taken in turn.",
}

_CAMERA_METRICS = _METRICS | {
    "tail slope": "exponent of relMSE against camera samples over the curve's second half, with its 95 % confidence interval. "
    "Pure noise of independent samples gives −1; a bias floor bends it towards 0.",
}

_CAMERA_STAGES = {
    "bands": "finding out into how many bands the spectrum must be cut for so many samples (srd alone)",
    "looks": "tracing camera rays and looking up what they see",
}

_CAMERA_PROTOCOL = (
    "One process and one OpenGL context; all methods look up the same caustic maps and use the same seeds. They differ in how camera "
    "rays sample the spectrum alone, so a difference between curves is a difference between methods.",
    "Every point is an independent rendering from nothing with one number of camera samples a pixel; numbers rise in equal ratios, as far as "
    "a picture is whole only after a multiple of its bands. Methods take turns within a seed, so that disturbances of the machine reach all alike.",
    "Camera time is bands + looks. Not in it: set-up of the scene (tree, uploads, compilation) and the caustic maps, which are made once for all methods.",
    "Places within a pixel are a lattice that is the same for every seed and method: what is left of it by few samples counts as bias² of all.",
    "Errors are taken on linear XYZ of all that the camera sees, before tone mapping and gamut clipping, against a reference that shares no code with the "
    "shaders: float64 camera paths of one random wavelength each, no column, no caustic map.",
)

_CAMERA_NOT_COVERED = {
    "other machines": "Times hold for the machine above. Ratios move where looking up and tracing differ in speed, as between a CPU and a GPU.",
    "the caustic maps": "Their cost and their error are those of the light pass, which has a bench of its own; here their error is common to all methods.",
    "the reference's caustic": "Its noise is not part of the reference's own error, but told beside it.",
    "one scene setting": "Each scene was measured at one picture size and one camera; a finer picture, or a camera nearer to the glass, asks for more bands.",
}

PROSE = {
    "light": Prose(_LIGHT_METHODS, _METRICS, _LIGHT_STAGES, _LIGHT_PROTOCOL, _LIGHT_NOT_COVERED),
    "camera": Prose(_CAMERA_METHODS, _CAMERA_METRICS, _CAMERA_STAGES, _CAMERA_PROTOCOL, _CAMERA_NOT_COVERED),
}
