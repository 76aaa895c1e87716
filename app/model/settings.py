"""What a user asks of one rendering, apart from the scene: plain values, validated by the command line."""

from __future__ import annotations

from dataclasses import dataclass

METHODS = (
    "srd",
    "srd-photons",
    "progressive",
    "srd-lambda",
    "stochastic",
    "stochastic-even",
    "stochastic-point",
    "progressive-stochastic",
    "hero",
    "regular-7",
    "regular-16",
)
"""Sampling methods that every comparison holds (docs/error-against-time.md)."""
RANDOM_METHODS = ("stochastic", "stochastic-even", "stochastic-point", "progressive-stochastic", "hero")
"""Methods whose photons have wavelengths drawn at random."""
LIGHT_METHODS = ("progressive", "stochastic-point", "progressive-stochastic", "hero")
"""The ones that only photons may follow; camera rays then follow `srd` or `stochastic`, see `camera_method_of`."""
CAMERA_METHODS = tuple(name for name in METHODS if name not in LIGHT_METHODS)
"""Methods that camera rays may follow too."""


def divides_spectrum(method: str) -> bool:
    """Whether photons and camera rays are swept along as many spectral bands as the scene asks for, one column a glass:
    `srd`, with or without beams, in one pass or many."""
    return method in ("srd", "srd-photons", "progressive")


def has_beams(method: str) -> bool:
    """Whether what flat facets throw goes as beams."""
    return method in ("srd", "progressive")


def camera_method_of(method: str) -> str:
    """What camera rays follow where photons follow `method`."""
    if method not in LIGHT_METHODS:
        return method
    return "srd" if divides_spectrum(method) else "stochastic"


@dataclass(frozen=True)
class RenderSettings:
    """One rendering. `photons` and `seconds` exclude each other; both None means the scene's own photon count."""

    width: int = 960
    height: int = 540
    photons: int | None = None
    seconds: float | None = None
    seed: int = 1
    method: str = "srd"
    camera_method: str | None = None
    """The camera's method where it differs from the light's `method`."""
    layer: str = "beauty"
    """"beauty", "caustic" or "map:RECEIVER"."""
    bins: int | None = None
    exposure_ev: float | None = None
    glare: float = 0.0
    """Share of the light that the camera's lens scatters; of pictures to look at only."""
    max_depth: int = 64
    spp: int | None = None
    """Camera samples a pixel; None chooses by the scene."""
    batch: int | None = None
    """Photons in flight at once; None lets the device's limits decide. Never changes the picture."""
    smoothing: float = 0.45
    """Standard deviation of a footprint in lattice spacings: wider ones blur edges more, and what ripple Gaussians so
    narrow leave splats take off themselves (`shaders/light/splat_shapes.glsl`)."""
    local_gain: bool = True
    """Whether the dispersion brush's dabs count; False is the physical picture."""
    editable: bool = False
    """Photons are kept and drawn again when dispersion and lights are edited: in the viewer."""
    least_bands: int = 1
    """Spectral bands of photons, at least: for derivatives, of which bands too wide leave more than of a picture."""
    any_view: bool = False
    """The camera may go anywhere (viewer, animation): what a scene needs is not judged by what its camera sees."""
    tally: bool = False
    """Also sum up what the maps hold, for `--stats`."""
