"""The commands that solve and that give figures of lenses, with their options: see `table`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from . import completion, options
from .options import MISSING, argument, option, shared, target
from .table import A_LENGTH, PHOTONS, SEED, OpensScene, ReadsScenes


@dataclass(frozen=True, kw_only=True)
class Match(OpensScene):
    """Rank the catalogue's glasses by how near the light that an object of each casts comes to what is wanted."""

    through: str = argument("OBJECT", "The object of glass.")
    receiver: str = argument("RECEIVER", "The flat object that is lit.", complete=completion.receivers)
    target: Path | None = option(
        "FILE",
        "The light that is wanted: a picture, or a .csv of spectra, a line a place, of 4 to 32 even bins from 380 to "
        "780 nm; default: the scene's own light, for a dispersion gain that nature does not offer.",
    )
    begin: tuple[float, float, float] | None = option(
        "X,Y,Z", "Where the target's first row begins on the receiver (of a picture, its upper left).", options.place
    )
    end: tuple[float, float, float] | None = option("X,Y,Z", "Where its first row ends.", options.place)
    last: tuple[float, float, float] | None = option(
        "X,Y,Z", "Where its last row begins; default: the target is a line.", options.place
    )
    count: int | None = option("N", "Glasses that are listed; default: 10.", options.integer(1, 2000))
    photons: int | None = shared(PHOTONS)
    seed: int | None = shared(SEED)


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
        options.number(lambda value: 0.0 < value < 1e9, "more than 0", A_LENGTH),
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
        options.number(lambda value: 0.0 < value < 1e9, "more than 0", " in the mesh's unit, for example 300"),
    )
    output: Path | None = target("OUT", "Write the target and, next to it, what the plate draws.", default=None)
    target: Path = option("PICTURE", "The picture that it was made for.", default=MISSING)
