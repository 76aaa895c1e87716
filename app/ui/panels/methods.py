"""The sampling methods in words."""

from __future__ import annotations

METHOD_NAMES = {
    "srd": "Spectral ray differentials",
    "srd-photons": "Differentials, photons alone",
    "srd-lambda": "Differentials by wavelength",
    "stochastic": "Random wavelengths",
    "stochastic-even": "Even random wavelengths",
    "stochastic-point": "Light tracing, one texel",
    "regular-7": "7 fixed wavelengths",
    "regular-16": "16 fixed wavelengths",
}
"""Method of `METHODS` -> what it is called on the screen."""

METHOD_TIPS = {
    "srd": "The default: each photon is swept along its own spectrum in closed form; as many spectral bands as needed.",
    "srd-photons": "The same without beams: what flat facets throw is left to photons too.",
    "srd-lambda": "One derivative by wavelength and one anchor a photon: the published method.",
    "stochastic": "One random wavelength a photon with a footprint: the usual way.",
    "stochastic-even": "The same with wavelengths from a low-discrepancy sequence: the usual way at its best.",
    "stochastic-point": "One random wavelength and one texel a photon: unbiased light tracing.",
    "regular-7": "Seven fixed wavelengths, a splat each: shows banding.",
    "regular-16": "Sixteen fixed wavelengths, a splat each: shows banding.",
}
"""Method of `METHODS` -> its tooltip."""
