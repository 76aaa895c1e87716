"""The sampling methods in words."""

from __future__ import annotations

METHOD_NAMES = {
    "srd": "Spectral ray differentials",
    "srd-photons": "Differentials, photons only",
    "progressive": "Differentials, passes without end",
    "srd-lambda": "Differentials by wavelength",
    "stochastic": "Random wavelengths",
    "stochastic-even": "Even random wavelengths",
    "stochastic-point": "Light tracing, one texel",
    "progressive-stochastic": "Random wavelengths, shrinking kernel",
    "hero": "Hero wavelength",
    "regular-7": "7 fixed wavelengths",
    "regular-16": "16 fixed wavelengths",
}
"""Method of `METHODS` -> what it is called on the screen."""

METHOD_TIPS = {
    "srd": "The default: flat facets throw polygons, all else photons, both swept along the spectrum in closed form.",
    "srd-photons": "The same without polygons: photons carry all light.",
    "progressive": "The default in passes that grow, each finer than the last: its error falls for as long as it runs.",
    "srd-lambda": "One derivative by wavelength and one anchor a photon: the published method.",
    "stochastic": "One random wavelength a photon with a footprint: the usual way.",
    "stochastic-even": "The same with wavelengths from a low-discrepancy sequence: the usual way at its best.",
    "stochastic-point": "One random wavelength and one texel a photon: unbiased light tracing.",
    "progressive-stochastic": "Passes of random wavelengths whose kernel shrinks: progressive photon mapping.",
    "hero": "Four stratified wavelengths share a photon's path until glass parts them.",
    "regular-7": "Seven fixed wavelengths, a splat each: shows banding.",
    "regular-16": "Sixteen fixed wavelengths, a splat each: shows banding.",
}
"""Method of `METHODS` -> its tooltip."""

MENU_METHODS = {method: name for method, name in METHOD_NAMES.items() if method != "progressive"}
"""Those that a menu offers. `progressive` ends with 1.0 to 1.6 times the error of `srd`: benches compare with it."""
