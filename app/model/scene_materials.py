"""Materials of a scene file: [materials.NAME] tables and those written inline on an object."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..base.errors import suggestion
from .io.scene_table import SceneTable
from .optics import glass
from .optics.colorimetry import VISIBLE_NM, attenuation_from_colour
from .optics.glass import Dispersion
from .optics.spectrum import read_csv
from .scene import (
    Absorption,
    Black,
    Dielectric,
    Diffuse,
    Material,
    Mirror,
)
from .scene_textures import TextureReader

KINDS = ("glass", "mirror", "diffuse", "black")
DEFAULT_GLASS = "N-BK7"
GAIN = "dispersion_gain"
MAX_PRIORITY = 1_000_000
MAX_ATTENUATION = 1e15
"""Per scene unit; float32 holds it in any unit the renderer may choose."""

_INDEX_KEYS = ("glass", "n_d", "sellmeier", "cauchy", "formula", "table", "csv")
_FITS_WITH_RANGE = ("sellmeier", "cauchy", "formula")
_SPECTRUM_SOURCES = ("csv", "nm")


def read_materials(table: SceneTable, textures: TextureReader | None = None) -> dict[str, Material]:
    """All of [materials.NAME] by name; `textures` reads their pictures, each once."""
    textures = textures or TextureReader()
    return {name: read_material(entry, textures) for name, entry in table.named_tables("materials").items()}


def read_object_material(
    table: SceneTable, named: dict[str, Material], textures: TextureReader | None = None
) -> Material:
    """The material of one object: `glass = "…"`, `material = "NAME"`, `material = {…}` or the default glass.

    "mirror", "diffuse" and "black" are known without being defined. The object's `priority`
    and `dispersion_gain` go above the material's own.
    """
    key = table.one_of(("glass", "material"), "the material")
    if key == "material" and isinstance(table.raw(key), str):
        name = table.string(key)
        plain: dict[str, Material] = {"mirror": Mirror(), "diffuse": Diffuse(), "black": Black()}
        known = plain | named
        if name not in known:
            table.fail(key, f"names '{name}', which is not defined under [materials]" + suggestion(name, known))
        material = known[name]
    elif key == "material":
        inner = table.table(key)
        assert inner is not None
        material = read_material(inner, textures)
    else:
        material = Dielectric(_catalogue(table, key or "", table.string("glass", DEFAULT_GLASS)))
    if table.has(GAIN):
        if not isinstance(material, Dielectric):
            table.fail(GAIN, "is for glass; this object has none")
        material = replace(material, dispersion=_with_gain(table, material.dispersion))
    if table.has("priority"):
        if not isinstance(material, Dielectric):
            table.fail("priority", "decides between overlapping solids of glass; this object has none")
        material = replace(material, priority=_priority(table))
    return material


def read_material(table: SceneTable, textures: TextureReader | None = None) -> Material:
    """One material table of any kind ('glass' unless it says otherwise)."""
    kind = table.choice("kind", KINDS, "glass")
    material: Material
    if kind == "mirror":
        material = Mirror(table.colour("reflectance", (1.0, 1.0, 1.0)))
    elif kind == "diffuse":
        material = _read_diffuse(table, textures or TextureReader())
    elif kind == "black":
        material = Black()
    else:
        material = Dielectric(_read_dispersion(table), _read_absorption(table), _priority(table))
    table.finish(f"a material of kind '{kind}'")
    return material


def _priority(table: SceneTable) -> int:
    return table.integer("priority", 0, at_least=-MAX_PRIORITY, at_most=MAX_PRIORITY)


def _read_diffuse(table: SceneTable, textures: TextureReader) -> Diffuse:
    key = table.one_of(("colour", "reflectance"), "the colour")
    if table.one_of(("reflectance", "texture"), "the colour") == "texture":
        # Beside a picture the colour is a factor, so that nothing given leaves the picture as it is.
        return Diffuse(table.colour("colour", (1.0, 1.0, 1.0)), texture=textures.read(table))
    if key != "reflectance":
        return Diffuse(table.colour("colour", (0.8, 0.8, 0.8)))
    inner = table.table(key)
    if inner is None:
        table.fail(key, "must be a table such as {csv = \"paint.csv\"}; an RGB goes under 'colour'")
    source, values = _read_curve(inner, "values")
    if values.min() < 0.0 or values.max() > 1.0:
        inner.fail(source, "must hold reflectances between 0 and 1")
    inner.finish("a reflectance")
    return Diffuse(reflectance_rgb=_rgb_under_white(values), reflectance=values)


def _rgb_under_white(reflectance: np.ndarray) -> tuple[float, float, float]:
    """Linear Rec.709 of a reflectance (401,) under D65, clipped to [0, 1]."""
    from .optics.spectrum import Spectrum, illuminant, xyz_to_rgb709

    white = illuminant("D65")
    seen = Spectrum(white.density * reflectance).xyz() / white.luminous()
    r, g, b = (float(v) for v in np.clip(xyz_to_rgb709(seen), 0.0, 1.0))
    return r, g, b


# -- refractive index ---------------------------------------------------------------------


def _read_dispersion(table: SceneTable) -> Dispersion:
    dispersion = _read_index(table)
    return _with_gain(table, dispersion) if table.has(GAIN) else dispersion


def _with_gain(table: SceneTable, dispersion: Dispersion) -> Dispersion:
    return glass.with_gain(dispersion, table.number(GAIN, at_least=0.0), table.where(GAIN))


def _read_index(table: SceneTable) -> Dispersion:
    key = table.one_of(_INDEX_KEYS, "the refractive index")
    if key is None:
        if table.has("V_d"):
            table.fail("V_d", "needs 'n_d' beside it")
        table.fail("", f"has no refractive index: give one of {', '.join(_INDEX_KEYS)}, or another kind")
    if key == "glass":
        return _catalogue(table, key, table.string(key))
    name = table.string("name", "")
    where = table.where(key)
    limits = _read_range(table) if key in _FITS_WITH_RANGE else None
    if key == "n_d":
        v_d = table.number("V_d", math.inf, infinite=True)
        return glass.from_abbe(table.number(key), v_d, name, where)
    if key == "sellmeier":
        inner = table.table(key)
        if inner is None:
            table.fail(key, "must be a table {B = […], C = […]} with C in µm²")
        b, c = inner.numbers("B"), inner.numbers("C")
        inner.finish("sellmeier")
        return glass.sellmeier(b, c, name, limits, where)
    if key == "cauchy":
        return glass.cauchy(table.numbers(key), name, limits, where)
    if key == "formula":
        inner = table.table(key)
        if inner is None:
            table.fail(key, "must be a table {number = 1 … 6, coefficients = […]} as refractiveindex.info numbers them")
        number = inner.integer("number", at_least=1, at_most=6)
        coefficients = inner.numbers("coefficients")
        inner.finish("formula")
        return glass.from_formula(f"formula {number}", coefficients, name, limits, where)  # type: ignore[arg-type]
    if key == "table":
        wavelengths, n = zip(*table.rows(key, 2), strict=True)
        return glass.table(wavelengths, n, name, where)
    path = table.existing_file(key)
    wavelengths_nm, indices = read_csv(path)
    return glass.table(wavelengths_nm, indices, name or path.stem, where)


def _read_range(table: SceneTable) -> tuple[float, float] | None:
    if not table.has("range_nm"):
        return None
    low, high = table.numbers("range_nm", count=2)
    return low, high


def _catalogue(table: SceneTable, key: str, name: str) -> Dispersion:
    from .optics import catalogue

    return catalogue.find(name, table.where(key))


# -- absorption ---------------------------------------------------------------------------


def _read_absorption(table: SceneTable) -> Absorption | None:
    """`absorption`: a colour, or a spectrum of transmittance, reached at a distance; or the coefficient itself."""
    if not table.has("absorption"):
        return None
    inner = table.table("absorption")
    if inner is None:
        table.fail("absorption", "must be a table such as {colour = [0.4, 0.9, 0.7], distance = 2.0}")
    if inner.has("coefficient"):
        wavelengths = inner.numbers("nm", at_least=2)
        values = np.array(inner.numbers("coefficient", count=len(wavelengths)))
        alpha = _on_visible_grid(inner, "coefficient", np.array(wavelengths), values)
    else:
        distance = inner.number("distance", above=0.0)
        if inner.one_of(("colour", *_SPECTRUM_SOURCES), "the colour") == "colour":
            alpha = attenuation_from_colour(inner.colour("colour"), distance, inner.where("colour"))
        else:
            source, transmittance = _read_curve(inner, "transmittance")
            if transmittance.min() <= 0.0 or transmittance.max() > 1.0:
                inner.fail(source, "must hold transmittances above 0 and at most 1")
            alpha = -np.log(transmittance) / distance
    if alpha.min() < 0.0:
        inner.fail("coefficient", "is negative somewhere; glass cannot amplify light")
    if alpha.max() > MAX_ATTENUATION:
        inner.fail(
            "distance",
            f'makes the glass opaque within {1.0 / MAX_ATTENUATION:g} units; use material = "black" for that',
        )
    inner.finish("absorption")
    return Absorption(alpha)


def _read_curve(table: SceneTable, value_key: str) -> tuple[str, np.ndarray]:
    """A curve over wavelength from `csv`, or from `nm` with `value_key`: (key to blame, (401,))."""
    source = table.one_of(_SPECTRUM_SOURCES, "the curve")
    if source is None:
        table.fail("", f"holds no curve: give 'csv', or 'nm' with '{value_key}'")
    if source == "csv":
        return source, _on_visible_grid(table, source, *read_csv(table.existing_file("csv")))
    wavelengths = table.numbers("nm", at_least=2)
    values = table.numbers(value_key, count=len(wavelengths))
    return value_key, _on_visible_grid(table, "nm", np.array(wavelengths), np.array(values))


def _on_visible_grid(table: SceneTable, key: str, wavelength_nm: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear between the rows, held at the ends, float64 (401,)."""
    if np.any(np.diff(wavelength_nm) <= 0.0):
        table.fail(key, "must list its wavelengths in ascending order")
    curve = np.interp(VISIBLE_NM, wavelength_nm, values)
    curve.setflags(write=False)
    return curve
