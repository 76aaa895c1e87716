"""Thin films in the words of a scene file: coatings of layers, and one film of a liquid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base.errors import suggestion
from ..fields import Animated, Number, Part, Row
from ..io.scene_table import REQUIRED, SceneTable
from ..optics.glass import Dispersion, constant
from ..optics.metals import Metal, find_metal
from ..optics.thin_films import MAX_LAYERS, MAX_NM, Film, Layer, Profile
from .dispersion_file import describe_dispersion, named_glass

FILM_NM = Number(
    "film_nm",
    0.0,
    unit="nm",
    optional=True,
    at_least=0.0,
    at_most=MAX_NM,
    row=Row(
        "Film",
        "Thickness of a film of liquid on its surface, such as oil on water, whose colours change with it; of a thin "
        "sheet, its own: a soap film has 100 to 1000. 0: none.",
        high=2000.0,
        format="%.0f",
        is_slider=True,
    ),
    animated=Animated("Thickness of the film on a surface of glass, nm"),
)
FILM_INDEX = Number("film_index", 1.33, optional=True, at_least=1.0, at_most=5.0)
FILM_FROM_NM = Number(
    "film_from_nm",
    0.0,
    unit="nm",
    optional=True,
    at_least=0.0,
    at_most=MAX_NM,
    row=Row(
        "Film begins",
        "Thickness where a film that varies begins; it ends with that of the film.",
        high=2000.0,
        format="%.0f",
        is_slider=True,
    ),
    animated=Animated("Thickness of a film that varies, where it begins, nm"),
)
RADIUS = (0.0, 0.0, 0.0)


class FilmAlong(Part):
    """`film_along`: a direction; or "radius", which is `RADIUS`."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """None: the film is even."""
        if not table.has("film_along"):
            if table.has("film_from_nm"):
                table.fail(
                    "film_from_nm", "has no effect on an even film: give 'film_along', a direction or \"radius\""
                )
            return {"film_along": None}
        if not isinstance(table.raw("film_along"), str):
            return {"film_along": table.unit_vector("film_along", REQUIRED)}
        table.choice("film_along", ("radius",))
        return {"film_along": RADIUS}

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """As it was given."""
        along = value.film_along
        return {} if along is None else {"film_along": "radius" if along == RADIUS else list(along)}


@dataclass(frozen=True)
class Coating:
    """A film with its words."""

    film: Film
    preset: str = ""
    """One of `PRESETS`, or ""."""


def _quarters(centre_nm: float, pairs: int) -> Film:
    """Quarter waves of titania and silica by turns, half as thick at both ends so that what passes does not ripple."""
    high, low = (Layer(constant(n), centre_nm / (4.0 * n)) for n in (2.35, 1.46))
    edge = Layer(high.medium, 0.5 * high.nm)
    return Film((edge, *(layer for _ in range(pairs - 1) for layer in (low, high)), low, edge))


PRESETS = {
    "ar": Film((Layer(constant(1.38), 99.6),)),
    "ar-broad": Film((Layer(constant(1.38), 99.6), Layer(constant(2.1), 131.0), Layer(constant(1.63), 84.4))),
    "dichroic-blue": _quarters(460.0, 9),
    "dichroic-red": _quarters(680.0, 9),
    "beam-splitter": Film((), share=0.5),
}
"""One layer of magnesium fluoride against reflections; three, for all colours; what reflects blue; red; half."""
TITLES = {
    "ar": "Antireflection",
    "ar-broad": "Antireflection, broad",
    "dichroic-blue": "Reflects blue",
    "dichroic-red": "Reflects red",
    "beam-splitter": "Reflects half",
}


def preset(name: str) -> Coating:
    """One of `PRESETS`."""
    return Coating(PRESETS[name], name)


class CoatingPart(Part):
    """`coating`: the name of a preset, a table of layers, or of a share."""

    def read(self, table: SceneTable) -> dict[str, Any]:
        """The coating, None without one."""
        if not table.has("coating"):
            return {"coating": None}
        if isinstance(table.raw("coating"), str):
            name = table.string("coating")
            if name not in PRESETS:
                known = ", ".join(PRESETS)
                table.fail("coating", f"'{name}' is unknown{suggestion(name, PRESETS)}; there are {known}")
            return {"coating": preset(name)}
        inner = table.given_table("coating", "{ layers = [{ n = 1.38, nm = 100 }] }")
        key = inner.one_of(("layers", "share"), "the coating")
        if key == "share":
            film = Film((), share=inner.number(key, at_least=0.0, at_most=1.0))
        else:
            film = Film(tuple(_read_layer(each) for each in inner.tables("layers")))
            if not 0 < len(film.layers) <= MAX_LAYERS:
                inner.fail("layers", f"holds {len(film.layers)} layers; give 1 to {MAX_LAYERS}")
        inner.finish("a coating")
        return {"coating": Coating(film)}

    def write(self, value: Any, path: Path | None) -> dict[str, Any]:
        """As it was given."""
        coating: Coating | None = value.coating
        if coating is None:
            return {}
        if coating.preset:
            return {"coating": coating.preset}
        if coating.film.share is not None:
            return {"coating": {"share": coating.film.share}}
        return {"coating": {"layers": [_layer_words(layer) for layer in coating.film.layers]}}


def _read_layer(table: SceneTable) -> Layer:
    key = table.one_of(("n", "glass", "metal"), "the layer's material")
    if key is None:
        table.fail("", "has no material: give 'n', 'glass' or 'metal'")
    nm = table.number("nm", above=0.0, at_most=MAX_NM)
    if key == "n":
        medium: Dispersion | Metal = constant(table.number(key, at_least=1.0, at_most=10.0))
    else:
        name = table.string(key)
        medium = named_glass(table, key, name) if key == "glass" else find_metal(name, table.where(key))
    table.finish("a layer")
    return Layer(medium, nm)


def _layer_words(layer: Layer) -> dict[str, Any]:
    medium = layer.medium
    if isinstance(medium, Metal):
        return {"metal": medium.name, "nm": layer.nm}
    assert isinstance(medium, Dispersion)
    words = {"n": medium.coefficients[0]} if medium.kind == "constant" else describe_dispersion(medium)
    return {**words, "nm": layer.nm}


def film_of(value: Any, liquid: Dispersion | None = None) -> Film | None:
    """The film that a material's keys say it has; `liquid`: of a sheet that is itself the film."""
    coating: Coating | None = value.coating
    along, thickest = value.film_along, value.film_nm
    profile = None
    if along is not None:
        thickest = max(thickest, value.film_from_nm)
        profile = Profile(value.film_from_nm, value.film_nm, None if along == RADIUS else along)
    if coating is None and thickest == 0.0:
        return None
    if coating is None and liquid is not None:
        return Film((Layer(liquid, thickest),), alone=True, profile=profile)
    above = (Layer(constant(value.film_index), thickest),) if thickest else ()
    if profile is not None:
        return Film(above, profile=profile)
    return Film(above) if coating is None else Film((*above, *coating.film.layers), coating.film.share)


def film_words(value: Any) -> str:
    """What a material's keys say of films, for reports."""
    words = f", a film of {value.film_nm:g} nm" if value.film_nm else ""
    if value.film_along is not None:
        words = f", a film of {value.film_from_nm:g} to {value.film_nm:g} nm"
    if value.coating is None:
        return words
    film = value.coating.film
    what = f"{film.share:.0%} reflected" if film.share is not None else f"{len(film.layers)} layers"
    return f"{words}, coating {value.coating.preset or what}"
