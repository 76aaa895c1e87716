"""The commands that solve and that give figures of lenses and gems, with their options: see `table`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..model.fields import Number
from . import completion, options
from .options import MISSING, argument, option, setting, shared, target
from .table import A_LENGTH, BINS, LINEAR, PHOTONS, POSITIVE, SEED, SHOWN, SPP, OpensScene, ReadsScenes

GRADIENT_SIZE = (256, 256)


@dataclass(frozen=True, kw_only=True)
class Gradient(OpensScene):
    """Write how the picture, or the light on a receiver, changes with a number of the scene."""

    of: str = argument(
        "PARAMETER", "As for animate, for example objects.prism.n_d; objects.prism.index is its whole curve."
    )
    output: Path = target("OUT", f"A picture, brighter red and darker blue: {SHOWN}; numbers: {LINEAR}.")
    receiver: str | None = option(
        "NAME", "Of the light on this object, not of the picture.", complete=completion.receivers
    )
    size: tuple[int, int] | None = setting("WxH", "Pixels; default: 256x256.", options.size, fields=("width", "height"))
    photons: int | None = shared(PHOTONS)
    spp: int | None = shared(SPP)
    bins: int | None = shared(BINS)
    seed: int | None = shared(SEED)
    step: float | None = option(
        "H",
        "Change of the parameter to either side; default: so that the picture changes by about 3 %.",
        options.number(POSITIVE, " in the parameter's unit, for example 0.001"),
    )


@dataclass(frozen=True, kw_only=True)
class Wanted(OpensScene):
    """Light that is wanted on a receiver."""

    target: Path | None = option(
        "FILE",
        "A picture, or a .csv of spectra, a line a place, of 4 to 32 even bins from 380 to 780 nm; default of match: "
        "the scene's own light, for a dispersion gain that nature does not offer.",
    )
    begin: tuple[float, float, float] | None = option(
        "X,Y,Z", "Where the target's first row begins on the receiver (of a picture, its upper left).", options.place
    )
    end: tuple[float, float, float] | None = option("X,Y,Z", "Where its first row ends.", options.place)
    last: tuple[float, float, float] | None = option(
        "X,Y,Z", "Where its last row begins; default: the target is a line.", options.place
    )
    width: float | None = option(
        "W",
        "Width of the light along that line, instead of a target: full width at half maximum.",
        options.number(POSITIVE, A_LENGTH),
    )
    photons: int | None = shared(PHOTONS)
    seed: int | None = shared(SEED)


@dataclass(frozen=True, kw_only=True)
class Match(Wanted):
    """Rank the catalogue's glasses by how near the light that an object of each casts comes to what is wanted."""

    through: str = argument("OBJECT", "The object of glass.")
    receiver: str = argument("RECEIVER", "The flat object that is lit.", complete=completion.receivers)
    count: int | None = option("N", "Glasses that are listed; default: 10.", options.integer(1, 2000))


@dataclass(frozen=True, kw_only=True)
class Fit(Wanted):
    """Find numbers of a scene with which it lights a receiver as is wanted, from those that it has."""

    receiver: str = argument("RECEIVER", "The flat object that is lit.", complete=completion.receivers)
    of: tuple[str, ...] = argument("PARAMETER...", "As for gradient; with a width one only.", repeated=True)


@dataclass(frozen=True, kw_only=True)
class Gem(ReadsScenes):
    """Show what a cut stone looks like from above: light return, fire, scintillation, windows; ASET, tilt curves."""

    stone: str = argument(
        "STONE", "A GemCad design (.asc), a mesh (.stl, .ply, .obj) or a scene.", complete=completion.scenes
    )
    object: str | None = option("NAME", "Which object of the scene; default: its first solid of glass.")
    glass: str | None = option(
        "GLASS",
        "What it is cut of: a glass, or an index, which has no fire; default: what the scene says.",
        complete=completion.glasses,
    )
    up: str = option("AXIS", "Where its table faces: z, -z, x, -x, y or -y of the file; default: z.", default="z")
    head: float = option(
        "DEG",
        "Half the angle at which the viewer's head hides light; default: 15.",
        options.number(Number("head", at_least=0.0, at_most=60.0), " in degrees, for example 16"),
        default=15.0,
    )
    output: Path | None = target(
        "OUT", "Write a report (.html), the figures and curves (.json) or a picture (.png).", default=None
    )
    picture: str = option(
        "NAME", "Which picture: aset, ideal-scope, brightness or fire; default: aset.", default="aset"
    )


@dataclass(frozen=True, kw_only=True)
class LensTable(ReadsScenes):
    """Show a lens's focal lengths, chromatic shift and spots by wavelength."""

    file: str = argument(
        "FILE", "A prescription (.csv, .zmx), or a scene with objects of shape lens.", complete=completion.scenes
    )
    object: str | None = option(
        "NAME", "One of the scene's lenses; those on its axis belong to it; default: the first."
    )
    beam: float | None = option(
        "D",
        "Diameter of the parallel light that enters; default: the file's, or all that passes.",
        options.number(POSITIVE, A_LENGTH),
    )
    wavelengths: tuple[float, ...] | None = option(
        "NM,NM", "Wavelengths; default: the file's, or the lines g, F, e, d and C.", options.wavelengths
    )


@dataclass(frozen=True, kw_only=True)
class LensCheck:
    """Check whether a caustic plate draws its picture: focus, error, efficiency, colour blur, tolerances."""

    plate: Path = argument("PLATE", "A mesh (.stl, .ply, .obj) with one flat side and, across from it, a shaped one.")
    glass: str = option("GLASS", "What it is made of; default: PMMA.", complete=completion.glasses, default="PMMA")
    distance: float | None = option(
        "D",
        "From the plate's far side to the screen, in the mesh's unit; default: where it is most like the target.",
        options.number(POSITIVE, " in the mesh's unit, for example 300"),
    )
    output: Path | None = target("OUT", "Write the target and, next to it, what the plate draws.", default=None)
    target: Path = option("PICTURE", "The picture that it was made for.", default=MISSING)
